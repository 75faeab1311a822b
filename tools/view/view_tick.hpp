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
#include "tools/view/min_max_columns.hpp"
#include "tools/view/min_max_history.hpp"
#include "tools/view/view_scene.hpp"

namespace wrenchd {

/// Numbers of one tick that the page draws. Poses and wrenches have the format of TickRecord.
struct ViewTick {
  std::uint64_t tick = 0;
  std::int64_t time_ns = 0;
  std::array<double, 7> X_BH{};      ///< Pose of the handle in the device base.
  std::array<double, 7> X_WP{};      ///< Commanded pose p.
  std::array<double, 7> X_WQ{};      ///< Proxy pose q; NaN if the proxy is not valid.
  TickRecord::BodyNumbers X_WB{};    ///< Poses of the free bodies.
  std::array<double, 6> F_out{};     ///< Wrench sent to the device.
  double energy_kg_m2 = 0.0;         ///< T of Eq. (8); NaN if the proxy is not valid.
  std::uint32_t rendering_id = 0;    ///< Number of the active rendering.
  std::int64_t duration_ns = 0;      ///< Sum of the durations of all stages.
  std::int64_t wake_latency_ns = 0;  ///< Time from the tick's due time to its start.

  bool proxy_valid() const noexcept;
  double depth_m() const noexcept;    ///< Distance from p to q; NaN if the proxy is not valid.
  double angle_rad() const noexcept;  ///< Angle of the rotation from p to q; NaN if the proxy is not valid.
  ChannelValues channels() const noexcept;
};

/// Returns the record of a live tick, field by field from the table of tick fields. Throws ClientError if the
/// daemon lacks a field. Not RT-safe: allocates.
TickRecord tick_record(const TickState& state);
/// Returns the numbers to draw. RT-safe.
ViewTick view_tick(const TickRecord& record);

/// Status texts and contacts of one tick.
struct ViewStatus {
  std::string state;
  std::string cause;
  std::string limits;
  std::string proxy_initialization;
  unsigned contact_count = 0;  ///< All contacts that hold the proxy, also those not in `contacts`.
  double authority = 0.0;
  double passivity_scale = 1.0;
  std::vector<ProxyContact> contacts;
};

/// Returns recorded contacts in the format of live ones. The obstacle names are empty. Not RT-safe:
/// allocates.
std::vector<ProxyContact> proxy_contacts(std::span<const Touch> contacts);
/// Returns the status texts of a tick with its contacts. Not RT-safe: allocates.
ViewStatus view_status(const TickRecord& record, std::vector<ProxyContact> contacts);

/// Returns {type: "frame", ...}, one tick as the page draws it. scene: null if not known. begin_ns: origin of
/// the page's time axis. Not RT-safe: allocates.
Json frame_json(const ViewTick& tick, const ViewStatus& status, const ViewScene* scene,
                std::int64_t begin_ns);

/// Returns a binary message with the buckets [from, to) of the history. Header: u32 2, u32 1 if the page must
/// discard its history, u32 number of buckets, u32 doubles per bucket. Each bucket: time [s], then minimum
/// and maximum of each channel. Not RT-safe: allocates.
std::string history_message(const MinMaxHistory& history, std::uint64_t from, std::uint64_t to, bool reset,
                            std::int64_t begin_ns);

/// Purpose of a message with columns.
enum class ColumnsFor : std::uint32_t {
  plots = 4,     ///< the range that the page has requested
  overview = 5,  ///< the whole recording, to select a time in it
};

/// Returns a binary message with columns of a recording. Header: u32 purpose, u32 number of the recording
/// (0: the shown one, 1: the compared one), u32 number of columns, u32 doubles per column, two doubles with
/// begin and end of the range [s]. Each column as a bucket of history_message(). Not RT-safe: allocates.
std::string columns_message(ColumnsFor purpose, std::uint32_t recording, const MinMaxColumns& columns,
                            std::int64_t begin_ns);

}  // namespace wrenchd
