// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <memory>

#include "config/settings.hpp"
#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "daemon/servo/device_port.hpp"
#include "daemon/servo/output_stage.hpp"
#include "daemon/servo/renderer.hpp"
#include "daemon/servo/request_inbox.hpp"
#include "daemon/servo/supervisor.hpp"
#include "daemon/servo/telemetry.hpp"
#include "daemon/servo/tick_clock.hpp"

namespace wrenchd {

/// If the device sets the pace and sends nothing for this many periods, the loop ticks without a new sample.
inline constexpr int kDeviceTimeout_periods = 4;

/// The servo loop: couples the hand and the virtual tool (core/README.md lists the frames).
///
/// Other threads reach it through requests() and telemetry() only. After construction nothing here allocates,
/// locks, logs, throws or waits, except for the sleep in run().
class ServoLoop {
 public:
  /// Profile, device and clock are kept by reference; the device is open. rendering: active first. Not
  /// RT-safe: allocates.
  ServoLoop(const Settings& settings, const DeviceProfile& profile, Device& device,
            std::unique_ptr<Rendering> rendering, const Clock& clock);

  /// Ticks until stop is set and the force has faded, or the device is gone. Releases the hand on every way
  /// out. Returns device_lost or none; every other fault is a state in which the loop continues. clock: the
  /// same as at construction, to sleep on.
  Fault run(Clock& clock, const std::atomic<bool>& stop) noexcept;

  /// One cycle of Algorithm 1 of the paper, at `now`, which was due at `due`. Returns the fault that changed
  /// the state in it, or none. After device_lost the next tick is the first tick of a newly opened device.
  /// RT-safe.
  Fault tick(TimePoint now, TimePoint due) noexcept;

  /// Scene time begins at `start` instead of at the first tick, so that two hands have the same scene time.
  /// Without effect after the first tick. RT-safe.
  void start_scene_at(TimePoint start) noexcept { clock_.start_scene_at(start); }

  /// Releases the hand at once, whatever the state: zero wrench, motors off. Harmless when called again.
  /// Between two ticks only. RT-safe.
  void release(TimePoint now) noexcept;

  /// Number of the free body that the tool holds, from 1 in the order of the scene; 0: none. Between two
  /// ticks only. RT-safe.
  std::size_t held_body() const noexcept { return renderer_.active().held_body(); }

  /// Where other threads put requests.
  RequestInbox& requests() noexcept { return requests_; }
  /// Where other threads read what the loop does.
  Telemetry& telemetry() noexcept { return telemetry_; }
  const Telemetry& telemetry() const noexcept { return telemetry_; }

 private:
  TimePoint wait_for_next(Clock& clock, TimePoint due) noexcept;
  Fault finish(const TickTime& t, const Requests& asked, std::uint32_t changes, const DeviceReading& in,
               const Demand& d, const Authority& a, const Limited& out, const Written& w,
               TimePoint ready) noexcept;
  Fault leave(const TickTime& t, const Requests& asked, const DeviceReading& in, const Written& last_write,
              TimePoint ready) noexcept;
  void change_limits(const LimitSettings& limits, bool armed) noexcept;
  void forget_device() noexcept;

  Pacing pacing_;
  Duration period_;
  RequestInbox requests_;
  Telemetry telemetry_;
  TickClock clock_;
  DevicePort port_;
  Renderer renderer_;
  OutputStage output_;
  Supervisor supervisor_;
};

}  // namespace wrenchd
