// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "devices/links/loopback_link.hpp"
#include "devices/profile_device.hpp"
#include "devices/simulation/reference_profile.hpp"
#include "devices/simulation/simulated_device.hpp"
#include "tests/support/random_values.hpp"

// Error and delay of the estimated velocity against the true twist of a simulated handle, for encoder steps
// and shares of lost reports. Prints the tables of devices/README.md. Virtual time: every run gives the same
// numbers.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

/// A link that loses a random share of all reports.
class LossyLink final : public ReportLink {
 public:
  LossyLink(ReportLink& link, double loss) : loss_(loss), link_(link) {}
  void open() override { link_.open(); }
  LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept override {
    LinkRead read = link_.read(now, buffer);
    while (read.status == LinkStatus::ok && random_.chance(loss_)) read = link_.read(now, buffer);
    return read;
  }
  LinkStatus write(TimePoint now, std::span<const std::uint8_t> report) noexcept override {
    return link_.write(now, report);
  }
  void wait_readable(TimePoint deadline) noexcept override { link_.wait_readable(deadline); }
  void close() noexcept override { link_.close(); }

 private:
  double loss_;
  ReportLink& link_;
  RandomValues random_{20261124};
};

struct Motion {
  const char* name;
  std::function<Pose(double t_s)> at;
};

/// Distance from the handle point to a fingertip: it converts rotations of the motions and encoder steps.
constexpr double kLever_m = 0.05;

Pose pose_of(const Vector3d& p_m) {
  return {rotation_from(p_m / kLever_m), p_m};
}

std::vector<Motion> motions() {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const auto swing = [](double rate_Hz, double amplitude_m) {
    return [=](double t_s) {
      const double phase = kTurn * rate_Hz * t_s;
      return pose_of(amplitude_m * Vector3d(std::sin(phase), std::sin(0.83 * phase + 1.0), 0.0));
    };
  };
  return {{"rest",
           [](double) {
             return pose_of({1.3e-5, 2.7e-5, 0.4e-5});
           }},
          {"slow: 10 mm/s", swing(0.3, 0.0053)},
          {"a swing of the hand: 0.25 m/s", swing(1.0, 0.04)},
          {"fast: 1 m/s, 4 Hz", swing(4.0, 0.04)},
          {"30 Hz, 1 mm", swing(30.0, 1e-3)}};
}

struct Series {
  std::vector<Vector3d> truth, estimate;

  /// Root of the mean square of estimate(t) - truth(t - delay).
  double error(double delay_ticks) const {
    const auto whole = static_cast<std::size_t>(delay_ticks);
    const double part = delay_ticks - static_cast<double>(whole);
    double sum = 0.0;
    std::size_t n = 0;
    for (std::size_t i = 100; i < truth.size(); ++i, ++n)
      sum += (estimate[i] - (1.0 - part) * truth[i - whole] - part * truth[i - whole - 1]).squaredNorm();
    return std::sqrt(sum / static_cast<double>(n));
  }
  /// The delay [ticks] at which the error is least.
  double delay() const {
    double best = 0.0;
    for (double d = 0.0; d < 20.0; d += 0.1)
      if (error(d) < error(best)) best = d;
    return best;
  }
  double largest_error() const {
    double largest = 0.0;
    for (std::size_t i = 100; i < truth.size(); ++i)
      largest = std::max(largest, (estimate[i] - truth[i]).norm());
    return largest;
  }
};

struct Result {
  Series linear, angular;
};

Result run(const Motion& motion, double step_m, double loss) {
  DeviceProfile profile = reference_profile();
  profile.pose_report.linear_velocity.present = profile.pose_report.angular_velocity.present = false;
  profile.max_linear_speed_m_per_s = 10.0;
  profile.max_angular_speed_rad_per_s = 100.0;
  profile.encoder_step_m = step_m;
  profile.encoder_step_rad = step_m / kLever_m;
  SimulationSettings settings;
  settings.position_quantum_m = step_m;
  settings.rotation_quantum_rad = step_m / kLever_m;
  settings.report_delay_s = settings.command_delay_s = 0.0;
  settings.playback_mode = PlaybackMode::open;
  settings.hand_path = {{}};
  constexpr double kDuration_s = 6.0;
  for (double t_s = 0.0; t_s <= kDuration_s + 0.01; t_s += 5e-4)
    settings.playback_path.push_back({t_s, motion.at(t_s)});
  VirtualClock clock;
  SimulatedDevice simulated(profile, settings);
  LoopbackLink loopback(simulated, clock, settings);
  LossyLink link(loopback, loss);
  ProfileDevice device(profile, link);
  device.open();
  device.read_newest(clock.now());
  Result result;
  while (seconds(clock.now().time_since_epoch()) < kDuration_s) {
    clock.sleep_until(clock.now() + std::chrono::milliseconds(1));
    const DeviceSample sample = device.read_newest(clock.now());
    result.linear.truth.push_back(simulated.V_BH().linear_m_per_s);
    result.angular.truth.push_back(simulated.V_BH().angular_rad_per_s);
    result.linear.estimate.push_back(sample.V_BH.linear_m_per_s);
    result.angular.estimate.push_back(sample.V_BH.angular_rad_per_s);
  }
  return result;
}

}  // namespace

int main() {
  std::printf(
      "| motion | step um | lost %% | rms error mm/s | largest mm/s | delay ms | rms error mrad/s | delay ms "
      "|\n"
      "|---|---:|---:|---:|---:|---:|---:|---:|\n");
  for (const Motion& motion : motions())
    for (const double step_um : {5.0, 10.0, 20.0, 50.0, 100.0})
      for (const double loss : {0.0, 0.01, 0.05}) {
        const Result result = run(motion, 1e-6 * step_um, loss);
        const bool at_rest = motion.name == std::string("rest");
        const auto delay = [&](const Series& series) {
          std::array<char, 16> text{"-"};
          if (!at_rest) std::snprintf(text.data(), text.size(), "%.1f", series.delay());
          return std::string(text.data());
        };
        std::printf("| %s | %.0f | %.0f | %.2f | %.2f | %s | %.1f | %s |\n", motion.name, step_um,
                    100.0 * loss, 1e3 * result.linear.error(0.0), 1e3 * result.linear.largest_error(),
                    delay(result.linear).c_str(), 1e3 * result.angular.error(0.0),
                    delay(result.angular).c_str());
      }
}
