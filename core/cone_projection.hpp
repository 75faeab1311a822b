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
///   n . (D z) + h >= mu |P (D z + slip)|        D z = D_a z_a + D_b z_b,   P = I - n n'
struct FrictionCone {
  using Block = Eigen::Matrix<double, 3, 6>;
  static constexpr std::size_t kFixed = SIZE_MAX;

  std::size_t a = kFixed, b = kFixed;  ///< numbers of the bodies; kFixed: the contact does not move it
  /// Displacement of the contact point of body a against that of body b, for the six components of each
  /// body's step.
  Block D_a = Block::Zero(), D_b = Block::Zero();
  Vector3d n = Vector3d::UnitZ();      ///< unit normal from b to a
  double h_m = 0.0;                    ///< distance of z = 0 from the apex of the cone, along n [m]
  Vector3d slip_m = Vector3d::Zero();  ///< tangential displacement at z = 0 [m]
  double mu = 0.0;                     ///< coefficient of friction
};

/// The step nearest to a given one that obeys friction cones, METHOD (105):
///
///   min 1/2 |z - z0|^2   subject to   z in every cone
///
/// The method is that of core/least_distance.hpp, with a supply of constraints: of each cone the half-space
/// that touches it at the present slip, METHOD (108). The most violated half-space of all cones enters next.
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

  /// Names a half-space that solve() tries first, by the normal that normals() returned for it.
  void suggest(std::size_t cone, const Vector3d& normal) noexcept;
  /// Solves. tolerance_m: accepted violation of a cone [m].
  Status solve(double tolerance_m) noexcept;

  /// The answer for a body.
  Vector6d z(std::size_t body) const noexcept { return z_.segment<kBlock>(at(body)); }
  /// The force of a cone on its body a, in the axes of n: z - z0 = sum D' force.
  Vector3d force(std::size_t cone) const noexcept;
  /// The normals n - mu direction of the half-spaces of a cone that are active at the answer, at most four. A
  /// point has three independent ones.
  StaticVector<Vector3d, 4> active_normals(std::size_t cone) const noexcept;
  std::size_t cone_count() const noexcept { return cones_.size(); }
  std::size_t steps() const noexcept { return steps_; }  ///< half-spaces activated by the last solve

 private:
  /// The half-space (n - mu direction)' D z >= bound of a cone, scaled to unit length.
  struct HalfSpace {
    std::size_t cone = 0;
    Vector3d normal;      ///< n - mu direction, before scaling
    double length = 1.0;  ///< of D' normal
    double bound = 0.0;   ///< for the scaled half-space
    double multiplier = 0.0;
  };
  static Eigen::Index at(std::size_t body) noexcept { return static_cast<Eigen::Index>(kBlock * body); }

  Vector3d displacement(const FrictionCone& cone) const noexcept;
  HalfSpace tangent(std::size_t cone, const Vector3d& direction) const noexcept;
  double product(const HalfSpace& half_space, const Eigen::VectorXd& z) const noexcept;
  void scatter(const HalfSpace& half_space, double factor, Eigen::VectorXd& z) const noexcept;
  bool most_violated(double tolerance_m, HalfSpace& worst) const noexcept;
  void start_with_suggested() noexcept;
  bool activate(HalfSpace entering) noexcept;
  void project_out(Eigen::VectorXd& rest, Eigen::VectorXd& r) const noexcept;
  void back_substitute(const Eigen::VectorXd& r, Eigen::VectorXd& d) const noexcept;
  bool append(const HalfSpace& half_space) noexcept;
  void append(const HalfSpace& half_space, double length) noexcept;
  void drop(std::size_t k) noexcept;
  void recompute() noexcept;

  std::size_t dimension_ = 0;
  std::vector<FrictionCone> cones_;
  std::vector<HalfSpace> active_;
  std::vector<HalfSpace> suggested_;  ///< only their cones and normals
  std::vector<HalfSpace> behind_;     ///< for drop()
  Eigen::VectorXd z0_, z_, rest_, r_, d_;
  Eigen::MatrixXd Q_;  ///< orthonormal columns
  Eigen::MatrixXd R_;  ///< upper triangle: active normals = Q R
  std::size_t steps_ = 0;
};

}  // namespace wrenchd
