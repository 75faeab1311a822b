// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/marker_columns.hpp"

#include <algorithm>

namespace wrenchd {
namespace {

/// Returns the conditions of each marker, an object each, in the order of the markers' times.
std::vector<std::pair<const RecordedEvent*, Json>> sorted_markers(const Recording& recording) {
  std::vector<std::pair<const RecordedEvent*, Json>> markers;
  for (const RecordedEvent& event : recording.events) {
    if (event.name != "marker") continue;
    Json conditions =
        event.conditions.empty() ? Json::object() : Json::parse(event.conditions, nullptr, false);
    if (!conditions.is_object())
      throw RecordingError("the conditions of the marker '" + event.text +
                           "' are not a JSON object; the file was changed, take it as it was recorded");
    markers.emplace_back(&event, std::move(conditions));
  }
  std::stable_sort(markers.begin(), markers.end(),
                   [](const auto& a, const auto& b) { return a.first->time_ns < b.first->time_ns; });
  return markers;
}

}  // namespace

MarkerColumns::MarkerColumns(const Recording& recording) {
  const auto markers = sorted_markers(recording);
  for (const auto& marker : markers)
    for (const auto& [name, value] : marker.second.items())
      if (std::find(conditions_.begin(), conditions_.end(), name) == conditions_.end())
        conditions_.push_back(name);
  std::vector<Json> held(conditions_.size());
  for (const auto& [event, set] : markers) {
    for (std::size_t i = 0; i < conditions_.size(); ++i)
      if (const auto value = set.find(conditions_[i]); value != set.end()) held[i] = *value;
    steps_.push_back({event->time_ns, event->text, held});
  }
}

const MarkerColumns::Step* MarkerColumns::at(std::int64_t now_ns) const noexcept {
  const auto after = std::upper_bound(steps_.begin(), steps_.end(), now_ns,
                                      [](std::int64_t t, const Step& step) { return t < step.time_ns; });
  return after == steps_.begin() ? nullptr : &*(after - 1);
}

}  // namespace wrenchd
