// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "daemon/journal.hpp"
#include "daemon/servo/event.hpp"

namespace wrenchd {

/// What an entry of the journal says of an event in fields, so that it can be asked for:
///
///   MESSAGE_ID         of states, of faults, or of the rest
///   WRENCHD_STATE      the state that was entered, or the one in which arming was refused
///   WRENCHD_FAULT      the fault
///   WRENCHD_CURE       what to do about it
///   WRENCHD_TIME_NS    monotonic time at which the servo thread said it
JournalFieldList journal_fields(const Event& event);

/// The ids, for `journalctl MESSAGE_ID=...`.
inline constexpr const char* kStateMessageId = "4e4882be19de4db6b9953f47b8c2b7ef";
inline constexpr const char* kFaultMessageId = "97836e6f60a2477cb2efbfb243d6577f";
inline constexpr const char* kRenderingMessageId = "e746b232b843498ebd9f18da5ddae19d";

}  // namespace wrenchd
