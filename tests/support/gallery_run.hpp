// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "daemon/runtime.hpp"
#include "daemon/servo/tick_record.hpp"

namespace wrenchd::test {

/// One run of a gallery scene in virtual time, from the start to the end of its hand script.
struct GalleryRun {
  RunConfig config;
  std::vector<TickRecord> ticks;
  std::vector<double> scene_time_s;           ///< scene time of each tick
  RunConfig second_config = {};               ///< configuration of the second hand, if the scene has two
  std::vector<TickRecord> second_ticks = {};  ///< ticks of the second hand; `ticks` are those of the first
};

/// Returns the configuration of a gallery scene as shipped, without the self-test.
RunConfig gallery_config(const std::string& name);

/// Returns the duration of the configuration's hand script [s].
double script_duration_s(const RunConfig& plan);

/// Runs the scene, armed from the start. seconds: maximum duration; 0: the whole hand script.
GalleryRun run_gallery_scene(const std::string& name, double seconds = 0.0);
/// The same with a changed configuration of the scene.
GalleryRun run_gallery_config(RunConfig config, double seconds = 0.0);

/// Returns a quantity of a run. M is the frame of the tool's mesh.
///
///   peak_force_N, peak_torque_Nm   largest of the run, on the handle (at a time: force_N, torque_Nm)
///   force_x_N, torque_x_mNm, ...   one component
///   contacts                       number of vertices and edges in contact
///   x_mm, y_mm, z_mm               position of M at the proxy, in the world
///   turn_deg                       rotation of M at the proxy about the world's z, unwrapped since the start
///   tilt_deg                       angle between M's z at the proxy and the world's z
///   hand_x_mm, hand_y_mm, ...      the same quantities at the hand
///   depth_mm                       distance from hand to proxy, between centres of mass
///
/// Throws std::invalid_argument if the quantity is unknown or the run has no tick at this time.
double run_figure(const GalleryRun& run, const std::string& quantity, double time_s);

/// One line of tests/data/gallery/NAME.csv: a range of a quantity, at a time or (time below 0) for the whole
/// run.
struct ExpectedFigure {
  double time_s = -1.0;
  std::string quantity;
  double min = 0.0, max = 0.0;
};
std::vector<ExpectedFigure> expected_figures(const std::string& name);

}  // namespace wrenchd::test
