// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/gallery.hpp"

#include <algorithm>
#include <sstream>
#include <stdexcept>

#include "config/load_settings.hpp"
#include "config/nearest_key.hpp"
#include "config/toml_files.hpp"

namespace wrenchd {
namespace {

constexpr std::size_t kColumns = 100;

/// Replaces all white space by single blanks.
std::string on_one_line(const std::string& text) {
  std::istringstream words(text);
  std::string line;
  for (std::string word; words >> word;) line += (line.empty() ? "" : " ") + word;
  return line;
}

std::string first_sentence(const std::string& line) {
  const std::size_t end = line.find(". ");
  return end == std::string::npos ? line : line.substr(0, end + 1);
}

std::string wrapped(const std::string& text) {
  std::istringstream words(text);
  std::string out, line;
  for (std::string word; words >> word; line += (line.empty() ? "" : " ") + word) {
    if (line.size() + 1 + word.size() <= kColumns) continue;
    out += line + '\n';
    line.clear();
  }
  return out + line + '\n';
}

}  // namespace

std::vector<GalleryScene> gallery(const SearchPath& search) {
  std::vector<GalleryScene> all;
  for (const std::filesystem::path& file : toml_files("gallery", search))
    all.push_back({file.stem().string(), file, on_one_line(load_settings(file, search).description)});
  return all;
}

std::string gallery_text(const SearchPath& search) {
  const std::vector<GalleryScene> all = gallery(search);
  std::size_t wide = 0;
  for (const GalleryScene& scene : all) wide = std::max(wide, scene.name.size());
  std::string text;
  for (const auto& [name, file, description] : all)
    text += name + std::string(wide - name.size() + 2, ' ') + first_sentence(description) + '\n';
  return text;
}

std::string gallery_text(const SearchPath& search, const std::string& name) {
  const std::vector<GalleryScene> all = gallery(search);
  std::vector<std::string> known;
  std::string names;
  for (const GalleryScene& scene : all) {
    if (scene.name == name)
      return wrapped(scene.description) + "\n    wrenchd --arm --live --config gallery/" + name +
             ".toml\n\n" + "or, in a source tree, tools/run " + name + ". The file is " +
             scene.file.string() + ".\n";
    known.push_back(scene.name);
    names += (names.empty() ? "" : ", ") + scene.name;
  }
  const std::string advice = nearest_name_advice(name, known);
  throw std::runtime_error("gallery: there is no '" + name + "'" +
                           (advice.empty() ? "; there are " + names : advice));
}

}  // namespace wrenchd
