// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <charconv>
#include <ostream>
#include <string_view>

#include "core/pose.hpp"

namespace wrenchd {

/// A row of numbers and words, separated by commas. Numbers have the shortest form that converts back to the
/// same value. The destructor ends the row.
class CsvRow {
 public:
  explicit CsvRow(std::ostream& out) : out_(out) {}
  ~CsvRow() { out_ << '\n'; }
  CsvRow(const CsvRow&) = delete;
  CsvRow& operator=(const CsvRow&) = delete;

  CsvRow& operator<<(double x) {
    std::array<char, 32> text;
    const auto end = std::to_chars(text.data(), text.data() + text.size(), x).ptr;
    return *this << std::string_view(text.data(), static_cast<std::size_t>(end - text.data()));
  }
  CsvRow& operator<<(std::string_view word) {
    if (!first_) out_ << ',';
    first_ = false;
    out_ << word;
    return *this;
  }
  CsvRow& operator<<(const Vector3d& v) { return *this << v.x() << v.y() << v.z(); }

 private:
  std::ostream& out_;
  bool first_ = true;
};

}  // namespace wrenchd
