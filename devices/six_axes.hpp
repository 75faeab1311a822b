// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <string>

#include "devices/report_descriptor.hpp"

namespace wrenchd {

/// How a device with six axes spreads them over its reports.
enum class AxesLayout : std::uint8_t {
  combined,  ///< X Y Z Rx Ry Rz in one report
  split,     ///< X Y Z in one, Rx Ry Rz in another: half of the pose is always older than the other half
};

/// Where a number of a device lies, and what the device says it means.
struct DescribedNumber {
  std::optional<std::uint8_t> report_id;
  std::size_t bit = 0;  ///< from the start of the report as it travels, its id included
  unsigned bits = 0;
  std::int64_t logical_min = 0;
  std::int64_t logical_max = 0;
  bool relative = false;  ///< so the device says; 3Dconnexion's say it of a displacement from the centre
  /// [m] or [rad] of one count, X Y Z and Rx Ry Rz each; NaN where the unit says neither, or says it of the
  /// wrong one: a unit stays until it is changed, and some devices forget to.
  double step = 0.0;

  bool is_signed() const noexcept { return logical_min < 0; }
};

/// A run of single bits, as of buttons.
struct DescribedBits {
  std::optional<std::uint8_t> report_id;
  std::size_t bit = 0;
  std::size_t count = 0;  ///< from the first to the last, gaps included
};

/// A multi-axis controller, generic desktop usage 01:08, as its report descriptor shows it.
struct SixAxisController {
  AxesLayout layout = AxesLayout::combined;
  std::array<DescribedNumber, 6> axes;   ///< X Y Z Rx Ry Rz
  std::optional<DescribedBits> buttons;  ///< of the first report that has some
  std::optional<DescribedBits> led;      ///< in an output report
};

/// The six axes, or the sentence that says why the device has none that can be told.
struct SixAxisResult {
  std::optional<SixAxisController> controller;
  std::string rejection;
};

/// Looks for a multi-axis controller. Ids of the device play no part: firmware made at home borrows those of
/// devices whose reports look different. Not RT safe.
SixAxisResult find_six_axes(const ReportDescriptor& descriptor);

}  // namespace wrenchd
