// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <span>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/simulation_settings.hpp"
#include "devices/links/loopback_link.hpp"
#include "devices/links/report_link.hpp"
#include "devices/pose_observer.hpp"
#include "devices/simulation/device_in_hand.hpp"

namespace wrenchd {

/// Link to an emulated device in a simulated hand, without hardware. All members except the constructor,
/// open() and device() are RT-safe.
class SimulatedLink final : public ReportLink, public PoseObserver {
 public:
  /// The clock must outlive the link.
  SimulatedLink(std::unique_ptr<DeviceInHand> device, Clock& clock, const SimulationSettings& settings)
      : device_(std::move(device)), clock_(clock), loopback_(*device_, clock, settings) {}

  /// Throws std::runtime_error while the device is unplugged. Not RT-safe: may allocate.
  void open() override {
    loopback_.open();
    device_->open(clock_.now());
  }
  LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept override {
    return loopback_.read(now, buffer);
  }
  LinkStatus write(TimePoint now, std::span<const std::uint8_t> report) noexcept override {
    return loopback_.write(now, report);
  }
  void wait_readable(TimePoint deadline) noexcept override { loopback_.wait_readable(deadline); }
  /// Shows the pose of the device to the simulated hand. RT-safe.
  void observe_pose(TimePoint now, const Pose& X_BH) noexcept override { device_->observe_pose(now, X_BH); }
  void close() noexcept override { loopback_.close(); }

  /// The simulated device, for fault injection and its true state.
  DeviceInHand& device() noexcept { return *device_; }
  std::uint64_t dropped() const noexcept { return loopback_.dropped(); }

 private:
  std::unique_ptr<DeviceInHand> device_;
  Clock& clock_;
  LoopbackLink loopback_;
};

/// Returns a link to the emulated device of a profile, held by the hand of the settings: a SimulatedDevice
/// for whole poses, a Polhem or a Falcon for encoder counts, a SpaceMouse for the deflection of a puck.
/// Throws std::invalid_argument with the remedy if the settings are invalid or no emulator supports the
/// report layout of the profile. The clock must outlive the link. Not RT-safe: allocates.
std::unique_ptr<SimulatedLink> make_simulated_link(const DeviceProfile& profile,
                                                   const SimulationSettings& settings, Clock& clock);

}  // namespace wrenchd
