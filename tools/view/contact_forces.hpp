// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <vector>

#include <wrenchd/state_reader.hpp>

#include "core/pose.hpp"

namespace wrenchd {

/// Returns the normal force of each contact [N]: its share of a wrench on the tool. The multipliers of METHOD
/// (35) have the ratios of the contact forces, not their size, which depends on the law and on all limits.
/// Therefore one common factor s >= 0 scales all of them so that the wrench of the contacts
///
///   sum s multiplier_i [n_i; (p_i - p_W) x n_i]
///
/// is closest to the given wrench by least squares; torques count as forces at the root mean square of the
/// lever arms. Friction and damping are not part of a contact's force. All results are NaN if the contact
/// wrenches cancel each other, which determines no factor. p_W: the point of the torque. All arguments in the
/// world. Not RT-safe: allocates.
std::vector<double> contact_forces_N(std::span<const ProxyContact> contacts, const Vector3d& p_W_m,
                                     const Vector3d& force_W, const Vector3d& torque_W);

}  // namespace wrenchd
