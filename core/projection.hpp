// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>

#include "core/contact.hpp"
#include "core/inertia.hpp"
#include "core/least_distance.hpp"
#include "core/pose.hpp"

namespace wrenchd {

enum class ProjectionStatus : std::uint8_t {
  free,          ///< the pose is admissible: q = p
  converged,     ///< q is a closest admissible configuration (a KKT point)
  budget_spent,  ///< q is admissible, and the best found within the iteration budget
  infeasible,    ///< no admissible pose was found near p: the obstacles contradict each other here
};

/// A contact that holds q, and the share of the wrench it carries.
struct ActiveContact {
  Contact contact;
  double multiplier = 0.0;  ///< d T / d gap >= 0; zero where the contact touches but carries nothing [kg m]
};

/// The closest-point projection of Eq. (7).
struct Projection {
  Pose X_WQ;            ///< the admissible configuration q of the tool's body frame in the world
  double energy = 0.0;  ///< T = d(p, q) of Eq. (8) [kg m^2]
  ProjectionStatus status = ProjectionStatus::free;
  std::uint16_t iterations = 0;  ///< Newton steps taken
  /// |grad T - sum multiplier grad gap| / |grad T| at q, in the body's own scale.
  double kkt_residual = 0.0;
  /// No admissible pose is closer: proven by project_globally(), never by project().
  bool proven_global = false;
  StaticVector<ActiveContact, ContactSet::kCapacity> active;  ///< contacts that touch at q
};

/// The contacts of an answer, with what those of one obstacle carry together shared evenly among them. Where
/// an edge or a face lies flat no single vertex is the deepest, and a method that does not balance torques
/// would make one out of rounding by choosing one. RT safe.
StaticVector<ActiveContact, ContactSet::kCapacity> evenly_loaded_contacts(
    const Projection& projection) noexcept;

/// The exact method (section 3.4 of the method): closest admissible configuration under the kinetic-energy
/// metric, all contacts together.
///
/// Unknowns: u = s/L and the unit quaternion E = (w, v) of R_p' R_q, with s = R_p'(x_q - x_p) and L a length
/// of the body's own (its radius of gyration), so that nothing below depends on the unit of length. With H^ =
/// H/(m L^2):
///
///   T/(m L^2) = |u|^2 + 4 v' H^ v          gap_i/L = n_i(E) . (u + R_E a_i - b_i)
///
/// where n_i, a_i/L and b_i/L are the contact as seen from p.
///
/// For a fixed rotation every gap is affine in u, whatever the kind of the contact. So the nearest
/// translation is a three-dimensional least-distance problem with an exact answer, and every iterate of the
/// method is admissible in the whole scene: a Newton step (a six-dimensional least-distance problem on the
/// linearised gaps, curvature of the contacts included) proposes a rotation, the translation restores
/// admissibility, and the step is accepted when T falls. The first iterate is the best translation, or last
/// tick's rotation; T only falls from there, and whenever time is up there is an answer.
///
/// All memory is in the object. One object serves one thread.
class ExactProjection {
 public:
  struct Budget {
    std::uint16_t iterations = 40;         ///< Newton steps
    std::uint16_t constraint_rounds = 24;  ///< of constraint generation, for each step
  };

  /// How far from X_start a followed proxy may go.
  struct StepLimit {
    double translation_m = std::numeric_limits<double>::infinity();
    double rotation_rad = std::numeric_limits<double>::infinity();
  };

  explicit ExactProjection(const Inertia& M);
  /// clearance_m: how far from touching contacts are held open [m]. A little more than rounding keeps a proxy
  /// clear of what it follows, for whoever checks its poses to the last digit.
  ExactProjection(const Inertia& M, Budget budget, double clearance_m = 0.0);

  /// Follows a proxy: the closest admissible configuration to p, sought from X_start, last tick's q. known:
  /// the contacts that carried there, with their multipliers; X_start must be admissible then. Without them
  /// the search starts from the best translation at the rotation of X_start. RT safe.
  Projection project(const Pose& X_WP, const ContactSource& scene, const Pose& X_start,
                     std::span<const ActiveContact> known = {}) noexcept;

  /// The same with the contacts known for all there are, and on a leash: where the optimum lies farther away,
  /// the answer is a pose on the way there, admissible for these contacts, no farther than the leash and with
  /// a lower T; its status is budget_spent. X_start must be admissible for them, but where the leash is
  /// infinite: then it is pushed out first, turning if it must. RT safe.
  Projection step(const Pose& X_WP, const Pose& X_start, std::span<const ActiveContact> known,
                  const StepLimit& leash) noexcept;

  /// The closest admissible configuration to p, whatever came before: tries further starts until the dual
  /// bound proves that none is closer, or the starts are used up. Where the first start is proven, as almost
  /// always, this costs what project() costs; otherwise up to a hundred times as much. RT safe.
  Projection project_globally(const Pose& X_WP, const ContactSource& scene) noexcept;

  /// The closest admissible configuration among those with the rotation of X_rotated: what a method that
  /// knows translations only would answer (X_rotated = X_WP), or the lift that makes any rotation admissible.
  /// RT safe.
  Projection translate(const Pose& X_WP, const ContactSource& scene, const Pose& X_rotated) noexcept;

  /// How far below zero a gap may seem by rounding at this pose [m]. RT safe.
  double gap_tolerance_m(const Pose& X_WT) const noexcept;

 private:
  /// A contact seen from p, in units of L.
  struct LocalContact {
    Vector3d n;   ///< vertex_face: the normal
    Vector3d a;   ///< in T
    Vector3d b;   ///< face_vertex, edge_edge
    double c;     ///< vertex_face: n . (x_p - b)
    Vector3d d;   ///< d_T
    Vector3d dB;  ///< d_W
    ContactKind kind;
  };
  /// A gap at one rotation, less the clearance: n . u + h.
  struct AffineGap {
    Vector3d n;
    double h;
  };
  struct Iterate {
    Vector3d u = Vector3d::Zero();
    Quaterniond E = Quaterniond::Identity();
    Matrix3d R = Matrix3d::Identity();  ///< of E
    double T = 0.0;                     ///< in units of m L^2
  };
  /// Hessian of the Lagrangian in (u, eta), [2 I, C; C', B].
  struct HessianBlocks {
    Matrix3d C = Matrix3d::Zero();
    Matrix3d B = Matrix3d::Zero();
  };
  /// Sums over contacts of one normal, each weighted with its multiplier.
  struct WeightedContactSum {
    double m = 0.0;
    Vector3d a = Vector3d::Zero();
    Vector3d b = Vector3d::Zero();
    Vector3d angular_gradient = Vector3d::Zero();  ///< of J
  };
  /// Triangular root [P 0; Q S] of a positive definite matrix, with P and S inverted.
  struct CholeskyFactor {
    Matrix3d P_inverse, Q, S_inverse;

    Vector6d solve(const Vector6d& y) const noexcept;             ///< root^-1 y
    Vector6d solve_transposed(const Vector6d& z) const noexcept;  ///< root'^-1 z
  };
  enum class LocalResult : std::uint8_t { converged, budget_spent, infeasible };
  enum class LineSearchResult : std::uint8_t { decreased, found_contacts, no_decrease };
  enum class Freedom : std::uint8_t { all, translation };

  void begin_query(const Pose& X_WP, const ContactSource& scene) noexcept;
  Quaterniond relative_rotation(const Quaterniond& R_WT) const noexcept;
  Projection multistart() noexcept;
  Projection solve(const Quaterniond& E_start, Freedom freedom = Freedom::all) noexcept;
  bool load_known_contacts(std::span<const ActiveContact> known) noexcept;
  Projection solve_from_known(const Pose& X_start, std::span<const ActiveContact> known) noexcept;
  Projection free_projection() const noexcept;
  Projection make_projection(LocalResult local) noexcept;
  Pose to_pose(const Iterate& state) const noexcept;
  void update_local_contacts(std::size_t first) noexcept;
  AffineGap affine_gap(const LocalContact& seen, const Matrix3d& R) const noexcept;
  bool overlaps_at_p(const LocalContact& seen) const noexcept;
  double scaled_energy(const Iterate& state) const noexcept;
  void rotate(Iterate& state, const Vector3d& eta) const noexcept;
  bool translate(Iterate& state) noexcept;
  bool extend_translation(Iterate& state) noexcept;
  bool restore_admissibility(Iterate& state) noexcept;
  bool find_feasible_rotation(Iterate& state) noexcept;
  bool project_translation(Iterate& state) noexcept;
  bool project_translation_or_rotate(Iterate& state) noexcept;
  LocalResult minimise(Iterate& state, bool asked) noexcept;
  bool exceeds_step_limit(const Iterate& state) const noexcept;
  bool all_gaps_open() const noexcept;
  bool has_idle_contact() const noexcept;
  double residual(const Vector6d& g) const noexcept;
  Vector6d gradient(const Iterate& state) const noexcept;
  HessianBlocks metric_hessian(const Iterate& state) const noexcept;
  HessianBlocks lagrangian_hessian(const Iterate& state) const noexcept;
  void add_contact_curvature(const Iterate& state, std::size_t i, const WeightedContactSum& load,
                             HessianBlocks& W) const noexcept;
  void linearise(const Iterate& state) noexcept;
  bool factorise(const HessianBlocks& W, CholeskyFactor& root) const noexcept;
  void factorise_convexified(const HessianBlocks& W, CholeskyFactor& root) const noexcept;
  void factorise_model(const Iterate& state) noexcept;
  bool newton_step(const Vector6d& g, Vector6d& dy) noexcept;
  LineSearchResult line_search(Iterate& state, const Vector6d& dy, double promised, bool ask) noexcept;
  void drop_idle_contacts(const Iterate& state) noexcept;
  bool add_touching_contacts(const Iterate& state) noexcept;
  void fill_projection(Projection& out) noexcept;
  bool certify_global() noexcept;
  Quaterniond dual_rotation() const noexcept;

  Inertia M_;
  Budget budget_;
  std::uint16_t iteration_limit_;  ///< of the query at hand
  double L_;                       ///< [m]
  double clearance_;               ///< in units of L
  double gap_slack_;               ///< by which a gap may miss it, likewise
  Matrix3d H_hat_;
  Matrix6d metric_root_;  ///< Cholesky factor of diag(2 I, 2 H^)

  // The query at hand
  Pose X_WP_;
  const ContactSource* scene_ = nullptr;
  double rounding_m_ = 0.0;   ///< of a gap
  double tolerance_m_ = 0.0;  ///< how far below zero a gap may be: rounding, less the clearance
  ContactSet contacts_;
  std::array<LocalContact, ContactSet::kCapacity> local_contacts_;
  std::array<double, ContactSet::kCapacity> multiplier_;
  std::array<Vector6d, ContactSet::kCapacity> J_;  ///< gradient of gap i in (u, eta)
  std::array<double, ContactSet::kCapacity> gap_;
  LeastDistance<3, ContactSet::kCapacity> translation_problem_;
  Quaterniond E_translated_ = Quaterniond::Identity();  ///< of the problem in translation_
  LeastDistance<6, ContactSet::kCapacity> newton_problem_;
  LeastDistance<7, ContactSet::kCapacity> feasibility_problem_;
  CholeskyFactor factor_;        ///< of the model at hand
  bool touching_added_ = false;  ///< what touches at the answer has been added
  double residual_ = 0.0;        ///< of the state linearised last
  Iterate state_;                ///< the iterate, and after a query its answer
  StepLimit step_limit_;         ///< infinite but for step()
  Iterate step_start_;           ///< where it is tied
  bool at_step_limit_ = false;
  std::uint16_t iterations_ = 0;
};

}  // namespace wrenchd
