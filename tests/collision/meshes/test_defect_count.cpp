// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "collision/meshes/defect_count.hpp"

namespace wrenchd::test_defect_count {

namespace {

TEST_CASE("a defect count reports the first defect and the number", "[defect_count]") {
  std::vector<std::string> report;
  DefectCount defects;
  defects.report(report, "cure");
  defects.report(report, "removed", "face", " without area");
  CHECK(report.empty());
  CHECK_FALSE(defects.any());
  defects.add([] { return "face 3 near " + format_point({1, 2.5, -1e-3}); });
  defects.report(report, "cure");
  defects.report(report, "removed", "face", " without area");
  CHECK(report == std::vector<std::string>{"face 3 near (1, 2.5, -0.001); cure",
                                           "removed 1 face without area: face 3 near (1, 2.5, -0.001)"});
  defects.add([]() -> std::string { throw 1; });  // only the first defect is described
  report.clear();
  defects.report(report, "cure");
  defects.report(report, "removed", "face", " without area");
  CHECK(report ==
        std::vector<std::string>{"face 3 near (1, 2.5, -0.001) (2 in all); cure",
                                 "removed 2 faces without area, first face 3 near (1, 2.5, -0.001)"});
}

}  // namespace
}  // namespace wrenchd::test_defect_count
