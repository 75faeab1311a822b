// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/event_journal.hpp"

#include <chrono>

#include "core/fault.hpp"
#include "core/state.hpp"

namespace wrenchd {

JournalFieldList journal_fields(const Event& event) {
  const auto ns = std::chrono::duration_cast<std::chrono::nanoseconds>(event.at.time_since_epoch()).count();
  JournalFieldList fields = {{"WRENCHD_TIME_NS", std::to_string(ns)}};
  if (const auto* state = std::get_if<Event::StateChanged>(&event.data)) {
    fields.emplace_back("MESSAGE_ID", kStateMessageId);
    fields.emplace_back("WRENCHD_STATE", name(state->state));
  } else if (const auto* raised = std::get_if<Event::FaultRaised>(&event.data)) {
    const FaultRow& row = fault_row(raised->fault);
    fields.emplace_back("MESSAGE_ID", kFaultMessageId);
    fields.emplace_back("WRENCHD_FAULT", row.name);
    fields.emplace_back("WRENCHD_CURE", row.cure);
  } else {
    fields.emplace_back("MESSAGE_ID", kRenderingMessageId);
    if (const auto* rejected = std::get_if<Event::ArmingRejected>(&event.data))
      fields.emplace_back("WRENCHD_STATE", name(rejected->state));
  }
  return fields;
}

}  // namespace wrenchd
