// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/table.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iomanip>
#include <ostream>
#include <stdexcept>

namespace wrenchd::bench {
namespace {

std::string formatted(const char* format, int decimals, double value) {
  char text[64];
  std::snprintf(text, sizeof text, format, decimals, value);
  return text;
}

}  // namespace

std::string fixed(double value, int decimals) {
  return std::isnan(value) ? "-" : formatted("%.*f", decimals, value);
}

std::string scientific(double value) {
  if (std::isnan(value)) return "-";
  return value == 0.0 ? "0" : formatted("%.*e", 1, value);
}

std::string whole(std::size_t value) {
  return std::to_string(value);
}

void Table::add(std::string of_case, std::string method, std::vector<std::string> cells) {
  if (cells.size() != columns_.size()) throw std::logic_error(name_ + ": a row with too many or few cells");
  rows_.push_back({std::move(of_case), std::move(method), std::move(cells)});
}

void Table::print(std::ostream& out) const {
  const auto wide = [](std::size_t w) { return std::setw(static_cast<int>(w)); };
  std::size_t case_width = 4;
  std::size_t method_width = 6;
  std::vector<std::size_t> widths;
  for (const std::string& column : columns_) widths.push_back(column.size());
  for (const Row& row : rows_) {
    case_width = std::max(case_width, row.of_case.size());
    method_width = std::max(method_width, row.method.size());
    for (std::size_t i = 0; i < widths.size(); ++i) widths[i] = std::max(widths[i], row.cells[i].size());
  }
  const auto line = [&](const std::string& of_case, const std::string& method,
                        const std::vector<std::string>& cells) {
    out << std::left << wide(case_width) << of_case << "  " << wide(method_width) << method << std::right;
    for (std::size_t i = 0; i < cells.size(); ++i) out << "  " << wide(widths[i]) << cells[i];
    out << '\n';
  };
  out << '\n' << name_ << '\n';
  line("case", "method", columns_);
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const bool same_case = i > 0 && rows_[i].of_case == rows_[i - 1].of_case;
    if (i > 0 && !same_case && method_width > 6) out << '\n';
    line(same_case ? "" : rows_[i].of_case, rows_[i].method, rows_[i].cells);
  }
  out.flush();
}

void Table::write_csv(std::ostream& out) const {
  for (const Row& row : rows_)
    for (std::size_t i = 0; i < columns_.size(); ++i)
      out << std::quoted(name_) << ',' << std::quoted(row.of_case) << ',' << std::quoted(row.method) << ','
          << std::quoted(columns_[i]) << ',' << row.cells[i] << '\n';
}

void write_csv(const std::filesystem::path& file, const std::vector<Table>& tables) {
  std::ofstream out(file);
  out << "table,case,method,column,value\n";
  for (const Table& table : tables) table.write_csv(out);
  out.close();
  if (!out) throw std::runtime_error(file.string() + ": cannot be written");
}

}  // namespace wrenchd::bench
