// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/state_methods.hpp"

#include <utility>

#include "daemon/state_layout.hpp"
#include "daemon/station.hpp"

namespace wrenchd {

void add_state_methods(MethodTable& table, Station& station) {
  const SharedState& state = station.show_state();
  table.add(
      {"state.open",
       Role::observer,
       {},
       "hands over the descriptor of the memory in which the state of every tick can be read, beside the "
       "answer (SCM_RIGHTS), and answers its layout: where each field lies, its type, unit, frame and "
       "meaning, and the names of obstacles",
       [&](const Json&, const Caller&) {
         Json result;
         int fd = -1;
         open_state(state, station.scene(), [&](const Json& layout, int descriptor) {
           result = layout;
           fd = descriptor;
         });
         return Answer(std::move(result), fd);
       }});
}

}  // namespace wrenchd
