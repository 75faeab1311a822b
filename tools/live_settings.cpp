// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/live_settings.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <optional>
#include <set>
#include <stdexcept>

#include <spdlog/fmt/fmt.h>

#include "config/nearest_key.hpp"
#include "config/toml_file.hpp"
#include "tools/daemon_call.hpp"

namespace wrenchd {
namespace {

/// Sections of the settings. A user may write "rendering" before every setting, because rendering.set sets
/// all.
constexpr std::string_view kSections[] = {"rendering.", "wrench."};
/// Longest soft start and a margin: after that, a rendering that has not arrived is reported as such.
constexpr auto kLongestCrossfade = std::chrono::seconds(6);

std::string text_of(const Json& row, const char* key) {
  const auto found = row.find(key);
  return found != row.end() && found->is_string() ? found->get<std::string>() : "";
}

std::string without_section(const std::string& name) {
  for (const std::string_view section : kSections)
    if (name.starts_with(section)) return name.substr(section.size());
  return name;
}

/// "stiffness.linear" for "stiffness.linear_N_per_m"
std::string without_unit(const std::string& name) {
  const std::size_t length = unit_of(name).size();
  return length == 0 ? name : name.substr(0, name.size() - length - 1);
}

/// "wrench.stiffness" for "wrench.stiffness.linear_N_per_m"; empty for a setting that is not part of a gain.
std::string gain_of(const std::string& name) {
  const std::size_t dot = name.rfind('.');
  const std::string component = name.substr(dot + 1);
  return component.starts_with("linear_") || component.starts_with("angular_") ? name.substr(0, dot) : "";
}

/// Returns true if the user may mean this setting by the name.
bool means(const std::string& typed, const std::string& name) {
  const std::string wanted = without_section(typed), full = without_section(name);
  const std::string stem = without_unit(full);
  if (wanted == full || wanted == stem || wanted == without_section(gain_of(name))) return true;
  return wanted == stem.substr(stem.rfind('.') + 1) && gain_of(name).empty();
}

/// A unit without the signs in which notations differ: "N.m/rad" and "N*m / rad" are "Nm/rad".
std::string plain_unit(const std::string& unit) {
  std::string plain;
  for (const char c : unit)
    if (std::string_view(" .*^_()").find(c) == std::string_view::npos) plain += c;
  return plain;
}

bool is_unit_of(const Json& row, const std::string& unit) {
  return unit.empty() || plain_unit(unit) == plain_unit(row["unit"]) ||
         unit == unit_of(row["name"].get<std::string>());
}

std::optional<double> number_at_start(const std::string& text, std::string& rest) {
  double number = 0.0;
  const char* const end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data(), end, number);
  if (parsed.ec != std::errc()) return {};
  const char* next = parsed.ptr;
  while (next != end && *next == ' ') ++next;
  rest.assign(next, end);
  return number;
}

/// Returns true for every unit, also of another quantity: "kN/m", "N.m/rad", "1/s2".
bool is_unit(const std::string& word) {
  std::string key;
  for (const char c : word.starts_with("1/") ? word.substr(1) : word) {
    if (c == '/')
      key += key.empty() ? "per_" : "_per_";
    else if (c == '.' || c == '*')
      key += '_';
    else if (c != '^')
      key += c;
  }
  return !key.empty() && unit_of("x_" + key) == key;
}

bool is_number(const std::string& text) {
  std::string rest;
  return number_at_start(text, rest) && rest.empty();
}

/// Returns true if some setting has this name; a wrong name is no error here.
bool names_setting(const std::string& word, const Json& settings) {
  return std::any_of(settings.begin(), settings.end(),
                     [&](const Json& row) { return means(word, row["name"].get<std::string>()); });
}

std::string names_of(const std::vector<Json>& rows) {
  std::string names;
  for (const Json& row : rows) names += (names.empty() ? "" : ", ") + row["name"].get<std::string>();
  return names;
}

std::string value_text(const Json& value) {
  if (value.is_number()) return to_text(value.get<double>());
  if (value.is_string()) return value.get<std::string>();
  return value.dump();
}

/// Of the components of a gain, the unit selects one; without a unit, the translational one is meant.
const Json& component_of(const std::vector<Json>& rows, const std::string& unit) {
  if (unit.empty()) return rows.front();
  for (const Json& row : rows)
    if (is_unit_of(row, unit)) return row;
  return rows.front();
}

std::string example(const Json& row) {
  return "wrenchctl set " + row["name"].get<std::string>() + "=" + value_text(row["value"]);
}

Json value_of(const Assignment& assignment, const Json& row) {
  const auto name = row["name"].get<std::string>();
  if (row.contains("words")) {
    if (!assignment.unit.empty())
      throw std::runtime_error(name + ": a word has no unit; leave '" + assignment.unit + "' out");
    return assignment.value;
  }
  std::string rest;
  const auto number = number_at_start(assignment.value, rest);
  if (!number || !std::isfinite(*number))
    throw std::runtime_error(name + ": expected " + text_of(row, "expected") + ", found '" +
                             assignment.value + "', as in " + example(row));
  if (!is_unit_of(row, assignment.unit)) {
    const auto unit = row["unit"].get<std::string>();
    throw std::runtime_error(name + ": '" + assignment.unit + "' is not its unit; " +
                             (unit.empty() ? "it has none" : "give the value in " + unit) + ", as in " +
                             example(row));
  }
  return *number;
}

/// Sets the key of a dotted name in nested tables.
void set_key(Json& request, const std::string& name, const Json& value) {
  const std::size_t dot = name.find('.');
  if (dot == std::string::npos)
    request[name] = value;
  else
    set_key(request[name.substr(0, dot)], name.substr(dot + 1), value);
}

bool has_key(const Json& request, const std::string& name) {
  const std::size_t dot = name.find('.');
  const auto found = request.find(name.substr(0, dot));
  if (found == request.end()) return false;
  return dot == std::string::npos || has_key(*found, name.substr(dot + 1));
}

/// The loader accepts a gain only with both components. Adds the one that is not assigned.
void complete_gains(Json& request, const Json& settings) {
  for (const Json& row : settings) {
    const auto name = row["name"].get<std::string>();
    const std::string gain = gain_of(name);
    if (gain.empty() || !has_key(request, gain) || has_key(request, name)) continue;
    if (!request[gain.substr(0, gain.find('.'))][gain.substr(gain.find('.') + 1)].is_object()) continue;
    if (!row["value"].is_number())
      throw std::runtime_error(gain + ": the present gain is a matrix; assign both components, or all of " +
                               gain + " as [[...], ...]");
    set_key(request, name, row["value"]);
  }
}

/// Waits until the loop renders this rendering. Returns false if it does not in time, or does not tick.
bool wait_for_rendering(Client& client, std::uint32_t id) {
  const auto end = std::chrono::steady_clock::now() + kLongestCrossfade;
  while (std::chrono::steady_clock::now() < end) {
    ClientEvent received;
    if (!client.poll_event(received, std::chrono::milliseconds(100))) continue;
    const Json event = Json::parse(received.json);
    if (event["name"] == "scene" && event["crossfade_complete"] == true && event["rendering_id"] >= id)
      return true;
  }
  return false;
}

void show_settings(const std::vector<std::string>& names, const Json& settings, const ControlOptions& options,
                   const Json& present) {
  std::vector<Json> rows;
  if (names.empty()) rows.assign(settings.begin(), settings.end());
  for (const std::string& name : names)
    for (const Json& row : find_settings(name, settings)) rows.push_back(row);
  if (options.json) return print(pretty(names.empty() ? present : Json(rows)));
  print(settings_text(rows));
}

}  // namespace

std::vector<Assignment> assignments_of(const std::vector<std::string>& words, const Json& settings) {
  std::vector<Assignment> all;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    const std::size_t equals = word.find('=');
    Assignment& one = all.emplace_back(Assignment{word.substr(0, equals), {}, {}});
    if (one.name.empty())
      throw std::runtime_error("'" + word +
                               "': a name is missing before '=', as in wrenchctl set stiffness=600");
    if (equals != std::string::npos) {
      one.value = word.substr(equals + 1);
      if (one.value.empty())
        throw std::runtime_error(one.name +
                                 ": a value is missing after '='; leave '=' out to show the setting");
    } else if (i + 1 < words.size() && words[i + 1].find('=') == std::string::npos &&
               !names_setting(words[i + 1], settings)) {
      one.value = words[++i];
    }
    if (std::string rest; number_at_start(one.value, rest) && !rest.empty()) {
      one.value = one.value.substr(0, one.value.size() - rest.size());
      one.unit = rest;
    } else if (is_number(one.value) && i + 1 < words.size() && is_unit(words[i + 1])) {
      one.unit = words[++i];
    }
  }
  return all;
}

std::vector<Json> find_settings(const std::string& name, const Json& settings) {
  std::vector<Json> rows;
  std::vector<std::string> known;
  for (const Json& row : settings) {
    const auto full = row["name"].get<std::string>();
    if (full == name) return {row};
    if (means(name, full)) rows.push_back(row);
    for (const std::string& known_name : {full, without_section(full), without_unit(without_section(full)),
                                          gain_of(full), without_section(gain_of(full))})
      if (!known_name.empty()) known.push_back(known_name);
  }
  if (rows.empty()) {
    const std::string advice = nearest_name_advice(name, known);
    throw std::runtime_error("there is no setting '" + name + "'" +
                             (advice.empty() ? "; wrenchctl set lists all settings" : advice));
  }
  const std::string gain = gain_of(rows.front()["name"]);
  const bool one_gain = !gain.empty() && std::all_of(rows.begin(), rows.end(), [&](const Json& row) {
    return gain_of(row["name"]) == gain;
  });
  if (rows.size() > 1 && !one_gain)
    throw std::runtime_error("'" + name + "' is the name of several settings; choose one of " +
                             names_of(rows));
  return rows;
}

Json rendering_request(const std::vector<Assignment>& assignments, const Json& settings) {
  Json request = Json::object();
  for (const Assignment& assignment : assignments) {
    if (assignment.value.empty())
      throw std::runtime_error(assignment.name + ": a value is missing; wrenchctl set " + assignment.name +
                               " alone shows the setting");
    const std::vector<Json> rows = find_settings(assignment.name, settings);
    const std::string gain = gain_of(rows.front()["name"]);
    const bool matrix = !gain.empty() && assignment.value.starts_with('[');
    const Json& row = component_of(rows, assignment.unit);
    const std::string key = matrix ? gain : row["name"].get<std::string>();
    if (has_key(request, key)) throw std::runtime_error(key + ": it is assigned twice; keep one of the two");
    const Json value = matrix ? Json::parse(assignment.value, nullptr, false) : value_of(assignment, row);
    if (value.is_discarded())
      throw std::runtime_error(gain + ": '" + assignment.value +
                               "' is not a matrix, as in [[1, 0, ...], ...]");
    set_key(request, key, value);
  }
  complete_gains(request, settings);
  return request;
}

std::string settings_text(const std::vector<Json>& rows) {
  std::size_t name_width = 0, value_width = 0;
  const auto value_and_unit = [](const Json& row) {
    const std::string unit = text_of(row, "unit");
    return value_text(row["value"]) + (unit.empty() ? "" : " " + unit);
  };
  for (const Json& row : rows) {
    name_width = std::max(name_width, row["name"].get<std::string>().size());
    if (!row["value"].is_array()) value_width = std::max(value_width, value_and_unit(row).size());
  }
  std::string text;
  for (const Json& row : rows) {
    const std::string unused = text_of(row, "unused");
    text +=
        fmt::format("{:<{}}  {:<{}}  {}{}\n", row["name"].get<std::string>(), name_width, value_and_unit(row),
                    value_width, text_of(row, "expected"), unused.empty() ? "" : "; " + unused);
  }
  return text;
}

std::string changes_text(const Json& changed) {
  std::string text, undo;
  std::set<std::string> matrices;
  for (const Json& one : changed) {
    const auto name = one["name"].get<std::string>();
    const auto unit = one["unit"].get<std::string>();
    text += fmt::format("{}: {} -> {}{}\n", name, value_text(one["before"]), value_text(one["now"]),
                        unit.empty() ? "" : " " + unit);
    if (!one["before"].is_array())
      undo += " " + name + "=" + value_text(one["before"]);
    else if (matrices.insert(gain_of(name)).second)
      undo += " '" + gain_of(name) + "=" + value_text(one["before"]) + "'";
  }
  if (text.empty()) return "nothing changes: the settings have these values already\n";
  return text + "undo: wrenchctl set" + undo + "\n";
}

std::string scale_text(double scale_before, double scale_now, const Json& settings) {
  if (scale_before >= 1.0 && scale_now >= 1.0) return {};
  if (scale_now >= 1.0)
    return fmt::format("stability bound: scales nothing now; it scaled the stiffness to {:.3g} % before\n",
                       100.0 * scale_before);
  std::string rendered;
  for (const Json& row : settings) {
    const auto name = row["name"].get<std::string>();
    const bool spring = name == "wrench.energy_stiffness_per_s2" || gain_of(name) == "wrench.stiffness";
    if (!spring || row.contains("unused") || !row["value"].is_number()) continue;
    const auto value = row["value"].get<double>();
    rendered +=
        fmt::format("; {}: {:.6g} of {:.6g} {}", name, scale_now * value, value, text_of(row, "unit"));
  }
  return fmt::format("stability bound: scales the stiffness to {:.3g} % (before: {:.3g} %){}\n",
                     100.0 * scale_now, 100.0 * scale_before, rendered);
}

void run_set(const std::vector<std::string>& words, const ControlOptions& options) {
  Client client(options.socket, kResponseTimeout);
  const Json present = call(client, "rendering.get");
  const Json& settings = present["settings"];
  const std::vector<Assignment> assignments = assignments_of(words, settings);
  const bool shows = std::all_of(assignments.begin(), assignments.end(),
                                 [](const Assignment& one) { return one.value.empty(); });
  if (shows) {
    std::vector<std::string> names;
    for (const Assignment& one : assignments) names.push_back(one.name);
    return show_settings(names, settings, options, present);
  }
  const Json request = rendering_request(assignments, settings);
  const Json before = call(client, "subscribe", {{"events", Json::array({"scene"})}});
  const Json result = call(client, "rendering.set", request);
  if (options.json) return print(pretty(result));
  print(changes_text(result["changed"]));
  if (result["changed"].empty()) return;
  if (!wait_for_rendering(client, result["rendering_id"].get<std::uint32_t>()))
    return print(
        "the force still crosses over to the new values; wrenchctl set and status show the result\n");
  const Json rows = call(client, "rendering.get")["settings"];
  print(scale_text(before["stiffness_scale"].get<double>(),
                   call(client, "status")["stiffness_scale"].get<double>(), rows));
  for (const Json& one : result["changed"])
    for (const Json& row : rows)
      if (row["name"] == one["name"] && row.contains("unused"))
        print(fmt::format("note: {} has no effect now: {}\n", one["name"].get<std::string>(),
                          row["unused"].get<std::string>()));
}

}  // namespace wrenchd
