// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/nearest_key.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <numeric>
#include <utility>

namespace wrenchd {
namespace {

/// Units that a user may write; key names join them with "_" and "per".
constexpr std::array<std::string_view, 50> kUnits = {
    "per", "m",   "dm",  "cm",    "mm",   "um",   "nm",  "km",  "in",  "s",  "ms", "us", "ns",
    "min", "Hz",  "kHz", "MHz",   "rad",  "mrad", "deg", "rpm", "rps", "N",  "mN", "uN", "kN",
    "cN",  "lbf", "kgf", "Nm",    "mNm",  "Nmm",  "kNm", "kg",  "g",   "mg", "t",  "lb", "m2",
    "mm2", "cm2", "s2",  "count", "deg2", "rad2", "A",   "mA",  "W",   "mW", "kW"};

bool is_unit(std::string_view word) {
  return std::find(kUnits.begin(), kUnits.end(), word) != kUnits.end();
}

/// Start of the unit in a key: after the last word that is no unit. The first word is never a unit.
std::size_t unit_start(std::string_view key) {
  std::size_t start = key.size();
  for (std::size_t end = key.size(), bar;
       (bar = key.rfind('_', end - 1)) != std::string_view::npos && bar > 0; end = bar) {
    if (!is_unit(key.substr(bar + 1, end - bar - 1))) break;
    start = bar + 1;
  }
  return start;
}

std::string_view stem_of(std::string_view key) {
  const std::size_t start = unit_start(key);
  return start == key.size() ? key : key.substr(0, start - 1);
}

/// Longest key for which a suggestion is computed; every known key has less than half of it.
constexpr std::size_t kMaxGuessed = 80;

/// Levenshtein distance, one row at a time.
std::size_t edits(std::string_view a, std::string_view b) {
  if (a.size() > kMaxGuessed) return a.size();
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, diagonal + 1});
    }
  }
  return row.back();
}

const KnownKey* nearest(std::string_view unknown, const std::vector<KnownKey>& known, bool same_stem) {
  const KnownKey* best = nullptr;
  for (const KnownKey& key : known) {
    if (same_stem && stem_of(key.name) != stem_of(unknown)) continue;
    if (!best || edits(unknown, key.name) < edits(unknown, best->name)) best = &key;
  }
  return best;
}

/// A name of fewer letters begins too many other names.
constexpr std::size_t kMinBeginning = 3;

/// Largest number of edits between a name and what a user typed instead.
std::size_t tolerated_edits(std::string_view unknown) {
  return std::clamp<std::size_t>(unknown.size() / 3, 2, 8);
}

std::string lower_case(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

std::string list(const std::vector<KnownKey>& known) {
  std::string names;
  for (const KnownKey& key : known) names += (names.empty() ? "'" : ", '") + key.name + "'";
  return names;
}

}  // namespace

std::string_view unit_of(std::string_view key) {
  return key.substr(unit_start(key));
}

std::string readable_unit(std::string_view unit) {
  std::string text;
  bool below = false;  // true after "per"
  for (std::size_t start = 0; start < unit.size();) {
    const std::size_t end = std::min(unit.find('_', start), unit.size());
    const std::string_view word = unit.substr(start, end - start);
    start = end + 1;
    if (word == "per") {
      below = true;
      continue;
    }
    if (below)
      text += text.empty() ? "1/" : "/";
    else if (!text.empty())
      text += ".";
    text += word == "Nm" ? "N.m" : word;
  }
  return text;
}

NearestKey nearest_key(std::string_view unknown, const std::vector<KnownKey>& known) {
  if (known.empty()) return {"", "no key is known here"};
  const KnownKey* same = nearest(unknown, known, true);
  if (same && !same->unit.empty()) {
    return {same->name, "give it in " + readable_unit(same->unit) + " as '" + same->name + "'"};
  }
  const KnownKey* near = same ? same : nearest(unknown, known, false);
  if (same || edits(unknown, near->name) <= tolerated_edits(unknown))
    return {near->name, "did you mean '" + near->name + "'?"};
  return {"", "known keys here: " + list(known)};
}

std::string nearest_name(std::string_view unknown, const std::vector<std::string>& known) {
  const std::string typed = lower_case(unknown);
  const std::string* best = nullptr;
  const std::string* longer = nullptr;
  std::size_t least = tolerated_edits(typed) + 1, longer_names = 0;
  for (const std::string& name : known) {
    const std::string candidate = lower_case(name);
    if (typed.size() >= kMinBeginning && candidate.starts_with(typed)) {
      longer = &name;
      ++longer_names;
    }
    // A short name of which every letter must change is another name.
    const std::size_t distance = edits(typed, candidate);
    if (distance >= least || distance >= std::max(typed.size(), candidate.size())) continue;
    least = distance;
    best = &name;
  }
  if (longer_names == 1 && least > 1) return *longer;
  return best ? *best : "";
}

std::string nearest_name_advice(std::string_view unknown, const std::vector<std::string>& known) {
  const std::string name = nearest_name(unknown, known);
  return name.empty() ? "" : "; did you mean '" + name + "'?";
}

}  // namespace wrenchd
