// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/fault_text.hpp"

#include <algorithm>
#include <stdexcept>
#include <vector>

#include <spdlog/fmt/fmt.h>

#include "config/nearest_key.hpp"
#include "core/fault.hpp"

namespace wrenchd {
namespace {

double milliseconds(Duration d) {
  return 1e3 * seconds(d);
}

/// Returns when the reaction begins, measured from the moment at which the fault is detectable.
std::string begin_text(const FaultRow& row) {
  if (row.persistence == Duration{0}) return "in the same tick";
  return fmt::format("after {:.0f} ms, within one tick", milliseconds(row.persistence));
}

/// Returns when the force has ended, measured from the same moment.
std::string end_text(Reaction reaction) {
  switch (reaction) {
    case Reaction::none:
      return "the force remains";
    case Reaction::fade_100ms:
    case Reaction::fade_10ms:
      return fmt::format("no force {:.0f} ms later", milliseconds(time_to_zero(reaction)));
    default:
      return "no force in that tick";
  }
}

/// Returns the effect of a fault on an active loop.
std::string reaction_text(const FaultRow& row) {
  const Transition& from_active = transition(row.trigger, State::active);
  if (!from_active.changes_state) return "the loop reports it, and the force remains";
  return fmt::format("state {}; {}, {}", name(from_active.to), begin_text(row),
                     end_text(std::max(from_active.reaction, row.reaction)));
}

std::string paragraph(const FaultRow& row) {
  return fmt::format(
      "{}\n  description  {}\n  detection    {}\n  reaction     {}\n  reason       {}\n"
      "  remedy       {}\n",
      row.name, row.message, row.detector, reaction_text(row), row.reason, row.cure);
}

std::string state_names(StateSet set) {
  std::string names;
  for (std::size_t s = 0; s < kStateCount; ++s)
    if (contains(set, static_cast<State>(s)))
      names += (names.empty() ? "" : ", ") + std::string(name(static_cast<State>(s)));
  return names;
}

}  // namespace

std::string fault_text() {
  std::string text;
  for (const FaultRow& row : fault_rows()) text += paragraph(row) + "\n";
  return text +
         fmt::format("{} faults. wrenchctl faults --states shows the state machine.\n", fault_rows().size());
}

std::string fault_text(const std::string& name) {
  std::string names;
  std::vector<std::string> known;
  for (const FaultRow& row : fault_rows()) {
    if (row.name == name) return paragraph(row);
    names += (names.empty() ? "" : ", ") + std::string(row.name);
    known.emplace_back(row.name);
  }
  const std::string advice = nearest_name_advice(name, known);
  throw std::runtime_error("there is no fault '" + name + "'" +
                           (advice.empty() ? "; the names are " + names : advice));
}

std::string state_machine_text() {
  std::string text = fmt::format("{:<13} {:<58} {:<13} {:<12} {:<10} {}\n", "trigger", "in the states",
                                 "next state", "force", "zero in", "reason");
  for (const Transition& row : transitions()) {
    const std::string to = row.changes_state ? name(row.to) : "-";
    const std::string within = row.reaction == Reaction::none ? "-"
                               : time_to_zero(row.reaction) == Duration{0}
                                   ? "1 tick"
                                   : fmt::format("{:.0f} ms", milliseconds(time_to_zero(row.reaction)));
    text += fmt::format("{:<13} {:<58} {:<13} {:<12} {:<10} {}\n", name(row.trigger), state_names(row.from),
                        to, name(row.reaction), within, row.reason);
  }
  return text;
}

}  // namespace wrenchd
