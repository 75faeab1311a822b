// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/bodies/body_world.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <Eigen/Cholesky>

#include "core/metric.hpp"

namespace wrenchd {
namespace {

/// Most Newton steps of an island with Coulomb's friction, METHOD (106), and then most without friction.
constexpr int kNewtonSteps = 12;
/// Most Newton steps of an island if the work limit of the solver is reached.
constexpr int kLateSteps = 8;
/// After this number of Newton steps without an answer to Coulomb's law, the lifts of the cones stay as they
/// are.
constexpr int kUnanswered = 2;
/// A solve ends if no point moved farther than this in a Newton step [m]. It is small against the clearance.
constexpr double kConverged_m = 1e-10;
/// A solve that did not converge is accepted if its last Newton step moved no point farther than this [m].
constexpr double kAccepted_m = 1e-9;
/// Step of the differences for the curvature of a gap [m, rad].
constexpr double kDifference = 1e-6;
/// Accepted violation of a cone in a Newton step [m].
constexpr double kTolerance_m = 1e-11;
/// Least gap of an admissible pose, least gap at which a contact is held, which leaves room for the tolerance
/// of a cone, and largest gap of a contact that touches, as multiples of the clearance.
constexpr double kMinClearance = 0.2;
constexpr double kLeastHold = 0.3;
constexpr double kTouch = 1.1;
/// Gap at which a sweep looks past the contacts that are held open, as a multiple of the clearance.
constexpr double kBehind = 0.1;
/// A gap below the clearance opens by at most this multiple of the clearance in a step.
constexpr double kOpening = 0.01;
/// Distance that bodies_are_out_of_reach() adds to the reach of the tool [m]. It is larger than the clearance
/// and than rounding.
constexpr double kReachMargin_m = 1e-6;
/// If a sweep finds an overlap but no contact, the contacts with a gap below this multiple of the clearance
/// at the start are added.
constexpr double kNear = 4.0;
/// A path that is too long falls to this fraction.
constexpr double kShorter = 0.25;
constexpr double kMinFraction = 1.0 / 256.0;
/// A body whose fastest point moves more slowly than this [m/s] for this number of steps may fall asleep.
/// What begins to slide or to topple is faster within a few steps.
constexpr double kCalmSpeed_m_per_s = 1e-5;
constexpr std::uint16_t kCalmSteps = 100;

/// A U^-1 for an upper triangle U.
Matrix3d right_divided(const Matrix3d& A, const Matrix3d& U) noexcept {
  return U.transpose().triangularView<Eigen::Lower>().solve(A.transpose()).transpose();
}

/// The next shorter fraction of a path; 0 after the shortest.
double shorter(double fraction) noexcept {
  return fraction > kMinFraction ? kShorter * fraction : 0.0;
}

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
  dropped_.reserve(kMaxContacts);
  island_contacts_.reserve(kMaxContacts);
  island_bodies_.reserve(bodies_.size());
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
    if (clean) clean = !drop_separated();
  }
  if (!clean) hold_all();
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
  dropped_.clear();
  for (BodyContact& contact : contacts_) {
    contact.stays = false;
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

std::size_t BodyWorld::root_of(std::size_t body) noexcept {
  while (bodies_[body].island != body) body = bodies_[body].island = bodies_[bodies_[body].island].island;
  return body;
}

/// Bodies that a chain of contacts connects are one island.
void BodyWorld::find_islands() noexcept {
  for (std::size_t i = 0; i < bodies_.size(); ++i) bodies_[i].island = i;
  for (const BodyContact& c : contacts_)
    if (c.b != BodyContact::kFixed) bodies_[root_of(c.b)].island = root_of(c.a);
  for (std::size_t i = 0; i < bodies_.size(); ++i)
    if (is_held(i)) bodies_[root_of(i)].island = root_of(bodies_[i].mover);
  for (std::size_t i = 0; i < bodies_.size(); ++i) bodies_[i].island = root_of(i);
}

/// Solves the islands with a body whose contacts changed.
void BodyWorld::solve_islands() noexcept {
  find_islands();
  for (std::size_t island = 0; island < bodies_.size(); ++island) {
    if (bodies_[island].island != island) continue;
    bool solved = true;
    double fraction = 1.0;  // the same time passes for all bodies of an island
    for (const Body& body : bodies_) {
      if (body.island != island) continue;
      solved = solved && body.solved;
      fraction = std::min(fraction, body.fraction);
    }
    if (solved) continue;
    for (;;) {
      for (Body& body : bodies_) {
        if (body.island != island || body.weight_per_s2 == 0.0) continue;
        body.fraction = fraction;
        set_goal(body);
      }
      if (solve_island(island)) break;
      fraction = shorter(fraction);
    }
  }
}

/// Solves an island. Returns false if Newton's method does not converge: the tick is then too long.
bool BodyWorld::solve_island(std::size_t island) noexcept {
  island_bodies_.clear();
  island_contacts_.clear();
  bool holding = false;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (bodies_[i].island != island || bodies_[i].weight_per_s2 == 0.0) continue;
    bodies_[i].solved = true;
    if (is_held(i)) {
      holding = true;
      continue;
    }
    bodies_[i].block = island_bodies_.size();
    island_bodies_.push_back(i);
  }
  for (std::size_t k = 0; k < contacts_.size(); ++k)
    if (bodies_[contacts_[k].a].island == island) island_contacts_.push_back(k);
  if (bodies_[island].fraction == 0.0) {
    for (const std::size_t k : island_contacts_) contacts_[k].force_W_N.setZero();
    for (Body& body : bodies_)
      if (body.island == island && body.weight_per_s2 > 0.0) hold(body);
    return true;
  }
  if (island_contacts_.empty() && !holding) {
    for (const std::size_t i : island_bodies_) bodies_[i].X_WQ = bodies_[i].X_goal;
    return true;
  }
  int unanswered = 0;
  for (int k = 0; k < kNewtonSteps; ++k) {
    const bool in_time = solver_steps_ < settings_.solver_steps;
    if (newton_step(in_time && unanswered < kUnanswered ? Friction::coulomb : Friction::frozen)) break;
    if (cones_status_ == ConeProjection::Status::budget_spent) ++unanswered;
    if (!in_time && k >= kLateSteps) break;
  }
  if (last_change_m_ <= kAccepted_m && admissible(island)) return true;
  for (int k = 0; k < kNewtonSteps; ++k)
    if (newton_step(Friction::none)) break;
  if (last_change_m_ <= kAccepted_m && admissible(island)) return true;
  for (Body& body : bodies_)
    if (body.island == island && body.weight_per_s2 > 0.0) body.X_WQ = body.motion.X_WB;
  return false;
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

/// True if the present poses of an island keep all its known contacts open.
bool BodyWorld::admissible(std::size_t island) const noexcept {
  return std::all_of(contacts_.begin(), contacts_.end(), [&](const BodyContact& c) {
    return bodies_[c.a].island != island || geometry(c).gap_m >= kMinClearance * kClearance_m;
  });
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

/// The cone of a contact at q, METHOD (105), or its half-space without friction, METHOD (107).
FrictionCone BodyWorld::cone_of(const BodyContact& c, Friction friction) const noexcept {
  const ContactGeometry at = acting_geometry(c);
  FrictionCone cone;
  cone.n = at.n_W;
  cone.h_m = geometry(c).gap_m - c.hold_m;
  if (c.mu > 0.0 && friction != Friction::none) {
    cone.mu = c.mu;
    cone.slip_m = slip_m(c, at);
    cone.s_m = c.mu * c.slip_m;
  }
  const auto set_block = [&](std::size_t i, double sign, std::size_t& block, FrictionCone::Block& D) {
    const Body& body = bodies_[bodies_[i].mover];
    const Pose X_WB = is_held(i) ? acting_pose_of_mover(i) : acting_pose(i);
    const Vector3d arm_m =
        is_held(i) ? arm_of_held(i, at.point_W_m) : Vector3d(at.point_W_m - X_WB.translation_m);
    block = body.block;
    FrictionCone::Block moved;
    moved << sign * Matrix3d::Identity(), -sign * hat(arm_m) * X_WB.rotation.toRotationMatrix();
    // The upper triangle is inverted from the right, by blocks.
    const Matrix3d left = right_divided(moved.leftCols<3>(), body.root.topLeftCorner<3, 3>());
    D << left, right_divided(moved.rightCols<3>() - left * body.root.topRightCorner<3, 3>(),
                             body.root.bottomRightCorner<3, 3>());
  };
  set_block(c.a, 1.0, cone.a, cone.D_a);
  if (c.b != BodyContact::kFixed) set_block(c.b, -1.0, cone.b, cone.D_b);
  return cone;
}

/// Gradient of kappa T / 2 at q, METHOD (14), in the translation in W and the rotation in the body frame.
Vector6d BodyWorld::pull_gradient(const Body& body, const Pose& X_goal) noexcept {
  Quaterniond E = X_goal.rotation.conjugate() * body.X_WQ.rotation;
  if (E.w() < 0.0) E.coeffs() = -E.coeffs();
  const Vector3d v = E.vec(), Hv = body.M.H_kg_m2 * v;
  Vector6d gradient;
  gradient << body.weight_per_s2 * body.M.mass_kg * (body.X_WQ.translation_m - X_goal.translation_m),
      2.0 * body.weight_per_s2 * (E.w() * Hv - v.cross(Hv));
  return gradient;
}

/// The metric of a body at q, METHOD (15), with the factor kappa / 2.
Matrix6d BodyWorld::metric_of(const Body& body) noexcept {
  Quaterniond E = body.X_goal.rotation.conjugate() * body.X_WQ.rotation;
  if (E.w() < 0.0) E.coeffs() = -E.coeffs();
  const Matrix3d G = 0.5 * (E.w() * Matrix3d::Identity() + hat(E.vec()));
  Matrix6d metric = Matrix6d::Zero();
  metric.diagonal().head<3>().setConstant(body.weight_per_s2 * body.M.mass_kg);
  metric.bottomRightCorner<3, 3>() = 4.0 * body.weight_per_s2 * (G.transpose() * body.M.H_kg_m2 * G);
  return metric;
}

/// Sets the root of a body's metric at q. Returns the step without contacts, in coordinates in which the
/// metric is the identity.
Vector6d BodyWorld::descent(std::size_t i) noexcept {
  Body& body = bodies_[i];
  Vector6d gradient = pull_gradient(body, body.X_goal);
  Matrix6d metric = metric_of(body);
  const bool holding = moves_others(i);
  if (holding) add_held(i, gradient, metric);
  if (!is_tool(i) || !root_with_curvature(i, metric)) {
    if (holding) {
      body.root = metric.llt().matrixU();
    } else {
      body.root = Matrix6d::Zero();
      body.root.diagonal().head<3>() = metric.diagonal().head<3>().cwiseSqrt();
      body.root.bottomRightCorner<3, 3>() = Matrix3d(metric.bottomRightCorner<3, 3>()).llt().matrixU();
    }
  }
  body.root.transpose().triangularView<Eigen::Lower>().solveInPlace(gradient);
  return -gradient;
}

/// The root of the tool's metric less the curvature of its gaps times their loads, METHOD (113). Its loads
/// and levers are large against its spring, so without the curvature Newton's method converges slowly or not
/// at all. Returns false if that is not positive definite, also with the gradients of the gaps added, (40).
bool BodyWorld::root_with_curvature(std::size_t mover, const Matrix6d& metric) noexcept {
  Matrix6d W = metric, across = Matrix6d::Zero();
  for (const std::size_t k : island_contacts_) {
    const BodyContact& c = contacts_[k];
    const bool of_tool = moves_with(c.a, mover);
    if (of_tool == moves_with(c.b, mover)) continue;
    const double load_N = c.force_W_N.dot(geometry(c).n_W);
    if (!(load_N > 0.0)) continue;
    const Vector6d gradient = gap_gradient(mover, c, Vector6d::Zero());
    across += gradient * gradient.transpose();
    Matrix6d curvature;
    for (int axis = 0; axis < 6; ++axis) {
      const Vector6d step = kDifference * Vector6d::Unit(axis);
      curvature.col(axis) =
          (gap_gradient(mover, c, step) - gap_gradient(mover, c, -step)) / (2.0 * kDifference);
    }
    W -= 0.5 * load_N * (curvature + curvature.transpose());
    // Friction, at its point of the tool: METHOD (24) with the normal in its place
    const ContactGeometry at = geometry(c);
    const Pose X_TW = inverse(bodies_[mover].X_WQ);
    const Vector3d friction_W_N = c.force_W_N - load_N * at.n_W;
    const Vector3d f = X_TW.rotation * (of_tool ? friction_W_N : -friction_W_N), p = X_TW * at.point_W_m;
    W.bottomRightCorner<3, 3>() -=
        0.5 * (f * p.transpose() + p * f.transpose()) - f.dot(p) * Matrix3d::Identity();
  }
  double stiffening = 0.0;
  for (int attempt = 0; attempt < 4; ++attempt) {
    const Eigen::LLT<Matrix6d> llt(W + stiffening * across);
    if (llt.info() == Eigen::Success) {
      bodies_[mover].root = llt.matrixU();
      return true;
    }
    stiffening = stiffening == 0.0 ? 4.0 * W.lpNorm<Eigen::Infinity>() : 30.0 * stiffening;
  }
  return false;
}

/// Gradient of a gap of the tool, or of what it holds, in the tool's translation in W and its rotation in T,
/// at a step from q.
Vector6d BodyWorld::gap_gradient(std::size_t mover, const BodyContact& c,
                                 const Vector6d& step) const noexcept {
  Pose X_WT = bodies_[mover].X_WQ;
  X_WT.translation_m += step.head<3>();
  X_WT.rotation = (X_WT.rotation * rotation_from(step.tail<3>())).normalized();
  const auto pose_of = [&](std::size_t i) {
    if (i == BodyContact::kFixed) return Pose{};
    if (i == mover) return X_WT;
    return moves_with(i, mover) ? X_WT * bodies_[i].X_MB : bodies_[i].X_WQ;
  };
  const ContactGeometry at = geometry_of(c, pose_of(c.a), pose_of(c.b));
  const Vector3d n_W = moves_with(c.a, mover) ? at.n_W : -at.n_W;
  Vector6d gradient;
  gradient << n_W, X_WT.rotation.conjugate() * (at.point_W_m - X_WT.translation_m).cross(n_W);
  return gradient;
}

/// One Newton step of an island, METHOD (99), (105). Returns true if it moved no point.
bool BodyWorld::newton_step(Friction friction) noexcept {
  cones_.clear(island_bodies_.size());
  for (const std::size_t i : island_bodies_) cones_.z0(bodies_[i].block) = descent(i);
  for (const std::size_t k : island_contacts_) {
    const BodyContact& contact = contacts_[k];
    for (const Vector3d& normal : contact.active_normals) cones_.suggest(cones_.cone_count(), normal);
    cones_.add(cone_of(contact, friction));
  }
  cones_status_ =
      friction == Friction::coulomb ? cones_.solve_coulomb(kTolerance_m) : cones_.solve(kTolerance_m);
  solver_steps_ += static_cast<std::uint32_t>(cones_.steps());
  double change_m = 0.0;
  for (const std::size_t i : island_bodies_) {
    Body& body = bodies_[i];
    const Vector6d step = body.root.triangularView<Eigen::Upper>().solve(cones_.z(body.block));
    const Vector3d shift = step.head<3>(), turn = step.tail<3>();
    body.X_WQ.translation_m += shift;
    body.X_WQ.rotation = (body.X_WQ.rotation * rotation_from(turn)).normalized();
    double radius_m = body.radius_m;
    for (const Body& held : bodies_)
      if (held.mover == i && &held != &body) radius_m += held.X_MB.translation_m.norm() + held.radius_m;
    change_m = std::max(shift.norm() + radius_m * turn.norm(), change_m);
    if (is_tool(i)) move_held(i);
  }
  for (std::size_t k = 0; k < island_contacts_.size(); ++k) {
    BodyContact& contact = contacts_[island_contacts_[k]];
    contact.force_W_N = cones_.force(k);
    contact.active_normals = cones_.active_normals(k);
    if (contact.mu > 0.0 && friction == Friction::coulomb) contact.slip_m = cones_.lift_m(k) / contact.mu;
  }
  last_change_m_ = change_m;
  return change_m <= kConverged_m;
}

BodyPath BodyWorld::path_of(std::size_t body) const noexcept {
  if (body == BodyContact::kFixed) return {};
  return {bodies_[body].motion.X_WB, bodies_[body].X_WQ};
}

bool BodyWorld::takes_part(std::size_t body) const noexcept {
  return body == BodyContact::kFixed || bodies_[body].weight_per_s2 > 0.0;
}

/// Sweeps the pairs with a body whose end pose changed since the last sweeps. Returns true if all paths are
/// free.
bool BodyWorld::sweep_pairs() noexcept {
  bool free = true;
  for (const auto& pair : pairs_) {
    const auto changed = [&](std::size_t i) {
      return i != BodyContact::kFixed && !same_bits(bodies_[i].X_WQ, bodies_[i].X_WQ_swept);
    };
    if (!takes_part(pair->a()) || !takes_part(pair->b()) || joins(*pair)) continue;
    const bool moves = pair->is_fixed() && pair->scene().has_moving_obstacles();
    if (!moves && !changed(pair->a()) && !changed(pair->b())) continue;
    if (!sweep_pair(*pair)) free = false;
  }
  if (free)
    for (Body& body : bodies_) body.X_WQ_swept = body.X_WQ;
  return free;
}

bool BodyWorld::sweep_pair(BodyPair& pair) noexcept {
  bool free = true;
  if (pair.is_fixed() && !pair.scene().half_spaces().empty()) {
    ContactSet met;
    for (const BodyContact& c : contacts_)
      if (c.a == pair.a() && c.b == BodyContact::kFixed) met.add(c.contact);
    const std::size_t known = met.size();
    pair.add_half_spaces(bodies_[pair.a()].X_WQ, 0.5 * kClearance_m, met);
    for (std::size_t k = known; k < met.size(); ++k) free = !add_contact(pair, met[k]) && free;
  }
  const BodyPath path_a = path_of(pair.a()), path_b = path_of(pair.b());
  if (!pair.is_near(path_a, path_b)) return free;
  const SweepQuery::SweepResult found =
      pair.sweep(path_a, path_b, kClearance_m, budget_, {time_s_, until_s_});
  bool found_new = false;
  for (const Contact& contact : found.contacts) found_new = add_contact(pair, contact) || found_new;
  if (found_new) return false;
  if (found.complete && !found.overlaps) {
    if (found.contacts.empty()) return free;
    if (held_open(pair, found)) return !add_behind(pair) && free;
  }
  if (!add_touching(pair)) shorten(pair);
  return false;
}

/// Adds contacts that a sweep did not name because the path meets known ones first. These are held open, but
/// at less than the clearance. Returns true if there are such contacts.
bool BodyWorld::add_behind(BodyPair& pair) noexcept {
  const BodyPath path_a = path_of(pair.a()), path_b = path_of(pair.b());
  const BodyPair::SweepTimes times = {time_s_, until_s_};
  const SweepQuery::SweepResult behind = pair.sweep(path_a, path_b, kBehind * kClearance_m, budget_, times);
  bool found_new = false;
  for (const Contact& contact : behind.contacts) found_new = add_contact(pair, contact) || found_new;
  if (found_new) return true;
  if (behind.complete && !behind.overlaps && behind.contacts.empty()) {
    pair.sweep(path_a, path_b, kClearance_m, budget_, times);  // for touches()
    return false;
  }
  shorten(pair);
  return true;
}

/// Adds the contacts that touch at the start. A sweep that finds no contact although its end overlaps may
/// lack one that was dropped at the border of its features. Returns false if all are known.
bool BodyWorld::add_touching(BodyPair& pair) noexcept {
  if (pair.scene().has_moving_obstacles()) return false;  // their contacts are those of the end of the step
  const auto start_of = [&](std::size_t i) {
    return i == BodyContact::kFixed ? BodyPath{} : BodyPath{bodies_[i].motion.X_WB, bodies_[i].motion.X_WB};
  };
  pair.sweep(start_of(pair.a()), start_of(pair.b()), kNear * kClearance_m, budget_, {time_s_, time_s_});
  bool found_new = false;
  for (const Contact& contact : pair.touching()) found_new = add_contact(pair, contact) || found_new;
  return found_new;
}

/// True if the known contacts keep open what a sweep found: a gap just below the clearance is no crossing.
bool BodyWorld::held_open(const BodyPair& pair, const SweepQuery::SweepResult& found) const noexcept {
  return std::all_of(found.contacts.begin(), found.contacts.end(), [&](const Contact& contact) {
    return std::any_of(contacts_.begin(), contacts_.end(), [&](const BodyContact& known) {
      return known.a == pair.a() && known.b == pair.b() && same_features(known.contact, contact) &&
             geometry(known).gap_m >= kMinClearance * kClearance_m;
    });
  });
}

void BodyWorld::unsolve(std::size_t body) noexcept {
  if (body == BodyContact::kFixed) return;
  if (bodies_[body].asleep) wake(body);
  bodies_[body].solved = false;
  bodies_[body].touches = true;
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

/// Lets the bodies of a pair try a shorter way.
void BodyWorld::shorten(const BodyPair& pair) noexcept {
  for (const std::size_t i : {pair.a(), pair.b()}) {
    if (i == BodyContact::kFixed) continue;
    const std::size_t island = bodies_[i].island;
    for (Body& body : bodies_) {
      if (body.island != island) continue;
      body.fraction = shorter(body.fraction);
      body.solved = false;
    }
  }
}

/// Returns false if the contact is known or there is no room.
bool BodyWorld::add_contact(const BodyPair& pair, const Contact& contact) noexcept {
  if (contacts_.size() == kMaxContacts) return false;
  BodyContact added;
  added.a = pair.a();
  added.b = pair.b();
  added.contact = contact;
  for (const BodyContact& known : contacts_)
    if (known.a == added.a && known.b == added.b && same_features(known.contact, contact)) return false;
  const Body& a = bodies_[added.a];
  added.mu = pair.is_fixed() ? a.friction : std::sqrt(a.friction * bodies_[added.b].friction);
  added.hold_m = held_gap_m(added, 0.0);
  added.stays = std::any_of(dropped_.begin(), dropped_.end(), [&](const BodyContact& dropped) {
    return dropped.a == added.a && dropped.b == added.b && same_features(dropped.contact, contact);
  });
  contacts_.push_back(added);
  unsolve(added.a);
  unsolve(added.b);
  return true;
}

const BodyPair& BodyWorld::pair_of(const BodyContact& contact) const noexcept {
  return **std::find_if(pairs_.begin(), pairs_.end(),
                        [&](const auto& pair) { return pair->a() == contact.a && pair->b() == contact.b; });
}

/// Drops contacts that do not touch, and contacts whose features do not face each other. Returns true if one
/// of these carried: the poses are then solved again. If a sweep then finds the same contact once more, as at
/// the border of a face, the contact stays until the next step.
bool BodyWorld::drop_separated() noexcept {
  bool carried = false;
  std::erase_if(contacts_, [&](const BodyContact& c) {
    if (bodies_[c.a].asleep || c.stays) return false;
    const double gap_m = geometry(c).gap_m;
    const bool loaded = c.force_W_N.squaredNorm() > 0.0;
    if (gap_m > kTouch * kClearance_m) return !loaded;
    if (pair_of(c).touches(c.contact)) return false;
    if (!loaded) return true;
    carried = true;
    if (dropped_.size() < dropped_.capacity()) dropped_.push_back(c);
    unsolve(c.a);
    unsolve(c.b);
    return true;
  });
  return carried;
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
      const Vector3d impulse = sign * body.step_s * c.force_W_N;
      body.free.velocity_W_m_per_s += impulse / body.M.mass_kg;
      body.free.spin_W += (at.point_W_m - acting_pose(i).translation_m).cross(impulse);
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

/// The work on a tool adds up over the steps of the other hand, and the next step of its own hand completes
/// the sum. is_of_step: the step is one of the tool's own hand.
void BodyWorld::begin_work(Tool& tool, bool is_of_step) noexcept {
  if (tool.work_complete) tool.work_J = 0.0;
  tool.work_complete = is_of_step;
}

/// Prepares the sweeps of the next step, for the motions that the bodies would have without contact.
void BodyWorld::prefetch() noexcept {
  const auto still = [&](std::size_t i) { return i == BodyContact::kFixed || bodies_[i].asleep; };
  for (const auto& pair : pairs_) {
    if (!takes_part(pair->a()) || !takes_part(pair->b()) || joins(*pair)) continue;
    if (still(pair->a()) && still(pair->b()) && !pair->scene().has_moving_obstacles()) continue;
    const auto next = [&](std::size_t i) {
      if (i == BodyContact::kFixed) return BodyPath{};
      const BodyMotion& motion = bodies_[i].motion;
      if (bodies_[i].asleep) return BodyPath{motion.X_WB, motion.X_WB};
      return BodyPath{motion.X_WB, is_tool(i)
                                       ? bodies_[i].X_goal
                                       : moved_freely(bodies_[i].M, motion, bodies_[i].forces, dt_s_).X_WB};
    };
    const BodyPath path_a = next(pair->a()), path_b = next(pair->b());
    if (pair->is_near(path_a, path_b)) pair->prefetch(path_a, path_b, time_s_, budget_);
  }
}

}  // namespace wrenchd
