// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <wrenchd/state_reader.hpp>

#include "collision/touch.hpp"
#include "daemon/control/json_rpc.hpp"
#include "daemon/servo/tick_record.hpp"
#include "tools/view/min_max_history.hpp"
#include "tools/view/view_scene.hpp"

namespace wrenchd {

/// The numbers of one tick that are drawn, wherever it comes from. Poses and wrenches as in TickRecord.
struct ViewTick {
  std::uint64_t tick = 0;
  std::int64_t time_ns = 0;
  std::array<double, 7> X_WP{}, X_WQ{};  ///< q is NaN while the proxy has no place
  std::array<double, 6> F_out{};         ///< told to the device
  double energy_kg_m2 = 0.0;             ///< T of Eq. (8) [kg m^2]; NaN as q
  std::uint32_t rendering_id = 0;
  std::int64_t duration_ns = 0, wake_latency_ns = 0;

  bool proxy_valid() const noexcept;
  double depth_m() const noexcept;    ///< from p to q; NaN as q
  double angle_rad() const noexcept;  ///< likewise
  ChannelValues channels() const noexcept;
};

ViewTick view_tick(const TickState& state);
ViewTick view_tick(const TickRecord& record);

/// What else is shown of it.
struct ViewStatus {
  std::string state, cause, limits, proxy_initialization;
  unsigned contact_count = 0;
  double authority = 0.0, passivity_scale = 1.0;
  std::vector<ProxyContact> contacts;
};

ViewStatus view_status(const TickState& state);
ViewStatus view_status(const TickRecord& record, std::span<const Touch> touches);

/// {type: "frame", ...}: one moment, as the page gets it. scene: null where nobody knows it. begin_ns: what
/// the page counts time from.
Json frame_json(const ViewTick& tick, const ViewStatus& words, const ViewScene* scene, std::int64_t begin_ns);

/// A binary message of the stretches [from, to): u32 2, u32 1 where what the page has is no longer true, u32
/// stretches, u32 numbers a stretch; then doubles: time [s], and least and greatest of each channel in turn.
std::string history_message(const MinMaxHistory& extremes, std::uint64_t from, std::uint64_t to, bool anew,
                            std::int64_t begin_ns);

}  // namespace wrenchd
