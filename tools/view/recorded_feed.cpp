// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/recorded_feed.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/fault.hpp"
#include "core/state.hpp"

namespace wrenchd {
namespace {

constexpr double kNs = 1e9;
/// Up to this number of ticks per column, columns are made from the ticks, else from the buckets of the
/// history.
constexpr std::size_t kTicksPerColumn = 20;

}  // namespace

RecordedFeed::RecordedFeed(std::string name, Recording recording, std::shared_ptr<const ViewScene> scene,
                           std::string why_no_scene)
    : name_(std::move(name)),
      recording_(std::move(recording)),
      scene_(std::move(scene)),
      scene_error_(std::move(why_no_scene)) {
  if (recording_.ticks.empty()) throw RecordingError(name_ + ": has no ticks, so there is nothing to show");
  for (const TickRecord& record : recording_.ticks) history_.add(record.now_ns, view_tick(record).channels());
}

double RecordedFeed::duration_s() const noexcept {
  return static_cast<double>(recording_.ticks.back().now_ns - begin_ns()) / kNs;
}

double RecordedFeed::rate_Hz() const noexcept {
  const auto& ticks = recording_.ticks;
  std::vector<std::int64_t> steps_ns;
  for (std::size_t i = 1; i < ticks.size() && i < 10'000; ++i)
    steps_ns.push_back(ticks[i].now_ns - ticks[i - 1].now_ns);
  if (steps_ns.empty()) return 0.0;
  const auto middle = steps_ns.begin() + static_cast<std::ptrdiff_t>(steps_ns.size() / 2);
  std::nth_element(steps_ns.begin(), middle, steps_ns.end());
  return *middle > 0 ? kNs / static_cast<double>(*middle) : 0.0;
}

std::int64_t RecordedFeed::time_ns(double t_s) const {
  const double t = std::isfinite(t_s) ? std::clamp(t_s, 0.0, duration_s()) : 0.0;
  return begin_ns() + std::llround(t * kNs);
}

std::size_t RecordedFeed::index_at(double t_s) const {
  const auto& ticks = recording_.ticks;
  const auto after = std::upper_bound(ticks.begin(), ticks.end(), time_ns(t_s),
                                      [](std::int64_t t, const TickRecord& one) { return t < one.now_ns; });
  return static_cast<std::size_t>(std::max<std::ptrdiff_t>(after - ticks.begin() - 1, 0));
}

Json RecordedFeed::frame(double t_s) const {
  const std::size_t row = index_at(t_s);
  const TickRecord& record = recording_.ticks[row];
  return frame_json(view_tick(record), view_status(record, proxy_contacts(recording_.contacts_of(row))),
                    scene_.get(), begin_ns());
}

MinMaxColumns RecordedFeed::columns(double from_s, double to_s, std::size_t count) const {
  MinMaxColumns out(time_ns(from_s), time_ns(to_s), count);
  const std::size_t first = index_at(from_s), last = index_at(to_s);
  if (last - first <= kTicksPerColumn * count) {
    for (std::size_t i = first; i <= last; ++i) {
      const ChannelValues values = view_tick(recording_.ticks[i]).channels();
      out.add({recording_.ticks[i].now_ns, values, values});
    }
    return out;
  }
  const std::uint64_t end = history_.index_at(out.to_ns() + 1);
  for (std::uint64_t i = history_.index_at(out.from_ns()); i < end; ++i) out.add(history_.at(i));
  return out;
}

bool RecordedFeed::has_scene_of(const RecordedFeed& other) const {
  return recording_.header.scene == other.recording_.header.scene;
}

std::pair<RollingHistogram::Summary, RollingHistogram::Summary> RecordedFeed::tick_times(double t_s) const {
  RollingHistogram took, late;
  const std::size_t last = index_at(t_s);
  const std::int64_t from = recording_.ticks[last].now_ns - RollingHistogram::kWindow_s * 1'000'000'000;
  for (std::size_t i = index_at(t_s - static_cast<double>(RollingHistogram::kWindow_s)); i <= last; ++i) {
    if (recording_.ticks[i].now_ns < from) continue;
    const ViewTick tick = view_tick(recording_.ticks[i]);
    took.add(tick.time_ns, tick.duration_ns);
    late.add(tick.time_ns, tick.wake_latency_ns);
  }
  return {took.summary(), late.summary()};
}

Json RecordedFeed::state_changes() const {
  Json out = Json::array();
  const TickRecord* before = nullptr;
  for (const TickRecord& record : recording_.ticks) {
    if (before == nullptr || before->state != record.state || before->state_cause != record.state_cause)
      out.push_back({{"t", static_cast<double>(record.now_ns - begin_ns()) / kNs},
                     {"state", wrenchd::name(static_cast<State>(record.state))},
                     {"cause", fault_row(record.state_cause).name}});
    before = &record;
  }
  return out;
}

Json RecordedFeed::markers() const {
  Json out = Json::array();
  for (const RecordedEvent& event : recording_.events) {
    if (event.name != "marker") continue;
    const Json conditions = Json::parse(event.conditions, nullptr, false);
    out.push_back({{"t", static_cast<double>(event.time_ns - begin_ns()) / kNs},
                   {"label", event.text},
                   {"conditions", conditions.is_object() ? conditions : Json::object()}});
  }
  return out;
}

}  // namespace wrenchd
