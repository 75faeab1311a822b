// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>

#include <catch2/catch.hpp>

#include "tools/view/contact_forces.hpp"

namespace wrenchd::test_contact_forces {

namespace {

ProxyContact contact(const Vector3d& p, const Vector3d& n, double multiplier) {
  ProxyContact out;
  for (std::size_t i = 0; i < 3; ++i) {
    out.point_W_m[i] = p[static_cast<Eigen::Index>(i)];
    out.normal_W[i] = n[static_cast<Eigen::Index>(i)];
  }
  out.multiplier_kg_m = multiplier;
  return out;
}

struct Applied {
  Vector3d force = Vector3d::Zero(), torque = Vector3d::Zero();
};

/// Returns the wrench of contact forces of these sizes about p.
Applied applied(const std::vector<ProxyContact>& contacts, const std::vector<double>& forces_N,
                const Vector3d& p) {
  Applied out;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const Vector3d f = forces_N[i] * Vector3d(contacts[i].normal_W.data());
    out.force += f;
    out.torque += (Vector3d(contacts[i].point_W_m.data()) - p).cross(f);
  }
  return out;
}

const Vector3d kX = Vector3d::UnitX(), kY = Vector3d::UnitY(), kZ = Vector3d::UnitZ();

}  // namespace

TEST_CASE("contact forces have the ratios of the multipliers and the size of the wrench", "[view]") {
  const std::vector<ProxyContact> contacts = {contact({0.01, 0.0, 0.0}, kZ, 1e-4),
                                              contact({0.0, 0.02, 0.0}, kX, 3e-4),
                                              contact({0.0, 0.0, 0.03}, (kY + kZ).normalized(), 2e-4)};
  const Vector3d p(0.1, -0.2, 0.05);
  const Applied wrench = applied(contacts, {0.7, 2.1, 1.4}, p);
  const auto forces = contact_forces_N(contacts, p, wrench.force, wrench.torque);
  REQUIRE(forces.size() == 3);
  CHECK(forces[0] == Approx(0.7));
  CHECK(forces[1] == Approx(2.1));
  CHECK(forces[2] == Approx(1.4));
}

TEST_CASE("a couple of contacts is found by its torque alone", "[view]") {
  const std::vector<ProxyContact> contacts = {contact({0.02, 0.0, 0.0}, kZ, 1e-4),
                                              contact({-0.02, 0.0, 0.0}, -kZ, 1e-4)};
  const Applied wrench = applied(contacts, {3.0, 3.0}, Vector3d::Zero());
  REQUIRE(wrench.force.norm() < 1e-12);
  const auto forces = contact_forces_N(contacts, Vector3d::Zero(), wrench.force, wrench.torque);
  CHECK(forces[0] == Approx(3.0));
  CHECK(forces[1] == Approx(3.0));
}

TEST_CASE("without a wrench contacts have no force, and none pulls", "[view]") {
  const std::vector<ProxyContact> contacts = {contact(Vector3d::Zero(), kZ, 1e-4)};
  CHECK(contact_forces_N(contacts, Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero())[0] == 0.0);
  CHECK(contact_forces_N(contacts, Vector3d::Zero(), -5.0 * kZ, Vector3d::Zero())[0] == 0.0);
  CHECK(contact_forces_N(contacts, Vector3d::Zero(), 5.0 * kZ + 2.0 * kX, Vector3d::Zero())[0] ==
        Approx(5.0));
}

TEST_CASE("contacts that cancel each other determine no force", "[view]") {
  const std::vector<ProxyContact> contacts = {contact(Vector3d::Zero(), kZ, 1e-4),
                                              contact(Vector3d::Zero(), -kZ, 1e-4)};
  for (const double force : contact_forces_N(contacts, Vector3d::Zero(), kZ, Vector3d::Zero()))
    CHECK(std::isnan(force));
  CHECK(contact_forces_N({}, Vector3d::Zero(), kZ, Vector3d::Zero()).empty());
}

}  // namespace wrenchd::test_contact_forces
