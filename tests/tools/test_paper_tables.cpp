// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <sstream>
#include <string>

#include <catch2/catch.hpp>

#include "tools/paper_tables.hpp"

namespace wrenchd::test_paper_tables {

TEST_CASE("all numbers of the paper except two of Eq. (47) are reproduced to their last digit", "[paper]") {
  std::istringstream lines(paper_tables());
  int equal = 0;
  int starred = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.find("* differs") != std::string::npos || line.find('.') == std::string::npos) continue;
    const auto stars = std::count(line.begin(), line.end(), '*');
    if (stars == 0) {
      ++equal;
      continue;
    }
    starred += static_cast<int>(stars);
    CHECK(line.rfind("(47) eps v_", 0) == 0);
  }
  CHECK(starred == 6);  // v_x and v_y, each by three methods
  CHECK(equal > 14);
}

TEST_CASE("the tables contain more digits than the paper", "[paper]") {
  const std::string text = paper_tables();
  for (const char* digits : {"9.631542185", "-0.086714620", "270.712157436", "-0.296066223", "4.4684"})
    CHECK(text.find(digits) != std::string::npos);
}

}  // namespace wrenchd::test_paper_tables
