// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "daemon/journal.hpp"
#include "daemon/servo/event.hpp"

namespace wrenchd {

/// Returns the fields of an event's journal entry, by which journalctl finds it:
///
///   MESSAGE_ID         one id for states, one for faults, one for all other events
///   WRENCHD_STATE      the state that the loop entered, or in which a request to arm was rejected
///   WRENCHD_FAULT      name of the fault
///   WRENCHD_CURE       what to do about the fault
///   WRENCHD_TIME_NS    monotonic time at which the servo thread emitted the event [ns]
///
/// Not RT-safe: allocates.
JournalFieldList journal_fields(const Event& event);

/// Message ids, for `journalctl MESSAGE_ID=...`.
inline constexpr const char* kStateMessageId = "4e4882be19de4db6b9953f47b8c2b7ef";
inline constexpr const char* kFaultMessageId = "97836e6f60a2477cb2efbfb243d6577f";
inline constexpr const char* kRenderingMessageId = "e746b232b843498ebd9f18da5ddae19d";

}  // namespace wrenchd
