// SPDX-License-Identifier: GPL-3.0-or-later
// Bodies of a BodyWorld that rebound: core/METHOD.md, section 15.11.
#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "collision/bodies/body_world.hpp"

namespace wrenchd {
namespace {

/// A contact is at rest, and does not rebound, if it approaches more slowly than kLeastApproach_m_per_s plus
/// kFallen times the velocity that gravity adds in a step.
constexpr double kLeastApproach_m_per_s = 0.01;
constexpr double kFallen = 2.0;

/// Largest share in [0, 1] at which a convex parabola is at most 0, METHOD (118). none <= 0, half and whole >
/// 0: its values at 0, 1/2 and 1.
double largest_share(double none, double half, double whole) noexcept {
  const double A = 2.0 * (whole - 2.0 * half + none), B = whole - none - A;
  const double root = std::sqrt(std::max(B * B - 4.0 * A * none, 0.0));
  const double share = B > 0.0 ? -2.0 * none / (B + root) : (root - B) / (2.0 * A);
  return std::clamp(share, 0.0, 1.0);
}

}  // namespace

/// Replaces the forces of the islands in which bodies with restitution meet.
void BodyWorld::rebound() noexcept {
  if (std::none_of(bodies_.begin(), bodies_.end(), [](const Body& body) { return body.restitution > 0.0; }))
    return;
  find_islands();
  for (std::size_t island = 0; island < bodies_.size(); ++island)
    if (bodies_[island].island == island && find_impact(island)) rebound_island();
}

/// Sets impact_ to the impact of an island. Returns false if nothing rebounds in it, or a tool is part of it.
bool BodyWorld::find_impact(std::size_t island) noexcept {
  island_bodies_.clear();
  impact_.contacts.clear();
  impact_.step_s = bodies_[island].step_s;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    Body& body = bodies_[i];
    if (body.island != island) continue;
    if (body.step_s == 0.0) return false;  // a tool, asleep, or held
    body.block = island_bodies_.size();
    island_bodies_.push_back(i);
    impact_.before[i] = body.motion;
  }
  const double rest_m_per_s =
      kLeastApproach_m_per_s + kFallen * impact_.step_s * settings_.gravity_W_m_per_s2.norm();
  double time_s = impact_.step_s;
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    const BodyContact& c = contacts_[k];
    if (bodies_[c.a].island != island) continue;
    impact_.contacts.push_back({k});
    const double approach = approach_m_per_s(c);
    if (c.restitution > 0.0 && approach > rest_m_per_s)
      time_s = std::min(time_s, time_of_impact_s(c, approach));
  }
  for (const std::size_t i : island_bodies_)
    impact_.before[i] = moved_freely(bodies_[i].M, bodies_[i].motion, bodies_[i].forces, time_s);
  bool rebounds = false;
  for (ImpactContact& one : impact_.contacts) {
    const BodyContact& c = contacts_[one.contact];
    const double approach = approach_m_per_s(c);
    if (approach > rest_m_per_s) one.rebound_m_per_s = c.restitution * approach;
    rebounds = rebounds || one.rebound_m_per_s > 0.0;
  }
  return rebounds;
}

/// Velocity before the impact of the point of a body at point_W_m [m/s].
Vector3d BodyWorld::velocity_before_W(std::size_t i, const Vector3d& point_W_m) const noexcept {
  const BodyMotion& before = impact_.before[i];
  return before.velocity_W_m_per_s +
         angular_velocity_W(bodies_[i].M, before).cross(point_W_m - acting_pose(i).translation_m);
}

/// Velocity before the impact with which the two sides of a contact approach [m/s].
double BodyWorld::approach_m_per_s(const BodyContact& c) const noexcept {
  const ContactGeometry at = acting_geometry(c);
  const Vector3d other_m_per_s = c.b == BodyContact::kFixed
                                     ? Vector3d(other_displacement_m(c, at.point_W_m) / impact_.step_s)
                                     : velocity_before_W(c.b, at.point_W_m);
  return at.n_W.dot(other_m_per_s - velocity_before_W(c.a, at.point_W_m));
}

/// Time from the start of the step to the moment at which a contact closes [s].
double BodyWorld::time_of_impact_s(const BodyContact& c, double approach_m_per_s) const noexcept {
  const ContactGeometry start = geometry_of(c, bodies_[c.a].motion.X_WB,
                                            c.b == BodyContact::kFixed ? Pose{} : bodies_[c.b].motion.X_WB);
  double gap_m = start.gap_m - c.hold_m;
  // The contact is where its obstacle is at the end of the step.
  if (c.b == BodyContact::kFixed) gap_m += start.n_W.dot(other_displacement_m(c, start.point_W_m));
  return std::clamp(gap_m / approach_m_per_s, 0.0, impact_.step_s);
}

/// Sets the forces of METHOD (117), or those without restitution. Returns false if no answer was found.
bool BodyWorld::solve_impact(bool elastic) noexcept {
  const double step_s = impact_.step_s;
  cones_.clear(island_bodies_.size());
  for (const std::size_t i : island_bodies_) {
    Body& body = bodies_[i];
    const BodyMotion& before = impact_.before[i];
    body.root = Matrix6d::Zero();
    body.root.diagonal().head<3>().setConstant(std::sqrt(body.M.mass_kg) / step_s);
    body.root.bottomRightCorner<3, 3>() = Matrix3d(body.M.H_kg_m2.llt().matrixU()) / step_s;
    Vector6d way;
    way << step_s * before.velocity_W_m_per_s,
        step_s * (acting_pose(i).rotation.conjugate() * angular_velocity_W(body.M, before));
    cones_.z0(body.block) = body.root.triangularView<Eigen::Upper>() * way;
  }
  for (const ImpactContact& one : impact_.contacts) {
    const BodyContact& c = contacts_[one.contact];
    FrictionCone cone = cone_of(c, Friction::coulomb);
    const Vector3d other_m = c.b == BodyContact::kFixed
                                 ? other_displacement_m(c, acting_geometry(c).point_W_m)
                                 : Vector3d(Vector3d::Zero());
    cone.h_m = -cone.n.dot(other_m) - (elastic ? step_s * one.rebound_m_per_s : 0.0);
    cone.slip_m = cone.n.dot(other_m) * cone.n - other_m;
    for (const Vector3d& normal : c.active_normals) cones_.suggest(cones_.cone_count(), normal);
    cones_.add(cone);
  }
  if (cones_.solve_coulomb(kTolerance_m) != ConeProjection::Status::optimal) return false;
  for (std::size_t k = 0; k < impact_.contacts.size(); ++k)
    (elastic ? impact_.contacts[k].elastic_W_N : impact_.contacts[k].plastic_W_N) = cones_.force(k);
  return true;
}

/// Returns the energy of the bodies at the end of the step, less that at its start and the work of obstacles
/// [J]. share: part of the restitution, theta of METHOD (118).
double BodyWorld::energy_rise_J(double share) noexcept {
  double rise_J = 0.0;
  for (const std::size_t i : island_bodies_) {
    impact_.after[i] = impact_.before[i];
    impact_.after[i].X_WB = bodies_[i].X_WQ;
  }
  for (const ImpactContact& one : impact_.contacts) {
    const BodyContact& c = contacts_[one.contact];
    const ContactGeometry at = acting_geometry(c);
    const Vector3d force_W_N = (1.0 - share) * one.plastic_W_N + share * one.elastic_W_N;
    add_impulse(c.a, impact_.step_s * force_W_N, at.point_W_m, impact_.after[c.a]);
    if (c.b == BodyContact::kFixed)
      rise_J -= force_W_N.dot(other_displacement_m(c, at.point_W_m));
    else
      add_impulse(c.b, -impact_.step_s * force_W_N, at.point_W_m, impact_.after[c.b]);
  }
  for (const std::size_t i : island_bodies_) {
    const Body& body = bodies_[i];
    rise_J += kinetic_energy_J(body.M, impact_.after[i]) - kinetic_energy_J(body.M, body.motion) -
              body.M.mass_kg *
                  settings_.gravity_W_m_per_s2.dot(body.X_WQ.translation_m - body.motion.X_WB.translation_m);
  }
  return rise_J;
}

/// Gives the bodies of impact_ the velocities of METHOD (117), (118). Without an answer they keep those of
/// (109).
void BodyWorld::rebound_island() noexcept {
  if (!solve_impact(true)) return;
  double share = 1.0;
  if (const double whole_J = energy_rise_J(1.0); whole_J > 0.0) {
    if (!solve_impact(false)) return;
    const double none_J = energy_rise_J(0.0);
    if (none_J > 0.0) return;
    share = largest_share(none_J, energy_rise_J(0.5), whole_J);
  }
  for (const ImpactContact& one : impact_.contacts)
    contacts_[one.contact].force_W_N = (1.0 - share) * one.plastic_W_N + share * one.elastic_W_N;
  for (const std::size_t i : island_bodies_) {
    bodies_[i].free.velocity_W_m_per_s = impact_.before[i].velocity_W_m_per_s;
    bodies_[i].free.spin_W = impact_.before[i].spin_W;
  }
}

}  // namespace wrenchd
