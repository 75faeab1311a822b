// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "devices/six_axes.hpp"
#include "tests/support/sample_descriptors.hpp"

namespace wrenchd::test_six_axes {

namespace {

using namespace test;

SixAxisResult found_in(const Bytes& bytes) {
  return find_six_axes(parse_report_descriptor(bytes));
}

SixAxisController six_axes(const Bytes& bytes) {
  const SixAxisResult found = found_in(bytes);
  INFO(found.rejection);
  REQUIRE(found.controller);
  return *found.controller;
}

/// A multi-axis controller of these items.
Bytes controller(const std::string& items) {
  return from_hex("05 01 09 08 a1 01 15 81 25 7f 75 08 95 01" + items + "c0");
}

TEST_CASE("split and combined layouts are distinguished by the descriptor alone", "[six_axes]") {
  CHECK(six_axes(space_navigator()).layout == AxesLayout::split);
  CHECK(six_axes(space_mouse_wireless()).layout == AxesLayout::combined);
  CHECK(six_axes(ten_bit_axes()).layout == AxesLayout::combined);
  // These two have the id of a device with the other layout.
  CHECK(six_axes(home_made_combined()).layout == AxesLayout::combined);
  CHECK(six_axes(home_made_split()).layout == AxesLayout::split);
}

TEST_CASE("axes, buttons and LED of a SpaceNavigator are found at their known positions", "[six_axes]") {
  const SixAxisController device = six_axes(space_navigator());
  for (std::size_t i = 0; i < 6; ++i) {
    const DescribedNumber& axis = device.axes[i];
    CHECK(axis.report_id == (i < 3 ? 1 : 2));
    CHECK(axis.bit == 8 + 16 * (i % 3));
    CHECK(axis.bits == 16);
    CHECK(axis.is_signed());
    CHECK(axis.logical_max == 350);
    CHECK(axis.relative);
  }
  CHECK(device.axes[0].step == Approx(4e-6).epsilon(1e-12));  // 1400e-4 cm are 350 counts
  CHECK(std::isnan(device.axes[3].step));                     // a unit of length for a rotation
  REQUIRE(device.buttons);
  CHECK(device.buttons->report_id == 3);
  CHECK(device.buttons->bit == 8);
  CHECK(device.buttons->count == 2);
  REQUIRE(device.led);
  CHECK(device.led->report_id == 4);
  CHECK(device.led->bit == 8);
}

TEST_CASE("combined axes follow each other, on byte borders or not", "[six_axes]") {
  const SixAxisController wireless = six_axes(space_mouse_wireless());
  const SixAxisController ten = six_axes(ten_bit_axes());
  for (std::size_t i = 0; i < 6; ++i) {
    CHECK(wireless.axes[i].report_id == 1);
    CHECK(wireless.axes[i].bit == 8 + 16 * i);
    CHECK_FALSE(wireless.axes[i].relative);
    CHECK_FALSE(ten.axes[i].report_id);
    CHECK(ten.axes[i].bit == 3 + 10 * i);
    CHECK(ten.axes[i].bits == 10);
    CHECK(std::isnan(ten.axes[i].step));
  }
  CHECK(ten.buttons->bit == 0);
  CHECK(ten.buttons->count == 3);
  CHECK_FALSE(ten.led);
  CHECK(six_axes(home_made_combined()).buttons->count == 32);
}

TEST_CASE("steps come from physical range, exponent and unit", "[six_axes]") {
  const auto steps = [](const std::string& units) {
    const SixAxisController device = six_axes(controller(units + "19 30 29 35 95 06 81 02"));
    return std::pair(device.axes[0].step, device.axes[3].step);
  };
  CHECK(steps("65 11 55 0e").first == Approx(1e-4));  // no physical range: a count is a hundredth of a cm
  CHECK(steps("65 13 35 81 45 7f").first == Approx(0.0254));
  CHECK(steps("65 14 36 02 ff 46 fe 00").second == Approx(2.0 * std::numbers::pi / 180.0));
  CHECK(steps("65 12 55 fd").second == Approx(1e-3));
  CHECK(std::isnan(steps("65 12").first));
  CHECK(std::isnan(steps("65 11").second));
  CHECK(std::isnan(steps("65 21").first));              // cm^2
  CHECK(std::isnan(steps("65 11 35 7f 45 01").first));  // inverted physical range
}

TEST_CASE("a device without six axes is rejected with the reason", "[six_axes]") {
  struct Other {
    Bytes bytes;
    std::string why_not;
  };
  for (const Other& other : {
           Other{boot_keyboard(),
                 "it is no multi-axis controller (01:08); its applications are 01:06 (keyboard)"},
           Other{effects_joystick(),
                 "its applications are 01:04 (joystick)"},  // although it has all six axes
           Other{teensy_rawhid(), "its applications are ffab:200 (vendor defined)"},
           Other{controller("19 30 29 32 95 03 81 02"), "without Rx, Ry, Rz"},
           Other{controller("19 30 29 35 95 06 81 02 09 30 95 01 81 02"), "it has X twice"},
           Other{controller("19 30 29 35 95 06 b1 02"),
                 "without X, Y, Z, Rx, Ry, Rz"},  // feature report only
           Other{controller("19 30 29 35 95 06 81 03"), "without X, Y, Z, Rx, Ry, Rz"},  // padding only
           Other{controller("75 40 19 30 29 35 95 06 81 02"), "its X has 64 bits; the maximum is 32"},
           Other{controller("85 01 19 30 29 31 95 02 81 02 85 02 19 32 29 35 95 04 81 02"),
                 "its axes are not grouped"},
       }) {
    const SixAxisResult found = found_in(other.bytes);
    INFO(found.rejection);
    CHECK_FALSE(found.controller);
    CHECK(found.rejection.find(other.why_not) != std::string::npos);
  }
}

}  // namespace
}  // namespace wrenchd::test_six_axes
