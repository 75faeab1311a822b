// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <filesystem>
#include <iosfwd>
#include <string>
#include <vector>

namespace wrenchd::bench {

/// A number for people: as many decimals as asked for, "-" for NaN.
std::string fixed(double value, int decimals);
/// The same with two significant digits and an exponent; "0" for zero.
std::string scientific(double value);
std::string whole(std::size_t value);

/// Rows that say of which case and which method they are, and then one cell a column.
class Table {
 public:
  Table(std::string name, std::vector<std::string> columns)
      : name_(std::move(name)), columns_(std::move(columns)) {}

  void add(std::string of_case, std::string method, std::vector<std::string> cells);

  /// Aligned columns; an empty line before each new case.
  void print(std::ostream& out) const;
  /// One line a cell: table,case,method,column,value; all but the value in quotes.
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

/// All of them in one file, under a header. Throws std::runtime_error where it cannot be written.
void write_csv(const std::filesystem::path& file, const std::vector<Table>& tables);

}  // namespace wrenchd::bench
