// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "devices/clamp_norm.hpp"

namespace wrenchd::test_clamp_norm {

TEST_CASE("a vector longer than its limit keeps its direction, a shorter one its bits", "[clamp_norm]") {
  const Eigen::Vector3d v(3.0, -4.0, 12.0);  // norm 13
  CHECK((clamp_norm(v, 6.5) - 0.5 * v).norm() < 1e-15);
  CHECK(clamp_norm(v, 13.0) == v);
  CHECK(clamp_norm(v, 20.0) == v);
  CHECK(clamp_norm(v, 0.0) == Eigen::Vector3d::Zero());
  CHECK(clamp_norm(Eigen::Vector3d::Zero(), 0.0) == Eigen::Vector3d::Zero());
}

}  // namespace wrenchd::test_clamp_norm
