// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <filesystem>
#include <iosfwd>
#include <string>
#include <vector>

namespace wrenchd::bench {

/// Formats a number with this many decimals; "-" for NaN.
std::string fixed(double value, int decimals);
/// Formats a number with two significant digits and an exponent; "0" for zero.
std::string scientific(double value);
std::string whole(std::size_t value);

/// A table whose rows start with a case and a method, followed by one cell per column.
class Table {
 public:
  Table(std::string name, std::vector<std::string> columns)
      : name_(std::move(name)), columns_(std::move(columns)) {}

  void add(std::string of_case, std::string method, std::vector<std::string> cells);

  /// Prints aligned columns, with an empty line before each new case.
  void print(std::ostream& out) const;
  /// Writes one line per cell: table,case,method,column,value. All fields except the value are quoted.
  void write_csv(std::ostream& out) const;

 private:
  struct Row {
    std::string of_case, method;
    std::vector<std::string> cells;
  };

  std::string name_;
  std::vector<std::string> columns_;
  std::vector<Row> rows_;
};

/// Writes all tables to one file with a header. Throws std::runtime_error if the file cannot be written.
void write_csv(const std::filesystem::path& file, const std::vector<Table>& tables);

}  // namespace wrenchd::bench
