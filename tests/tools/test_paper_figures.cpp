// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "tests/support/temporary_directory.hpp"
#include "tools/paper_examples.hpp"
#include "tools/paper_figures.hpp"

namespace wrenchd::test_paper_figures {

using Catch::Matchers::Contains;

namespace {

std::string bytes_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::vector<std::string> lines_of(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

std::vector<double> numbers_of(const std::string& line) {
  std::istringstream in(line);
  std::vector<double> numbers;
  for (std::string cell; std::getline(in, cell, ',');) numbers.push_back(std::stod(cell));
  return numbers;
}

}  // namespace

TEST_CASE("five figures are written, each with a table of its values", "[paper]") {
  const test::TemporaryDirectory files;
  const std::filesystem::path directory = files.path() / "new" / "figures";
  write_paper_figures(directory);
  for (const int figure : {11, 12, 13, 14, 15}) {
    const std::string name = "fig" + std::to_string(figure);
    INFO(name);
    CHECK(lines_of(directory / (name + ".csv")).size() == 121);
    const std::string png = bytes_of(directory / (name + ".png"));
    CHECK(png.substr(0, 8) == "\x89PNG\r\n\x1a\n");
    CHECK(png.size() > 20000);  // an empty frame has a tenth of this size
  }
  const auto steps = simulate_example_4_2(Method::planar);
  const auto forces = lines_of(directory / "fig14.csv");
  const auto torques = lines_of(directory / "fig15.csv");
  CHECK(forces[0] == "t,f_y,f_y_traditional");
  for (std::size_t i = 0; i < steps.size(); ++i) {
    CHECK(numbers_of(forces[i + 1]).at(1) == steps[i].F_W.force_N.y());
    CHECK(numbers_of(torques[i + 1]).at(1) == steps[i].F_W.torque_Nm.z());
  }
  // Fig. 13 marks with a cross where contact starts, ends and starts again.
  int crosses = 0;
  const auto centres = lines_of(directory / "fig13.csv");
  for (std::size_t i = 1; i < centres.size(); ++i) crosses += static_cast<int>(numbers_of(centres[i]).at(3));
  CHECK(crosses == 3);
}

TEST_CASE("figures that cannot be written or drawn are rejected with a remedy", "[paper]") {
  const test::TemporaryDirectory files;
  const auto file = files.write("file", "not a directory");
  CHECK_THROWS_WITH(write_paper_figures(file),
                    Contains("file: is not a directory") && Contains("name another"));
  CHECK_THROWS_WITH(write_paper_figures(file / "below"),
                    Contains("is not a directory and cannot be created; name another directory"));

  const std::string path = std::getenv("PATH");
  setenv("PATH", "/nowhere", 1);
  const auto directory = files.path() / "figures";
  CHECK_THROWS_WITH(write_paper_figures(directory),
                    Contains("gnuplot: cannot be run") && Contains("install the package gnuplot-nox"));
  setenv("PATH", path.c_str(), 1);
  CHECK(lines_of(directory / "fig15.csv").size() == 121);
}

}  // namespace wrenchd::test_paper_figures
