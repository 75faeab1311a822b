// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/inherited_toml.hpp"

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "core/files/absolute_name.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

constexpr const char* kKey = "inherits";

TomlEntry* find(TomlNode::Table& table, const std::string& key) {
  const auto found =
      std::find_if(table.begin(), table.end(), [&](const TomlEntry& entry) { return entry.key == key; });
  return found == table.end() ? nullptr : &*found;
}

/// Writes the file into every location of a tree.
void set_file(TomlNode& node, const std::shared_ptr<const fs::path>& file) {
  node.location.file = file;
  if (auto* array = std::get_if<TomlNode::Array>(&node.value))
    for (TomlNode& element : *array) set_file(element, file);
  if (auto* table = std::get_if<TomlNode::Table>(&node.value)) {
    for (TomlEntry& entry : *table) {
      entry.location.file = file;
      set_file(entry.node, file);
    }
  }
}

bool same_file(const fs::path& a, const fs::path& b) {
  std::error_code error;
  return a == b || (fs::equivalent(a, b, error) && !error);
}

std::vector<fs::path> candidates(const std::string& name, const fs::path& named_in,
                                 const SearchPath& search) {
  const fs::path file = profile_file(name);
  std::vector<fs::path> places;
  if (!file.is_absolute())
    places.push_back(named_in.parent_path() / (name.ends_with(".toml") ? file : file.filename()));
  for (const fs::path& place : search.candidates(file)) places.push_back(place);
  return places;
}

fs::path parent_of(const std::string& name, const SourceLocation& place, const std::vector<fs::path>& chain,
                   const SearchPath& search) {
  bool only_in_chain = false;
  std::string searched;
  for (const fs::path& candidate : candidates(name, chain.back(), search)) {
    searched += (searched.empty() ? "" : ", ") + absolute_name(candidate).string();
    std::error_code error;
    if (!fs::exists(candidate, error)) continue;
    const bool in_chain = std::any_of(chain.begin(), chain.end(),
                                      [&](const fs::path& file) { return same_file(file, candidate); });
    if (!in_chain) return candidate;
    only_in_chain = true;
  }
  if (only_in_chain) {
    std::string path;
    for (const fs::path& file : chain) path += file.filename().string() + " -> ";
    throw ConfigError(chain.back(), place,
                      "key 'inherits': the profiles inherit each other (" + path + printable(name) +
                          "); one of them must not inherit");
  }
  throw ConfigError(chain.back(), place,
                    "key 'inherits': no profile of this name; searched " + searched +
                        "; name one that is there, or leave the key out");
}

}  // namespace

void merge_over(TomlNode::Table& table, TomlNode::Table parent) {
  for (TomlEntry& inherited : parent) {
    TomlEntry* own = find(table, inherited.key);
    if (!own) {
      table.push_back(std::move(inherited));
      continue;
    }
    auto* own_table = std::get_if<TomlNode::Table>(&own->node.value);
    auto* parent_table = std::get_if<TomlNode::Table>(&inherited.node.value);
    if (own_table && parent_table) merge_over(*own_table, std::move(*parent_table));
  }
}

TomlNode read_inherited(const fs::path& file, const SearchPath& search, std::vector<ConfigText>* texts) {
  std::vector<fs::path> chain = {file};
  const auto read = [texts](const fs::path& one) {
    std::string text = read_config_text(one);
    TomlNode tree = read_toml_text(text, one);
    if (texts != nullptr) texts->push_back({one, std::move(text)});
    return tree;
  };
  if (texts != nullptr) texts->clear();
  TomlNode merged = read(file);
  for (;;) {
    auto& table = std::get<TomlNode::Table>(merged.value);
    TomlEntry* entry = find(table, kKey);
    if (!entry) break;
    const auto* name = std::get_if<std::string>(&entry->node.value);
    SourceLocation place = entry->node.location;
    place.file = nullptr;
    if (!name || name->empty() || name->find('\0') != std::string::npos) {
      throw ConfigError(chain.back(), place,
                        "key 'inherits': expected the name of a profile between quotation marks, found " +
                            describe(entry->node));
    }
    const fs::path parent = parent_of(*name, place, chain, search);
    std::erase_if(table, [](const TomlEntry& e) { return e.key == kKey; });
    chain.push_back(parent);
    TomlNode inherited = read(parent);
    set_file(inherited, std::make_shared<const fs::path>(parent));
    merge_over(table, std::move(std::get<TomlNode::Table>(inherited.value)));
  }
  return merged;
}

}  // namespace wrenchd
