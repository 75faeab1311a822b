// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/device_profile.hpp"
#include "core/spatial.hpp"
#include "daemon/servo/calm_condition.hpp"
#include "daemon/servo/contact_state.hpp"

namespace wrenchd {

/// The wrench that the virtual world demands, before anything limits it. Wrenches are about the point and in
/// the axes that DeviceProfile::wrench_point names, without the components that the device has no motors for.
///
/// In a tick without a usable sample the wrenches are those of the previous tick, and no work is done.
struct Demand {
  Wrench F_contact;   ///< Wrench of contacts and local models.
  Wrench F_weight;    ///< Wrench that holds the weight of the handle.
  Wrench F_external;  ///< Wrench that another program requests.
  DofMask undriven =
      kNoDof;  ///< Components of these wrenches that are left out because the device has no motors for them.
  Wrench F_T;  ///< Of the contact alone, about the origin and in the axes of the body frame T.
  bool sample_usable = false;
  CalmCondition calm;  ///< The handle is slow, and full authority would not push it much.
  bool interrupted =
      false;  ///< The proxy became invalid in this tick, and not by a command: the ramp starts again.
  bool proxy_invalidated = false;  ///< The proxy became invalid in this tick, by a command or not.
  bool in_contact = false;
  double stored_energy_J = 0.0;  ///< Energy that the contact springs hold.
  double crossfade_work_J =
      0.0;  ///< Work that fading contacts in or out did on the springs since the last tick.
  double obstacle_work_J =
      0.0;  ///< Work that moving obstacles did on the springs, negative if they took some.
  double local_model_work_J = 0.0;   ///< Work that fading local models did on their springs.
  double external_declared_J = 0.0;  ///< Energy that the other program declared for its wrench in this tick.
  bool external_active = false;      ///< Another program acts on the hand, or its wrench still fades.
  double contact_gain = 1.0;         ///< Share of the contact wrench that the workspace lets through.
  double next_rendering_weight = 0.0;  ///< Share of the rendering that is being faded in.
  ContactState contact;                ///< The contact that the wrench is of.
};

}  // namespace wrenchd
