// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/event_description.hpp"

#include <fmt/format.h>

#include "core/transitions.hpp"
#include "daemon/wait_text.hpp"

namespace wrenchd {
namespace {

/// The measured size of a fault, for those that have one.
std::string measured(Fault fault, double value) {
  switch (fault) {
    case Fault::tick_late:
    case Fault::loop_stalled:
    case Fault::wrench_late:
      return fmt::format(" ({:.1f} ms)", 1e3 * value);
    case Fault::self_test_rate:
      return fmt::format(" ({:.0f} reports/s)", value);
    default:
      return {};
  }
}

EventDescription describe_event(const Event::StateChanged& e) {
  return {"state",
          EventLevel::info,
          fmt::format("state: {}", name(e.state)),
          {{"state", name(e.state)}, {"cause", fault_json(e.cause)}}};
}

EventDescription describe_event(const Event::FaultRaised& e) {
  const FaultRow& row = fault_row(e.fault);
  return {"fault",
          is_severe(e.fault) ? EventLevel::error : EventLevel::warning,
          fmt::format("{}: {}{}; {}", row.name, row.message, measured(e.fault, e.value), row.cure),
          {{"fault", fault_json(e.fault)}, {"value", e.value}, {"repeats", 0}}};
}

EventDescription describe_event(const Event::StiffnessScaled& e) {
  if (e.scale >= 1.0)
    return {"stiffness",
            EventLevel::info,
            "the configured stiffness is within the stability bound; it is no longer scaled",
            {{"scale", e.scale}}};
  return {"stiffness",
          EventLevel::warning,
          fmt::format(
              "the stability bound at the measured rate and delay scales the stiffness to {:.0f} %; lower "
              "the stiffness in [wrench], or state more damping in the profile if the device has more",
              100.0 * e.scale),
          {{"scale", e.scale}}};
}

EventDescription describe_event(const Event::StabilityBoundUnknown&) {
  return {"stiffness",
          EventLevel::warning,
          "the profile states no damping, so the stability bound is unknown: measure the damping of the "
          "device, and "
          "state damping_N_s_per_m and damping_Nm_s_per_rad",
          {{"scale", nullptr}}};
}

EventDescription describe_event(const Event::ArmingRejected& e) {
  return {"arming_rejected",
          EventLevel::warning,
          fmt::format("not armed: {}", transition(Trigger::arm, e.state).reason),
          {{"state", name(e.state)}}};
}

EventDescription describe_event(const Event::ProjectionInfeasible&) {
  return {"proxy_initialization",
          EventLevel::warning,
          "no admissible pose near the hand: the obstacles leave no room; the proxy stays where it was",
          {{"outcome", "projection_infeasible"}}};
}

EventDescription describe_event(const Event::ProxySearchStarted&) {
  return {"proxy_initialization",
          EventLevel::info,
          "proxy initialization: wrenchd searches the admissible pose nearest to the hand; zero wrench until "
          "then",
          {{"outcome", "searching"}}};
}

EventDescription describe_event(const Event::ProxyFound& e) {
  return {"proxy_initialization",
          EventLevel::info,
          fmt::format("proxy initialized {:.1f} mm from the hand", 1e3 * e.distance_m),
          {{"outcome", "found"}, {"distance_m", e.distance_m}}};
}

EventDescription describe_event(const Event::ProxySearchFailed&) {
  return {"proxy_initialization",
          EventLevel::warning,
          "no admissible pose found: the tool does not fit where the hand is; zero wrench, and the search "
          "repeats. "
          "Move the handle to where the tool has room",
          {{"outcome", "failed"}}};
}

EventDescription describe_event(const Event::Waits& e) {
  return {"waits",
          EventLevel::warning,
          fmt::format("{}: {}", name(e.state), wait_text(e.reason)),
          {{"state", name(e.state)},
           {"reason", name(e.reason.kind)},
           {"fault", fault_json(e.reason.fault)},
           {"value", e.reason.value},
           {"limit", e.reason.limit}}};
}

EventDescription describe_event(const Event::Released&) {
  return {"released", EventLevel::info, "the hand is released: zero wrench, motors off", Json::object()};
}

EventDescription describe_event(const Event::CrossfadeStarted& e) {
  return {"scene",
          EventLevel::info,
          fmt::format("crossfade to rendering {} begins", e.rendering_id),
          {{"rendering_id", e.rendering_id}, {"crossfade_complete", false}}};
}

EventDescription describe_event(const Event::RenderingChanged& e) {
  return {"scene",
          EventLevel::info,
          fmt::format("rendering {} is active", e.rendering_id),
          {{"rendering_id", e.rendering_id}, {"crossfade_complete", true}}};
}

EventDescription describe_event(const Event::Grasped& e) {
  return {"grasp",
          EventLevel::info,
          fmt::format("the tool holds body {}", e.body),
          {{"body", e.body}, {"held", true}, {"broke", false}}};
}

EventDescription describe_event(const Event::LetGo& e) {
  return {"grasp",
          EventLevel::info,
          e.broke ? fmt::format("the tool lost body {}: its load was larger than the strength of the grasp "
                                "([rendering.grasp])",
                                e.body)
                  : fmt::format("the tool let go of body {}", e.body),
          {{"body", e.body}, {"held", false}, {"broke", e.broke}}};
}

}  // namespace

EventDescription describe(const Event& event) {
  return std::visit([](const auto& data) { return describe_event(data); }, event.data);
}

Json fault_json(Fault fault) {
  if (fault == Fault::none) return nullptr;
  const FaultRow& row = fault_row(fault);
  return {{"name", row.name}, {"message", row.message}, {"cure", row.cure}};
}

bool is_severe(Fault fault) noexcept {
  const Trigger trigger = fault_row(fault).trigger;
  return trigger == Trigger::hard_fault || trigger == Trigger::self_test_failed || trigger == Trigger::stop ||
         trigger == Trigger::device_disconnected;
}

const char* name(EventLevel level) noexcept {
  switch (level) {
    case EventLevel::info:
      return "info";
    case EventLevel::warning:
      return "warning";
    case EventLevel::error:
      return "error";
  }
  return "unknown";
}

}  // namespace wrenchd
