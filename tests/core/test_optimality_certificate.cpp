// SPDX-License-Identifier: GPL-3.0-or-later
#include <vector>

#include <catch2/catch.hpp>

#include "core/optimality_certificate.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_optimality_certificate {

using test::RandomValues;

namespace {

LocalContact vertex_face(RandomValues& random) {
  LocalContact c{};
  c.kind = ContactKind::vertex_face;
  c.n = random.unit<3>();
  c.a = random.vector<3>();
  c.c = random.normal();
  return c;
}

Eigen::Vector4d coefficients(const Quaterniond& q) {
  return {q.w(), q.x(), q.y(), q.z()};
}

/// The part of the Lagrangian that depends on the rotation: 4 v' H^ v - sum m_i n_i . R a_i.
double rotational_part(const Matrix3d& H_hat, const std::vector<LocalContact>& contacts,
                       const std::vector<double>& multipliers, const Quaterniond& q) {
  double sum = 4.0 * q.vec().dot(H_hat * q.vec());
  for (std::size_t i = 0; i < contacts.size(); ++i)
    sum -= multipliers[i] * contacts[i].n.dot(q * contacts[i].a);
  return sum;
}

struct Case {
  Matrix3d H_hat;
  std::vector<LocalContact> contacts;
  std::vector<double> multipliers;
};

Case random_case(RandomValues& random) {
  const Inertia M = random.inertia();
  Case out{M.H_kg_m2 / M.mass_kg, {}, {}};
  const int count = random.integer(1, 5);
  for (int i = 0; i < count; ++i) {
    out.contacts.push_back(vertex_face(random));
    out.multipliers.push_back(random.uniform(0.0, 2.0));
  }
  return out;
}

}  // namespace

TEST_CASE("the dual matrix is the rotational part of the Lagrangian as a quadratic form", "[certificate]") {
  RandomValues random(221);
  for (int i = 0; i < 200; ++i) {
    const Case c = random_case(random);
    const Eigen::Matrix4d Z = dual_matrix(c.H_hat, c.contacts, c.multipliers);
    const Quaterniond q = random.rotation();
    CHECK(coefficients(q).dot(Z * coefficients(q)) ==
          Approx(rotational_part(c.H_hat, c.contacts, c.multipliers, q)).margin(1e-12));
  }
}

TEST_CASE("no rotation has a lower Lagrangian than the dual rotation", "[certificate]") {
  RandomValues random(222);
  for (int i = 0; i < 100; ++i) {
    const Case c = random_case(random);
    const Quaterniond best = dual_rotation(c.H_hat, c.contacts, c.multipliers);
    CHECK(best.norm() == Approx(1.0));
    const double least = rotational_part(c.H_hat, c.contacts, c.multipliers, best);
    for (int k = 0; k < 100; ++k)
      CHECK(least <= rotational_part(c.H_hat, c.contacts, c.multipliers, random.rotation()) + 1e-12);
  }
}

TEST_CASE("contacts without a positive multiplier have no effect on the certificate", "[certificate]") {
  RandomValues random(223);
  Case c = random_case(random);
  const Eigen::Matrix4d Z = dual_matrix(c.H_hat, c.contacts, c.multipliers);
  LocalContact edges = vertex_face(random);
  edges.kind = ContactKind::edge_edge;
  c.contacts.push_back(edges);
  c.multipliers.push_back(0.0);
  CHECK(dual_matrix(c.H_hat, c.contacts, c.multipliers) == Z);
  CHECK(has_dual_bound(c.contacts, c.multipliers));
  c.multipliers.back() = 1e-12;
  CHECK_FALSE(has_dual_bound(c.contacts, c.multipliers));
}

TEST_CASE("the dual bound is met if and only if the Lagrangian is convex in the rotation", "[certificate]") {
  RandomValues random(224);
  for (int i = 0; i < 100; ++i) {
    const Inertia M = random.inertia();
    HessianBlocks hessian;
    hessian.B = M.H_kg_m2;
    CHECK(meets_dual_bound(hessian));
    const Vector3d v = random.unit<3>();
    hessian.B -= 1.01 * v.dot(M.H_kg_m2 * v) * v * v.transpose();
    CHECK_FALSE(meets_dual_bound(hessian));
  }
}

}  // namespace wrenchd::test_optimality_certificate
