// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <vector>

#include <catch2/catch.hpp>

#include "collision/penetration.hpp"
#include "core/energy_law.hpp"
#include "core/metric.hpp"
#include "core/wrench_law.hpp"
#include "tests/support/case_count.hpp"
#include "tests/support/overlapping_scene.hpp"

namespace wrenchd::test_energy_law {

using namespace wrenchd::test;

namespace {

Vector6d numbers(const Wrench& W) {
  Vector6d out;
  out << W.force_N, W.torque_Nm;
  return out;
}

/// Minus the derivative of U along a twist of p in its own axes, by central differences.
template <class Potential>
double pull(const Potential& U, const Pose& X_WP, const Vector6d& xi) {
  constexpr double h = 1e-5;
  return -(U(X_WP * exp(Vector6d(h * xi))) - U(X_WP * exp(Vector6d(-h * xi)))) / (2.0 * h);
}

/// A smooth closed path about p:  p exp(a cos t + b sin t + c cos 2t).
struct Loop {
  Pose X_WP;
  Vector6d a, b, c;
  Pose at(double t) const {
    return X_WP * exp(Vector6d(a * std::cos(t) + b * std::sin(t) + c * std::cos(2.0 * t)));
  }
};

/// Both laws at one point of a loop: power per unit of t, and displacement.
struct Rate {
  Pose X_WQ;
  double energy_law, pid;
  double potential, pid_potential;
  bool touching;
};

/// Follows q along a loop, from point to point.
class Follower {
 public:
  Follower(const Loop& loop, const Scene& scene)
      : loop_(loop), M_(scene.tool().solid.inertia), depth_(scene, {}) {}

  Pose first() { return depth_.query(loop_.at(0.0)).projection.X_WQ; }

  Rate at(double t, const Pose& X_last) {
    constexpr double h = 1e-4;
    const Pose X_WP = loop_.at(t);
    const Penetration p = depth_.follow(X_WP, X_last);
    const Vector6d xi = (8.0 * log(inverse(loop_.at(t - h)) * loop_.at(t + h)) -
                         log(inverse(loop_.at(t - 2.0 * h)) * loop_.at(t + 2.0 * h))) /
                        (12.0 * h);
    const Pose& X_WQ = p.projection.X_WQ;
    return {X_WQ,
            numbers(energy_wrench(M_, 1.0, X_WP, X_WQ)).dot(xi),
            p.eps.dot(xi),
            0.5 * p.projection.energy,
            0.5 * p.eps.squaredNorm(),
            p.contacts > 0};
  }

 private:
  const Loop& loop_;
  Inertia M_;
  PenetrationDepth depth_;
};

struct Work {
  double energy_law = 0.0;  ///< work around the loop, divided by the largest potential on it
  double pid = 0.0;         ///< work of K_P = k_P I around the loop, divided by its largest k_P |eps|^2 / 2
  bool smooth = true;       ///< true if q is continuous and stays in contact
};

bool far_apart(const Pose& a, const Pose& b, double most) {
  return log(inverse(a) * b).norm() > most;
}

/// Simpson's rule from a to b, halved where the wrench has a kink: where contacts change.
void integrate(Follower& follower, double t_a, const Rate& a, double t_b, const Rate& b, int halvings,
               Work& work) {
  const double t = 0.5 * (t_a + t_b);
  const Rate middle = follower.at(t, a.X_WQ);
  const double h = t_b - t_a;
  const double kink = std::abs(a.energy_law - 2.0 * middle.energy_law + b.energy_law) * h;
  const bool fine = kink < 2e-8 * middle.potential;
  if (!fine && halvings > 0) {
    integrate(follower, t_a, a, t, middle, halvings - 1, work);
    integrate(follower, t, middle, t_b, b, halvings - 1, work);
    return;
  }
  if (far_apart(a.X_WQ, b.X_WQ, 1e-4 + 5.0 * h)) work.smooth = false;
  work.energy_law += h / 6.0 * (a.energy_law + 4.0 * middle.energy_law + b.energy_law);
  work.pid += h / 6.0 * (a.pid + 4.0 * middle.pid + b.pid);
}

Work around(const Loop& loop, const Scene& scene) {
  constexpr int kPieces = 32;
  constexpr int kHalvings = 12;
  Follower follower(loop, scene);
  Work work;
  double peak = 0.0;
  double peak_pid = 0.0;
  const double dt = 2.0 * 3.14159265358979323846 / kPieces;
  const Rate first = follower.at(0.0, follower.first());
  Rate a = first;
  for (int i = 0; i < kPieces && work.smooth; ++i) {
    const Rate b = follower.at((i + 1) * dt, a.X_WQ);
    work.smooth = b.touching;
    if (work.smooth) integrate(follower, i * dt, a, (i + 1) * dt, b, kHalvings, work);
    peak = std::max(peak, b.potential);
    peak_pid = std::max(peak_pid, b.pid_potential);
    a = b;
  }
  if (far_apart(a.X_WQ, first.X_WQ, 1e-6)) work.smooth = false;
  work.energy_law /= peak;
  work.pid /= peak_pid;
  return work;
}

}  // namespace

TEST_CASE("the energy wrench is minus the gradient of the potential at fixed q", "[energy_law]") {
  RandomValues random(1);
  for (int i = 0; i < 100; ++i) {
    const Inertia M = random_body(random, 12).solid.inertia;
    const double k = random.uniform(0.5, 3.0);
    const Pose X_WP{random.rotation(), random.vector<3>()};
    const Pose X_WQ = X_WP * exp(Vector6d(0.5 * random.unit<6>()));
    const auto U = [&](const Pose& X) { return 0.5 * k * energy(M, X, X_WQ); };
    const Vector6d W = numbers(energy_wrench(M, k, X_WP, X_WQ));
    for (int axis = 0; axis < 6; ++axis)
      CHECK(W[axis] == Approx(pull(U, X_WP, Vector6d::Unit(axis))).margin(1e-9));
  }
}

TEST_CASE("the energy wrench is also minus the gradient if q is the projection of p", "[energy_law]") {
  RandomValues random(2);
  for (int i = 0; i < 60; ++i) {
    const OverlappingScene c = overlap_corner(random, 1, random.uniform(0.05, 0.15));
    PenetrationDepth depth(c.scene, {});
    const auto U = [&](const Pose& X) { return 0.5 * depth.query(X).projection.energy; };
    const Pose X_WQ = depth.query(c.X_WP).projection.X_WQ;
    const Vector6d W = numbers(energy_wrench(c.scene.tool().solid.inertia, 1.0, c.X_WP, X_WQ));
    for (int axis = 0; axis < 6; ++axis)
      CHECK(W[axis] == Approx(pull(U, c.X_WP, Vector6d::Unit(axis))).margin(1e-6));
  }
}

TEST_CASE("to first order it is K_P = k M", "[energy_law]") {
  RandomValues random(3);
  const Inertia M = random_body(random, 12).solid.inertia;
  const Vector6d eps = 1e-6 * random.unit<6>();
  Vector6d expected;
  expected << 2.0 * M.mass_kg * eps.head<3>(), 2.0 * M.H_kg_m2 * eps.tail<3>();
  const Pose X_WP{random.rotation(), random.vector<3>()};
  CHECK((numbers(energy_wrench(M, 2.0, X_WP, X_WP * exp(eps))) - expected).norm() < 1e-11);
}

TEST_CASE("no work is done around a closed path in contact", "[energy_law]") {
  RandomValues random(4);
  constexpr int kLoops = case_count(1000);
  double worst = 0.0;
  double worst_pid = 0.0;
  int jumped = 0;
  for (int loops = 0; loops < kLoops;) {
    const OverlappingScene c = overlap_corner(random, random.integer(1, 2), random.uniform(0.1, 0.2));
    const Loop loop{c.X_WP, 0.05 * random.unit<6>(), 0.05 * random.unit<6>(), 0.02 * random.unit<6>()};
    const Work work = around(loop, c.scene);
    if (!work.smooth) {  // q changed to another minimum, or the contact ended: not a closed path of U
      REQUIRE(++jumped < kLoops);
      continue;
    }
    ++loops;
    worst = std::max(worst, std::abs(work.energy_law));
    worst_pid = std::max(worst_pid, std::abs(work.pid));
  }
  WARN("work around " << kLoops << " loops, of the peak potential: energy law at most " << worst
                      << ", Eq. (16) with k_P alone at most " << worst_pid << "; " << jumped
                      << " loops drawn again because q jumped");
  CHECK(worst < 1e-6);
  CHECK(worst_pid > 1e-3);  // otherwise the comparison is empty
}

}  // namespace wrenchd::test_energy_law
