// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>

#include "core/contact.hpp"
#include "core/contact_gap.hpp"
#include "core/hessian.hpp"
#include "core/inertia.hpp"
#include "core/least_distance.hpp"
#include "core/pose.hpp"

namespace wrenchd {

enum class ProjectionStatus : std::uint8_t {
  free,  ///< the pose is admissible: q = p
  /// q is a closest admissible configuration: a KKT point with a residual of at most kOptimalResidual
  converged,
  /// q is admissible, and the best configuration within the iteration budget or the step limit
  budget_spent,
  infeasible,  ///< no admissible pose was found near p: the obstacles contradict each other here
};

/// Largest KKT residual of a projection of the exact method with the status converged, METHOD (42).
inline constexpr double kOptimalResidual = 1e-6;

/// A contact that touches at q, with its multiplier.
struct ActiveContact {
  Contact contact;
  double multiplier = 0.0;  ///< d T / d gap >= 0; zero for a contact that touches without load [kg m]
};

/// Result of the closest-point projection, Eq. (7).
struct Projection {
  Pose X_WQ;            ///< admissible configuration q of the tool body frame, in the world
  double energy = 0.0;  ///< T = d(p, q) of Eq. (8) [kg m^2]
  ProjectionStatus status = ProjectionStatus::free;
  std::uint16_t iterations = 0;  ///< number of Newton steps
  /// KKT residual |grad T - sum multiplier grad gap| / |grad T| at q, METHOD (42), in scaled units: the part
  /// of the pull on q that no contact balances. 0 if p is admissible, 1 if no contact touches.
  double kkt_residual = 0.0;
  /// True if project_globally() proved that no admissible pose is closer. project() never sets it.
  bool proven_global = false;
  StaticVector<ActiveContact, ContactSet::kCapacity> active;  ///< contacts that touch at q
};

/// The contacts of a projection with the load of each obstacle distributed evenly over its contacts. If an
/// edge or a face lies flat, no vertex is the deepest. A method that does not balance torques would otherwise
/// derive a torque from rounding. RT-safe.
StaticVector<ActiveContact, ContactSet::kCapacity> evenly_loaded_contacts(
    const Projection& projection) noexcept;

/// The exact method (core/METHOD.md, section 5): closest admissible configuration under the kinetic-energy
/// metric, all contacts together.
///
/// Unknowns: u = R_p'(x_q - x_p)/L and the unit quaternion E = (w, v) of R_p' R_q. L is the body's radius of
/// gyration. Scaled energy and gaps, METHOD (12), (20):
///
///   T/(m L^2) = |u|^2 + 4 v' H^ v          gap_i/L = n_i(E) . (u + R_E a_i - b_i),      H^ = H/(m L^2)
///
/// A Newton step (least-distance problem in six dimensions) proposes a rotation; the nearest translation
/// (least-distance problem in three dimensions) restores admissibility; the step is accepted if T falls.
/// Every iterate is admissible in the whole scene, so an iteration limit leaves a valid result.
///
/// All memory is in the object. One object serves one thread.
class ExactProjection {
 public:
  struct Budget {
    std::uint16_t iterations = 40;         ///< Newton steps
    std::uint16_t constraint_rounds = 24;  ///< rounds of constraint generation per step
  };

  /// Largest distance of the result of step() from X_start, METHOD (44).
  struct StepLimit {
    double translation_m = std::numeric_limits<double>::infinity();
    double rotation_rad = std::numeric_limits<double>::infinity();
  };

  explicit ExactProjection(const Inertia& M);
  /// clearance_m: gap at which contacts are held [m]. A value slightly above rounding keeps the proxy
  /// admissible for exact collision tests. Not RT-safe: set-up.
  ExactProjection(const Inertia& M, Budget budget, double clearance_m = 0.0);

  /// The closest admissible configuration to p, searched from X_start, the previous q. known: contacts with
  /// load at X_start and their multipliers; then X_start must be admissible. Without them the search starts
  /// from the nearest translation at the rotation of X_start. RT-safe.
  Projection project(const Pose& X_WP, const ContactSource& scene, const Pose& X_start,
                     std::span<const ActiveContact> known = {}) noexcept;

  /// Projects with the known contacts only and stays within `limit` of X_start. If the optimum is farther
  /// away, returns a pose within the limit that is admissible for these contacts and has a lower T, with
  /// status iteration_limit. X_start must be admissible for the known contacts, unless the limit is infinite.
  /// Then the nearest admissible pose is the start; its rotation may differ. RT-safe.
  Projection step(const Pose& X_WP, const Pose& X_start, std::span<const ActiveContact> known,
                  const StepLimit& limit) noexcept;

  /// Sets the multipliers of the contacts in q.active to those that make the KKT residual at q.X_WQ least,
  /// METHOD (44a), and sets q.kkt_residual. Contacts that do not touch at q.X_WQ get the multiplier 0.
  /// RT-safe.
  void balance(const Pose& X_WP, Projection& q) noexcept;

  /// The closest admissible configuration to p, without history. Tries further starts until the dual
  /// certificate proves the result optimal or no start is left. Usually the first start is proven, and the
  /// query takes as long as project(); otherwise up to a hundred times as long. Allocates nothing. Not
  /// RT-safe: may take a hundred projections.
  Projection project_globally(const Pose& X_WP, const ContactSource& scene) noexcept;

  /// The closest admissible configuration among those with the rotation of X_rotated, METHOD (36): the result
  /// of a method with translation only (X_rotated = X_WP), or the nearest admissible translation for any
  /// rotation. RT-safe.
  Projection translate(const Pose& X_WP, const ContactSource& scene, const Pose& X_rotated) noexcept;

  /// Rounding error of a gap at this pose [m]; gaps down to minus this value count as admissible. RT-safe.
  double gap_tolerance_m(const Pose& X_WT) const noexcept;

 private:
  struct Iterate {
    Vector3d u = Vector3d::Zero();
    Quaterniond E = Quaterniond::Identity();
    Matrix3d R = Matrix3d::Identity();  ///< rotation matrix of E
    double T = 0.0;                     ///< scaled energy T/(m L^2)
  };
  enum class LocalResult : std::uint8_t { converged, budget_spent, infeasible };
  enum class LineSearchResult : std::uint8_t { decreased, found_contacts, no_decrease };
  enum class Freedom : std::uint8_t { all, translation };

  void begin_query(const Pose& X_WP, const ContactSource& scene) noexcept;
  Quaterniond relative_rotation(const Quaterniond& R_WT) const noexcept;
  Iterate to_iterate(const Pose& X_WT) const noexcept;
  Projection multistart() noexcept;
  Projection solve(const Quaterniond& E_start, Freedom freedom = Freedom::all) noexcept;
  bool load_known_contacts(std::span<const ActiveContact> known) noexcept;
  Projection solve_from_known(const Pose& X_start, std::span<const ActiveContact> known) noexcept;
  Projection free_projection() const noexcept;
  Projection make_projection(LocalResult local) noexcept;
  Pose to_pose(const Iterate& state) const noexcept;
  void update_local_contacts(std::size_t first) noexcept;
  double scaled_energy(const Iterate& state) const noexcept;
  void rotate(Iterate& state, const Vector3d& eta) const noexcept;
  bool translate(Iterate& state) noexcept;
  bool extend_translation(Iterate& state) noexcept;
  bool restore_admissibility(Iterate& state) noexcept;
  bool find_feasible_rotation(Iterate& state) noexcept;
  bool project_translation(Iterate& state) noexcept;
  bool project_translation_or_rotate(Iterate& state) noexcept;
  LocalResult minimise(Iterate& state, bool scene_asked) noexcept;
  bool exceeds_step_limit(const Iterate& state) const noexcept;
  bool all_gaps_open() const noexcept;
  bool has_idle_contact() const noexcept;
  double residual(const Vector6d& g) const noexcept;
  Vector6d gradient(const Iterate& state) const noexcept;
  HessianBlocks metric_hessian(const Iterate& state) const noexcept;
  HessianBlocks lagrangian_hessian(const Iterate& state) const noexcept;
  void linearise(const Iterate& state) noexcept;
  void factorise_convexified(const HessianBlocks& W, CholeskyFactor& root) const noexcept;
  void factorise_model(const Iterate& state) noexcept;
  bool newton_step(const Vector6d& g, Vector6d& dy) noexcept;
  LineSearchResult line_search(Iterate& state, const Vector6d& dy, double predicted_decrease,
                               bool ask_scene) noexcept;
  void drop_idle_contacts(const Iterate& state) noexcept;
  bool add_touching_contacts(const Iterate& state) noexcept;
  void fill_projection(Projection& out) noexcept;
  bool certify_global() noexcept;

  Inertia M_;
  Budget budget_;
  std::uint16_t iteration_limit_;  ///< iteration limit of the current query
  double L_;                       ///< radius of gyration [m]
  double clearance_;               ///< clearance in units of L
  double gap_slack_;               ///< accepted violation of the clearance, in units of L
  Matrix3d H_hat_;
  Matrix6d metric_root_;  ///< Cholesky factor of the metric diag(2 I, 2 H^)

  // The current query
  Pose X_WP_;
  const ContactSource* scene_ = nullptr;
  double rounding_m_ = 0.0;   ///< rounding error of a gap [m]
  double tolerance_m_ = 0.0;  ///< accepted value of -gap: rounding minus clearance [m]
  ContactSet contacts_;
  std::array<LocalContact, ContactSet::kCapacity> local_contacts_;
  std::array<double, ContactSet::kCapacity> multiplier_;
  std::array<Vector6d, ContactSet::kCapacity> J_;  ///< gradient of each gap in (u, eta), METHOD (22)
  std::array<double, ContactSet::kCapacity> gap_;
  LeastDistance<3, ContactSet::kCapacity> translation_problem_;
  Quaterniond E_translated_ = Quaterniond::Identity();  ///< rotation of the problem in translation_problem_
  LeastDistance<6, ContactSet::kCapacity> newton_problem_;
  LeastDistance<7, ContactSet::kCapacity> feasibility_problem_;
  CholeskyFactor factor_;        ///< root of the current quadratic model
  bool touching_added_ = false;  ///< true after add_touching_contacts() succeeded
  double residual_ = 0.0;        ///< KKT residual of the state linearised last
  Iterate state_;                ///< current iterate; after a query its result
  StepLimit step_limit_;         ///< infinite except in step()
  Iterate step_start_;           ///< X_start of step() in scaled coordinates
  bool at_step_limit_ = false;
  std::uint16_t iterations_ = 0;
};

}  // namespace wrenchd
