// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <type_traits>

#include "collision/touch.hpp"
#include "daemon/servo/tick_record.hpp"

namespace wrenchd {

/// A row of /ticks. Rows of /contacts are of type Touch.
struct TickRow {
  TickRecord tick;
  std::uint64_t first_contact = 0;
  std::uint32_t contact_count = 0;
  std::uint32_t padding = 0;
};
static_assert(std::is_trivially_copyable_v<TickRow> && std::is_trivially_copyable_v<Touch>);

}  // namespace wrenchd
