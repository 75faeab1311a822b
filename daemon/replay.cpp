// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/replay.hpp"

#include <bit>
#include <span>

namespace wrenchd {
namespace {

Pose pose_of(const std::array<double, 7>& x) noexcept {
  Pose X;
  X.translation_m = {x[0], x[1], x[2]};
  X.rotation.coeffs() << x[3], x[4], x[5], x[6];
  return X;
}

/// A device whose samples come out of a recording, one a tick.
class RecordedDevice final : public Device {
 public:
  void play(const TickRecord& record) noexcept { record_ = &record; }

  void open() override {}
  DeviceSample read_newest(TimePoint) noexcept override;
  Fault write(TimePoint, const Wrench&, bool) noexcept override {
    return static_cast<Fault>(record_->write_fault);
  }
  std::uint64_t commands_sent() const noexcept override { return record_->commanded; }
  void release(TimePoint) noexcept override {}
  void wait_readable(TimePoint) noexcept override {}
  void close() noexcept override {}

 private:
  const TickRecord* record_ = nullptr;
};

/// The clock of a recording: when a wrench was ready, and how long the machine had slept.
class RecordedClock final : public Clock {
 public:
  void play(const TickRecord& record) noexcept { record_ = &record; }

  TimePoint now() const noexcept override {
    return TimePoint(Duration(record_ == nullptr ? 0 : record_->answered_ns));
  }
  void sleep_until(TimePoint) noexcept override {}
  Duration slept() const noexcept override { return Duration(record_->slept_ns); }

 private:
  const TickRecord* record_ = nullptr;
};

/// A placer whose answers come out of a recording, at the ticks at which they came then.
class RecordedPlacer final : public Placer {
 public:
  void play(const TickRecord& record) noexcept { record_ = &record; }

  void ask(const PlacementQuestion& question) noexcept override { question_ = question; }
  bool answer(PlacementAnswer& answer) noexcept override {
    const auto placing = static_cast<Placing>(record_->placing);
    answer = {question_.number, placing == Placing::placed, pose_of(record_->X_WQ), question_.scene_time_s};
    return placing == Placing::placed || placing == Placing::nowhere;
  }

 private:
  const TickRecord* record_ = nullptr;
  PlacementQuestion question_;
};

DeviceSample RecordedDevice::read_newest(TimePoint) noexcept {
  const TickRecord& r = *record_;
  DeviceSample sample;
  sample.X_BH = pose_of(r.X_BH);
  sample.V_BH.linear_m_per_s = {r.V_BH[0], r.V_BH[1], r.V_BH[2]};
  sample.V_BH.angular_rad_per_s = {r.V_BH[3], r.V_BH[4], r.V_BH[5]};
  sample.device_time_s = r.device_time_s;
  sample.sequence = r.sequence;
  sample.acknowledged = r.acknowledged;
  sample.arrived = TimePoint(Duration(r.arrived_ns));
  sample.skipped = r.skipped;
  sample.missing = r.missing;
  sample.rejected = r.rejected;
  sample.repeated = r.repeated;
  sample.buttons = r.buttons;
  sample.fresh = r.fresh != 0;
  sample.motors_on = r.motors_on != 0;
  sample.watchdog_tripped = r.watchdog_tripped != 0;
  sample.homed = r.homed != 0;
  sample.fault = static_cast<Fault>(r.sample_fault);
  return sample;
}

/// Compares two runs of numbers by their bits, so that NaN equals itself and -0 is not 0.
std::optional<Difference> compare(std::uint64_t tick, const char* field, std::span<const double> recorded,
                                  std::span<const double> replayed) {
  for (std::size_t i = 0; i < recorded.size(); ++i)
    if (std::bit_cast<std::uint64_t>(recorded[i]) != std::bit_cast<std::uint64_t>(replayed[i]))
      return Difference{tick, std::string(field) + '[' + std::to_string(i) + ']', recorded[i], replayed[i]};
  return {};
}

std::optional<Difference> compare(const TickRecord& then, const TickRecord& now) {
  const auto whole = [](const TickRecord& r) {
    return std::array<double, 18>{r.energy,
                                  r.authority,
                                  r.stiffness_share,
                                  r.guard_share,
                                  r.energy_in_J,
                                  r.energy_out_J,
                                  r.injected_J,
                                  static_cast<double>(r.contacts),
                                  static_cast<double>(r.iterations),
                                  static_cast<double>(r.projection_status),
                                  static_cast<double>(r.placing),
                                  static_cast<double>(r.state),
                                  static_cast<double>(r.cause),
                                  static_cast<double>(r.motors_told),
                                  static_cast<double>(r.limit_causes),
                                  static_cast<double>(r.dropped),
                                  static_cast<double>(r.faults),
                                  static_cast<double>(r.released)};
  };
  if (auto d = compare(then.tick, "X_WP", then.X_WP, now.X_WP)) return d;
  if (auto d = compare(then.tick, "X_WQ", then.X_WQ, now.X_WQ)) return d;
  if (auto d = compare(then.tick, "eps", then.eps, now.eps)) return d;
  if (auto d = compare(then.tick, "F_T", then.F_T, now.F_T)) return d;
  if (auto d = compare(then.tick, "F_out", then.F_out, now.F_out)) return d;
  return compare(then.tick,
                 "energy, authority, stiffness and guard share, energies, contacts, iterations, status, "
                 "placing, state, cause, motors, limits, dropped, "
                 "faults, released",
                 whole(then), whole(now));
}

}  // namespace

std::optional<Difference> replay(const Recording& recording, const Plan& plan) {
  if (!recording.ticks.empty() && recording.ticks.front().tick != 0)
    throw RecordingError(
        "the recording begins at tick " + std::to_string(recording.ticks.front().tick) +
        ": what the loop had in mind by then, and where obstacles that move stood, is not in it; replay the "
        "whole recording, from tick 0");
  const Scene scene(plan.scene);
  RecordedClock clock;
  RecordedDevice device;
  RecordedPlacer placer;
  ServoLoop loop(plan.settings, plan.profile, device, scene, placer, clock);
  for (const TickRecord& then : recording.ticks) {
    if (then.changes > 0)
      throw RecordingError(
          "at tick " + std::to_string(then.tick) +
          " the scene, the workspace or a limit was changed while the loop ran, and to what is not in the "
          "recording: it can be replayed up to there, and is the same bits so far; record a run without "
          "changes to replay all of it");
    clock.play(then);
    device.play(then);
    placer.play(then);
    const TimePoint now{Duration(then.now_ns)};
    // The record of a release from outside is the last tick's, with zero wrench and `released` set.
    if ((then.commands & kLetGo) != 0) {
      loop.release(now);
    } else {
      loop.ask(then.commands);
      loop.tick(now, now);
    }
    TickRecord replayed;
    loop.latest().read(replayed);
    if (auto difference = compare(then, replayed)) return difference;
  }
  return {};
}

}  // namespace wrenchd
