// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/conforming_case.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>
#include <stdexcept>

#include "collision/meshes/make_mesh.hpp"
#include "tests/support/conforming_mesh.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test {
namespace {

constexpr double kShaft_m = 0.0099, kShaftLength_m = 0.060, kBoreLength_m = 0.050;
constexpr double kGearRadius_m = 0.021, kGearLength_m = 0.010;
constexpr double kTeeth = 20.0;
constexpr std::uint32_t kShaftFacets = 64, kGearFacets = 160;

std::string short_number(std::size_t n) {
  if (n >= 1'000'000) return std::to_string(n / 1'000'000).append("M");
  return n >= 1000 ? std::to_string(n / 1000).append("k") : std::to_string(n);
}

std::string with_clearance(const char* body, const char* what, double clearance_m) {
  std::ostringstream name;
  name << body << what << ' ' << std::lround(1e6 * clearance_m) << " um";
  return name.str();
}

std::vector<ConformingCase> all_cases() {
  using enum ConformingShape;
  std::vector<ConformingCase> all;
  const auto add = [&](std::string name, ConformingCase of) {
    of.name = name + ' ' + short_number(of.tool_triangles) + " / " + short_number(of.obstacle_triangles);
    of.name += of.in_float ? ", float" : ", exact";
    if (of.rotated) of.name += ", rotated";
    all.push_back(of);
  };
  const auto add_variants = [&](const std::string& name, const ConformingCase& of) {
    for (const bool in_float : {false, true})
      for (const bool turned : {false, true}) {
        ConformingCase variant = of;
        variant.in_float = in_float;
        variant.rotated = turned;
        add(name, variant);
      }
  };
  add("cube", {"", cube_on_slab, 12, 12});
  for (const std::size_t n : {50'000, 200'000, 1'000'000}) add_variants("cube", {"", cube_on_slab, n, 12});
  for (const std::size_t n : {10'000, 50'000, 200'000, 1'000'000})
    add_variants("cube", {"", cube_on_slab, n, n});
  for (const double clearance_m : {10e-6, 50e-6})
    for (const Profile profile : {Profile::faceted, Profile::smooth})
      for (const std::size_t n : {10'000, 50'000, 200'000, 1'000'000})
        for (const bool turned_float : {false, true}) {
          const char* const shaft = profile == Profile::faceted ? "faceted shaft" : "smooth shaft";
          add(with_clearance(shaft, " in bore", clearance_m),
              {"", shaft_in_bore, n, n, clearance_m, profile, turned_float, turned_float});
        }
  for (const double clearance_m : {10e-6, 50e-6})
    for (const std::size_t n : {50'000, 200'000})
      add(with_clearance("shaft", " inserted", clearance_m),
          {"", shaft_inserted, n, n, clearance_m, Profile::faceted, true, true});
  for (const Profile profile : {Profile::faceted, Profile::smooth})
    for (const std::size_t n : {10'000, 50'000, 200'000, 1'000'000})
      for (const bool turned_float : {false, true})
        add(profile == Profile::faceted ? "faceted gears" : "smooth gears",
            {"", gears, n, n, 0.0, profile, turned_float, turned_float});
  add("peg in hole", {"", peg_in_hole, 20'000, 40'000});
  return all;
}

std::uint32_t at_least_one(double x) {
  return static_cast<std::uint32_t>(std::max(1L, std::lround(x)));
}

ProfileRing circle(double z_m, double radius_m) {
  return {z_m, [radius_m](double) { return radius_m; }};
}

/// Returns the radius over the angle of a gear: 0 to 1 and back per tooth, cut off at root and tip.
double gear_radius_m(double angle) {
  const double phase = kTeeth * angle / kFullTurn_rad, x = phase - std::floor(phase);
  const double wave = x < 0.5 ? 2.0 * x : 2.0 - 2.0 * x;
  return 0.019 + 0.004 * std::clamp(2.4 * wave - 0.7, 0.0, 1.0);
}

/// The sheet of a prism that is divided into nearly square cells.
struct Sheet {
  double perimeter_m, length_m;
  std::uint32_t facets;
};

/// Sets the number of corners and returns the parts of the outer facets for a number of triangles.
FacetParts cells(const ConformingCase& of, const Sheet& sheet, std::size_t triangles, Prism& prism) {
  const double squares = 0.5 * static_cast<double>(triangles);
  const double around = std::sqrt(squares * sheet.perimeter_m / sheet.length_m);
  FacetParts parts;
  if (of.profile == Profile::faceted) {
    prism.corners = sheet.facets;
    parts.across = at_least_one(around / sheet.facets);
  } else {
    prism.corners = std::max(8U, at_least_one(around));
  }
  parts.along = at_least_one(squares / (static_cast<double>(prism.corners) * parts.across));
  return parts;
}

/// Makes a prism at the tessellation of the case or, if coarse, undivided.
TriangleMesh divided_prism(Prism prism, FacetParts parts, bool coarse) {
  return make_prism(prism, coarse ? FacetParts{} : parts);
}

MeshesOfCase shaft_and_bore(const ConformingCase& of, bool coarse) {
  const bool chamfered = of.shape == ConformingShape::shaft_inserted;
  const double end_m = 0.5 * kShaftLength_m, chamfer_m = 0.001, mouth_m = 0.002;
  const double half_m = 0.5 * kBoreLength_m, perimeter_m = kFullTurn_rad * kShaft_m;
  Prism shaft;
  shaft.outside = {circle(-end_m, kShaft_m), circle(end_m, kShaft_m)};
  if (chamfered)
    shaft.outside = {circle(-end_m, kShaft_m - chamfer_m), circle(-end_m + chamfer_m, kShaft_m),
                     circle(end_m, kShaft_m)};
  const FacetParts parts = cells(of, {perimeter_m, kShaftLength_m, kShaftFacets}, of.tool_triangles, shaft);

  Prism tube;
  FacetParts inside = cells(of, {perimeter_m, kBoreLength_m, kShaftFacets}, of.obstacle_triangles, tube);
  inside.along_bore = inside.along;
  inside.along = 1;
  // The facets of the bore, not its corners, keep the clearance.
  const double bore_m = (kShaft_m + of.clearance_m) / std::cos(0.5 * kFullTurn_rad / tube.corners);
  tube.outside = {circle(-half_m, 0.020), circle(half_m, 0.020)};
  tube.bore = {circle(-half_m, bore_m), circle(half_m, bore_m)};
  if (chamfered)
    tube.bore = {circle(-half_m, bore_m), circle(half_m - mouth_m, bore_m), circle(half_m, bore_m + mouth_m)};
  return {divided_prism(shaft, parts, coarse), divided_prism(tube, inside, coarse)};
}

TriangleMesh gear(const ConformingCase& of, std::size_t triangles, bool coarse) {
  Prism prism;
  // The flanks make the outline about half as long again as the pitch circle.
  const FacetParts parts =
      cells(of, {1.5 * kFullTurn_rad * kGearRadius_m, kGearLength_m, kGearFacets}, triangles, prism);
  const double half_m = 0.5 * kGearLength_m;
  prism.outside = {{-half_m, gear_radius_m}, {half_m, gear_radius_m}};
  prism.bore = {circle(-half_m, 0.006), circle(half_m, 0.006)};
  return divided_prism(prism, parts, coarse);
}

MeshesOfCase meshes(const ConformingCase& of, bool coarse) {
  switch (of.shape) {
    case ConformingShape::cube_on_slab: {
      MeshesOfCase both = {make_mesh({"cube", coarse ? 12 : of.tool_triangles}),
                           make_mesh({"table", coarse ? 12 : of.obstacle_triangles})};
      for (Vector3d& p : both.obstacle.vertices_m) p.z() -= 0.01;
      return both;
    }
    case ConformingShape::shaft_in_bore:
    case ConformingShape::shaft_inserted:
      return shaft_and_bore(of, coarse);
    case ConformingShape::gears:
      return {gear(of, of.tool_triangles, coarse), gear(of, of.obstacle_triangles, coarse)};
    case ConformingShape::peg_in_hole:
      break;
  }
  return {make_mesh({"peg", of.tool_triangles}), make_mesh({"hole", of.obstacle_triangles})};
}

/// Rises from 0 to 1 in a given time, at first and at last at rest.
double smooth_rise(double t_s, double duration_s) {
  const double x = std::clamp(t_s / duration_s, 0.0, 1.0);
  return 0.5 - 0.5 * std::cos(std::numbers::pi * x);
}

/// The phases of a motion; all zero for seed 1.
struct Phases {
  explicit Phases(std::uint64_t seed) {
    RandomValues random(seed);
    for (double& phase : at) phase = seed == 1 ? 0.0 : random.uniform(0.0, kFullTurn_rad);
  }
  /// Returns a sine of this amplitude and frequency.
  double sine(std::size_t which, double amplitude, double frequency_Hz, double t_s) const {
    return amplitude * std::sin(kFullTurn_rad * frequency_Hz * t_s + at[which]);
  }
  double at[6];
};

Quaterniond rocked(double angle_rad, double t_s) {
  return rotation_from(angle_rad * Vector3d(std::cos(3.0 * t_s), std::sin(3.0 * t_s), 0.0));
}

/// Lands, slides and rocks; from 1.3 s to 1.6 s it is in the air.
Pose pose_on_slab(const Phases& phases, double t) {
  const double landed = smooth_rise(t, 0.12) - smooth_rise(t - 1.3, 0.12) + smooth_rise(t - 1.55, 0.12);
  const double depth_m = 0.0026 + phases.sine(0, 0.0008, 1.1, t);
  return {rotation_from({0, 0, phases.sine(1, 0.55, 0.45, t)}) * rocked(phases.sine(2, 0.05, 3.0, t), t),
          {phases.sine(3, 0.055, 0.75, t), phases.sine(4, 0.015, 0.9, t),
           0.025 + 0.006 * (1.0 - landed) - depth_m * landed}};
}

/// Is pressed aside and tilted, moves along the bore and spins in it.
Pose pose_in_bore(const Phases& phases, double t) {
  const double pressed = smooth_rise(t, 0.1);
  const double aside_m = pressed * (0.0015 + phases.sine(0, 0.0008, 3.0, t)), angle = 4.0 * t + phases.at[1];
  const double along_m = 0.02 * std::sin(kFullTurn_rad * 2.0 * t);
  return {rotation_from({0, 0, 2.5 * t}) * rocked(pressed * phases.sine(2, 0.02, 1.5, t), t),
          {aside_m * std::cos(angle), aside_m * std::sin(angle), along_m}};
}

/// Goes 25 mm into the bore at up to 0.28 m/s and out again, 0.5 mm aside and a little tilted.
Pose pose_inserted(const Phases& phases, double t) {
  constexpr double kFree_m = 0.5 * (kShaftLength_m + kBoreLength_m) + 0.003;
  const double in = 0.5 - 0.5 * std::cos(kFullTurn_rad * 1.5 * t);
  return {rotation_from({0, 0, 1.5 * t}) * rocked(phases.sine(0, 0.01, 1.0, t), t),
          {phases.sine(1, 0.0005, 2.0, t), phases.sine(2, 0.0005, 1.7, t), kFree_m - 0.055 * in}};
}

/// Is pressed into the other gear and rolls around it.
Pose pose_of_gear(const Phases& phases, double t) {
  const double half_tooth_rad = 0.5 * kFullTurn_rad / kTeeth;
  const double roll_rad = 0.6 * std::sin(kFullTurn_rad * 0.3 * t);
  const double away_m = 0.050 - smooth_rise(t, 0.12) * (0.0095 + phases.sine(0, 0.0008, 1.7, t));
  const double twist_rad = phases.sine(1, 0.01, 3.0, t);
  return {rocked(phases.sine(2, 0.02, 2.0, t), t) *
              rotation_from({0, 0, half_tooth_rad + 2.0 * roll_rad + twist_rad}),
          {away_m * std::cos(roll_rad), away_m * std::sin(roll_rad), phases.sine(3, 0.003, 0.7, t)}};
}

Pose pose_at(const ConformingCase& of, const Phases& phases, double t_s) {
  switch (of.shape) {
    case ConformingShape::cube_on_slab:
      return pose_on_slab(phases, t_s);
    case ConformingShape::shaft_inserted:
      return pose_inserted(phases, t_s);
    case ConformingShape::gears:
      return pose_of_gear(phases, t_s);
    case ConformingShape::shaft_in_bore:
    case ConformingShape::peg_in_hole:
      break;
  }
  return pose_in_bore(phases, t_s);
}

}  // namespace

const std::vector<ConformingCase>& conforming_cases() {
  static const std::vector<ConformingCase> all = all_cases();
  return all;
}

const ConformingCase& conforming_case(const std::string& name) {
  for (const ConformingCase& of : conforming_cases())
    if (of.name == name) return of;
  throw std::invalid_argument("no conforming case is named '" + name + "'");
}

MeshesOfCase fine_meshes(const ConformingCase& of) {
  return meshes(of, false);
}

MeshesOfCase coarse_meshes(const ConformingCase& of) {
  return meshes(of, true);
}

Quaterniond file_rotation(const ConformingCase& of) {
  return of.rotated ? rotation_from({0.61, -0.83, 0.47}) : Quaterniond::Identity();
}

std::vector<Pose> conforming_trajectory(const ConformingCase& of, std::size_t ticks, std::uint64_t seed) {
  const Phases phases(seed);
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < ticks; ++i) poses.push_back(pose_at(of, phases, 1e-3 * static_cast<double>(i)));
  return poses;
}

}  // namespace wrenchd::test
