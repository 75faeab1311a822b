// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "tests/support/paths.hpp"
#include "tests/support/run_program.hpp"

namespace wrenchd::test_growth {

namespace {

using namespace test;

/// Returns the cells of a line without quotes.
std::vector<std::string> cells_of(const std::string& line) {
  std::istringstream in(line);
  std::vector<std::string> cells;
  for (std::string cell; std::getline(in, cell, ',');) {
    if (cell.size() > 1 && cell.front() == '"') cell = cell.substr(1, cell.size() - 2);
    cells.push_back(cell);
  }
  return cells;
}

TEST_CASE("the cost by mesh size is written cell by cell and plotted", "[growth]") {
  const TemporaryDirectory files;
  const auto csv = files.path() / "growth.csv";
  const ProgramResult bench = run_program("bench_contact", {"--quick", "--growth", "--csv", csv.string()});
  INFO(bench.err);
  REQUIRE(bench.exit_code == 0);
  std::ifstream in(csv);
  std::string line;
  REQUIRE(std::getline(in, line));
  CHECK(line == "table,case,method,column,value");
  // Two sizes, two methods, four columns each: count, then p50 <= p99 <= max.
  int rows = 0;
  double last = 0.0;
  const std::vector<std::string> columns = {"triangles", "p50", "p99", "max"};
  for (; std::getline(in, line); ++rows) {
    INFO(line);
    const auto cells = cells_of(line);
    REQUIRE(cells.size() == 5);
    const std::size_t column = static_cast<std::size_t>(rows % 4);
    CHECK(cells[0] == "growth: a tool of 10k triangles on a boulder with N triangles [us]");
    CHECK(cells[1] == (rows < 8 ? "2000" : "6000"));
    CHECK(cells[2] == (rows % 8 < 4 ? "wrenchd all pairs" : "wrenchd whole tick"));
    CHECK(cells[3] == columns[column]);
    const double value = std::stod(cells[4]);
    if (column == 0) CHECK(value == Approx(std::stod(cells[1])).epsilon(0.1));
    if (column == 1) CHECK(value > 0.0);
    if (column > 1) CHECK(value >= last);
    last = value;
  }
  CHECK(rows == 16);

  if (std::system("command -v gnuplot > /dev/null") != 0) {
    WARN("gnuplot is not installed: nothing drawn");
    return;
  }
  const auto svg = files.path() / "growth.svg";
  const std::string draw = "gnuplot -c " + test::source_path("tests/bench/growth.gp") + " " + csv.string() +
                           " " + svg.string() + " 2> " + (files.path() / "said").string();
  REQUIRE(std::system(draw.c_str()) == 0);
  std::ifstream drawn(svg);
  const std::string picture{std::istreambuf_iterator<char>(drawn), {}};
  CHECK(picture.find("wrenchd whole tick") != std::string::npos);
  CHECK(picture.find("</svg>") != std::string::npos);
}

}  // namespace
}  // namespace wrenchd::test_growth
