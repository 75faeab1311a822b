// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "daemon/control/event_description.hpp"

namespace wrenchd {

/// An event of the daemon, or a marker of an experiment, as a recording contains it.
struct RecordedEvent {
  /// Largest sizes in a recording [bytes]. Longer texts are cut at the end of a character.
  static constexpr std::size_t kNameBytes = 32;
  static constexpr std::size_t kTextBytes = 512;
  static constexpr std::size_t kConditionsBytes = 1024;

  std::int64_t time_ns = 0;  ///< Time of the event, on the clock of the ticks.
  std::int64_t tick = -1;    ///< Tick that was in progress; -1 if no tick was stored at that time.
  EventLevel severity = EventLevel::info;
  std::string name;  ///< Kind of the event, as in feed_events(): "state", "fault", "marker".
  std::string text;  ///< The event for people; of a marker: its label.
  /// Size of a fault [SI], scale of the stiffness, distance of the proxy [m] or number of the rendering; NaN
  /// if the event has no number.
  double value = std::numeric_limits<double>::quiet_NaN();
  std::string conditions;  ///< Conditions of a marker: a JSON object of numbers and texts; empty: none.
};

/// Returns the longest beginning of an UTF-8 text that has at most this many bytes and ends between two
/// characters. Not RT-safe: allocates.
std::string cut_text(std::string_view text, std::size_t max_bytes);

}  // namespace wrenchd
