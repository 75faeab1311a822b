// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/conformance/conformance.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <stdexcept>

#include <spdlog/fmt/fmt.h>

#include "core/finite.hpp"
#include "devices/conformance/device_session.hpp"
#include "devices/conformance/direction_pulses.hpp"
#include "devices/conformance/reported_velocity.hpp"
#include "devices/discovery/shared_usb_ids.hpp"
#include "devices/layout_check.hpp"
#include "devices/profile_device.hpp"
#include "devices/profile_reports.hpp"
#include "devices/report_descriptor.hpp"
#include "devices/simulation/reference_profile.hpp"

namespace wrenchd {
namespace {

using namespace std::chrono_literals;

/// Durations of the parts of a check.
struct Pace {
  /// Time in which the check only observes the device. The jitter of the host changes a rate over one second
  /// by less than 1 %.
  Duration listen;
  Duration series;   ///< duration of the first commands
  Duration silence;  ///< time without commands, longer than the longest hold time
  const PulsePace& pulses;
};
constexpr Pace kThorough = {1s, 300ms, 80ms, kThoroughPulses};
constexpr Pace kBrief = {300ms, 120ms, 45ms, kBriefPulses};

// Sections of devices/README.md.
constexpr const char* kPoseSection = "Pose report, device to host";
constexpr const char* kUsbSection = "USB";
std::string rule_section(int rule) {
  return fmt::format("Rules for firmware, rule {}", rule);
}

/// Reports of the first moments may still follow the commands of an earlier host.
constexpr Duration kEarlierHost = 100ms;

/// Permitted deviation of the norm of the quaternion from 1: far above the rounding of the field.
constexpr double kMaxNormError = 0.01;
/// Permitted deviation of the report rate, as in the self-test.
constexpr double kMaxRateError = 0.1;
/// Permitted deviation of the device clock: arrival times jitter by some milliseconds, an oscillator does
/// not.
constexpr double kMaxClockError = 0.05;

constexpr Travel kTravelByHand = {0.010, 0.10};

/// The layout's limit of the hold time.
constexpr double kMaxHold_s = 0.032;
/// Period of the motor context and of the encoder reading.
constexpr double kFirmwareTolerance_s = 0.001;
/// Delay of a command on its way to the device, if the device does not acknowledge.
constexpr double kHostTolerance_s = 0.010;
/// A hold time that a firmware with a fixed time of 32 ms does not meet, and that a host with jitter can
/// keep.
constexpr double kShortHold_s = 0.008;

/// First sequence of the commands: they wrap in the first series.
constexpr std::uint64_t kFirstSequence = 65536 - 100;
constexpr Duration kSettle = 30ms;
/// Least displacement by a pulse that is not a step of the report's numbers, in such steps.
constexpr double kLeastSteps_m = 2.0, kLeastSteps_rad = 4.0;
/// Attempts of a check that a delay of the host can spoil.
constexpr int kAttempts = 3;

std::vector<MotionSample> motion_samples(const DeviceSession& session) {
  std::vector<MotionSample> samples;
  for (const ReceivedReport& r : session.reports())
    if (r.outcome == Decoding::ok) samples.push_back({r.device_time_s, r.content.X_BH, r.content.V_BH});
  return samples;
}

std::string milliseconds(double s) {
  return fmt::format("{:.1f} ms", 1e3 * s);
}

/// Result of one stop of the commands.
struct WatchdogTrial {
  bool was_on = false;   ///< the motors were on at the end of the commands
  bool off = false;      ///< the motors went off during the silence
  bool tripped = false;  ///< watchdog_tripped was set then
  double least_s = 0.0;  ///< bounds of the time from the last command to the motors' end
  double most_s = 0.0;
};

/// A session as the pulses drive it.
class PulsedSession final : public PulsedDevice {
 public:
  explicit PulsedSession(DeviceSession& session) : session_(session) {}

  std::vector<MotionSample> drive(Duration time, const Wrench& F) override {
    session_.clear();
    session_.drive(time, true, kMaxHold_s, F);
    return motion_samples(session_);
  }

 private:
  DeviceSession& session_;
};

class Conformance {
 public:
  Conformance(const DeviceProfile& profile, ReportLink& link, const UsbDevice* device, Clock& clock,
              const ConformanceUser& user, const ConformanceOptions& options)
      : profile_(profile),
        device_(device),
        user_(user),
        options_(options),
        pace_(options.brief ? kBrief : kThorough),
        session_(profile, link, clock, user.cancelled) {}

  std::vector<RuleResult> run() {
    judge_identity();
    listen();
    judge_motion();
    judge_commands();
    judge_pulses();
    judge_release();
    skip("saturation", "it needs a wrench beyond the limits of the device", rule_section(8));
    skip("newest_only", "the kernel fetches every report, however slow the host is", rule_section(3));
    return std::move(results_);
  }

 private:
  void add(std::string rule, bool passed, std::string seen, std::string section) {
    results_.push_back(
        {std::move(rule), passed ? Judgement::pass : Judgement::fail, std::move(seen), std::move(section)});
  }
  void add(std::string rule, RuleFinding finding, std::string section) {
    results_.push_back({std::move(rule), finding.judgement, std::move(finding.seen), std::move(section)});
  }
  void skip(std::string rule, std::string why, std::string section) {
    results_.push_back({std::move(rule), Judgement::not_judged, std::move(why), std::move(section)});
  }
  bool has(const std::string& rule, Judgement judgement) const {
    return std::any_of(results_.begin(), results_.end(),
                       [&](const RuleResult& r) { return r.rule == rule && r.judgement == judgement; });
  }
  bool passed(const std::string& rule) const { return has(rule, Judgement::pass); }
  bool failed(const std::string& rule) const { return has(rule, Judgement::fail); }

  /// Newest valid report since the session was cleared. Throws if the device has stopped sending.
  const PoseReport& latest() const {
    if (const ReceivedReport* newest = session_.newest()) return newest->content;
    throw std::runtime_error("the device stopped sending valid reports; check its power and its main loop");
  }

  // --- identity ------------------------------------------------------------

  void judge_identity() {
    if (device_ == nullptr || device_->report_descriptor.empty()) {
      for (const char* rule : {"report_descriptor", "usb_id", "serial_number"})
        skip(rule, "the device is not a HID device of this machine", kUsbSection);
      return;
    }
    judge_descriptor();
    const SharedUsbIds* shared = find_shared_usb_id({device_->vendor, device_->product});
    add("usb_id", shared == nullptr,
        fmt::format("{:04x}:{:04x}", device_->vendor, device_->product) +
            (shared == nullptr ? "" : fmt::format(", the id of {}", shared->users)),
        kUsbSection);
    add("serial_number", !device_->serial.empty(),
        device_->serial.empty() ? "none" : to_printable(device_->serial), kUsbSection);
  }

  void judge_descriptor() {
    std::string wrong;
    try {
      const auto lines =
          find_differences(parse_report_descriptor(device_->report_descriptor), expected_reports(profile_));
      if (!lines.empty()) wrong = lines.front();
    } catch (const DescriptorError& error) {
      wrong = error.what();
    }
    if (wrong.empty() && (device_->usage_page != 0xff00 || device_->usage != 0x01))
      wrong = fmt::format("usage {:04x}:{:02x}; expected ff00:01", device_->usage_page, device_->usage);
    add("report_descriptor", wrong.empty(), wrong.empty() ? "declares both reports" : wrong, kUsbSection);
  }

  // --- reports ------------------------------------------------------------

  void listen() {
    session_.listen(kEarlierHost);
    session_.clear();
    session_.listen(pace_.listen);
    judge_frames();
    valid_.clear();
    for (const ReceivedReport& r : session_.reports())
      if (r.outcome == Decoding::ok) valid_.push_back(&r);
    // A wrong checksum is right by chance in some reports. The link counts as lossy below the same share.
    reports_valid_ =
        valid_.size() >= ProfileDevice::kTrustReports && 3 * valid_.size() >= 2 * session_.reports().size();
    if (!reports_valid_) {
      for (const char* rule : {"unused_bits", "sequence", "device_time", "report_rate", "quaternion_norm",
                               "motors_off_at_start"})
        skip(rule, "too few reports are valid", kPoseSection);
      return;
    }
    judge_unused_bits();
    judge_sequence();
    judge_time();
    judge_norm();
    judge_motors_at_start();
    valid_.clear();
  }

  void judge_frames() {
    const auto& reports = session_.reports();
    const auto count = [&reports](auto wanted) {
      return std::count_if(reports.begin(), reports.end(),
                           [&wanted](const ReceivedReport& r) { return wanted(r.outcome); });
    };
    const auto misshapen =
        count([](Decoding d) { return d == Decoding::wrong_length || d == Decoding::wrong_id; });
    const auto corrupt = count([](Decoding d) { return d == Decoding::bad_checksum; });
    std::string seen = fmt::format("{} reports", reports.size());
    if (reports.empty()) seen = fmt::format("no report in {:.1f} s", seconds(pace_.listen));
    for (const ReceivedReport& r : reports) {
      if (r.outcome != Decoding::wrong_length && r.outcome != Decoding::wrong_id) continue;
      seen += fmt::format(", {} with another length or id, such as {} bytes, id 0x{:02x}", misshapen,
                          r.bytes.size(), r.bytes.empty() ? 0 : r.bytes[0]);
      break;
    }
    add("report_frame", !reports.empty() && misshapen == 0, seen, kPoseSection);
    const auto framed = static_cast<std::ptrdiff_t>(reports.size()) - misshapen;
    if (framed == 0)
      skip("report_checksum", "there is no report with the right length and id", kPoseSection);
    else
      add("report_checksum", corrupt == 0,
          fmt::format("{} of {} reports with a wrong checksum", corrupt, framed), kPoseSection);
  }

  void judge_unused_bits() {
    std::uint8_t set = 0;
    for (const ReceivedReport* r : valid_) set = static_cast<std::uint8_t>(set | (r->bytes[1] & 0xFCU));
    add("unused_bits", set == 0, fmt::format("bits 2 to 7 of byte 1: 0x{:02x}", set), kUnitsSection);
  }

  void judge_sequence() {
    long repeated = 0, backwards = 0, missing = 0;
    for (std::size_t i = 1; i < valid_.size(); ++i) {
      const std::uint64_t step = (valid_[i]->content.sequence - valid_[i - 1]->content.sequence) & 0xFFFFU;
      if (step == 0)
        ++repeated;
      else if (step > 32767)
        ++backwards;
      else
        missing += static_cast<long>(step) - 1;
    }
    const auto n = static_cast<long>(valid_.size());
    sequence_works_ = repeated + backwards == 0;
    add("sequence", sequence_works_ && missing <= n / 20,
        fmt::format("{} reports: {} repeated, {} backwards, {} missing", n, repeated, backwards, missing),
        rule_section(2));
  }

  void judge_time() {
    const double host_s = seconds(valid_.back()->arrived - valid_.front()->arrived);
    const double device_s = valid_.back()->device_time_s - valid_.front()->device_time_s;
    const bool decreases = std::adjacent_find(valid_.begin(), valid_.end(), [](const auto* a, const auto* b) {
                             return b->device_time_s < a->device_time_s;
                           }) != valid_.end();
    const bool right = std::abs(device_s / host_s - 1.0) < kMaxClockError;
    add("device_time", !decreases && right,
        fmt::format("{:.3f} s while the host counted {:.3f} s{}", device_s, host_s,
                    decreases ? "; it decreases" : ""),
        rule_section(1));
    double reports = static_cast<double>(valid_.size() - 1);
    if (sequence_works_)
      reports =
          static_cast<double>((valid_.back()->content.sequence - valid_.front()->content.sequence) & 0xFFFFU);
    const double rate_Hz = reports / host_s;
    add("report_rate", std::abs(rate_Hz / profile_.report_rate_Hz - 1.0) <= kMaxRateError,
        fmt::format("{:.0f} Hz; the profile states {:.0f} Hz", rate_Hz, profile_.report_rate_Hz),
        kUsbSection);
  }

  void judge_norm() {
    double least = 1e9, most = 0.0;
    for (const ReceivedReport* r : valid_) {
      const double norm = r->content.X_BH.rotation.norm();
      least = std::min(least, norm), most = std::max(most, norm);
    }
    norm_works_ = least > 1.0 - kMaxNormError && most < 1.0 + kMaxNormError;
    add("quaternion_norm", norm_works_, fmt::format("{:.5f} to {:.5f}", least, most), kPoseSection);
  }

  void judge_motors_at_start() {
    const auto on = std::count_if(valid_.begin(), valid_.end(),
                                  [](const ReceivedReport* r) { return r->content.motors_on; });
    add("motors_off_at_start", on == 0,
        on == 0 ? "off before the first command"
                : fmt::format("on in {} reports before the first command", on),
        rule_section(7));
  }

  // --- velocity ------------------------------------------------------------

  void judge_motion() {
    const std::array<const char*, 3> rules = {"quaternion_order", "linear_velocity", "angular_velocity"};
    const bool linear = profile_.pose_report.linear_velocity.present;
    const bool angular = profile_.pose_report.angular_velocity.present;
    std::string why;
    if (!reports_valid_) why = "too few reports are valid";
    if (why.empty() && !norm_works_) why = "the quaternion is not a unit quaternion";
    if (why.empty() && !linear && !angular) why = "the profile has no velocity; wrenchd estimates it";
    if (!why.empty()) {
      for (const char* rule : rules) skip(rule, why, rule_section(4));
      return;
    }
    const VelocityComparison seen = observe_motion();
    const bool order_known = judge_order(seen, angular);
    judge_velocity(seen, "linear_velocity", kLinearDofs, linear, true, kTravelByHand);
    judge_velocity(seen, "angular_velocity", kAngularDofs, angular, order_known, kTravelByHand);
  }

  /// Judges each velocity by the motion of the pulses if the motion of the user could not judge it.
  void judge_velocities_of_pulses(const DirectionPulses& pulses) {
    const VelocityComparison seen = compare_velocities(pulses.motion());
    const Travel enough =
        least_travel_by_pulses(profile_.pose_report.position.step, profile_.pose_report.orientation.step);
    const auto judge = [&](const char* rule, DofMask axes, bool present, bool pose_known) {
      const auto known =
          std::find_if(results_.begin(), results_.end(), [&](const RuleResult& r) { return r.rule == rule; });
      if (!present || known == results_.end() || known->judgement != Judgement::not_judged) return;
      results_.erase(known);
      judge_velocity(seen, rule, axes, present, pose_known, enough);
    };
    judge("linear_velocity", kLinearDofs, profile_.pose_report.linear_velocity.present, true);
    judge("angular_velocity", kAngularDofs, profile_.pose_report.angular_velocity.present,
          passed("torque_direction") && !failed("quaternion_order"));
  }

  VelocityComparison observe_motion() {
    if (options_.motion_time <= Duration{0}) return {};
    user_.instruct(fmt::format(
        "Move the handle to and fro along all three axes, and turn it about all three, for at most {:.0f} s.",
        seconds(options_.motion_time)));
    session_.clear();
    VelocityComparison seen;
    for (Duration spent{}; spent < options_.motion_time; spent += 200ms) {
      session_.listen(200ms);
      seen = compare_velocities(motion_samples(session_));
      bool enough = seen.turned_rad >= kMinTurn_rad;
      for (std::size_t i = 0; i < 6; ++i) enough = enough && seen.axes[i].travel >= kTravelByHand.of(i);
      if (enough) break;
    }
    user_.instruct("Now hold the handle still and loosely.");
    return seen;
  }

  /// Returns false if the order of the quaternion is wrong. Without an angular velocity there is nothing to
  /// compare the orientation with.
  bool judge_order(const VelocityComparison& seen, bool angular) {
    if (!angular) {
      skip("quaternion_order", "the profile has no angular velocity to compare it with", kUnitsSection);
      return true;
    }
    add("quaternion_order", judge_quaternion_order(seen), kUnitsSection);
    return !failed("quaternion_order");
  }

  void judge_velocity(const VelocityComparison& seen, const char* rule, DofMask axes, bool present,
                      bool pose_known, const Travel& enough) {
    if (!present)
      skip(rule, "the profile has none; wrenchd estimates it", rule_section(4));
    else if (!pose_known)
      skip(rule, "the order of the quaternion is not known to be right", rule_section(4));
    else
      add(rule, wrenchd::judge_velocity(seen, axes, enough), rule_section(4));
  }

  // --- commands ------------------------------------------------------------

  static constexpr std::array<const char*, 15> kCommandRules = {
      "acknowledged",     "sequence_wraps",    "motors_follow_enable", "no_trip_at_enable_0", "watchdog",
      "hold_time",        "default_hold_time", "tripped_bit",          "repeated_command",    "old_command",
      "command_checksum", "command_length",    "command_id",           "restarted_host",      "release"};

  static std::string section_of(const std::string& rule) {
    if (rule == "acknowledged") return rule_section(9);
    if (rule == "motors_follow_enable" || rule == "no_trip_at_enable_0" || rule == "release")
      return rule_section(7);
    if (rule == "watchdog" || rule == "hold_time" || rule == "default_hold_time" || rule == "tripped_bit")
      return rule_section(6);
    return rule_section(5);
  }

  void skip_all(std::initializer_list<const char*> rules, const std::string& why) {
    for (const char* rule : rules) skip(rule, why, section_of(rule));
  }

  void judge_commands() {
    trusted_ = reports_valid_ && sequence_works_;
    if (!trusted_) {
      for (const char* rule : kCommandRules)
        skip(rule, "nothing is written to a device whose reports are not valid and in sequence",
             section_of(rule));
      return;
    }
    judge_acknowledgement();
    judge_enable();
    if (!passed("motors_follow_enable")) {
      skip_all({"watchdog", "hold_time", "default_hold_time", "tripped_bit", "repeated_command",
                "old_command", "command_checksum", "command_length", "command_id"},
               "the motors do not follow `enable`");
    } else {
      judge_watchdog();
      judge_repetition();
      judge_intrusions();
    }
    judge_restart();
  }

  /// A series of zero commands with the motors on, across the wrap of the sequence. With the motors off, the
  /// firmware may take the wrap for a restarted host.
  void judge_acknowledgement() {
    session_.set_sequence(kFirstSequence);
    session_.clear();
    session_.drive(pace_.series, true, kMaxHold_s);
    session_.listen(kSettle);
    const auto& commands = session_.commands();
    std::vector<double> latencies_s;
    std::optional<std::uint64_t> previous;
    for (const ReceivedReport& r : session_.reports()) {
      if (r.outcome != Decoding::ok) continue;
      const std::uint64_t low = r.content.acknowledged & 0xFFU;
      if (previous == low) continue;
      if (previous) add_latency(commands, r, latencies_s);
      previous = low;
    }
    const std::size_t expected = std::min(commands.size(), session_.reports().size());
    acknowledges_ = latencies_s.size() >= expected / 4;
    if (!acknowledges_) {
      add("acknowledged", false,
          fmt::format("{} commands sent, {} changes of `acknowledged`", commands.size(), latencies_s.size()),
          rule_section(9));
      skip_all({"sequence_wraps"}, "the device does not acknowledge commands");
      return;
    }
    std::nth_element(latencies_s.begin(), latencies_s.begin() + static_cast<long>(latencies_s.size() / 2),
                     latencies_s.end());
    const double median_s = latencies_s[latencies_s.size() / 2];
    const double limit_s = 0.005 + 3.0 / profile_.report_rate_Hz;
    add("acknowledged", median_s <= limit_s,
        fmt::format("median {} after the command; at most {} expected", milliseconds(median_s),
                    milliseconds(limit_s)),
        rule_section(9));
    judge_wrap();
  }

  /// A firmware that compares sequences without the wrap rejects commands after it, until its watchdog has
  /// tripped.
  void judge_wrap() {
    const auto& commands = session_.commands();
    Duration pause{};
    for (std::size_t i = 1; i < commands.size(); ++i)
      pause = std::max(pause, Duration{commands[i].sent - commands[i - 1].sent});
    bool on = false, interrupted = false;
    for (const ReceivedReport& r : session_.reports()) {
      if (r.outcome != Decoding::ok || r.arrived > commands.back().sent) continue;
      interrupted = interrupted || (on && !r.content.motors_on);
      on = on || r.content.motors_on;
    }
    const std::uint64_t last = latest().acknowledged & 0xFFU;
    if (interrupted && seconds(pause) > 0.5 * kMaxHold_s)
      skip("sequence_wraps", "the host was too slow for the hold time", rule_section(5));
    else
      add("sequence_wraps", last == (session_.sequence() & 0xFFU) && !interrupted,
          fmt::format("command {} acknowledged as {} after the wrap at 65535{}", session_.sequence(), last,
                      interrupted ? "; the motors went off" : ""),
          rule_section(5));
  }

  /// Adds the time from the newest command with these low bits to the report.
  static void add_latency(const std::vector<SentCommand>& commands, const ReceivedReport& report,
                          std::vector<double>& latencies_s) {
    for (auto c = commands.rbegin(); c != commands.rend(); ++c) {
      if (c->sent > report.arrived || (c->sequence & 0xFFU) != (report.content.acknowledged & 0xFFU))
        continue;
      latencies_s.push_back(seconds(report.arrived - c->sent));
      return;
    }
  }

  void judge_enable() {
    session_.clear();
    session_.drive(kSettle, true, kMaxHold_s);
    session_.drive(kSettle, true, kMaxHold_s);
    const bool on = latest().motors_on;
    session_.clear();
    session_.drive(kSettle, false, kMaxHold_s);
    session_.drive(kSettle, false, kMaxHold_s);
    const bool off = !latest().motors_on, tripped = latest().watchdog_tripped;
    add("motors_follow_enable", on && off,
        fmt::format("{} after `enable` 1, {} after `enable` 0", on ? "on" : "off", off ? "off" : "on"),
        rule_section(7));
    if (!on || !off)
      skip_all({"no_trip_at_enable_0"}, "the motors do not follow `enable`");
    else
      add("no_trip_at_enable_0", !tripped,
          tripped ? "`watchdog_tripped` is set" : "`watchdog_tripped` is not set", rule_section(7));
  }

  // --- watchdog ------------------------------------------------------------

  /// Switches the motors on with zero wrench, then sends nothing.
  WatchdogTrial stop_commands(double hold_s) {
    WatchdogTrial trial;
    for (int attempt = 0; attempt < kAttempts && !trial.was_on; ++attempt) {
      session_.clear();
      session_.drive(20ms, true, hold_s);
      const SentCommand last = session_.commands().back();
      session_.listen(pace_.silence);
      trial = evaluate(last);
    }
    return trial;
  }

  WatchdogTrial evaluate(const SentCommand& last) const {
    WatchdogTrial trial;
    const ReceivedReport* before = nullptr;  // the report before the acknowledgement
    const ReceivedReport* accepted = nullptr;
    const ReceivedReport* on = nullptr;
    for (const ReceivedReport& r : session_.reports()) {
      if (r.outcome != Decoding::ok) continue;
      const bool after =
          acknowledges_ ? (r.content.acknowledged & 0xFFU) == (last.sequence & 0xFFU) : r.arrived > last.sent;
      if (accepted == nullptr && after) accepted = &r;
      if (accepted == nullptr) {
        before = &r;
      } else if (r.content.motors_on) {
        trial.was_on = true;
        on = &r;
        trial.off = false;
      } else if (trial.was_on && !trial.off) {
        trial.off = true;
        trial.tripped = r.content.watchdog_tripped;
        trial.least_s = on->device_time_s - accepted->device_time_s;
        trial.most_s = r.device_time_s - (before == nullptr ? accepted : before)->device_time_s;
      }
    }
    return trial;
  }

  /// Judges that the motors go off within limit_s of the last command.
  void judge_hold(const char* rule, double hold_s, double limit_s) {
    const WatchdogTrial trial = stop_commands(hold_s);
    const double tolerance_s = acknowledges_ ? kFirmwareTolerance_s : kHostTolerance_s;
    if (!trial.was_on)
      skip(rule, "the motors were off before the commands stopped", rule_section(6));
    else if (!trial.off)
      add(rule, false,
          fmt::format("the motors are still on {} after the last command",
                      milliseconds(seconds(pace_.silence))),
          rule_section(6));
    else
      add(rule, trial.least_s <= limit_s + tolerance_s && trial.tripped,
          fmt::format("off {} to {} after the last command, at most {} expected; `watchdog_tripped` is {}set",
                      milliseconds(std::max(trial.least_s, 0.0)), milliseconds(trial.most_s),
                      milliseconds(limit_s), trial.tripped ? "" : "not "),
          rule_section(6));
  }

  void judge_watchdog() {
    judge_hold("watchdog", 1.0, kMaxHold_s);
    if (!passed("watchdog")) {
      skip_all({"hold_time", "default_hold_time", "tripped_bit"}, "the watchdog does not work");
      return;
    }
    judge_hold("default_hold_time", 0.0, kMaxHold_s);
    judge_hold("hold_time", kShortHold_s, kShortHold_s);
    judge_tripped_bit();
  }

  void judge_tripped_bit() {
    const WatchdogTrial trial = stop_commands(kShortHold_s);
    session_.drive(kSettle, false, kMaxHold_s);
    const bool stays = latest().watchdog_tripped;
    session_.drive(kSettle, true, kMaxHold_s);
    const bool cleared = !latest().watchdog_tripped;
    if (!trial.off)
      skip("tripped_bit", "the watchdog did not trip", rule_section(6));
    else
      add("tripped_bit", stays && cleared,
          fmt::format("{} after commands with `enable` 0, {} after commands with `enable` 1",
                      stays ? "set" : "not set", cleared ? "not set" : "set"),
          rule_section(6));
  }

  // --- commands that the firmware must reject ------------------------------------------------------------

  void judge_repetition() {
    if (!passed("watchdog")) {
      skip_all({"repeated_command"}, "the watchdog does not work");
      return;
    }
    session_.drive(20ms, true, kMaxHold_s);
    const auto bytes = session_.encoded(session_.sequence(), true, kMaxHold_s);
    session_.clear();
    for (Duration spent{}; spent < pace_.silence; spent += DeviceSession::kCommandPeriod)
      session_.send_bytes(bytes);
    const bool off = !latest().motors_on;
    add("repeated_command", off,
        fmt::format("motors {} after {} of the same command", off ? "off" : "on",
                    milliseconds(seconds(pace_.silence))),
        rule_section(5));
  }

  void judge_intrusions() {
    judge_intrusion("old_command", [this](std::uint64_t sequence) {
      return session_.encoded(sequence - 5, false, kMaxHold_s);
    });
    judge_intrusion("command_checksum", [this](std::uint64_t sequence) {
      auto bytes = session_.encoded(sequence + 1, false, kMaxHold_s);
      bytes.back() = static_cast<std::uint8_t>(bytes.back() ^ 0x55U);
      return bytes;
    });
    judge_intrusion("command_length", [this](std::uint64_t sequence) {
      auto bytes = session_.encoded(sequence + 1, false, kMaxHold_s);
      bytes.pop_back();
      return bytes;
    });
    judge_intrusion("command_id", [this](std::uint64_t sequence) {
      auto bytes = session_.encoded(sequence + 1, false, kMaxHold_s);
      bytes[0] = 0x03;
      const std::size_t at = bytes.size() - 2;
      const std::uint16_t crc = crc16_ccitt_false(std::span(bytes).first(at));
      bytes[at] = static_cast<std::uint8_t>(crc & 0xFFU);
      bytes[at + 1] = static_cast<std::uint8_t>(crc >> 8U);
      return bytes;
    });
  }

  /// Sends a command with `enable` 0 that the firmware must reject, while the motors are on. If the firmware
  /// accepts the command, the motors go off and the watchdog has not tripped.
  template <class MakeCommand>
  void judge_intrusion(const char* rule, MakeCommand make) {
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
      session_.drive(20ms, true, kMaxHold_s);
      const auto bytes = make(session_.sequence());
      session_.clear();
      for (int i = 0; i < 3; ++i) session_.send_bytes(bytes);
      session_.listen(8ms);
      if (latest().watchdog_tripped) continue;  // the host was too slow
      session_.set_sequence(session_.sequence() + 1);
      add(rule, latest().motors_on,
          latest().motors_on ? "rejected: the motors stay on" : "accepted: the motors went off",
          rule_section(5));
      session_.drive(kSettle, false, kMaxHold_s);
      return;
    }
    skip(rule, "the host was too slow for the hold time", rule_section(5));
  }

  /// A restarted host begins with any sequence. The motors are off.
  void judge_restart() {
    if (!acknowledges_) {
      skip_all({"restarted_host"}, "the device does not acknowledge commands");
      return;
    }
    session_.drive(kSettle, false, kMaxHold_s);
    session_.set_sequence(session_.sequence() + 65536 - 1000);
    session_.clear();
    session_.drive(kSettle, false, kMaxHold_s);
    session_.listen(kSettle);
    const bool accepted = (latest().acknowledged & 0xFFU) == (session_.sequence() & 0xFFU);
    add("restarted_host", accepted,
        fmt::format("a sequence 1000 behind, motors off: {}", accepted ? "accepted" : "rejected"),
        rule_section(5));
    if (!accepted) session_.set_sequence(session_.sequence() + 2000);
  }

  // --- pulses ------------------------------------------------------------

  void judge_pulses() {
    const std::array<const char*, 2> rules = {"force_direction", "torque_direction"};
    std::string why;
    if (!options_.pulses) why = "pulses are switched off";
    if (why.empty() && !(passed("motors_follow_enable") && passed("watchdog")))
      why = "no force is applied without a working watchdog";
    if (!why.empty()) {
      for (const char* rule : rules) skip(rule, why, kUnitsSection);
      return;
    }
    const double pulse_N = pulse_force_N(profile_), pulse_Nm = pulse_torque_Nm(profile_);
    user_.instruct(fmt::format("Pulses of at most {:.2f} N and {:.3f} N.m follow.", pulse_N, pulse_Nm));
    PulsedSession device(session_);
    DirectionPulses pulses(device, pace_.pulses);
    add("force_direction",
        pulses.judge_force(pulse_N, kLinearDofs, kLeastSteps_m * profile_.pose_report.position.step),
        kUnitsSection);
    if (failed("quaternion_order"))
      skip("torque_direction", "the order of the quaternion is wrong", kUnitsSection);
    else
      add("torque_direction",
          pulses.judge_torque(pulse_Nm, kAngularDofs,
                              kLeastSteps_rad * profile_.pose_report.orientation.step),
          kUnitsSection);
    if (reports_valid_ && norm_works_) judge_velocities_of_pulses(pulses);
  }

  // --- the end ------------------------------------------------------------

  void judge_release() {
    if (!trusted_) return;
    session_.release();
    session_.clear();
    session_.listen(kSettle);
    const bool off = !latest().motors_on;
    add("release", off,
        off ? "motors off after the zero commands" : "motors still on after the zero commands",
        rule_section(7));
  }

  const DeviceProfile& profile_;
  const UsbDevice* device_;
  const ConformanceUser& user_;
  const ConformanceOptions& options_;
  const Pace& pace_;
  DeviceSession session_;
  std::vector<RuleResult> results_;
  /// Valid reports of listen(). The pointers are valid until the session is cleared.
  std::vector<const ReceivedReport*> valid_;
  bool reports_valid_ = false;  ///< enough reports of listen() were valid
  bool sequence_works_ = false;
  bool norm_works_ = false;
  bool trusted_ = false;
  bool acknowledges_ = false;
};

/// Values that differ in every field.
PoseReport distinct_pose(bool linear, bool angular) {
  PoseReport r;
  r.X_BH = {Quaterniond(0.5, 0.1, 0.2, 0.3), {0.011, 0.022, 0.033}};
  if (linear) r.V_BH.linear_m_per_s = {0.1, 0.2, 0.3};
  if (angular) r.V_BH.angular_rad_per_s = {0.4, 0.5, 0.6};
  r.sequence = 0x1234, r.device_time = 0x56789abc, r.acknowledged = 0xde, r.buttons = 0x5a;
  r.motors_on = true;
  return r;
}

template <class Layout, class Report>
bool same_bytes(const Layout& a, const Layout& b, const Report& report) {
  std::array<std::uint8_t, kMaxReportBytes> bytes_a{}, bytes_b{};
  return encode(a, report, bytes_a) == encode(b, report, bytes_b) && bytes_a == bytes_b;
}

}  // namespace

bool has_open_layout(const DeviceProfile& profile) {
  const DeviceProfile open = reference_profile();
  const PoseReport pose = distinct_pose(profile.pose_report.linear_velocity.present,
                                        profile.pose_report.angular_velocity.present);
  PoseReport tripped = pose;
  tripped.motors_on = false, tripped.watchdog_tripped = true;
  WrenchReport wrench;
  wrench.F = {{1.0, 2.0, 3.0}, {0.1, 0.2, 0.3}};
  wrench.sequence = 0x1234, wrench.hold_time_s = 0.017, wrench.enable = true;
  return profile.has_output && profile.more_reports.empty() && profile.stream == StreamStyle::free_running &&
         same_bytes(profile.pose_report, open.pose_report, pose) &&
         same_bytes(profile.pose_report, open.pose_report, tripped) &&
         same_bytes(profile.wrench_report, open.wrench_report, wrench);
}

void require_open_layout(const DeviceProfile& profile) {
  if (has_open_layout(profile)) return;
  throw std::runtime_error(
      "profile " + profile.name +
      ": its reports are not those of the open report layout, whose rules this command checks; "
      "a profile of such a device inherits reference_full_speed or reference_high_speed");
}

std::vector<RuleResult> check_conformance(const DeviceProfile& profile, ReportLink& link,
                                          const UsbDevice* device, Clock& clock, const ConformanceUser& user,
                                          const ConformanceOptions& options) {
  require_open_layout(profile);
  return Conformance(profile, link, device, clock, user, options).run();
}

}  // namespace wrenchd
