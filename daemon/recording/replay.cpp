// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/replay.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "daemon/hand_scenes.hpp"

namespace wrenchd {
namespace {

/// A device that returns the samples of a recording, one for each tick.
class RecordedDevice final : public Device {
 public:
  void play(const TickRecord& record) noexcept { record_ = &record; }

  void open() override {}
  DeviceSample read_newest(TimePoint) noexcept override;
  Fault write(TimePoint, const Wrench&, bool) noexcept override { return record_->write_fault; }
  std::uint64_t commands_sent() const noexcept override { return record_->last_command_sent; }
  void release(TimePoint) noexcept override {}
  void wait_readable(TimePoint) noexcept override {}
  void close() noexcept override {}

 private:
  const TickRecord* record_ = nullptr;
};

/// A clock that returns the times of a recording: when the wrench was ready, and how long the machine was
/// suspended.
class RecordedClock final : public Clock {
 public:
  void play(const TickRecord& record) noexcept { record_ = &record; }

  TimePoint now() const noexcept override {
    return TimePoint(Duration(record_ == nullptr ? 0 : record_->wrench_ready_ns));
  }
  void sleep_until(TimePoint) noexcept override {}
  Duration time_suspended() const noexcept override { return Duration(record_->suspended_ns); }

 private:
  const TickRecord* record_ = nullptr;
};

/// A proxy initializer that returns the results of a recording, each at its recorded tick.
class RecordedProxyInitializer final : public ProxyInitializer {
 public:
  void play(const TickRecord& record) noexcept { record_ = &record; }

  void request(const ProxyInitializationRequest& request) noexcept override { request_ = request; }
  bool take_result(ProxyInitializationResult& result) noexcept override {
    const auto initialization = static_cast<ProxyInitialization>(record_->proxy_initialization);
    result = {request_.id, initialization == ProxyInitialization::found, pose_from_numbers(record_->X_WQ),
              request_.scene_time_s, request_.X_WB};
    return initialization == ProxyInitialization::found || initialization == ProxyInitialization::failed;
  }

 private:
  const TickRecord* record_ = nullptr;
  ProxyInitializationRequest request_;
};

DeviceSample RecordedDevice::read_newest(TimePoint) noexcept {
  const TickRecord& r = *record_;
  DeviceSample sample;
  sample.X_BH = pose_from_numbers(r.X_BH);
  sample.V_BH.linear_m_per_s = {r.V_BH[0], r.V_BH[1], r.V_BH[2]};
  sample.V_BH.angular_rad_per_s = {r.V_BH[3], r.V_BH[4], r.V_BH[5]};
  sample.estimated_velocity_dofs = r.estimated_velocity_dofs;
  sample.device_time_s = r.device_time_s;
  sample.sequence = r.sequence;
  sample.acknowledged = r.acknowledged_command;
  sample.arrived = TimePoint(Duration(r.arrived_ns));
  sample.superseded = r.superseded;
  sample.missing = r.missing;
  sample.rejected = r.rejected;
  sample.repeated = r.repeated;
  sample.buttons = r.buttons;
  sample.fresh = r.fresh != 0;
  sample.motors_on = r.motors_on != 0;
  sample.watchdog_tripped = r.watchdog_tripped != 0;
  sample.homed = r.homed != 0;
  sample.fault = r.sample_fault;
  return sample;
}

ExternalWrenchRequest recorded_request(const TickRecord& r) noexcept {
  const auto& F = r.requested_external;
  return {{{F[0], F[1], F[2]}, {F[3], F[4], F[5]}},
          r.external_energy_J,
          TimePoint(Duration(r.external_expires_ns))};
}

/// Compares two arrays bit by bit: NaN equals itself, and -0 differs from 0.
std::optional<Difference> compare(std::uint64_t tick, const char* field, std::span<const double> recorded,
                                  std::span<const double> replayed) {
  for (std::size_t i = 0; i < recorded.size(); ++i)
    if (std::bit_cast<std::uint64_t>(recorded[i]) != std::bit_cast<std::uint64_t>(replayed[i]))
      return Difference{0, tick, std::string(field) + '[' + std::to_string(i) + ']', recorded[i],
                        replayed[i]};
  return {};
}

struct Compared {
  const char* name;
  double (*of)(const TickRecord&);
};

/// Compared scalars, as double. Every integer is exact as a double. So is the set of faults: it has less than
/// 53 bits.
#define WRENCHD_COMPARED(member)                                               \
  Compared {                                                                   \
#member, [](const TickRecord& r) { return static_cast<double>(r.member); } \
  }
constexpr std::array kComparedNumbers = {
    WRENCHD_COMPARED(energy),
    WRENCHD_COMPARED(kkt_residual),
    WRENCHD_COMPARED(authority),
    WRENCHD_COMPARED(stiffness_scale),
    WRENCHD_COMPARED(passivity_scale),
    WRENCHD_COMPARED(energy_in_J),
    WRENCHD_COMPARED(energy_out_J),
    WRENCHD_COMPARED(injected_J),
    WRENCHD_COMPARED(external_balance_J),
    WRENCHD_COMPARED(contact_gain),
    WRENCHD_COMPARED(contacts),
    WRENCHD_COMPARED(iterations),
    WRENCHD_COMPARED(projection_status),
    WRENCHD_COMPARED(proxy_initialization),
    WRENCHD_COMPARED(state),
    WRENCHD_COMPARED(state_cause),
    WRENCHD_COMPARED(motors_commanded),
    WRENCHD_COMPARED(limit_causes),
    WRENCHD_COMPARED(undriven_dofs),
    WRENCHD_COMPARED(faults),
    WRENCHD_COMPARED(released),
};
#undef WRENCHD_COMPARED
static_assert(kFaultCount < 53);

std::optional<Difference> compare(const TickRecord& then, const TickRecord& now) {
  if (auto d = compare(then.tick, "X_WP", then.X_WP, now.X_WP)) return d;
  if (auto d = compare(then.tick, "X_WQ", then.X_WQ, now.X_WQ)) return d;
  if (auto d = compare(then.tick, "X_WB", then.X_WB, now.X_WB)) return d;
  if (auto d = compare(then.tick, "eps", then.eps, now.eps)) return d;
  if (auto d = compare(then.tick, "F_T", then.F_T, now.F_T)) return d;
  if (auto d = compare(then.tick, "F_external", then.F_external, now.F_external)) return d;
  if (auto d = compare(then.tick, "F_out", then.F_out, now.F_out)) return d;
  for (const Compared& number : kComparedNumbers) {
    const double a = number.of(then), b = number.of(now);
    if (std::bit_cast<std::uint64_t>(a) != std::bit_cast<std::uint64_t>(b))
      return Difference{0, then.tick, number.name, a, b};
  }
  return {};
}

/// The replay of one hand, tick by tick.
class HandReplay {
 public:
  /// The recording and the configuration must outlive this object. Throws RecordingError if the recording
  /// does not begin at the first tick. scene_start: first tick of either of two hands.
  HandReplay(const Recording& recording, const RunConfig& config, const HandScene& hand,
             std::optional<TimePoint> scene_start = {})
      : recording_(recording),
        proxy_initializer_(std::make_shared<RecordedProxyInitializer>()),
        loop_(config.settings, config.profile, device_,
              std::make_unique<Rendering>(0, config.settings, config.profile, hand.scene, proxy_initializer_,
                                          hand.tool),
              clock_) {
    if (!recording.ticks.empty() && recording.ticks.front().tick != 0)
      throw RecordingError(
          "the recording begins at tick " + std::to_string(recording.ticks.front().tick) +
          ": a replay needs the state of the loop at its first tick (measured stiffness, motor "
          "temperature, earlier faults, obstacle poses); replay a recording from the start of a "
          "run, as wrenchd --record writes it");
    if (scene_start) loop_.start_scene_at(*scene_start);
  }

  bool ended() const noexcept { return next_ == recording_.ticks.size(); }
  /// Time of the next tick. An external release has the time of the tick before, and comes after all ticks of
  /// both hands. Precondition: not ended().
  std::int64_t next_ns() const noexcept {
    const TickRecord& next = recording_.ticks[next_];
    return (next.commands & kReleasedExternally) != 0 ? INT64_MAX : next.now_ns;
  }
  /// Computes the next tick and compares it. Throws RecordingError if it is missing, or if a client made a
  /// change that is not in the recording.
  std::optional<Difference> step();

 private:
  void check_complete(const TickRecord& then);

  const Recording& recording_;
  std::size_t next_ = 0;
  std::uint64_t last_tick_ = 0;  ///< an external release has the number of the previous tick
  RecordedClock clock_;
  RecordedDevice device_;
  std::shared_ptr<RecordedProxyInitializer> proxy_initializer_;
  ServoLoop loop_;
};

void HandReplay::check_complete(const TickRecord& then) {
  if (then.tick != last_tick_ && then.tick != last_tick_ + 1)
    throw RecordingError(
        "ticks " + std::to_string(last_tick_ + 1) + " to " + std::to_string(then.tick - 1) +
        " are missing in the recording; all ticks before them agree. Record to a faster disk to replay the "
        "whole run");
  last_tick_ = then.tick;
  if (then.change_count > 0)
    throw RecordingError(
        "at tick " + std::to_string(then.tick) +
        " a client changed the scene, the workspace or a limit, and the recording does not contain the "
        "change; all ticks before it agree. Record a run without changes to replay the whole run");
}

std::optional<Difference> HandReplay::step() {
  const TickRecord& then = recording_.ticks[next_++];
  check_complete(then);
  clock_.play(then);
  device_.play(then);
  proxy_initializer_->play(then);
  const TimePoint now{Duration(then.now_ns)};
  // An external release repeats the record of the previous tick with zero wrench and `released` set.
  if ((then.commands & kReleasedExternally) != 0) {
    loop_.release(now);
  } else {
    loop_.requests().request(then.commands);
    if (then.external_expires_ns != 0) loop_.requests().set_external_wrench(recorded_request(then));
    loop_.tick(now, now);
  }
  TickRecord replayed;
  loop_.telemetry().latest_record().read(replayed);
  return compare(then, replayed);
}

}  // namespace

const char* compared_fields() {
  static const std::string names = [] {
    std::string text = "X_WP, X_WQ, X_WB, eps, F_T, F_external, F_out";
    for (const Compared& number : kComparedNumbers) text += std::string(", ") + number.name;
    return text;
  }();
  return names.c_str();
}

std::optional<Difference> replay(const Recording& recording, const RunConfig& config) {
  HandReplay hand(recording, config, {std::make_shared<const Scene>(config.scene), {}});
  while (!hand.ended())
    if (auto difference = hand.step()) return difference;
  return {};
}

std::optional<Difference> replay_two_hands(const std::array<Recording, 2>& recordings,
                                           const std::array<RunConfig, 2>& configs) {
  MeshLoader meshes;
  const std::array<HandScene, 2> scenes = make_hand_scenes(configs[0], configs[1], meshes);
  std::int64_t first_ns = INT64_MAX;
  for (const Recording& recording : recordings)
    if (!recording.ticks.empty()) first_ns = std::min(first_ns, recording.ticks.front().now_ns);
  const TimePoint start{Duration(first_ns)};
  std::array<HandReplay, 2> hands = {HandReplay(recordings[0], configs[0], scenes[0], start),
                                     HandReplay(recordings[1], configs[1], scenes[1], start)};
  while (!hands[0].ended() || !hands[1].ended()) {
    const bool second = hands[0].ended() || (!hands[1].ended() && hands[1].next_ns() < hands[0].next_ns());
    if (auto difference = hands[second ? 1 : 0].step()) {
      difference->hand = second ? 1 : 0;
      return difference;
    }
  }
  return {};
}

}  // namespace wrenchd
