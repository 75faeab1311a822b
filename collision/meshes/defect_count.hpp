// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "core/pose.hpp"

namespace wrenchd {

/// Formats a point for messages: "(1, 2, 3)". Not RT-safe: allocates.
std::string format_point(const Vector3d& p);

/// Returns " (12 in all)", or nothing if count is at most 1. Not RT-safe: allocates.
std::string total_suffix(std::size_t count);

/// Counts the defects of one kind and describes the first one. Not RT-safe: allocates.
class DefectCount {
 public:
  /// Counts a defect. sentence(): makes its description; called for the first defect only.
  template <class Sentence>
  void add(const Sentence& sentence) {
    if (count_++ == 0) first_ = sentence();
  }
  /// Appends "FIRST (N in all); REMEDY" if there was a defect.
  void report(std::vector<std::string>& defects, const std::string& cure) const {
    if (count_ > 0) defects.push_back(first_ + total_suffix(count_) + "; " + cure);
  }
  /// Appends "BEFORE N NOUN(s) AFTER, first FIRST" if there was a defect.
  void report(std::vector<std::string>& changes, const std::string& before, const std::string& one,
              const std::string& after) const;

  bool any() const noexcept { return count_ > 0; }
  std::size_t count() const noexcept { return count_; }

 private:
  std::size_t count_ = 0;
  std::string first_;
};

}  // namespace wrenchd
