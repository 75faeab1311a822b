// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/conformance/direction_check.hpp"

#include <algorithm>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <utility>

#include <spdlog/fmt/fmt.h>

#include "core/fault.hpp"
#include "devices/conformance/device_session.hpp"
#include "devices/conformance/direction_pulses.hpp"
#include "devices/profile_reports.hpp"
#include "devices/velocity_estimator.hpp"

namespace wrenchd {
namespace {

/// Least displacement by a pulse that is not a step of the encoders, in such steps.
constexpr double kLeastSteps = 2.0;
/// Sequences of commands whose time is kept.
constexpr std::size_t kCommandsKept = 256;

/// Counts what the sequences of reports and acknowledgements show during the pulses.
class SequenceCount {
 public:
  void add_command(std::uint64_t sequence, TimePoint sent) {
    commands_.emplace_back(sequence, sent);
    if (commands_.size() > kCommandsKept) commands_.pop_front();
    ++sent_;
  }
  void add_sample(const DeviceSample& sample) {
    reports_ += 1 + sample.missing;
    repeated_ += sample.repeated;
    missing_ += sample.missing;
    if (acknowledged_ != sample.acknowledged && acknowledged_) add_latency(sample);
    acknowledged_ = sample.acknowledged;
  }

  RuleFinding sequence() const {
    return {repeated_ == 0 && missing_ <= reports_ / 20 ? Judgement::pass : Judgement::fail,
            fmt::format("{} reports: {} repeated or backwards, {} missing", reports_, repeated_, missing_)};
  }
  RuleFinding acknowledged(double report_rate_Hz) {
    if (latencies_s_.size() < sent_ / 4)
      return {Judgement::fail,
              fmt::format("{} commands sent, {} changes of `acknowledged`", sent_, latencies_s_.size())};
    const auto middle = latencies_s_.begin() + static_cast<std::ptrdiff_t>(latencies_s_.size() / 2);
    std::nth_element(latencies_s_.begin(), middle, latencies_s_.end());
    const double limit_s = 0.005 + 3.0 / report_rate_Hz;
    return {*middle <= limit_s ? Judgement::pass : Judgement::fail,
            fmt::format("median {:.1f} ms after the command; at most {:.1f} ms expected", 1e3 * *middle,
                        1e3 * limit_s)};
  }

 private:
  void add_latency(const DeviceSample& sample) {
    const auto command = std::find_if(commands_.rbegin(), commands_.rend(),
                                      [&](const auto& c) { return c.first == sample.acknowledged; });
    if (command != commands_.rend()) latencies_s_.push_back(seconds(sample.arrived - command->second));
  }

  std::deque<std::pair<std::uint64_t, TimePoint>> commands_;
  std::size_t sent_ = 0;
  std::uint64_t reports_ = 0, repeated_ = 0, missing_ = 0;
  std::optional<std::uint64_t> acknowledged_;
  std::vector<double> latencies_s_;
};

/// An opened device as the pulses drive it.
class PulsedProfileDevice final : public PulsedDevice {
 public:
  PulsedProfileDevice(ProfileDevice& device, Clock& clock, const std::function<bool()>& cancelled)
      : device_(device), clock_(clock), cancelled_(cancelled) {}
  ~PulsedProfileDevice() override { device_.release(clock_.now()); }
  PulsedProfileDevice(const PulsedProfileDevice&) = delete;
  PulsedProfileDevice& operator=(const PulsedProfileDevice&) = delete;

  std::vector<MotionSample> drive(Duration time, const Wrench& F) override {
    std::vector<MotionSample> samples;
    for (const TimePoint end = clock_.now() + time; clock_.now() < end;) {
      if (cancelled_()) throw SessionCancelled();
      clock_.sleep_until(clock_.now() + DeviceSession::kCommandPeriod);
      const DeviceSample sample = device_.read_newest(clock_.now());
      if (sample.fault == Fault::device_lost) throw DeviceDisconnected();
      if (sample.fault != Fault::none)
        throw std::runtime_error("the device has the fault " + std::string(fault_row(sample.fault).name));
      if (sample.fresh) {
        samples.push_back({sample.device_time_s, sample.X_BH, sample.V_BH});
        count_.add_sample(sample);
      }
      device_.write(clock_.now(), F, true);
      count_.add_command(device_.commands_sent(), clock_.now());
    }
    return samples;
  }
  SequenceCount& count() noexcept { return count_; }

 private:
  ProfileDevice& device_;
  Clock& clock_;
  const std::function<bool()>& cancelled_;
  SequenceCount count_;
};

/// Checks one device.
class DirectionCheck {
 public:
  DirectionCheck(ProfileDevice& device, Clock& clock, const std::function<bool()>& cancelled)
      : profile_(device.profile()),
        driven_(driven_dofs(profile_)),
        sensed_(sensed_dofs(profile_)),
        step_(velocity_estimator_settings(profile_)),
        device_(device, clock, cancelled),
        pulses_(device_, kBriefPulses) {}

  std::vector<RuleResult> run() {
    judge_directions();
    const DofMask reported =
        profile_.deflection ? kNoDof : static_cast<DofMask>(sensed_ & ~estimated_velocity_dofs(profile_));
    const VelocityComparison seen = compare_velocities(pulses_.motion());
    judge_velocity("linear_velocity", seen, reported & kLinearDofs);
    judge_velocity("angular_velocity", seen, reported & kAngularDofs);
    judge_sequences();
    return std::move(results_);
  }

 private:
  void add(std::string rule, RuleFinding finding) {
    results_.push_back({std::move(rule), finding.judgement, std::move(finding.seen), kUnitsSection});
  }

  void judge_directions() {
    const DofMask force = driven_ & kLinearDofs, torque = driven_ & kAngularDofs;
    if (force != 0)
      add_direction(
          "force_direction", force,
          pulses_.judge_force(pulse_force_N(profile_), force & sensed_, kLeastSteps * step_.step_m));
    if (torque != 0)
      add_direction(
          "torque_direction", torque,
          pulses_.judge_torque(pulse_torque_Nm(profile_), torque & sensed_, kLeastSteps * step_.step_rad));
  }

  /// A direction is not known to be right if the device does not sense all axes that it drives.
  void add_direction(const char* rule, DofMask driven, RuleFinding finding) {
    const auto unsensed = static_cast<DofMask>(driven & ~sensed_);
    if (unsensed != 0 && finding.judgement == Judgement::pass)
      finding = {Judgement::not_judged, "the device drives and does not sense " + dof_text(unsensed)};
    add(rule, std::move(finding));
  }

  void judge_velocity(const char* rule, const VelocityComparison& seen, DofMask axes) {
    if (axes != 0)
      add(rule, wrenchd::judge_velocity(seen, axes, least_travel_by_pulses(step_.step_m, step_.step_rad)));
  }

  void judge_sequences() {
    if (any_report(profile_, &PoseReportLayout::sequence)) add("sequence", device_.count().sequence());
    if (any_report(profile_, &PoseReportLayout::acknowledged))
      add("acknowledged", device_.count().acknowledged(profile_.report_rate_Hz));
  }

  const DeviceProfile& profile_;
  DofMask driven_, sensed_;
  VelocityEstimator::Settings step_;
  PulsedProfileDevice device_;
  DirectionPulses pulses_;
  std::vector<RuleResult> results_;
};

}  // namespace

std::vector<RuleResult> check_directions(ProfileDevice& device, Clock& clock,
                                         const std::function<bool()>& cancelled) {
  return DirectionCheck(device, clock, cancelled).run();
}

}  // namespace wrenchd
