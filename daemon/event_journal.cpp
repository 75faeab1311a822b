// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/event_journal.hpp"

#include <chrono>

#include "core/fault.hpp"
#include "core/state.hpp"

namespace wrenchd {

JournalFieldList journal_fields(const Event& event) {
  const auto ns = std::chrono::duration_cast<std::chrono::nanoseconds>(event.at.time_since_epoch()).count();
  JournalFieldList fields = {{"WRENCHD_TIME_NS", std::to_string(ns)}};
  switch (event.kind) {
    case Event::Kind::state_changed:
      fields.emplace_back("MESSAGE_ID", kStateMessageId);
      fields.emplace_back("WRENCHD_STATE", name(static_cast<State>(event.detail)));
      break;
    case Event::Kind::fault_raised: {
      const FaultRow& row = fault_row(static_cast<Fault>(event.detail));
      fields.emplace_back("MESSAGE_ID", kFaultMessageId);
      fields.emplace_back("WRENCHD_FAULT", row.name);
      fields.emplace_back("WRENCHD_CURE", row.cure);
      break;
    }
    case Event::Kind::arming_refused:
      fields.emplace_back("MESSAGE_ID", kRenderingMessageId);
      fields.emplace_back("WRENCHD_STATE", name(static_cast<State>(event.detail)));
      break;
    default:
      fields.emplace_back("MESSAGE_ID", kRenderingMessageId);
      break;
  }
  return fields;
}

}  // namespace wrenchd
