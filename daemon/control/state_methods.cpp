// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/state_methods.hpp"

#include <utility>

#include "daemon/control/state_layout.hpp"
#include "daemon/runtime.hpp"

namespace wrenchd {

void add_state_methods(MethodTable& table, Runtime& station) {
  const SharedState& state = station.enable_shared_state();
  table.add(
      {"state.open",
       Role::observer,
       {},
       "hands over the descriptor of the memory in which the state of every tick can be read, beside the "
       "answer (SCM_RIGHTS), and answers its layout: where each field lies, its type, unit, frame and "
       "meaning, and the names of obstacles in one rendering",
       [&](const Json&, const Caller&) {
         Json result;
         int fd = -1;
         open_state(state, station.reconfigurator().obstacle_names(),
                    [&](const Json& layout, int descriptor) {
                      result = layout;
                      fd = descriptor;
                    });
         return MethodResult(std::move(result), fd);
       }});
  table.add(
      {"state.names",
       Role::observer,
       {},
       "obstacles: the names by number, as they are in the rendering of that number: contacts of ticks of "
       "another rendering are with other obstacles",
       [&](const Json&, const Caller&) {
         const Reconfigurator::ObstacleNames obstacles = station.reconfigurator().obstacle_names();
         return MethodResult(Json{{"obstacles", obstacles.names}, {"rendering", obstacles.rendering_id}});
       }});
}

}  // namespace wrenchd
