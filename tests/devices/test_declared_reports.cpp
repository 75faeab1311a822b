// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "devices/declared_reports.hpp"
#include "tests/support/sample_descriptors.hpp"

namespace wrenchd::test_declared_reports {

using namespace test;

TEST_CASE("declared reports are known by id and length", "[declared_reports]") {
  const DeclaredReports mouse{space_navigator()};
  CHECK(mouse.contains(Bytes{1, 0, 0, 0, 0, 0, 0}));
  CHECK(mouse.contains(Bytes{3, 0, 0}));
  CHECK_FALSE(mouse.contains(Bytes{1, 0, 0}));
  CHECK_FALSE(mouse.contains(Bytes{4, 0}));  // an output report
  CHECK_FALSE(mouse.contains(Bytes{0x1c, 0, 0}));
  CHECK_FALSE(mouse.contains(Bytes{}));
  const DeclaredReports teensy{teensy_rawhid()};
  CHECK(teensy.contains(Bytes(64)));
  CHECK_FALSE(teensy.contains(Bytes(63)));
}

TEST_CASE("the keys of a SpaceMouse Enterprise are declared", "[declared_reports]") {
  const DeclaredReports enterprise{space_mouse_enterprise()};
  CHECK(enterprise.contains(Bytes{0x1c, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}));
}

TEST_CASE("without a valid descriptor nothing is declared", "[declared_reports]") {
  CHECK_FALSE(DeclaredReports().contains(Bytes{1, 2}));
  CHECK_FALSE(DeclaredReports(Bytes{0x75}).contains(Bytes{1, 2}));
}

}  // namespace wrenchd::test_declared_reports
