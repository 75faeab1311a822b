// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdint>
#include <limits>

#include <catch2/catch.hpp>

#include "tools/tick_selection.hpp"

namespace wrenchd::test_tick_selection {

TEST_CASE("components of every field have a name, a unit and an exact text", "[export]") {
  TickRecord tick;
  tick.rendering_checksum = std::numeric_limits<std::uint64_t>::max();
  tick.now_ns = std::numeric_limits<std::int64_t>::min();
  tick.F_out = {0.1, 1.0 / 3.0, -0.0, 1e300, 5e-324, 2.0};
  tick.state = 200;
  const auto text = [&](const char* name, std::size_t component) {
    for (const RecordField& field : selected_fields({.columns = {name}})) {
      std::string to;
      append_component(to, field, &tick, component);
      return std::string(field.name) + component_suffix(field, component) + " " + to + " " +
             component_unit(field, component);
    }
    return std::string();
  };
  CHECK(text("rendering_checksum", 0) == "rendering_checksum 18446744073709551615 1");
  CHECK(text("now_ns", 0) == "now_ns -9223372036854775808 ns");
  CHECK(text("F_out", 1) == "F_out.fy 0.3333333333333333 N");
  CHECK(text("F_out", 2) == "F_out.fz -0 N");
  CHECK(text("F_out", 4) == "F_out.ty 5e-324 N.m");
  CHECK(text("state", 0) == "state 200 enum");
  CHECK(real_component(selected_fields({.columns = {"F_out"}})[0], &tick, 3) == 1e300);
}

}  // namespace wrenchd::test_tick_selection
