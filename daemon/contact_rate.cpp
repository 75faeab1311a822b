// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/contact_rate.hpp"

#include <cstdio>

#include "core/clock.hpp"

namespace wrenchd {
namespace {

constexpr double kFirstReport_s = 5.0;
/// With this number of overruns the first report comes at once.
constexpr std::uint64_t kManyOverruns = 20;
constexpr double kFall = 2.0 / 3.0;
/// Fraction of the ticks that must end before the next one is due.
constexpr double kInTime = 0.999;
/// The lowest rate that a configuration can choose ([servo] rate_Hz).
constexpr double kLowestRate_Hz = 500.0;

/// Returns the rate at which kInTime of the ticks end in time; 0 before the first tick.
double allowed_rate_Hz(const LoopTiming& timing) {
  const double tick_s = seconds(timing.tick.quantile(kInTime));
  return tick_s > 0.0 ? 1.0 / tick_s : 0.0;
}

}  // namespace

std::string ContactRateReport::start_text() {
  return "contacts = \"cgal\": a tick allocates memory and takes as long as the meshes require, so it is not "
         "real-time; wrenchd measures the rate that the scene allows";
}

std::optional<ContactRateReport::Message> ContactRateReport::check(const LoopTiming& timing) {
  const bool measured = static_cast<double>(timing.tick.count()) >= kFirstReport_s * rate_Hz_;
  if (!measured && timing.overruns.load() < kManyOverruns) return {};
  const double allowed_Hz = allowed_rate_Hz(timing);
  if (reported_Hz_ > 0.0 && allowed_Hz > kFall * reported_Hz_) return {};
  return report(allowed_Hz);
}

std::optional<ContactRateReport::Message> ContactRateReport::close(const LoopTiming& timing) {
  if (reported_Hz_ > 0.0 || timing.tick.count() == 0) return {};
  return report(allowed_rate_Hz(timing));
}

ContactRateReport::Message ContactRateReport::report(double allowed_Hz) {
  reported_Hz_ = allowed_Hz;
  char measured[160];
  std::snprintf(
      measured, sizeof measured,
      "contacts = \"cgal\": 99.9 %% of the ticks took at most %.2f ms, so this scene allows %.0f Hz",
      1e3 / allowed_Hz, allowed_Hz);
  if (allowed_Hz >= rate_Hz_) return {false, measured};
  char cure[160];
  std::snprintf(cure, sizeof cure,
                ", and the loop runs at %.0f Hz; choose contacts = \"native\", coarser meshes%s, or run with "
                "--virtual-time",
                rate_Hz_, allowed_Hz >= kLowestRate_Hz ? ", a lower rate_Hz" : "");
  return {true, std::string(measured) + cure};
}

}  // namespace wrenchd
