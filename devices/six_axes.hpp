// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <string>

#include "devices/report_descriptor.hpp"

namespace wrenchd {

/// Distribution of six axes over the reports of a device.
enum class AxesLayout : std::uint8_t {
  combined,  ///< X Y Z Rx Ry Rz in one report
  split,  ///< X Y Z in one report, Rx Ry Rz in another: one half of the pose is always older than the other
};

/// Position and meaning of a number in a device's reports.
struct DescribedNumber {
  std::optional<std::uint8_t> report_id;
  std::size_t bit = 0;  ///< first bit, from the start of the transmitted report, including its id
  unsigned bits = 0;
  std::int64_t logical_min = 0;
  std::int64_t logical_max = 0;
  bool relative = false;  ///< as declared by the device; 3Dconnexion devices declare it for a displacement
                          ///< from the centre
  /// Size of one count: [m] for X Y Z, [rad] for Rx Ry Rz. NaN if the descriptor states no unit or a unit of
  /// the wrong kind. Some devices forget to change the unit, which stays valid until it is changed.
  double step = 0.0;

  bool is_signed() const noexcept { return logical_min < 0; }
};

/// A run of single bits, such as buttons.
struct DescribedBits {
  std::optional<std::uint8_t> report_id;
  std::size_t bit = 0;
  std::size_t count = 0;  ///< number of bits from the first to the last, including gaps
};

/// A multi-axis controller, generic desktop usage 01:08, as described by its report descriptor.
struct SixAxisController {
  AxesLayout layout = AxesLayout::combined;
  std::array<DescribedNumber, 6> axes;   ///< X Y Z Rx Ry Rz
  std::optional<DescribedBits> buttons;  ///< buttons of the first report that has any
  std::optional<DescribedBits> led;      ///< in an output report
};

/// The controller, or the reason why the device is not recognised as one.
struct SixAxisResult {
  std::optional<SixAxisController> controller;
  std::string rejection;
};

/// Searches a report descriptor for a multi-axis controller. Ignores the ids of the device: self-made
/// firmware often copies the ids of devices with other layouts. Not RT-safe: allocates.
SixAxisResult find_six_axes(const ReportDescriptor& descriptor);

}  // namespace wrenchd
