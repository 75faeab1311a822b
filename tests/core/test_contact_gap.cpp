// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>

#include <catch2/catch.hpp>

#include "core/contact_gap.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_contact_gap {

using test::RandomValues;

namespace {

constexpr ContactKind kKinds[] = {ContactKind::vertex_face, ContactKind::face_vertex, ContactKind::edge_edge};

/// A random contact; its edges are at least 0.3 rad from parallel at any pose with the rotation R_WT.
Contact random_contact(RandomValues& random, ContactKind kind, const Quaterniond& R_WT) {
  Contact c;
  c.kind = kind;
  c.p_TCa_m = random.vector<3>();
  c.p_WCb_m = random.vector<3>();
  c.n_W = random.unit<3>();
  c.offset_m = c.n_W.dot(c.p_WCb_m);
  if (kind == ContactKind::vertex_face) return c;
  c.d_T = random.unit<3>();
  if (kind == ContactKind::face_vertex) return c;
  do c.d_W = random.unit<3>();
  while ((R_WT * c.d_T).cross(c.d_W).norm() < 0.3);
  return c;
}

LocalContact local(const Contact& contact, const Pose& X_WP, double L_m) {
  LocalContact out;
  make_local(contact, X_WP, X_WP.rotation.toRotationMatrix().transpose(), L_m, out);
  return out;
}

/// The state (u, E) after the displacement y = (du, eta).
struct ScaledPose {
  Vector3d u;
  Quaterniond E;

  Matrix3d R() const { return E.toRotationMatrix(); }
  ScaledPose moved(const Vector6d& y) const {
    const Quaterniond step(1.0, 0.5 * y[3], 0.5 * y[4], 0.5 * y[5]);
    return {u + y.head<3>(), (E * step).normalized()};
  }
};

double gap(const LocalContact& contact, const ScaledPose& s) {
  const auto [n, h] = affine_gap(contact, s.R(), 0.0);
  return n.dot(s.u) + h;
}

Vector6d gradient(const LocalContact& contact, const ScaledPose& s) {
  return gap_gradient(contact, affine_gap(contact, s.R(), 0.0).n, gap(contact, s), s.u, s.R());
}

Matrix6d hessian(const LocalContact& contact, const ScaledPose& s) {
  const Vector6d J = gradient(contact, s);
  HessianBlocks blocks;
  subtract_gap_curvature(contact, J.head<3>(), {1.0, contact.a, contact.b, J.tail<3>()}, s.u, s.R(), blocks);
  Matrix6d K;
  K << Matrix3d::Zero(), -blocks.C, -blocks.C.transpose(), -blocks.B;
  return K;
}

Vector6d axis(int i, double length) {
  return length * Vector6d::Unit(i);
}

}  // namespace

TEST_CASE("a local gap is the gap of the contact in units of L", "[contact_gap]") {
  RandomValues random(201);
  for (const ContactKind kind : kKinds) {
    for (int i = 0; i < 200; ++i) {
      const Pose X_WP = random.pose();
      const double L_m = random.log_uniform(0.01, 10.0);
      const ScaledPose s{random.vector<3>(), random.rotation()};
      const Contact c = random_contact(random, kind, X_WP.rotation * s.E);
      const Pose X_WQ{X_WP.rotation * s.E, X_WP.translation_m + X_WP.rotation * (L_m * s.u)};
      CHECK(L_m * gap(local(c, X_WP, L_m), s) == Approx(gap_m(c, X_WQ)).margin(1e-12));
    }
  }
}

TEST_CASE("the clearance is subtracted from a gap", "[contact_gap]") {
  RandomValues random(202);
  for (const ContactKind kind : kKinds) {
    const ScaledPose s{random.vector<3>(), random.rotation()};
    const LocalContact c = local(random_contact(random, kind, s.E), Pose{}, 1.0);
    CHECK(affine_gap(c, s.R(), 0.25).h == Approx(affine_gap(c, s.R(), 0.0).h - 0.25).margin(1e-14));
  }
}

TEST_CASE("gap_at_p_below agrees with the gap at p", "[contact_gap]") {
  RandomValues random(203);
  const ScaledPose at_p{Vector3d::Zero(), Quaterniond::Identity()};
  for (const ContactKind kind : kKinds) {
    for (int i = 0; i < 200; ++i) {
      const LocalContact c = local(random_contact(random, kind, Quaterniond::Identity()), Pose{}, 1.0);
      const double value = gap(c, at_p);
      CHECK(gap_at_p_below(c, 0.0) == (value < 0.0));
      CHECK(gap_at_p_below(c, std::abs(value) * 1.01));
      CHECK(gap_at_p_below(c, std::abs(value) * 0.99) == (value < 0.0));
    }
  }
}

TEST_CASE("the gradient of a gap agrees with central differences", "[contact_gap]") {
  RandomValues random(204);
  constexpr double kStep = 1e-5;
  for (const ContactKind kind : kKinds) {
    for (int i = 0; i < 200; ++i) {
      const ScaledPose s{random.vector<3>(), random.rotation()};
      const LocalContact c = local(random_contact(random, kind, s.E), Pose{}, 1.0);
      const Vector6d J = gradient(c, s);
      for (int k = 0; k < 6; ++k) {
        const double difference =
            (gap(c, s.moved(axis(k, kStep))) - gap(c, s.moved(axis(k, -kStep)))) / (2.0 * kStep);
        CHECK(J[k] == Approx(difference).epsilon(1e-7).margin(1e-7));
      }
    }
  }
}

TEST_CASE("the curvature of a closed gap agrees with central differences", "[contact_gap]") {
  RandomValues random(205);
  constexpr double kStep = 1e-4;
  for (const ContactKind kind : kKinds) {
    for (int i = 0; i < 200; ++i) {
      ScaledPose s{random.vector<3>(), random.rotation()};
      const LocalContact c = local(random_contact(random, kind, s.E), Pose{}, 1.0);
      s.u -= gap(c, s) * affine_gap(c, s.R(), 0.0).n;
      const Matrix6d K = hessian(c, s);
      CHECK(K.isApprox(K.transpose()));
      for (int row = 0; row < 6; ++row) {
        for (int column = 0; column < 6; ++column) {
          const auto value = [&](double a, double b) {
            return gap(c, s.moved(axis(row, a) + axis(column, b)));
          };
          const double difference =
              (value(kStep, kStep) - value(kStep, -kStep) - value(-kStep, kStep) + value(-kStep, -kStep)) /
              (4.0 * kStep * kStep);
          CHECK(K(row, column) == Approx(difference).epsilon(1e-4).margin(1e-4));
        }
      }
    }
  }
}

TEST_CASE("the curvature of several contacts with one normal is that of their sum", "[contact_gap]") {
  RandomValues random(206);
  for (const ContactKind kind : kKinds) {
    const ScaledPose s{random.vector<3>(), random.rotation()};
    const Contact first = random_contact(random, kind, s.E);
    HessianBlocks together, apart;
    WeightedContactSum load;
    for (int i = 0; i < 3; ++i) {
      Contact contact = first;
      contact.p_TCa_m = random.vector<3>();
      contact.p_WCb_m = random.vector<3>();
      const LocalContact c = local(contact, Pose{}, 1.0);
      const Vector6d J = gradient(c, s);
      const double m = random.uniform(0.1, 2.0);
      subtract_gap_curvature(c, J.head<3>(), {m, m * c.a, m * c.b, m * J.tail<3>()}, s.u, s.R(), apart);
      load.m += m;
      load.a += m * c.a;
      load.b += m * c.b;
      load.angular_gradient += m * J.tail<3>();
    }
    const LocalContact c = local(first, Pose{}, 1.0);
    subtract_gap_curvature(c, affine_gap(c, s.R(), 0.0).n, load, s.u, s.R(), together);
    CHECK(together.B.isApprox(apart.B, 1e-12));
    CHECK((together.C - apart.C).norm() < 1e-12);
  }
}

}  // namespace wrenchd::test_contact_gap
