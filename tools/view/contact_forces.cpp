// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/contact_forces.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace wrenchd {
namespace {

/// A contact sum that is smaller than this share of its terms is rounding.
constexpr double kCancelled = 1e-6;

}  // namespace

std::vector<double> contact_forces_N(std::span<const ProxyContact> contacts, const Vector3d& p_W_m,
                                     const Vector3d& force_W, const Vector3d& torque_W) {
  Vector3d force = Vector3d::Zero(), torque = Vector3d::Zero();
  double all = 0.0, arms = 0.0;
  for (const ProxyContact& contact : contacts) {
    const Vector3d n(contact.normal_W.data());
    const Vector3d arm = Vector3d(contact.point_W_m.data()) - p_W_m;
    force += contact.multiplier_kg_m * n;
    torque += contact.multiplier_kg_m * arm.cross(n);
    all += std::abs(contact.multiplier_kg_m);
    arms += arm.squaredNorm();
  }
  std::vector<double> out(contacts.size(), std::numeric_limits<double>::quiet_NaN());
  if (contacts.empty()) return out;
  const double arm2 = arms / static_cast<double>(contacts.size());
  const double weight = arm2 > 0.0 ? 1.0 / arm2 : 0.0;
  const double square = force.squaredNorm() + weight * torque.squaredNorm();
  if (!(std::sqrt(square) > kCancelled * all)) return out;
  const double scale = std::max((force_W.dot(force) + weight * torque_W.dot(torque)) / square, 0.0);
  for (std::size_t i = 0; i < contacts.size(); ++i) out[i] = scale * contacts[i].multiplier_kg_m;
  return out;
}

}  // namespace wrenchd
