// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/bodies/body_world.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "core/metric.hpp"

namespace wrenchd {
namespace {

/// A gap below the clearance opens by at most this multiple of the clearance in a step.
constexpr double kOpening = 0.01;
/// Distance that bodies_are_out_of_reach() adds to the reach of the tool [m]. It is larger than the clearance
/// and than rounding.
constexpr double kReachMargin_m = 1e-6;
/// A body whose fastest point moves more slowly than this [m/s] for this number of steps may fall asleep.
/// What begins to slide or to topple is faster within a few steps.
constexpr double kCalmSpeed_m_per_s = 1e-5;
constexpr std::uint16_t kCalmSteps = 100;

std::shared_ptr<const MeshBvh> bvh_of(const ToolBody& body) {
  return std::make_shared<const MeshBvh>(body.mesh, body.kind);
}

}  // namespace

BodyWorld::BodyWorld(const Scene& scene, std::vector<FreeBody> bodies, const Settings& settings)
    : settings_(settings), cones_(bodies.size() + 1, kMaxContacts) {
  if (bodies.size() + 1 > kMaxBodies) throw std::invalid_argument("too many bodies: at most 32");
  bodies_.resize(bodies.size() + 1);
  bodies_[0].name = "tool";
  bodies_[0].M = scene.tool().solid.inertia;
  bodies_[0].friction = settings.tool_friction;
  bodies_[0].radius_m = scene.tool_radius_m();
  std::vector<std::shared_ptr<const MeshBvh>> meshes(bodies_.size());
  meshes[0] = scene.tool_mesh() != nullptr ? scene.shared_tool_mesh() : bvh_of(scene.tool());
  for (std::size_t i = 1; i < bodies_.size(); ++i) {
    FreeBody& given = bodies[i - 1];
    meshes[i] = given.mesh ? given.mesh : bvh_of(given.body);
    Body& body = bodies_[i];
    body.name = given.name;
    body.M = given.body.solid.inertia;
    body.forces = {settings.gravity_W_m_per_s2, given.linear_damping_per_s, given.angular_damping_per_s};
    body.friction = given.friction;
    body.restitution = given.restitution;
    body.motion = given.motion;
    body.radius_m = meshes[i]->surface.radius_m();
    for (const Vector3d& p : given.body.hull.vertices_T_m) body.radius_m = std::max(body.radius_m, p.norm());
  }
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    bodies_[i].mover = i;
    if (i > 0 && !bodies[i - 1].of_hand) continue;
    bodies_[i].tool = tools_.size();
    tools_.push_back({});
    tools_.back().body = i;
  }
  if (tools_.size() > kMaxTools || (tools_.size() == kMaxTools && !is_tool(bodies_.size() - 1)))
    throw std::invalid_argument("at most one body is the tool of a second hand, and it is the last one");
  tools_before_ = tools_;
  const auto body_of = [&](std::size_t i) -> const ToolBody& {
    return i == 0 ? scene.tool() : bodies[i - 1].body;
  };
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (!scene.half_spaces().empty() || !scene.meshes().empty())
      pairs_.push_back(std::make_unique<BodyPair>(
          i, BodyPair::kFixed, Scene(body_of(i), scene.half_spaces(), {}, scene.meshes(), meshes[i])));
    for (std::size_t j = i + 1; j < bodies_.size(); ++j) {
      std::vector<MeshObstacle> other;
      other.emplace_back(bodies_[j].name, meshes[j], Pose{});
      pairs_.push_back(
          std::make_unique<BodyPair>(i, j, Scene(body_of(i), {}, {}, std::move(other), meshes[i])));
    }
  }
  contacts_.reserve(kMaxContacts);
  contacts_before_.reserve(kMaxContacts);
  bodies_before_.reserve(bodies_.size());
  island_contacts_.reserve(kMaxContacts);
  island_bodies_.reserve(bodies_.size());
  impact_.contacts.reserve(kMaxContacts);
  impact_.before.resize(bodies_.size());
  impact_.after.resize(bodies_.size());
}

void BodyWorld::place(std::size_t body, const BodyMotion& motion) noexcept {
  tool_was_moved_ = false;
  bodies_[body].motion = motion;
  for (Body& one : bodies_) {
    one.asleep = false;
    one.calm_steps = 0;
  }
  std::erase_if(contacts_, [&](const BodyContact& c) { return c.a == body || c.b == body; });
  for (const auto& pair : pairs_)
    if (pair->a() == body || pair->b() == body) pair->reset();
  constexpr double kSame = 1e-12;  // [m, rad]
  for (Tool& tool : tools_) {
    if (!is_tool(body) || tool.body == body) tool.back.reset();
    if (tool.grasp && log(inverse(bodies_[tool.body].motion.X_WB * tool.grasp->X_TB) *
                          bodies_[tool.grasp->body].motion.X_WB)
                              .norm() > kSame)
      tool.grasp.reset();
  }
  find_movers();
}

double BodyWorld::energy_J() const noexcept {
  double sum = 0.0;
  for (const Body& body : bodies_)
    if (body.tool == kNoTool)
      sum += kinetic_energy_J(body.M, body.motion) -
             body.M.mass_kg * settings_.gravity_W_m_per_s2.dot(body.motion.X_WB.translation_m);
  return sum;
}

BodyWorld::Status BodyWorld::step(const std::optional<Hand>& hand, double dt_s, double until_s,
                                  std::size_t tool) noexcept {
  dt_s_ = dt_s;
  until_s_ = until_s;
  begin(hand, tool);
  bool clean = false;
  for (rounds_ = 0; rounds_ < settings_.rounds && !clean; ++rounds_) {
    solve_islands();
    clean = sweep_pairs();
  }
  if (clean) {
    drop_separated();
    rebound();
  } else {
    hold_all();
  }
  apply_impulses(tool);
  finish_grasps();
  if (clean) time_s_ = until_s;
  if (settings_.sleeps) fall_asleep();
  prefetch();
  const bool whole = std::all_of(bodies_.begin(), bodies_.end(), [](const Body& body) {
    return body.weight_per_s2 == 0.0 || body.fraction == 1.0;
  });
  return clean && whole ? Status::converged : Status::budget_spent;
}

/// core/METHOD.md, section 15.7: the tool stays in a ball about the hand's pose, because T falls on its way.
bool BodyWorld::bodies_are_out_of_reach(const Pose& X_WP) const noexcept {
  const Body& tool = bodies_[0];
  if (tools_.size() > 1 || tools_[0].grasp || tools_[0].back || tool.friction > 0.0) return false;
  const double reach_m =
      tool.radius_m + std::sqrt(energy(tool.M, X_WP, tool.motion.X_WB) / tool.M.mass_kg) + kReachMargin_m;
  const auto is_far = [&](const Body& body) {
    const double distance_m = (body.motion.X_WB.translation_m - X_WP.translation_m).norm();
    return body.asleep && distance_m > reach_m + body.radius_m;
  };
  return std::all_of(bodies_.begin() + 1, bodies_.end(), is_far) &&
         std::none_of(pairs_.begin(), pairs_.end(),
                      [](const auto& pair) { return pair->scene().has_moving_obstacles(); });
}

void BodyWorld::move_tool(const Pose& X_WT, double until_s) noexcept {
  // Between two consecutive calls only the tool changes, so the copies of the bodies and contacts stay valid.
  if (!tool_was_moved_) {
    std::erase_if(contacts_, [](const BodyContact& c) { return c.a == 0; });
    tools_[0].load_W = {};
    save();
  }
  bodies_before_[0] = {bodies_[0].motion, false, 0};
  time_before_s_ = time_s_;
  bodies_[0].motion.X_WB = X_WT;
  time_s_ = until_s;
  tools_[0].grasp_broke = false;
  tools_[0].work_J = 0.0;
  tool_was_moved_ = true;
}

/// Copies the state that take_back() restores.
void BodyWorld::save() noexcept {
  bodies_before_.clear();
  for (const Body& body : bodies_) bodies_before_.push_back({body.motion, body.asleep, body.calm_steps});
  contacts_before_ = contacts_;  // equal capacities: no allocation
  time_before_s_ = time_s_;
  tools_before_ = tools_;
}

void BodyWorld::enter_tool(std::size_t tool, const Pose& X_WT) noexcept {
  BodyMotion motion;
  motion.X_WB = X_WT;
  place(tools_[tool].body, motion);
  tools_[tool].hand = Hand{X_WT};
}

void BodyWorld::remove_tool(std::size_t tool) noexcept {
  Tool& out = tools_[tool];
  out.hand.reset();
  std::erase_if(contacts_, [&](const BodyContact& c) { return c.a == out.body || c.b == out.body; });
  let_go(tool);
  out.back.reset();
  out.load_W = {};
}

/// Sets the goals of all bodies and moves the contacts with the obstacles that move. hand: what the hand of
/// this tool asks for.
void BodyWorld::begin(const std::optional<Hand>& hand, std::size_t tool) noexcept {
  save();
  tool_was_moved_ = false;
  budget_ = {settings_.node_visits};
  solver_steps_ = 0;
  last_change_m_ = 0.0;
  for (Body& body : bodies_) {
    body.touches = false;
    body.solved = body.asleep;
    body.fraction = 1.0;
    body.weight_per_s2 = 1.0;
    body.X_WQ = body.X_WQ_swept = body.motion.X_WB;
  }
  if (hand) tools_[tool].hand = hand;
  if (!hand) remove_tool(tool);
  for (Tool& one : tools_) {
    one.grasp_broke = false;
    bodies_[one.body].weight_per_s2 = one.hand ? one.hand->stiffness_per_s2 : 0.0;
  }
  advance_returns();
  std::erase_if(contacts_, [&](const BodyContact& c) { return c.expired && !bodies_[c.a].asleep; });
  for (BodyContact& contact : contacts_) {
    contact.curvature_of = BodyContact::kFixed;
    contact.last_force_W_N = contact.force_W_N;
    bodies_[contact.a].touches = true;
    if (contact.b != BodyContact::kFixed) bodies_[contact.b].touches = true;
  }
  for (const Tool& one : tools_) {
    if (!one.grasp) continue;
    wake(one.grasp->body);
    bodies_[one.body].touches = bodies_[one.grasp->body].touches = true;
  }
  for (BodyContact& contact : contacts_) contact.hold_m = held_gap_m(contact, kOpening * kClearance_m);
  move_contacts(time_s_, until_s_);
  for (Body& body : bodies_) set_goal(body);
}

/// A contact is held at the clearance, or at the gap that it has at the start, which may open by opening_m:
/// pushing bodies apart takes energy. An obstacle that moves pushes.
double BodyWorld::held_gap_m(const BodyContact& c, double opening_m) const noexcept {
  if (c.b == BodyContact::kFixed && pair_of(c).scene().has_moving_obstacles()) return kClearance_m;
  const Pose X_WB = c.b == BodyContact::kFixed ? Pose{} : bodies_[c.b].motion.X_WB;
  const double gap_m = geometry_of(c, bodies_[c.a].motion.X_WB, X_WB).gap_m;
  return std::clamp(gap_m + opening_m, kLeastHold * kClearance_m, kClearance_m);
}

/// A body without contact ends where its exact motion ends. One with contact moves at the velocity that it
/// has at the end, METHOD (102). In a shortened step less time passes for the body.
void BodyWorld::set_goal(Body& body) noexcept {
  body.shortened = false;
  if (body.asleep) {
    body.step_s = 0.0;
    body.free = body.motion;
    body.X_goal = body.motion.X_WB;
  } else if (body.tool != kNoTool) {
    body.free = body.motion;
    if (body.weight_per_s2 == 0.0) return hold(body);
    const Pose X_goal = tool_goal(tools_[body.tool]);
    body.X_goal = body.fraction < 1.0 ? between(body.motion.X_WB, X_goal, body.fraction) : X_goal;
  } else {
    body.step_s = body.fraction * dt_s_;
    if (body.step_s == 0.0) return hold(body);
    body.weight_per_s2 = 1.0 / (body.step_s * body.step_s);
    body.free = moved_freely(body.M, body.motion, body.forces, body.step_s);
    body.X_goal = body.free.X_WB;
    if (body.touches) {
      const Pose& start = body.motion.X_WB;
      const Vector3d omega_W = angular_velocity_W(body.M, body.free);
      body.X_goal = {rotation_from(body.step_s * omega_W) * start.rotation,
                     start.translation_m + body.step_s * body.free.velocity_W_m_per_s};
    }
  }
  if (!body.touches) body.X_WQ = body.X_goal;
}

/// A body that is held stays where it is, at rest.
void BodyWorld::hold(Body& body) noexcept {
  body.step_s = 0.0;
  body.X_WQ = body.X_goal = body.motion.X_WB;
  body.free = body.motion;
  body.free.velocity_W_m_per_s.setZero();
  body.free.spin_W.setZero();
}

void BodyWorld::move_contacts(double from_s, double to_s) noexcept {
  for (const auto& pair : pairs_) {
    if (!pair->is_fixed() || !pair->scene().has_moving_obstacles()) continue;
    for (BodyContact& c : contacts_) {
      if (c.a != pair->a() || c.b != BodyContact::kFixed) continue;
      c.obstacle_motion = pair->scene().obstacle_displacement(c.contact.obstacle, from_s, to_s);
      c.contact = moved(c.contact, c.obstacle_motion);
    }
  }
}

ContactGeometry BodyWorld::geometry(const BodyContact& contact) const noexcept {
  return geometry_of(contact, bodies_[contact.a].X_WQ,
                     contact.b == BodyContact::kFixed ? Pose{} : bodies_[contact.b].X_WQ);
}

/// The pose at which a contact acts on a body: half way for a free body, so that the contact does the work of
/// its gap, METHOD (103); q for a tool, whose wrench is the gradient at q.
Pose BodyWorld::acting_pose(std::size_t body) const noexcept {
  return is_tool(body) ? bodies_[body].X_WQ : half_way(body);
}

/// The pose of its mover at which what acts on a held body acts.
Pose BodyWorld::acting_pose_of_mover(std::size_t body) const noexcept {
  const std::size_t mover = bodies_[body].mover;
  return is_tool(body) ? bodies_[mover].X_WQ : half_way(mover);
}

Pose BodyWorld::half_way(std::size_t body) const noexcept {
  return between(bodies_[body].motion.X_WB, bodies_[body].X_WQ, 0.5);
}

ContactGeometry BodyWorld::acting_geometry(const BodyContact& contact) const noexcept {
  return geometry_of(contact, acting_pose(contact.a),
                     contact.b == BodyContact::kFixed ? Pose{} : acting_pose(contact.b));
}

/// Displacement in this step of the material point that is at point_W_m where contacts act.
Vector3d BodyWorld::displacement_m(std::size_t body, const Vector3d& point_W_m) const noexcept {
  const Vector3d p_B = inverse(acting_pose(body)) * point_W_m;
  return bodies_[body].X_WQ * p_B - bodies_[body].motion.X_WB * p_B;
}

/// The same of body b of a contact, or of its obstacle.
Vector3d BodyWorld::other_displacement_m(const BodyContact& c, const Vector3d& point_W_m) const noexcept {
  return c.b == BodyContact::kFixed ? Vector3d(point_W_m - inverse(c.obstacle_motion) * point_W_m)
                                    : displacement_m(c.b, point_W_m);
}

/// Displacement of the point of body a against that of body b (or of the obstacle) in this step, along the
/// surface: METHOD (104). at: the acting geometry.
Vector3d BodyWorld::slip_m(const BodyContact& c, const ContactGeometry& at) const noexcept {
  const Vector3d moved = displacement_m(c.a, at.point_W_m) - other_displacement_m(c, at.point_W_m);
  return moved - at.n_W.dot(moved) * at.n_W;
}

/// Wakes the island of a body, in the course of a step.
void BodyWorld::wake(std::size_t body) noexcept {
  const std::size_t island = bodies_[body].island;
  for (Body& one : bodies_) {
    if (one.island != island || !one.asleep) continue;
    one.asleep = one.solved = false;
    one.calm_steps = 0;
    set_goal(one);
  }
}

/// Puts the islands to sleep whose bodies have all been calm, and which neither a tool nor an obstacle that
/// moves touches.
void BodyWorld::fall_asleep() noexcept {
  find_islands();
  for (Body& body : bodies_) {
    const double speed_m_per_s = body.motion.velocity_W_m_per_s.norm() +
                                 body.radius_m * angular_velocity_W(body.M, body.motion).norm();
    const bool calm = body.touches && speed_m_per_s < kCalmSpeed_m_per_s;
    body.calm_steps = calm ? std::min<std::uint16_t>(body.calm_steps + 1, kCalmSteps) : std::uint16_t{0};
  }
  for (const Tool& tool : tools_) bodies_[tool.body].calm_steps = 0;
  for (const BodyContact& c : contacts_)
    if (c.b == BodyContact::kFixed && pair_of(c).scene().has_moving_obstacles()) bodies_[c.a].calm_steps = 0;
  for (std::size_t island = 0; island < bodies_.size(); ++island) {
    const bool calm = std::all_of(bodies_.begin(), bodies_.end(), [&](const Body& body) {
      return body.island != island || body.calm_steps == kCalmSteps;
    });
    if (!calm) continue;
    for (Body& body : bodies_) {
      if (body.island != island || body.asleep) continue;
      body.asleep = true;
      body.motion.velocity_W_m_per_s.setZero();
      body.motion.spin_W.setZero();
    }
  }
}

const BodyPair& BodyWorld::pair_of(const BodyContact& contact) const noexcept {
  return **std::find_if(pairs_.begin(), pairs_.end(),
                        [&](const auto& pair) { return pair->a() == contact.a && pair->b() == contact.b; });
}

void BodyWorld::take_back() noexcept {
  for (std::size_t i = 0; i < bodies_before_.size(); ++i) {
    bodies_[i].motion = bodies_before_[i].motion;
    bodies_[i].asleep = bodies_before_[i].asleep;
    bodies_[i].calm_steps = bodies_before_[i].calm_steps;
  }
  contacts_ = contacts_before_;  // equal capacities: no allocation
  time_s_ = time_before_s_;
  tools_ = tools_before_;
  tool_was_moved_ = false;
  find_movers();
}

/// A sweep from an admissible start that meets nothing ends at an admissible pose. The tool rests on it, and
/// the bodies move from where they were to where they are.
bool BodyWorld::admits_tool(const Pose& X_WT, std::span<const Pose> X_WB_then, double then_s,
                            std::size_t tool) noexcept {
  const std::size_t own = tools_[tool].body;
  const BodyPath rest = {X_WT, X_WT};
  VisitBudget budget{settings_.node_visits};
  return std::all_of(pairs_.begin(), pairs_.end(), [&](const auto& pair) {
    if (pair->a() != own && pair->b() != own) return true;
    BodyPath path;
    if (!pair->is_fixed()) {
      const std::size_t other = pair->a() == own ? pair->b() : pair->a();
      if (is_tool(other) && !has_hand(bodies_[other].tool)) return true;
      path = {X_WB_then[place_among_others(other)], bodies_[other].motion.X_WB};
    }
    const bool moved = pair->is_fixed() ? pair->scene().has_moving_obstacles() && then_s != time_s_
                                        : !same_bits(path.start, path.end);
    const BodyPath& path_a = pair->a() == own ? rest : path;
    const BodyPath& path_b = pair->a() == own ? path : rest;
    if (!moved || !pair->is_near(path_a, path_b)) return true;
    const SweepQuery::SweepResult found =
        pair->sweep(path_a, path_b, kMinClearance * kClearance_m, budget, {then_s, time_s_});
    return found.complete && !found.overlaps && found.contacts.empty();
  });
}

/// Nothing moves, bodies and obstacles: the poses at the start are admissible together.
void BodyWorld::hold_all() noexcept {
  for (Body& body : bodies_) hold(body);
  move_contacts(until_s_, time_s_);
  for (BodyContact& contact : contacts_) {
    contact.force_W_N.setZero();
    contact.obstacle_motion = {};
  }
}

/// Applies the impulses of all contacts to the motions without contact, METHOD (109), and adds up the work on
/// the tools, METHOD (111).
void BodyWorld::apply_impulses(std::size_t tool_of_step) noexcept {
  for (std::size_t tool = 0; tool < tools_.size(); ++tool) begin_work(tools_[tool], tool == tool_of_step);
  for (BodyContact& c : contacts_) {
    if (bodies_[c.a].asleep) continue;
    const ContactGeometry at = acting_geometry(c);
    c.point_W_m = at.point_W_m;
    c.normal_W = at.n_W;
    c.slip_m = slip_m(c, at).norm();
    // finish_grasps() adds the work of held bodies.
    if (is_tool(c.a))
      tools_[bodies_[c.a].tool].work_J +=
          0.5 * (c.last_force_W_N + c.force_W_N).dot(other_displacement_m(c, at.point_W_m));
    if (c.b != BodyContact::kFixed && is_tool(c.b))
      tools_[bodies_[c.b].tool].work_J -=
          0.5 * (c.last_force_W_N + c.force_W_N).dot(displacement_m(c.a, at.point_W_m));
    const auto push = [&](std::size_t i, double sign) {
      if (i == BodyContact::kFixed || is_tool(i) || is_held(i)) return;
      Body& body = bodies_[i];
      add_impulse(i, sign * body.step_s * c.force_W_N, at.point_W_m, body.free);
    };
    push(c.a, 1.0);
    push(c.b, -1.0);
  }
  push_held();
  for (Body& body : bodies_) {
    body.free.X_WB = body.X_WQ;
    body.motion = body.free;
  }
}

/// Adds an impulse at a point to a motion of a body, METHOD (109).
void BodyWorld::add_impulse(std::size_t i, const Vector3d& impulse_W_Ns, const Vector3d& point_W_m,
                            BodyMotion& motion) const noexcept {
  motion.velocity_W_m_per_s += impulse_W_Ns / bodies_[i].M.mass_kg;
  motion.spin_W += (point_W_m - acting_pose(i).translation_m).cross(impulse_W_Ns);
}

/// The work on a tool adds up over the steps of the other hand, and the next step of its own hand completes
/// the sum. is_of_step: the step is one of the tool's own hand.
void BodyWorld::begin_work(Tool& tool, bool is_of_step) noexcept {
  if (tool.work_complete) tool.work_J = 0.0;
  tool.work_complete = is_of_step;
}

}  // namespace wrenchd
