// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "collision/bodies/body_contact.hpp"
#include "collision/bodies/body_pair.hpp"
#include "collision/bodies/free_body.hpp"
#include "collision/bodies/grasp.hpp"
#include "collision/scene.hpp"
#include "core/cone_projection.hpp"
#include "core/free_motion.hpp"

namespace wrenchd {

/// The tool, free bodies and fixed obstacles as one system: one step is the projection of core/METHOD.md,
/// section 15, of the hand's pose and of the motions without contact onto the poses in which nothing
/// overlaps.
///
/// Body 0 is the tool of the first hand; free bodies are 1, 2, ... A body with of_hand is the tool of a
/// second hand. Tools are numbered in this order, from 0. A tool takes part in steps if its hand has a pose.
/// No step ends with an overlap, and no body passes through another. If the work limit of a step is reached,
/// bodies stay where they were.
///
/// A body at rest falls asleep with all bodies that a chain of contacts connects it to, unless a tool or an
/// obstacle that moves is among them. It wakes when something touches one of them.
///
/// The constructor allocates all memory. One object serves one thread.
class BodyWorld {
 public:
  static constexpr std::size_t kMaxBodies = 33;  ///< with the tools
  static constexpr std::size_t kMaxTools = 2;
  static constexpr std::size_t kMaxContacts = 1024;
  static constexpr double kClearance_m = 1e-9;  ///< gap at which contacts are held [m]

  struct Settings {
    Vector3d gravity_W_m_per_s2 = {0.0, 0.0, -9.81};
    double tool_friction = 0.0;
    bool sleeps = true;                   ///< bodies at rest cost nothing until something touches them
    std::uint32_t rounds = 24;            ///< rounds of solving and sweeping per step
    std::uint32_t node_visits = 400'000;  ///< work limit of all sweeps of a step [node visits]
    /// Steps of ConeProjection after which a step looks for no more answers to Coulomb's law and takes
    /// convex ones.
    std::uint32_t solver_steps = 300;
    GraspStrength grasp;  ///< a larger load ends a grasp
  };
  /// What the hand asks for: the pose that it commands and the stiffness k of the energy law.
  struct Hand {
    Pose X_WP;
    double stiffness_per_s2 = 1.0;
  };
  enum class Status : std::uint8_t {
    converged,
    budget_spent,  ///< admissible, but some bodies did not move as far as they would
  };

  /// The scene gives the tool and the fixed obstacles, and must outlive this object; it has no contacts by
  /// planes of convex bodies. Throws std::invalid_argument if there are too many bodies or tools. Not
  /// RT-safe: allocates.
  BodyWorld(const Scene& scene, std::vector<FreeBody> bodies, const Settings& settings);

  /// Places a body. Its pose must be admissible. A grasp ends, unless its body still is where the tool holds
  /// it. RT-safe.
  void place(std::size_t body, const BodyMotion& motion) noexcept;

  /// Moves all bodies for dt_s [s], and the obstacles that move to their poses at scene time until_s [s].
  /// hand: what the hand of this tool asks for; without it the tool is out of the world. The other hand asks
  /// for the same as in the last step of its tool. RT-safe.
  Status step(const std::optional<Hand>& hand, double dt_s, double until_s, std::size_t tool = 0) noexcept;
  Status step(const std::optional<Hand>& hand, double dt_s) noexcept {
    return step(hand, dt_s, time_s_ + dt_s);
  }
  /// Puts a tool into the world at a pose that admits_tool(). The steps of another hand then find it there.
  /// RT-safe.
  void enter_tool(std::size_t tool, const Pose& X_WT) noexcept;
  /// Takes a tool out of the world until it enters, or until the next step of its hand. It lets go. RT-safe.
  void remove_tool(std::size_t tool) noexcept;
  /// Joins the tool to the body that it presses on most. Returns false if it touches no body, or holds one.
  /// Two tools may hold one body. RT-safe.
  bool grasp(std::size_t tool = 0) noexcept;
  /// Lets go of the body that the tool holds. The tool then returns to the hand's pose without a jump.
  /// RT-safe.
  void let_go(std::size_t tool = 0) noexcept;
  /// Undoes the last step. The next step then is another attempt at the same one. RT-safe.
  void take_back() noexcept;
  /// Sets the scene time of the obstacle poses at the start of the next step. RT-safe.
  void set_time(double time_s) noexcept { time_s_ = time_s; }

  /// True if a step without the bodies has the same answer: they sleep, and the tool touches none of them on
  /// the way to the hand's pose X_WP. False in a world where the tool has friction, obstacles move, or two
  /// hands act. RT-safe.
  bool bodies_are_out_of_reach(const Pose& X_WP) const noexcept;
  /// Replaces a step if bodies_are_out_of_reach(): takes the tool pose X_WT that another proxy found, and
  /// scene time until_s [s]. RT-safe.
  void move_tool(const Pose& X_WT, double until_s) noexcept;
  /// True if the last step was a move_tool(), and no body was placed since. RT-safe.
  bool tool_was_moved() const noexcept { return tool_was_moved_; }

  /// True if the tool may enter at X_WT. It was admissible there with the bodies at X_WB_then and the
  /// obstacles at then_s; nothing has moved into it since. X_WB_then: one pose for each other body, at its
  /// place_among_others(). RT-safe.
  bool admits_tool(const Pose& X_WT, std::span<const Pose> X_WB_then, double then_s,
                   std::size_t tool = 0) noexcept;

  std::size_t body_count() const noexcept { return bodies_.size(); }  ///< with the tools
  std::size_t tool_count() const noexcept { return tools_.size(); }
  /// The number of the body that is a tool.
  std::size_t body_of(std::size_t tool) const noexcept { return tools_[tool].body; }
  /// True if a tool is in the world.
  bool has_hand(std::size_t tool) const noexcept { return tools_[tool].hand.has_value(); }
  /// The place of a body in a list of all bodies but one tool: the free bodies first, then the other tool.
  std::size_t place_among_others(std::size_t body) const noexcept {
    return is_tool(body) ? bodies_.size() - 2 : body - 1;
  }
  const BodyMotion& motion(std::size_t body) const noexcept { return bodies_[body].motion; }
  const Inertia& inertia(std::size_t body) const noexcept { return bodies_[body].M; }
  const std::string& name(std::size_t body) const noexcept { return bodies_[body].name; }
  /// The contacts that touch after the last step, with their forces.
  std::span<const BodyContact> contacts() const noexcept { return contacts_; }
  /// The body that the tool holds; 0 if it holds none.
  std::size_t held_body(std::size_t tool = 0) const noexcept {
    return tools_[tool].grasp ? tools_[tool].grasp->body : 0;
  }
  /// True if the last step ended a grasp of the tool whose load was larger than its strength.
  bool grasp_broke(std::size_t tool = 0) const noexcept { return tools_[tool].grasp_broke; }
  /// The wrench of a held body, or of the return after a grasp, on the tool in the last step, about the
  /// tool's centre of mass, in axes of W.
  const Wrench& tool_load_W(std::size_t tool = 0) const noexcept { return tools_[tool].load_W; }
  /// The wrench with which a pose attracts the tool at the end of the last step: minus the gradient of the
  /// energy law, about the tool's centre of mass, in axes of W. RT-safe.
  Wrench pull_to(const Pose& X_goal, std::size_t tool = 0) const noexcept;
  /// Scene time [s]. It stands still in a step that holds all bodies, so that no obstacle moves into one.
  double time_s() const noexcept { return time_s_; }
  /// Largest displacement of a point by the last Newton step [m]; 1e-12 or less if it converged.
  double last_change_m() const noexcept { return last_change_m_; }
  /// Work of bodies, of the other tool and of moving obstacles on the tool [J], METHOD (111): in the last
  /// step of this tool's hand and in the steps of the other hand before it.
  double work_on_tool_J(std::size_t tool = 0) const noexcept { return tools_[tool].work_J; }
  /// The tool and the obstacles or the body of a contact, as the features of contact.contact number them.
  const Scene& scene_of(const BodyContact& contact) const noexcept { return pair_of(contact).scene(); }
  bool asleep(std::size_t body) const noexcept { return bodies_[body].asleep; }
  std::uint32_t rounds() const noexcept { return rounds_; }  ///< of the last step
  std::uint32_t node_visits() const noexcept { return settings_.node_visits - budget_.remaining; }
  /// Kinetic and potential energy of the free bodies [J]; the height of the world's origin has none. RT-safe.
  double energy_J() const noexcept;

 private:
  static constexpr std::size_t kNoTool = SIZE_MAX;
  /// Least gap of an admissible pose, least gap at which a contact is held, which leaves room for the
  /// tolerance of a cone, and largest gap of a contact that touches, as multiples of the clearance.
  static constexpr double kMinClearance = 0.2, kLeastHold = 0.3, kTouch = 1.1;
  /// Accepted violation of a cone in a Newton step [m].
  static constexpr double kTolerance_m = 1e-11;

  struct Body {
    std::string name;
    Inertia M;
    FreeForces forces;
    double friction = 0.0;
    double restitution = 0.0;
    double radius_m = 0.0;
    BodyMotion motion;             ///< at the end of the last step
    BodyMotion free;               ///< without contact, at the end of this step
    Pose X_goal;                   ///< p of the projection
    Pose X_WQ;                     ///< q
    Pose X_WQ_swept;               ///< q of the last sweeps
    BodyPath next;                 ///< path of the next step if it meets nothing
    double weight_per_s2 = 0.0;    ///< kappa, 0: takes no part
    double fraction = 1.0;         ///< part of the step that the body tries
    bool shortened = false;        ///< tries a smaller part than its q is for
    double step_s = 0.0;           ///< time that passes for the body [s]
    std::size_t island = 0;        ///< number of the body that represents its island
    bool touches = false;          ///< has a contact
    bool solved = false;           ///< q is the answer for the present contacts
    bool asleep = false;           ///< rests until something touches its island
    std::uint16_t calm_steps = 0;  ///< consecutive steps in which it hardly moved
    std::size_t block = 0;         ///< number of the body in the problem of its island
    std::size_t tool = kNoTool;    ///< number of the tool that the body is
    std::size_t mover = 0;         ///< body whose unknowns move it: itself, or the tool that holds it
    Pose X_MB;                     ///< its pose in the frame of the mover
    Vector6d newton_step,
        newton_step_before;  ///< last two changes of q: translation in W [m], rotation in B [rad]
    Matrix6d root = Matrix6d::Identity();  ///< upper triangular root of the metric at q
  };

  /// A tool that a hand leads. A step changes it.
  struct Tool {
    std::size_t body = 0;            ///< number of its body
    std::optional<Hand> hand;        ///< what its hand asked for last; empty: the tool is out of the world
    std::optional<Grasp> grasp;      ///< empty: holds nothing
    std::optional<ToolReturn> back;  ///< way back to the hand after a grasp; empty: the tool is there
    /// Loads on the tool about its centre of mass, in axes of W: of the held body and of the return; of the
    /// held body alone.
    Wrench load_W, grasp_load_W;
    double work_J = 0.0;        ///< work on the tool: work_on_tool_J()
    bool work_complete = true;  ///< the last step completed work_J; the next step begins a new sum
    bool grasp_broke = false;   ///< grasp_broke()
  };

  enum class Friction : std::uint8_t { coulomb, frozen, none };

  /// A contact of an impact, METHOD (117).
  struct ImpactContact {
    std::size_t contact = 0;       ///< its place in contacts_
    double rebound_m_per_s = 0.0;  ///< least normal velocity after the impact, e u
    /// Forces on body a without and with restitution.
    Vector3d plastic_W_N = Vector3d::Zero(), elastic_W_N = Vector3d::Zero();
  };
  /// The bodies of an island in an impact.
  struct Impact {
    double step_s = 0.0;  ///< time that passes for the island in the step
    std::vector<ImpactContact> contacts;
    /// Motion of each body of the world just before the impact, and after it.
    std::vector<BodyMotion> before, after;
  };

  void begin(const std::optional<Hand>& hand, std::size_t tool) noexcept;
  void save() noexcept;
  void set_goal(Body& body) noexcept;
  double held_gap_m(const BodyContact& contact, double opening_m) const noexcept;
  void move_contacts(double from_s, double to_s) noexcept;
  void find_islands() noexcept;
  std::size_t root_of(std::size_t body) noexcept;
  void solve_islands() noexcept;
  bool solve_island(std::size_t island) noexcept;
  bool converge(std::size_t island, Friction friction) noexcept;
  const BodyPair& pair_of(const BodyContact& contact) const noexcept;
  bool newton_step(Friction friction) noexcept;
  bool extrapolate() noexcept;
  void move(std::size_t body, const Vector6d& step) noexcept;
  Vector6d descent(std::size_t body) noexcept;
  static Vector6d pull_gradient(const Body& body, const Pose& X_goal) noexcept;
  static Matrix6d metric_of(const Body& body) noexcept;
  void add_held(std::size_t mover, Vector6d& gradient, Matrix6d& metric) const noexcept;
  void move_held(std::size_t mover) noexcept;
  void find_movers() noexcept;
  bool is_tool(std::size_t body) const noexcept { return bodies_[body].tool != kNoTool; }
  bool is_held(std::size_t body) const noexcept { return bodies_[body].mover != body; }
  bool moves_with(std::size_t body, std::size_t mover) const noexcept {
    return body != BodyContact::kFixed && bodies_[body].mover == mover;
  }
  bool moves_others(std::size_t body) const noexcept;
  bool joins(const BodyPair& pair) const noexcept {
    return !pair.is_fixed() && bodies_[pair.a()].mover == bodies_[pair.b()].mover;
  }
  Pose acting_pose_of_mover(std::size_t body) const noexcept;
  Vector3d arm_of_held(std::size_t body, const Vector3d& point_W_m) const noexcept;
  Wrench load_of_held(const Tool& tool) const noexcept;
  Wrench contacts_on(std::size_t body) const noexcept;
  Pose tool_goal(const Tool& tool) const noexcept;
  void push_held() noexcept;
  void finish_grasps() noexcept;
  static void begin_work(Tool& tool, bool is_of_step) noexcept;
  void advance_returns() noexcept;
  void set_root_with_curvature(std::size_t mover, const Matrix6d& metric) noexcept;
  void set_curvature(std::size_t mover, BodyContact& contact) const noexcept;
  Vector6d gap_gradient(std::size_t mover, const BodyContact& contact, const Vector6d& step) const noexcept;
  FrictionCone cone_of(const BodyContact& contact, Friction friction) const noexcept;
  Vector3d displacement_m(std::size_t body, const Vector3d& point_W_m) const noexcept;
  Vector3d other_displacement_m(const BodyContact& contact, const Vector3d& point_W_m) const noexcept;
  Vector3d slip_m(const BodyContact& contact, const ContactGeometry& at) const noexcept;
  ContactGeometry geometry(const BodyContact& contact) const noexcept;
  Pose acting_pose(std::size_t body) const noexcept;
  Pose half_way(std::size_t body) const noexcept;
  ContactGeometry acting_geometry(const BodyContact& contact) const noexcept;
  bool admissible(std::size_t island) const noexcept;
  bool takes_part(std::size_t body) const noexcept;
  bool sweep_pairs() noexcept;
  bool sweep_pair(BodyPair& pair) noexcept;
  SweepQuery::SweepResult sweep(BodyPair& pair, double clearance_m) noexcept;
  bool is_shortened(std::size_t body) const noexcept {
    return body != BodyContact::kFixed && bodies_[body].shortened;
  }
  bool meets_soon(BodyPair& pair) noexcept;
  bool add_behind(BodyPair& pair) noexcept;
  bool add_touching(BodyPair& pair) noexcept;
  bool add_contact(const BodyPair& pair, const Contact& contact) noexcept;
  bool store_contact(const BodyPair& pair, const Contact& contact) noexcept;
  void drop_separated() noexcept;
  void add_successors(const BodyContact& expired) noexcept;
  bool held_open(const BodyPair& pair, const SweepQuery::SweepResult& found) const noexcept;
  void unsolve(std::size_t body) noexcept;
  void wake(std::size_t body) noexcept;
  void fall_asleep() noexcept;
  static double shorter(double fraction) noexcept;
  void shorten(const BodyPair& pair) noexcept;
  void hold(Body& body) noexcept;
  void hold_all() noexcept;
  void rebound() noexcept;
  void rebound_island() noexcept;
  bool find_impact(std::size_t island) noexcept;
  Vector3d velocity_before_W(std::size_t body, const Vector3d& point_W_m) const noexcept;
  double approach_m_per_s(const BodyContact& contact) const noexcept;
  double time_of_impact_s(const BodyContact& contact, double approach_m_per_s) const noexcept;
  bool solve_impact(bool elastic) noexcept;
  double energy_rise_J(double share) noexcept;
  void add_impulse(std::size_t body, const Vector3d& impulse_W_Ns, const Vector3d& point_W_m,
                   BodyMotion& motion) const noexcept;
  void apply_impulses(std::size_t tool_of_step) noexcept;
  void prefetch() noexcept;
  BodyPath path_of(std::size_t body) const noexcept;

  Settings settings_;
  std::vector<Body> bodies_;
  std::vector<std::unique_ptr<BodyPair>> pairs_;
  std::vector<BodyContact> contacts_;
  /// What a step changes of a body.
  struct BodyState {
    BodyMotion motion;
    bool asleep;
    std::uint16_t calm_steps;
  };
  std::vector<BodyState> bodies_before_;      ///< before the last step
  std::vector<BodyContact> contacts_before_;  ///< before the last step
  double time_before_s_ = 0.0;
  std::vector<Tool> tools_, tools_before_;  ///< before: before the last step
  bool tool_was_moved_ = false;
  std::vector<std::size_t> island_bodies_, island_contacts_;
  Impact impact_;
  ConeProjection cones_;
  ConeProjection::Status cones_status_ = ConeProjection::Status::optimal;
  VisitBudget budget_;
  double time_s_ = 0.0;   ///< scene time of the obstacle poses
  double dt_s_ = 0.0;     ///< time that passes for the bodies in the step
  double until_s_ = 0.0;  ///< scene time of the obstacle poses at the end of the step
  double last_change_m_ = 0.0;
  std::uint32_t rounds_ = 0, solver_steps_ = 0;
};

}  // namespace wrenchd
