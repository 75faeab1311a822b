// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>

#include "devices/simulation/emulated_device.hpp"

namespace wrenchd {

/// A 3Dconnexion SpaceMouse: a cap that springs back. While it is pushed a packet leaves every 8 ms,
/// translation and rotation in turn, or every 16 ms with both (combined format). Let go, it sends three
/// packets of zeros and is silent. Buttons are sent when they change. Out-report 4 is the LED. RT safe.
class EmulatedSpaceMouse final : public EmulatedDevice {
 public:
  enum class Format : std::uint8_t { split, combined };
  /// Counts at the end of the cap's way.
  static constexpr int kFullScale = 350;

  explicit EmulatedSpaceMouse(Format format) : format_(format) {}

  /// The hand pushes the cap this far, in counts: x right, y toward the user, z down; rotations about them.
  void set_deflection(const std::array<int, 6>& counts) noexcept;
  void set_buttons(std::uint32_t buttons) noexcept { buttons_ = buttons; }
  /// A fault: nothing is sent any more, zeros neither.
  void stop_sending() noexcept { sending_stopped_ = true; }

  void advance_to(TimePoint t, ReportSink& host) noexcept override;
  bool take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept override;
  TimePoint next_event() const noexcept override { return next_packet_at_; }

  bool led() const noexcept { return led_; }

 private:
  void send(ReportSink& host) noexcept;

  Format format_;
  bool powered_ = false, sending_stopped_ = false;
  TimePoint next_packet_at_{};  ///< when the next packet may leave
  std::array<int, 6> counts_{};
  int zeros_left_ = 0;  ///< packets of zeros still to be sent
  bool rotation_next_ = false;
  std::uint32_t buttons_ = 0, buttons_sent_ = 0;
  bool led_ = false;
};

}  // namespace wrenchd
