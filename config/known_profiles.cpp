// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/known_profiles.hpp"

#include <utility>

#include "config/load_profile.hpp"

namespace wrenchd {

KnownProfiles known_profiles(const SearchPath& search) {
  KnownProfiles known;
  for (const std::filesystem::path& file : profile_files(search)) {
    try {
      std::vector<ConfigText> texts;
      known.profiles.push_back(load_profile(file, search, &texts));
      known.files.push_back(file);
      known.texts.push_back(std::move(texts));
    } catch (const std::exception& rejected) {
      known.rejected.emplace_back(rejected.what());
    }
  }
  return known;
}

}  // namespace wrenchd
