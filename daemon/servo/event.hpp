// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <type_traits>
#include <variant>

#include <boost/lockfree/spsc_queue.hpp>

#include "core/clock.hpp"
#include "core/fault.hpp"
#include "core/state.hpp"
#include "daemon/servo/wait_reason.hpp"

namespace wrenchd {

/// Something that happened in a tick and is worth a line in the log. It holds no text, so that the servo
/// thread can make one without allocating. daemon/control/event_description.cpp turns events into text and
/// JSON.
struct Event {
  struct StateChanged {
    State state;  ///< State that the loop entered.
    Fault cause;  ///< Fault that led to it, or none.
  };
  struct FaultRaised {
    Fault fault;
    double value;               ///< Measured size of the fault, in SI units; 0 if the fault has no size.
    bool changed_state = true;  ///< True if the fault led to another state.
  };
  struct StiffnessScaled {
    double scale;  ///< Share of the configured stiffness that stays passive on this device, 0 to 1.
  };
  /// The profile states no damping, so no stiffness bound can be computed.
  struct StabilityBoundUnknown {};
  struct ArmingRejected {
    State state;  ///< State in which the request to arm came.
  };
  /// No admissible pose exists near the proxy; the proxy stays where it was.
  struct ProjectionInfeasible {};
  /// The proxy is invalid; the wrench is zero until a feasible pose is found.
  struct ProxySearchStarted {};
  struct ProxyFound {
    double distance_m;  ///< Distance from the commanded pose p to the feasible pose that was found.
  };
  /// No feasible pose was found; the search is repeated.
  struct ProxySearchFailed {};
  /// The loop has waited for the same condition for a second.
  struct Waits {
    State state;
    WaitReason reason;
  };
  /// The hand was released: zero wrench, motors off.
  struct Released {};
  struct CrossfadeStarted {
    std::uint32_t rendering_id;  ///< Rendering that replaces the active one.
  };
  struct RenderingChanged {
    std::uint32_t rendering_id;  ///< Rendering that is active from now on.
  };
  /// The tool holds a free body.
  struct Grasped {
    std::uint32_t body;  ///< Number of the body, from 1 in the order of the scene.
  };
  struct LetGo {
    std::uint32_t body;
    bool broke;  ///< True if the load was larger than the strength of the grasp.
  };
  using Data = std::variant<StateChanged, FaultRaised, StiffnessScaled, StabilityBoundUnknown, ArmingRejected,
                            ProjectionInfeasible, ProxySearchStarted, ProxyFound, ProxySearchFailed, Released,
                            CrossfadeStarted, RenderingChanged, Waits, Grasped, LetGo>;

  TimePoint at{};  ///< Start of the tick in which it happened, on the monotonic clock.
  Data data;
};
static_assert(std::is_trivially_copyable_v<Event>);

/// Carries events from the servo thread to one reader. When it is full, it drops events and counts them: the
/// loop never waits for the reader.
class EventQueue {
 public:
  /// By the servo thread. RT-safe.
  void emit(TimePoint at, const Event::Data& data) noexcept {
    if (!ring_.push(Event{at, data})) dropped_.fetch_add(1, std::memory_order_relaxed);
  }

  /// By the reader: takes the oldest event. Returns false if there is none. RT-safe.
  bool pop(Event& event) noexcept { return ring_.pop(event); }
  /// Number of events that were dropped so far. Any thread. RT-safe.
  std::uint64_t dropped() const noexcept { return dropped_.load(std::memory_order_relaxed); }

 private:
  boost::lockfree::spsc_queue<Event, boost::lockfree::capacity<1024>> ring_;
  std::atomic<std::uint64_t> dropped_{0};
};

}  // namespace wrenchd
