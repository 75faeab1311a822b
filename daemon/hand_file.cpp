// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/hand_file.hpp"

namespace wrenchd {

std::filesystem::path file_of_hand(const std::filesystem::path& file, const std::string& hand) {
  if (hand.empty() || file.empty()) return file;
  return file.parent_path() / (file.stem().string() + "-" + hand + file.extension().string());
}

}  // namespace wrenchd
