// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/pose.hpp"
#include "core/static_vector.hpp"

namespace wrenchd {

/// A contact with Coulomb friction between two bodies as a constraint on a step z of all bodies, METHOD
/// (105):
///
///   n . (D z) + h + s >= mu |P (D z + slip)|        D z = D_a z_a + D_b z_b,   P = I - n n'
struct FrictionCone {
  using Block = Eigen::Matrix<double, 3, 6>;
  static constexpr std::size_t kFixed = SIZE_MAX;

  std::size_t a = kFixed, b = kFixed;  ///< numbers of the bodies; kFixed: the contact does not move it
  /// Displacement of the contact point of body a against that of body b, for the six components of each
  /// body's step.
  Block D_a = Block::Zero(), D_b = Block::Zero();
  Vector3d n = Vector3d::UnitZ();      ///< unit normal from b to a
  double h_m = 0.0;                    ///< gap at z = 0 [m]
  double s_m = 0.0;                    ///< lift s of the cone along n, METHOD (105) [m]
  Vector3d slip_m = Vector3d::Zero();  ///< tangential displacement at z = 0 [m]
  double mu = 0.0;                     ///< coefficient of friction
};

/// The step nearest to a given one that obeys friction cones, METHOD (105):
///
///   min 1/2 |z - z0|^2   subject to   z in every cone
///
/// The method is that of core/least_distance.hpp, with a supply of constraints: of each cone the half-space
/// that touches it at the present slip, METHOD (108). The most violated half-space of all cones enters next.
/// The lifts s of the cones are those given, or those of Coulomb's law, s = mu |P (D z + slip)|.
///
/// The constructor allocates all memory; all other members are RT-safe. One object serves one thread.
class ConeProjection {
 public:
  enum class Status : std::uint8_t { optimal, infeasible, budget_spent };
  static constexpr std::size_t kBlock = 6;  ///< components of a body's step

  /// Not RT-safe: allocates.
  ConeProjection(std::size_t max_bodies, std::size_t max_cones);

  /// Begins a problem of `bodies` bodies without cones.
  void clear(std::size_t bodies) noexcept;
  /// Adds a cone. Returns false if there is no room.
  bool add(const FrictionCone& cone) noexcept;
  /// The components of z0 for a body.
  Eigen::Ref<Vector6d> z0(std::size_t body) noexcept { return z0_.segment<kBlock>(at(body)); }

  /// Names a half-space that solve() tries first, by the normal that active_normals() returned for it.
  void suggest(std::size_t cone, const Vector3d& normal) noexcept;
  /// Solves with the lifts that the cones have. tolerance_m: accepted violation of a cone [m].
  Status solve(double tolerance_m) noexcept;
  /// Solves with the lifts of Coulomb's law, METHOD (106); those that the cones have are the first guess.
  /// Status budget_spent: no answer after some steps, z is that for the lifts of the last one.
  Status solve_coulomb(double tolerance_m) noexcept;

  /// The answer for a body.
  Vector6d z(std::size_t body) const noexcept { return z_.segment<kBlock>(at(body)); }
  /// The force of a cone on its body a, in the axes of n: z - z0 = sum D' force.
  Vector3d force(std::size_t cone) const noexcept { return forces_[cone]; }
  /// The normals n - mu direction of the half-spaces of a cone that are active at the answer, at most four. A
  /// point has three independent ones.
  StaticVector<Vector3d, 4> active_normals(std::size_t cone) const noexcept;
  std::size_t cone_count() const noexcept { return cones_.size(); }
  /// mu |P (D z + slip)| of a cone at the answer [m].
  double lift_m(std::size_t cone) const noexcept;
  /// Half-spaces activated and Newton steps of the last solve.
  std::size_t steps() const noexcept { return steps_; }

 private:
  /// The half-space (n - mu direction)' D z >= bound of a cone, scaled to unit length.
  struct HalfSpace {
    std::size_t cone = 0;
    Vector3d normal;      ///< n - mu direction, before scaling
    double length = 1.0;  ///< of D' normal
    double bound = 0.0;   ///< for the scaled half-space
    double multiplier = 0.0;
  };
  /// An unknown of newton_step(): how it changes a cone's force and the steps of its bodies, and an equation
  /// row . D z + turn * unknown = target.
  struct Unknown {
    std::size_t cone;
    Vector3d force, row;
    Vector6d push_a, push_b, row_a, row_b;
    double turn, target;
  };
  /// Components of a vector outside of which it is zero.
  struct Range {
    Eigen::Index first = 0, size = 0;
  };
  static Eigen::Index at(std::size_t body) noexcept { return static_cast<Eigen::Index>(kBlock * body); }
  static Range range_of(const FrictionCone& cone) noexcept;
  static Range united(Range a, Range b) noexcept;

  Vector3d displacement(const FrictionCone& cone, const Eigen::VectorXd& z) const noexcept;
  Vector3d slip(const FrictionCone& cone) const noexcept;
  HalfSpace tangent(std::size_t cone, const Vector3d& direction) const noexcept;
  double product(const HalfSpace& half_space, const Eigen::VectorXd& z) const noexcept;
  void push(const FrictionCone& cone, const Vector3d& force, Eigen::VectorXd& z) const noexcept;
  bool most_violated(double tolerance_m, HalfSpace& worst) const noexcept;
  Status enter_violated(double tolerance_m) noexcept;
  void start_with_suggested() noexcept;
  void drop_negative() noexcept;
  bool slides() const noexcept;
  bool lifts_fit(double tolerance_m) const noexcept;
  double newton_step() noexcept;
  void set_unknowns() noexcept;
  void add_unknown(std::size_t cone, const Vector3d& force, const Vector3d& row, double turn,
                   double target) noexcept;
  double response(const Unknown& one, const Unknown& other) const noexcept;
  bool obeys_coulomb(double tolerance_m) const noexcept;
  bool solve_active() noexcept;
  void take_forces() noexcept;
  void suggest_active() noexcept;
  void eliminate(Eigen::Index size) noexcept;
  bool activate(HalfSpace entering) noexcept;
  double bound(const HalfSpace& half_space) const noexcept;
  void project_out(const HalfSpace& half_space) noexcept;
  void subtract_column(Eigen::Index column, double factor) noexcept;
  double dot_column(Eigen::Index column, Eigen::Index rows, const Eigen::VectorXd& x) const noexcept;
  void back_substitute(const Eigen::VectorXd& r, Eigen::VectorXd& d) const noexcept;
  bool append(const HalfSpace& half_space) noexcept;
  void append(const HalfSpace& half_space, double length) noexcept;
  void drop(std::size_t k) noexcept;
  void recompute() noexcept;

  std::size_t dimension_ = 0;
  std::vector<FrictionCone> cones_;
  std::vector<HalfSpace> active_;
  std::vector<HalfSpace> suggested_;  ///< only their cones and normals
  std::vector<Unknown> unknowns_;     ///< of the Newton step for Coulomb's law
  Eigen::VectorXd z0_, z_, z_before_, rest_, r_, d_;
  Range rest_range_;           ///< range of rest_ after project_out()
  std::vector<Range> ranges_;  ///< range of each column of Q_; most are short in a chain of bodies
  Eigen::MatrixXd Q_;          ///< orthonormal columns
  Eigen::MatrixXd R_;          ///< upper triangle: active normals = Q R
  Eigen::MatrixXd J_;          ///< Jacobian of the Newton step for Coulomb's law
  Eigen::VectorXd x_, d_x_;    ///< right side of the Newton step, and its solution
  std::vector<Eigen::Index>
      pivots_;                    ///< row of the pivot of each column of J_; -1: the column depends on others
  std::vector<Vector3d> forces_;  ///< force of each cone on its body a
  std::vector<char> left_out_;    ///< cones that Newton's method found with a negative load
  std::size_t steps_ = 0;
};

}  // namespace wrenchd
