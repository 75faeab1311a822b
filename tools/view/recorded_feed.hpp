// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "daemon/recording/recording_file.hpp"
#include "tools/view/min_max_columns.hpp"
#include "tools/view/min_max_history.hpp"
#include "tools/view/rolling_histogram.hpp"
#include "tools/view/view_scene.hpp"
#include "tools/view/view_tick.hpp"

namespace wrenchd {

/// The data of a recording at any time within it. Immutable after construction. Not RT-safe: allocates.
class RecordedFeed {
 public:
  static constexpr std::int64_t kBucket_ns = 10'000'000;

  /// name: title for the user. scene: null if unknown; scene_error then contains the reason. Throws
  /// RecordingError if the recording has no ticks.
  RecordedFeed(std::string name, Recording recording, std::shared_ptr<const ViewScene> scene,
               std::string why_no_scene);

  const std::string& name() const noexcept { return name_; }
  const std::string& version() const noexcept { return recording_.header.version; }
  const std::shared_ptr<const ViewScene>& scene() const noexcept { return scene_; }
  const std::string& scene_error() const noexcept { return scene_error_; }
  std::int64_t begin_ns() const noexcept { return recording_.ticks.front().now_ns; }
  double duration_s() const noexcept;
  double rate_Hz() const noexcept;  ///< from the median interval of the ticks

  /// Returns the last tick that began at or before this time since the start [s], as a frame message.
  Json frame(double t_s) const;
  /// Returns the curves from one time since the start to another [s], in at most `count` columns. A column
  /// is one tick if the range has few ticks.
  MinMaxColumns columns(double from_s, double to_s, std::size_t count) const;
  /// Returns tick durations and wake latencies in the ten seconds before this time.
  std::pair<RollingHistogram::Summary, RollingHistogram::Summary> tick_times(double t_s) const;
  /// Returns the changes of the loop state: [{t, state, cause}, ...].
  Json state_changes() const;
  /// Returns true if the scene files of both recordings have the same text.
  bool has_scene_of(const RecordedFeed& other) const;
  /// Returns the markers of the experiment: [{t, label, conditions}, ...]. t: time since the first tick [s].
  Json markers() const;

 private:
  std::size_t index_at(double t_s) const;
  std::int64_t time_ns(double t_s) const;

  std::string name_;
  Recording recording_;
  std::shared_ptr<const ViewScene> scene_;
  std::string scene_error_;
  MinMaxHistory history_{kBucket_ns};
};

}  // namespace wrenchd
