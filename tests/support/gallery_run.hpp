// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "daemon/runtime.hpp"
#include "daemon/servo/tick_record.hpp"

namespace wrenchd::test {

/// A scene of the gallery, felt once from the start of its hand script to its end, in virtual time.
struct GalleryRun {
  RunConfig config;
  std::vector<TickRecord> ticks;
  std::vector<double> scene_time_s;  ///< of each tick
};

/// The plan of a scene of the gallery as shipped, but for the self-test, which is left out.
RunConfig gallery_config(const std::string& name);

/// How long its hand script lasts.
double script_duration_s(const RunConfig& plan);

/// Runs it armed from the start. seconds: no longer than that; 0: once through its script.
GalleryRun run_gallery_scene(const std::string& name, double seconds = 0.0);

/// What there is to look at in a run. M is the frame of the tool's mesh.
///
///   peak_force_N, peak_torque_Nm   largest of the run, on the handle (at a moment: force_N, torque_Nm)
///   force_x_N, torque_x_mNm, ...   one component
///   contacts                       vertices and edges that touch
///   x_mm, y_mm, z_mm               of M at the proxy, in the world
///   turn_deg                       of M at the proxy about the world's z, counted on from the start
///   tilt_deg                       between M's z at the proxy and the world's
///   hand_x_mm, hand_y_mm, ...      the same where the hand is
///   depth_mm                       from one to the other, between centres of mass
///
/// Throws std::invalid_argument where nothing is called so, or the run has no such moment.
double run_figure(const GalleryRun& run, const std::string& quantity, double time_s);

/// One line of tests/data/gallery/NAME.csv: what is expected, at a moment or (time below 0) of the whole run.
struct ExpectedFigure {
  double time_s = -1.0;
  std::string quantity;
  double min = 0.0, max = 0.0;
};
std::vector<ExpectedFigure> expected_figures(const std::string& name);

}  // namespace wrenchd::test
