// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <Eigen/Core>

namespace wrenchd {

/// The point of a polyhedron in R^N nearest to a given point (core/METHOD.md, section 4), METHOD (31):
///
///   min 1/2 |z - z0|^2   subject to   b_i . z >= c_i,   |b_i| = 1
///
/// Dual active-set method of Goldfarb and Idnani (Math. Programming 27, 1983): starts at z0, adds the most
/// violated constraint, keeps the active multipliers non-negative, and drops constraints whose multiplier
/// reaches zero. At most N constraints are active. A constraint in the span of the active normals replaces
/// one of them. RT-safe.
template <int N, std::size_t Capacity>
class LeastDistance {
 public:
  using Vector = Eigen::Matrix<double, N, 1>;
  /// one coefficient per active constraint, in the order of activation
  using Coefficients = std::array<double, N>;
  enum class Status : std::uint8_t { optimal, infeasible, budget_spent };

  void clear() noexcept { count_ = 0; }

  /// Adds b . z >= c. b may have any length above zero.
  void add(const Vector& b, double c) noexcept {
    const double length = b.norm();
    const double scale = 1.0 / length;
    add_unit(b * scale, c * scale);
    length_[count_ - 1] = length;
  }
  /// Adds b . z >= c for a b of unit length.
  void add_unit(const Vector& b, double c) noexcept {
    normal_[count_] = b;
    bound_[count_] = c;
    length_[count_] = 1.0;
    ++count_;
  }

  /// Removes constraint i by moving the last constraint into its position. Invalidates z(); multipliers move
  /// along.
  void remove_unordered(std::size_t i) noexcept {
    --count_;
    normal_[i] = normal_[count_];
    bound_[i] = bound_[count_];
    length_[i] = length_[count_];
    multiplier_[i] = multiplier_[count_];
  }

  /// Solves from z0. tolerance: accepted violation of an inactive constraint, in units of z. An active
  /// constraint is met up to the rounding of b . z, which may be larger.
  Status solve(const Vector& z0, double tolerance) noexcept {
    z_ = z0;
    active_count_ = 0;
    for (std::size_t i = 0; i < count_; ++i) multiplier_[i] = 0.0;
    bool refined = true;
    for (std::size_t step = 0; step < kMaxSteps; ++step) {
      const std::size_t p = most_violated(tolerance);
      if (p == count_) {
        if (refined) return Status::optimal;
        refine(tolerance);
      } else if (!activate(p)) {
        return Status::infeasible;
      }
      refined = p == count_;
    }
    return Status::budget_spent;
  }

  const Vector& z() const noexcept { return z_; }
  /// Multiplier of constraint i for b_i as given: z - z0 = sum multiplier_i b_i. Zero if the constraint is
  /// inactive.
  double multiplier(std::size_t i) const noexcept { return multiplier_[i] / length_[i]; }
  std::size_t count() const noexcept { return count_; }
  /// Normal of constraint i, scaled to unit length.
  const Vector& normal(std::size_t i) const noexcept { return normal_[i]; }
  double bound(std::size_t i) const noexcept { return bound_[i]; }

 private:
  /// typical number of steps: the number of finally active constraints
  static constexpr std::size_t kMaxSteps = std::size_t{8} * N + 2 * Capacity;
  /// squared sine below which a normal counts as dependent on the active normals
  static constexpr double kDependent = 1e-20;

  bool is_active(std::size_t i) const noexcept {
    for (std::size_t k = 0; k < active_count_; ++k)
      if (active_[k] == i) return true;
    return false;
  }

  /// Index of the most violated inactive constraint; count_ if none exceeds the tolerance. Active constraints
  /// are met by construction, up to rounding.
  std::size_t most_violated(double tolerance) const noexcept {
    std::size_t worst = count_;
    double most = tolerance;
    for (std::size_t i = 0; i < count_; ++i) {
      const double violation = bound_[i] - normal_[i].dot(z_);
      if (violation > most && !is_active(i)) {
        most = violation;
        worst = i;
      }
    }
    return worst;
  }

  /// Makes constraint p active and drops constraints whose multiplier reaches zero, METHOD (33). Returns
  /// false if the constraints contradict each other.
  bool activate(std::size_t p) noexcept {
    for (;;) {
      // b_p = Q r + rest, Q R = active normals, d = R^-1 r: rate at which p's multiplier changes the active
      // ones.
      Coefficients r{};
      const Vector rest = project_out(normal_[p], r);
      const Coefficients d = back_substitute(r);
      const double curvature = rest.squaredNorm();
      const bool independent = curvature > kDependent && active_count_ < N;

      const double violation = bound_[p] - normal_[p].dot(z_);
      const double full = independent ? violation / curvature : std::numeric_limits<double>::infinity();
      double partial = std::numeric_limits<double>::infinity();
      std::size_t leaving = 0;
      for (std::size_t k = 0; k < active_count_; ++k) {
        const double dk = d[k];
        if (dk > 0.0 && multiplier_[active_[k]] < partial * dk) {
          partial = multiplier_[active_[k]] / dk;
          leaving = k;
        }
      }
      const double t = std::fmin(full, partial);
      if (!(t < std::numeric_limits<double>::infinity())) return false;

      for (std::size_t k = 0; k < active_count_; ++k) multiplier_[active_[k]] -= t * d[k];
      multiplier_[p] += t;
      if (independent) z_ += t * rest;
      if (full <= partial) {
        append(p, r, rest, std::sqrt(curvature));
        return true;
      }
      drop(leaving);
    }
  }

  /// Removes the rounding error between z and the active constraints: R' y = violations, z += Q y.
  void refine(double tolerance) noexcept {
    Coefficients y{};
    double most = 0.0;
    for (std::size_t k = 0; k < active_count_; ++k) {
      const double violation = bound_[active_[k]] - normal_[active_[k]].dot(z_);
      most = std::fmax(most, violation);
      double sum = violation;
      for (std::size_t j = 0; j < k; ++j) sum -= r_[k][j] * y[j];
      y[k] = sum / r_[k][k];
    }
    if (!(most > tolerance)) return;
    for (std::size_t k = 0; k < active_count_; ++k) z_ += y[k] * q_[k];
  }

  /// b minus its projection on the active normals; r receives the coefficients on Q. Orthogonalizes a second
  /// time if cancellation loses digits.
  Vector project_out(const Vector& b, Coefficients& r) const noexcept {
    constexpr double kLittleLost = 0.5;  // fraction of the squared length, which is 1
    Vector rest = b;
    for (int pass = 0; pass < 2; ++pass) {
      for (std::size_t k = 0; k < active_count_; ++k) {
        const double c = q_[k].dot(rest);
        rest -= c * q_[k];
        r[k] += c;
      }
      if (active_count_ == 0 || rest.squaredNorm() > kLittleLost) break;
    }
    return rest;
  }

  Coefficients back_substitute(const Coefficients& r) const noexcept {
    Coefficients d{};
    for (std::size_t k = active_count_; k-- > 0;) {
      double sum = r[k];
      for (std::size_t j = k + 1; j < active_count_; ++j) sum -= r_[j][k] * d[j];
      d[k] = sum / r_[k][k];
    }
    return d;
  }

  void append(std::size_t p, const Coefficients& r, const Vector& rest, double length) noexcept {
    if (active_count_ >= N) return;  // never true: activate() appends fewer than N constraints
    q_[active_count_] = rest / length;
    r_[active_count_] = r;
    r_[active_count_][active_count_] = length;
    active_[active_count_++] = p;
  }

  /// Removes the k-th active constraint and rebuilds the columns behind it.
  void drop(std::size_t k) noexcept {
    multiplier_[active_[k]] = 0.0;
    const std::size_t old_count = active_count_;
    active_count_ = k;
    for (std::size_t j = k + 1; j < old_count; ++j) {
      const std::size_t i = active_[j];
      Coefficients r{};
      const Vector rest = project_out(normal_[i], r);
      append(i, r, rest, rest.norm());
    }
  }

  std::array<Vector, Capacity> normal_;
  std::array<double, Capacity> bound_;
  std::array<double, Capacity> length_;
  std::array<double, Capacity> multiplier_;  ///< multipliers for the unit normals
  std::size_t count_ = 0;

  Vector z_ = Vector::Zero();
  std::array<std::size_t, N> active_;
  std::array<Vector, N> q_;        ///< orthonormal columns
  std::array<Coefficients, N> r_;  ///< columns of the triangle: active normal k = sum_j q_j r_k[j]
  std::size_t active_count_ = 0;
};

}  // namespace wrenchd
