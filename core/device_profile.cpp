// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/device_profile.hpp"

#include <array>

namespace wrenchd {
namespace {

DofMask sensed_in(const PoseReportLayout& layout) noexcept {
  DofMask dofs = kNoDof;
  if (layout.position.present || layout.translation.present) dofs |= kLinearDofs;
  if (layout.orientation.present || layout.rotation.present) dofs |= kAngularDofs;
  return dofs;
}

}  // namespace

DofMask sensed_dofs(const DeviceProfile& profile) noexcept {
  if (pose_source(profile) == PoseSource::joints)
    return profile.kinematics.joints == kMaxJoints ? kAllDofs : kLinearDofs;
  DofMask dofs = sensed_in(profile.pose_report);
  for (const PoseReportLayout& layout : profile.more_reports) dofs |= sensed_in(layout);
  return dofs;
}

DofMask driven_dofs(const DeviceProfile& profile) noexcept {
  if (!profile.has_output) return kNoDof;
  DofMask dofs = kNoDof;
  if (profile.wrench_report.force.present || profile.wrench_report.efforts.present) dofs |= kLinearDofs;
  if (profile.wrench_report.torque.present) dofs |= kAngularDofs;
  return dofs;
}

DofMask nonzero_dofs(const Wrench& F) noexcept {
  unsigned dofs = 0;
  for (unsigned i = 0; i < 3; ++i) {
    if (F.force_N[i] != 0.0) dofs |= 1u << i;
    if (F.torque_Nm[i] != 0.0) dofs |= 8u << i;
  }
  return static_cast<DofMask>(dofs);
}

Wrench restrict_to_dofs(Wrench F, DofMask dofs) noexcept {
  for (unsigned i = 0; i < 3; ++i) {
    if ((dofs >> i & 1u) == 0) F.force_N[i] = 0.0;
    if ((dofs >> i & 8u) == 0) F.torque_Nm[i] = 0.0;
  }
  return F;
}

const char* text(Transport transport) noexcept {
  switch (transport) {
    case Transport::loopback:
      return "loopback";
    case Transport::hidraw:
      return "hidraw";
    case Transport::libusb:
      return "libusb";
  }
  return "unknown";
}

std::string dof_text(DofMask dofs) {
  constexpr std::array<const char*, 6> kNames = {"x", "y", "z", "rx", "ry", "rz"};
  std::string names;
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if ((dofs >> i & 1u) == 0) continue;
    names += names.empty() ? "" : " ";
    names += kNames[i];
  }
  return names.empty() ? "none" : names;
}

}  // namespace wrenchd
