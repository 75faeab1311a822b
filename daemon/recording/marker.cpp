// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/marker.hpp"

#include <algorithm>
#include <stdexcept>

#include "daemon/recording/recorded_event.hpp"

namespace wrenchd {
namespace {

bool has_control_characters(const std::string& text) {
  return std::any_of(text.begin(), text.end(),
                     [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; });
}

bool is_name(const std::string& text) {
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; };
  return !text.empty() && text.size() <= kConditionNameBytes && is_letter(text[0]) &&
         std::all_of(text.begin(), text.end(),
                     [&](char c) { return is_letter(c) || (c >= '0' && c <= '9'); });
}

void check_condition(const std::string& name, const Json& value) {
  if (!is_name(name))
    throw std::invalid_argument("the condition '" + name +
                                "' needs a name of letters, digits and underscores, at most " +
                                std::to_string(kConditionNameBytes) + ", that begins with no digit");
  if (value.is_number()) return;
  if (!value.is_string())
    throw std::invalid_argument("the condition '" + name +
                                "' is neither a number nor a text; give one of them");
  const auto text = value.get<std::string>();
  if (text.size() > kConditionTextBytes || has_control_characters(text))
    throw std::invalid_argument("the text of the condition '" + name + "' must be one line of at most " +
                                std::to_string(kConditionTextBytes) + " bytes");
}

}  // namespace

void check_marker(const std::string& label, const Json& conditions) {
  if (label.empty() || label.size() > kMarkerLabelBytes || has_control_characters(label))
    throw std::invalid_argument("the label of a marker must be one line of 1 to " +
                                std::to_string(kMarkerLabelBytes) + " bytes");
  if (conditions.size() > kMarkerConditions)
    throw std::invalid_argument("a marker has at most " + std::to_string(kMarkerConditions) +
                                " conditions; set the others with a second marker");
  for (const auto& [name, value] : conditions.items()) check_condition(name, value);
  if (conditions.dump().size() > RecordedEvent::kConditionsBytes)
    throw std::invalid_argument("the conditions of a marker have at most " +
                                std::to_string(RecordedEvent::kConditionsBytes) +
                                " bytes as JSON; set some of them with a second marker");
}

bool MarkerRate::admit(TimePoint now) noexcept {
  credit_ = std::min(kBurst, credit_ + kPerSecond * seconds(std::max(now - last_, TimePoint::duration{})));
  last_ = now;
  if (credit_ < 1.0) return false;
  credit_ -= 1.0;
  return true;
}

}  // namespace wrenchd
