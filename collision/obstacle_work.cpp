// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/obstacle_work.hpp"

#include "core/contact.hpp"

namespace wrenchd {

double obstacle_work(const Projection& projection, const Scene& scene, double from_s, double to_s) noexcept {
  if (!scene.has_moving_obstacles()) return 0.0;
  double work = 0.0;
  for (const auto& [contact, multiplier] : projection.active) {
    if (multiplier == 0.0) continue;
    const Vector3d x_W = contact_point_W(contact, projection.X_WQ);
    const Pose D = scene.obstacle_displacement(contact.obstacle, from_s, to_s);
    work += multiplier * normal_W(contact, projection.X_WQ).dot(x_W - inverse(D) * x_W);
  }
  return work;
}

}  // namespace wrenchd
