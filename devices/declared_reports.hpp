// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace wrenchd {

/// The input reports that a report descriptor declares, by id and length. A device may send reports that no
/// profile needs, such as keys: they are no error.
class DeclaredReports {
 public:
  DeclaredReports() = default;
  /// descriptor: the raw bytes. Declares nothing if they are empty or invalid. Not RT-safe: allocates.
  explicit DeclaredReports(std::span<const std::uint8_t> descriptor);

  /// Returns true if the device declares a report of this id and length. RT-safe.
  bool contains(std::span<const std::uint8_t> report) const noexcept;

 private:
  bool numbered_ = false;
  std::array<std::uint16_t, 256> length_{};  ///< length by id, including the id; 0: no such report
};

}  // namespace wrenchd
