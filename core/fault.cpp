// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/fault.hpp"

namespace wrenchd {

FaultText text(Fault fault) noexcept {
  switch (fault) {
    case Fault::none:
      return {"none", "nothing is wrong", "nothing to do"};
    case Fault::device_lost:
      return {"device_lost", "the device left the bus", "plug it in again; wrenchd comes back disarmed"};
    case Fault::pose_not_finite:
      return {"pose_not_finite", "the device reported a pose that is not a number",
              "compare the profile's report layout with the device's firmware"};
    case Fault::pose_not_a_rotation:
      return {"pose_not_a_rotation", "the reported orientation is too far from a unit quaternion",
              "check byte offset, order (x y z w) and step of 'orientation' in the profile"};
    case Fault::pose_teleported:
      return {"pose_teleported", "the pose moved farther between two reports than a hand can",
              "home the device; check cables and encoders, and the speed limits in the profile"};
    case Fault::overspeed:
      return {"overspeed", "the handle moved faster than the profile allows",
              "hold the handle before arming; lower the stiffness if it ran away by itself"};
    case Fault::sample_stale:
      return {"sample_stale", "no new pose arrived for too long",
              "use a direct USB port; compare the device's report rate with the profile"};
    case Fault::wrench_not_finite:
      return {"wrench_not_finite", "the rendering produced a wrench that is not a number",
              "keep the recording and report it with the scene: this is a defect of wrenchd"};
    case Fault::write_failed:
      return {"write_failed", "the device did not take a wrench",
              "use a direct USB port; the device's own watchdog has switched its motors off by now"};
  }
  return {"unknown", "an unknown fault value", "report it: this is a defect of wrenchd"};
}

}  // namespace wrenchd
