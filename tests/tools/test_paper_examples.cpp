// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "tools/paper_examples.hpp"

namespace wrenchd::test_paper_examples {

TEST_CASE("example 4.1 is the paper's: p, and a cube of 50 by 50 by 50", "[paper]") {
  const Vector6d xi_p = log(pose_of_example_4_1(1.0));
  CHECK(xi_p[0] == Approx(-2.5).margin(5e-5));
  CHECK(xi_p[1] == Approx(24.9166).margin(5e-5));
  CHECK(xi_p[5] == Approx(-0.2).margin(1e-15));
  for (const double scale : {1.0, 10.0}) {
    const Inertia M = paper_scene(scale).tool().solid.inertia;
    CHECK(M.mass_kg == 1.0);
    CHECK(M.H_kg_m2.isApprox(scale * scale * 2500.0 / 6.0 * Matrix3d::Identity(), 1e-14));
  }
}

TEST_CASE("example 4.2: similar forces, and a torque some four hundred times smaller", "[paper]") {
  const PaperSummary planar = summary_of(simulate_example_4_2(Method::planar));
  const PaperSummary exact = summary_of(simulate_example_4_2(Method::exact));
  const PaperSummary traditional = summary_of(simulate_example_4_2(Method::translational));

  // An independent simulation, whose integrator may differ by a few percent: 69 steps, 3.84 and 0.112; 71
  // steps, 4.04 and 46.9.
  CHECK(planar.steps_in_contact == 69);
  CHECK(planar.max_force_y == Approx(3.84).epsilon(0.03));
  CHECK(planar.max_torque_z == Approx(0.112).epsilon(0.03));
  CHECK(traditional.steps_in_contact == 71);
  CHECK(traditional.max_force_y == Approx(4.04).epsilon(0.03));
  CHECK(traditional.max_torque_z == Approx(46.9).epsilon(0.03));

  // The motion is planar, so one plane of the family holds the exact answer.
  CHECK(exact.steps_in_contact == planar.steps_in_contact);
  CHECK(exact.max_force_y == Approx(planar.max_force_y).epsilon(1e-9));
  CHECK(exact.max_torque_z == Approx(planar.max_torque_z).epsilon(1e-9));
}

TEST_CASE("between contacts the cube of example 4.2 moves as a free body does", "[paper]") {
  const std::vector<PaperStep> steps = simulate_example_4_2(Method::translational);
  REQUIRE(steps.size() == 120);
  int free = 0;
  for (std::size_t i = 2; i < steps.size(); ++i) {
    if (steps[i - 2].in_contact || steps[i - 1].in_contact) continue;
    ++free;
    const auto moved = [&](std::size_t k) -> Vector3d {
      return steps[k].X_WP.translation_m - steps[k - 1].X_WP.translation_m;
    };
    CHECK((moved(i) - moved(i - 1)).norm() < 1e-3 * moved(i).norm());
    CHECK(steps[i].X_WP.rotation.angularDistance(steps[i - 1].X_WP.rotation) ==
          Approx(steps[i - 1].X_WP.rotation.angularDistance(steps[i - 2].X_WP.rotation)).epsilon(1e-9));
    if (!steps[i].in_contact) CHECK(steps[i].F_W.force_N.norm() == 0.0);
  }
  CHECK(free > 30);
}

}  // namespace wrenchd::test_paper_examples
