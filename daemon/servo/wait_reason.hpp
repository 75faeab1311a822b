// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <type_traits>

#include "core/clock.hpp"
#include "core/fault.hpp"
#include "core/state.hpp"

namespace wrenchd {

struct Demand;
struct DeviceSample;

/// Why a loop that is armed, or tests a device, gives no force yet: the first condition that does not hold.
/// It holds no text, so that the servo thread can make one; daemon/wait_text.hpp turns it into text.
struct WaitReason {
  enum class Kind : std::uint8_t {
    none,            ///< Nothing is missing: the force rises soon, or the state does not wait.
    no_report,       ///< No report has arrived for `value` [s].
    not_homed,       ///< The encoders have no reference.
    fault,           ///< A fault repeats that does not latch.
    proxy_search,    ///< The proxy is being searched for.
    no_room,         ///< The tool does not fit where the handle is.
    handle_moves,    ///< Speed `value`, at most `limit` [m/s].
    handle_turns,    ///< Angular speed `value`, at most `limit` [rad/s].
    contact_pushes,  ///< The contacts would push with `value`, at most `limit` [N].
    contact_twists,  ///< The contacts would twist with `value`, at most `limit` [N.m].
  };
  Kind kind = Kind::none;
  Fault fault = Fault::none;
  double value = 0.0;
  double limit = 0.0;
  std::array<double, 3> to_proxy_W_m{};  ///< As CalmCondition; for contact_pushes and contact_twists.
  double to_proxy_rad = 0.0;
};
static_assert(std::is_trivially_copyable_v<WaitReason>);

/// Returns what State::waiting or State::self_test waits for; Kind::none in other states. RT-safe.
WaitReason wait_reason(State state, FaultSet faults, const DeviceSample& sample, const Demand& demand,
                       TimePoint now) noexcept;

/// Name of a kind for programs, for example "contact_pushes". RT-safe.
const char* name(WaitReason::Kind kind) noexcept;

}  // namespace wrenchd
