// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "core/pose.hpp"

namespace wrenchd {

/// "(1, 2, 3)", as messages name a place.
std::string format_point(const Vector3d& p);

/// " (12 in all)"; nothing for one.
std::string total_suffix(std::size_t count);

/// First place and number of one kind of defect.
class DefectCount {
 public:
  /// sentence: makes the text, which only the first of a million needs.
  template <class Sentence>
  void add(const Sentence& sentence) {
    if (count_++ == 0) first_ = sentence();
  }
  /// Adds "FIRST (N in all); CURE".
  void report(std::vector<std::string>& defects, const std::string& cure) const {
    if (count_ > 0) defects.push_back(first_ + total_suffix(count_) + "; " + cure);
  }
  /// Adds "BEFORE N AFTER, the first FIRST". One: the word for what is counted, which takes an s for more.
  void report(std::vector<std::string>& changes, const std::string& before, const std::string& one,
              const std::string& after) const;

  bool any() const noexcept { return count_ > 0; }
  std::size_t count() const noexcept { return count_; }

 private:
  std::size_t count_ = 0;
  std::string first_;
};

}  // namespace wrenchd
