// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/state_methods.hpp"

#include <utility>

#include "daemon/control/state_layout.hpp"
#include "daemon/runtime.hpp"

namespace wrenchd {

void add_state_methods(MethodTable& table, Runtime& runtime) {
  const SharedState& state = runtime.enable_shared_state();
  table.add(
      {"state.open",
       Role::observer,
       {},
       "Returns the layout of the shared memory with the record of every tick: offset, type, unit, frame and "
       "meaning of each field, and the names of the obstacles. The reply carries the descriptor of the "
       "memory "
       "(SCM_RIGHTS).",
       [&](const Json&, const Caller&) {
         Json result;
         int fd = -1;
         open_state(state, runtime.reconfigurator().obstacle_names(),
                    [&](const Json& layout, int descriptor) {
                      result = layout;
                      fd = descriptor;
                    });
         return MethodResult(std::move(result), fd);
       }});
  table.add(
      {"state.obstacles",
       Role::observer,
       {},
       "Returns the names of the obstacles by number, and the rendering_id that they belong to. Tick records "
       "with "
       "another rendering_id number other obstacles.",
       [&](const Json&, const Caller&) {
         const Reconfigurator::ObstacleNames obstacles = runtime.reconfigurator().obstacle_names();
         return MethodResult(Json{{"obstacles", obstacles.names}, {"rendering_id", obstacles.rendering_id}});
       }});
}

}  // namespace wrenchd
