// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/gallery_run.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "tests/support/paths.hpp"
#include "tests/support/shipped_config.hpp"
#include "tests/support/two_hands.hpp"

namespace wrenchd::test {
namespace {

constexpr double kDeg = 180.0 / std::numbers::pi;

double norm3(const std::array<double, 6>& x, std::size_t from) {
  return std::hypot(x[from], x[from + 1], x[from + 2]);
}

/// Returns the angle of the pose's x axis about the world's z axis.
double heading_rad(const Pose& X) {
  const Vector3d x = X.rotation * Vector3d::UnitX();
  return std::atan2(x.y(), x.x());
}

const TickRecord& at(const GalleryRun& run, double time_s) {
  const auto rate_Hz = run.config.settings.servo.rate_Hz;
  const auto i = static_cast<std::size_t>(std::lround(time_s * rate_Hz));
  if (!(time_s >= 0.0) || i >= run.ticks.size())
    throw std::invalid_argument("the run has no moment " + std::to_string(time_s) + " s");
  return run.ticks[i];
}

double turned_deg(const GalleryRun& run, bool hand, double time_s) {
  double turned = 0.0, last = 0.0;
  const TickRecord* const end = &at(run, time_s);
  bool begun = false;
  for (const TickRecord* tick = run.ticks.data(); tick <= end; ++tick) {
    const auto& x = hand ? tick->X_WP : tick->X_WQ;
    if (!std::isfinite(x[0])) continue;
    const double now = heading_rad(pose_from_numbers(x));
    if (begun) turned += std::remainder(now - last, 2.0 * std::numbers::pi);
    last = now;
    begun = true;
  }
  return turned * kDeg;
}

}  // namespace

RunConfig gallery_config(const std::string& name) {
  RunConfig plan = load_run_config({source_path("config/gallery/") + name + ".toml", {}, {}, false},
                                   SearchPath({source_path("config")}));
  plan.settings.servo.self_test_s = 0.0;
  return plan;
}

double script_duration_s(const RunConfig& plan) {
  return plan.settings.simulation.hand_path.back().time_s;
}

namespace {

/// The ticks of the first of two hands.
GalleryRun run_two_hands(const std::string& name, double seconds) {
  TwoHands both(TwoHands::gallery(name));
  GalleryRun run{both.configs.front(), {}, {}};
  run.second_config = both.configs.back();
  const double last_s =
      seconds > 0.0 ? std::min(seconds, script_duration_s(run.config)) : script_duration_s(run.config);
  TimePoint first{};
  while (run.scene_time_s.empty() || run.scene_time_s.back() < last_s) {
    both.step();
    if (both.last[1].now_ns > both.last[0].now_ns) {
      run.second_ticks.push_back(both.last[1]);
      continue;
    }
    if (run.ticks.empty()) {
      first = both.clock.now();
      both.arm();
    }
    run.ticks.push_back(both.last[0]);
    run.scene_time_s.push_back(wrenchd::seconds(both.clock.now() - first));
  }
  return run;
}

}  // namespace

GalleryRun run_gallery_scene(const std::string& name, double seconds) {
  if (gallery_config(name).two_hands()) return run_two_hands(name, seconds);
  return run_gallery_config(gallery_config(name), seconds);
}

GalleryRun run_gallery_config(RunConfig config, double seconds) {
  GalleryRun run{std::move(config), {}, {}};
  VirtualRuntime virtual_run(run.config);
  const double last_s =
      seconds > 0.0 ? std::min(seconds, script_duration_s(run.config)) : script_duration_s(run.config);
  const auto count = static_cast<std::size_t>(std::lround(last_s * run.config.settings.servo.rate_Hz)) + 1;
  TimePoint first{};
  for (std::size_t i = 0; i < count; ++i) {
    if (i == 1) virtual_run.runtime.loop().requests().arm();
    virtual_run.tick();
    if (i == 0) first = virtual_run.clock.now();
    run.ticks.push_back(virtual_run.last);
    run.scene_time_s.push_back(wrenchd::seconds(virtual_run.clock.now() - first));
  }
  return run;
}

double run_figure(const GalleryRun& run, const std::string& quantity, double time_s) {
  const auto peak = [&](std::size_t from) {
    double most = 0.0;
    for (const TickRecord& tick : run.ticks) most = std::max(most, norm3(tick.F_out, from));
    return most;
  };
  if (quantity == "peak_force_N") return peak(0);
  if (quantity == "peak_torque_Nm") return peak(3);
  const TickRecord& tick = at(run, time_s);
  if (quantity == "force_N") return norm3(tick.F_out, 0);
  if (quantity == "torque_Nm") return norm3(tick.F_out, 3);
  constexpr const char* kAxes[] = {"x", "y", "z"};
  for (std::size_t k = 0; k < 3; ++k) {
    if (quantity == std::string("force_") + kAxes[k] + "_N") return tick.F_out[k];
    if (quantity == std::string("torque_") + kAxes[k] + "_mNm") return 1e3 * tick.F_out[3 + k];
  }
  if (quantity == "contacts") return tick.contacts;
  // "body0_x_mm": the centre of a free body
  constexpr std::size_t kBodyDigit = 4, kBodyAxis = 6, kPoseNumbers = 7;
  if (quantity.starts_with("body") && quantity.size() == std::string("body0_x_mm").size())
    return 1e3 * tick.X_WB.at(kPoseNumbers * static_cast<std::size_t>(quantity[kBodyDigit] - '0') +
                              static_cast<std::size_t>(quantity[kBodyAxis] - 'x'));
  const Pose X_WP = pose_from_numbers(tick.X_WP), X_WQ = pose_from_numbers(tick.X_WQ);
  if (quantity == "depth_mm") return 1e3 * (X_WP.translation_m - X_WQ.translation_m).norm();
  const bool hand = quantity.rfind("hand_", 0) == 0;
  const std::string what = hand ? quantity.substr(5) : quantity;
  if (what == "turn_deg") return turned_deg(run, hand, time_s);
  static thread_local std::string scene_of;
  static thread_local Vector3d p_MT_m;
  if (scene_of != run.config.scene.file) {
    p_MT_m = load_tool(run.config.scene.tool).solid.p_MT_m;
    scene_of = run.config.scene.file;
  }
  const Pose& X_WT = hand ? X_WP : X_WQ;
  const Vector3d p_WM = X_WT * Vector3d(-p_MT_m);
  if (what == "x_mm") return 1e3 * p_WM.x();
  if (what == "y_mm") return 1e3 * p_WM.y();
  if (what == "z_mm") return 1e3 * p_WM.z();
  if (what == "tilt_deg")
    return kDeg * std::acos(std::clamp((X_WT.rotation * Vector3d::UnitZ()).z(), -1.0, 1.0));
  throw std::invalid_argument("no figure is called '" + quantity + "'");
}

std::vector<ExpectedFigure> expected_figures(const std::string& name) {
  const std::string file = source_path("tests/data/gallery/") + name + ".csv";
  std::ifstream in(file);
  std::vector<ExpectedFigure> all;
  std::string line;
  std::getline(in, line);  // the header: time_s,quantity,min,max
  while (std::getline(in, line)) {
    std::istringstream cells(line);
    std::string time, quantity, least, most;
    std::getline(cells, time, ',');
    std::getline(cells, quantity, ',');
    std::getline(cells, least, ',');
    std::getline(cells, most, ',');
    all.push_back({time.empty() ? -1.0 : std::stod(time), quantity, std::stod(least), std::stod(most)});
  }
  return all;
}

}  // namespace wrenchd::test
