// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "core/fault.hpp"
#include "daemon/control/json_rpc.hpp"
#include "daemon/servo/event.hpp"

namespace wrenchd {

enum class EventLevel : std::uint8_t { info, warning, error };
/// "warning"
const char* name(EventLevel level) noexcept;

/// An event of the servo thread as people and programs read it.
struct EventDescription {
  std::string name;  ///< Name under which clients subscribe; feed_events() lists them.
  EventLevel level = EventLevel::info;
  std::string text;              ///< One line for the log.
  Json fields = Json::object();  ///< What the event says to programs.
};
/// Not RT-safe: allocates.
EventDescription describe(const Event& event);

/// The fault as status and events give it: name, message and cure; null for Fault::none. Not RT-safe:
/// allocates.
Json fault_json(Fault fault);

/// True if the fault latches, or releases the hand.
bool is_severe(Fault fault) noexcept;

}  // namespace wrenchd
