// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/load_loopback_script.hpp"

#include <algorithm>

#include "config/toml_reader.hpp"

namespace wrenchd {
namespace {

using Kind = SimulatedFault::Kind;

constexpr Range kTime_s{0, 86400};

/// Valid range of `value` for a kind; an empty range if the kind has no value.
Range value_range(Kind kind) {
  switch (kind) {
    case Kind::drop_reports:
      return {1, 1000};
    case Kind::delay_reports:
      return {1e-4, 1};
    case Kind::jump:
    case Kind::vibrate:
      return {1e-6, 10};
    case Kind::drift:
      return {1e-3, 100};
    case Kind::press_button:
      return {0, 31};
    default:
      return {0, 0};
  }
}

void read_fault(TomlTable& table, LoopbackScript& script) {
  SimulatedFault fault;
  double at_s = 0.0, for_s = 0.0;
  table.mandatory("at_s").number(at_s, kTime_s);
  table.mandatory("for_s").number(for_s, {1e-6, 86400});
  table.mandatory("kind").choice(fault.kind, {{"unplug", Kind::unplug},
                                              {"silence", Kind::silence},
                                              {"freeze", Kind::freeze},
                                              {"repeat", Kind::repeat},
                                              {"swap", Kind::swap},
                                              {"drop_reports", Kind::drop_reports},
                                              {"delay_reports", Kind::delay_reports},
                                              {"corrupt", Kind::corrupt},
                                              {"short_report", Kind::short_report},
                                              {"long_report", Kind::long_report},
                                              {"wrong_id", Kind::wrong_id},
                                              {"reject_commands", Kind::reject_commands},
                                              {"drop_commands", Kind::drop_commands},
                                              {"stall", Kind::stall},
                                              {"bad_quaternion", Kind::bad_quaternion},
                                              {"jump", Kind::jump},
                                              {"drift", Kind::drift},
                                              {"vibrate", Kind::vibrate},
                                              {"freeze_pose", Kind::freeze_pose},
                                              {"press_button", Kind::press_button},
                                              {"trip_watchdog", Kind::trip_watchdog},
                                              {"disable_watchdog", Kind::disable_watchdog},
                                              {"motors_off", Kind::motors_off}});
  const TomlValue value = table.optional("value");
  const Range range = value_range(fault.kind);
  if (value && !(range.max > range.min))
    value.reject("a fault of this kind has no value; leave it out");
  else
    value.number(fault.value, range);
  fault.start = from_seconds(at_s);
  fault.duration = from_seconds(for_s);
  script.faults.push_back(fault);
}

void read_command(TomlTable& table, LoopbackScript& script) {
  TimedCommand command;
  double at_s = 0.0;
  table.mandatory("at_s").number(at_s, kTime_s);
  table.mandatory("command").choice(command.commands, {{"arm", CommandSet{kArm}},
                                                       {"arm_with_lease", CommandSet{kArm | kLease}},
                                                       {"heartbeat", CommandSet{kHeartbeat}},
                                                       {"disarm", CommandSet{kDisarm}},
                                                       {"reinitialize", CommandSet{kReinitialize}},
                                                       {"grasp", CommandSet{kGrasp}},
                                                       {"let_go", CommandSet{kLetGo}},
                                                       {"stop", CommandSet{kStop}},
                                                       {"acknowledge", CommandSet{kAcknowledge}},
                                                       {"quit", CommandSet{kQuit}}});
  command.at = from_seconds(at_s);
  script.commands.push_back(command);
}

void read_loopback(TomlTable& table, LoopbackScript& script) {
  for (const TomlValue& fault : table.optional("fault").elements("tables, each headed [[fault]]"))
    fault.table(read_fault, script);
  for (const TomlValue& command : table.optional("command").elements("tables, each headed [[command]]"))
    command.table(read_command, script);
}

}  // namespace

LoopbackScript load_loopback_script(const std::filesystem::path& file) {
  LoopbackScript script;
  script.file = file;
  read_toml(file, read_loopback, script);
  std::stable_sort(script.commands.begin(), script.commands.end(),
                   [](const TimedCommand& a, const TimedCommand& b) { return a.at < b.at; });
  return script;
}

}  // namespace wrenchd
