// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>

#include "devices/simulation/emulated_device.hpp"

namespace wrenchd {

/// Emulated 3Dconnexion SpaceMouse: a spring-loaded puck. While it is deflected it sends a packet every 8 ms,
/// translation and rotation in turn, or both every 16 ms in the combined format. After its release it sends
/// three packets of zeros and then nothing. It sends buttons and keys when they change. Output report 4 sets
/// the LED.
/// All members are RT-safe except inject().
class EmulatedSpaceMouse final : public EmulatedDevice {
 public:
  /// enterprise: combined, with 31 buttons in place of 16, and numbered keys.
  enum class Format : std::uint8_t { split, combined, enterprise };
  /// Counts at full deflection.
  static constexpr int kFullScale = 350;

  explicit EmulatedSpaceMouse(Format format) : format_(format) {}

  /// Sets the deflection of the puck in counts: x right, y toward the user, z down, and rotations about these
  /// axes. Clamps it to kFullScale.
  void set_deflection(const std::array<int, 6>& counts) noexcept;
  void set_buttons(std::uint32_t buttons) noexcept { buttons_ = buttons; }
  /// Sets the numbers of the pressed keys, 0 for none. Only the format `enterprise` sends them.
  void set_keys(const std::array<std::uint16_t, 6>& keys) noexcept { keys_ = keys; }
  /// Fault: the device sends nothing any more, not even zeros.
  void stop_sending() noexcept { sending_stopped_ = true; }

  void advance_to(TimePoint t, ReportSink& host) noexcept override;
  bool take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept override;
  TimePoint next_event() const noexcept override { return next_packet_at_; }

  bool led() const noexcept { return led_; }

 private:
  void send(ReportSink& host) noexcept;
  void send_buttons(ReportSink& host) noexcept;
  void send_keys(ReportSink& host) noexcept;

  Format format_;
  bool powered_ = false, sending_stopped_ = false;
  TimePoint next_packet_at_{};  ///< earliest time of the next packet
  std::array<int, 6> counts_{};
  int zeros_left_ = 0;  ///< packets of zeros that are still to be sent
  bool rotation_next_ = false;
  std::uint32_t buttons_ = 0, buttons_sent_ = 0;
  std::array<std::uint16_t, 6> keys_{}, keys_sent_{};
  bool led_ = false;
};

}  // namespace wrenchd
