// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <iomanip>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string>

#include <catch2/catch.hpp>

#include "devices/layout_validation.hpp"
#include "devices/report_codec.hpp"
#include "devices/simulation/reference_profile.hpp"

namespace wrenchd {

using ReportBuffer = std::array<std::uint8_t, kMaxReportBytes>;

inline const PoseReportLayout kPose = reference_profile().pose_report;
inline const WrenchReportLayout kWrench = reference_profile().wrench_report;

/// Returns the report after encoding and decoding.
template <class Layout, class Report>
Report round_trip(const Layout& layout, const Report& report) {
  ReportBuffer bytes;
  REQUIRE(encode(layout, report, bytes) == layout.length);
  const auto decoded = decode(layout, std::span(bytes).first(layout.length));
  REQUIRE(decoded.outcome == Decoding::ok);
  return decoded.report;
}

/// Returns a layout of 32 bytes whose force has the given width.
inline WrenchReportLayout layout_with_force(unsigned bits, bool is_signed, double step) {
  WrenchReportLayout layout;
  layout.id = 7;
  layout.length = 32;
  layout.force = {.present = true, .byte = 1, .bits = bits, .is_signed = is_signed, .step = step, .count = 3};
  layout.torque = {.present = true, .byte = 16, .bits = 32, .is_signed = true, .step = 1e-6, .count = 3};
  return layout;
}

inline Vector3d force_round_trip(const WrenchReportLayout& layout, const Vector3d& force_N) {
  WrenchReport report;
  report.F.force_N = force_N;
  return round_trip(layout, report).F.force_N;
}

/// Returns bytes in hexadecimal, separated by blanks.
inline std::string hex(std::span<const std::uint8_t> bytes) {
  std::ostringstream out;
  for (const unsigned byte : bytes) out << std::hex << std::setw(2) << std::setfill('0') << byte << ' ';
  std::string text = out.str();
  text.pop_back();
  return text;
}

/// Returns the error of validate(); empty if the layout is valid.
template <class Layout>
std::string validation_error(const Layout& layout) {
  try {
    validate(layout);
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "";
}

}  // namespace wrenchd
