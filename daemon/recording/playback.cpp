// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/playback.hpp"

#include <sstream>
#include <string>
#include <string_view>

#include "config/config_error.hpp"
#include "config/pose_table.hpp"
#include "config/toml_file.hpp"
#include "core/files/opened_file.hpp"
#include "daemon/recording/recording_reader.hpp"

namespace wrenchd {
namespace {

bool is_good(const TickRecord& tick) {
  return tick.fresh != 0 && tick.sample_fault == Fault::none && tick.released == 0;
}

/// A day of poses at 1 kHz occupies about 10 GB, and such a table is a recording.
constexpr std::uint64_t kMaxTableBytes = std::uint64_t{1} << 30;

std::vector<TimedPose> of_recording(const OpenedFile& opened, const std::filesystem::path& file) {
  const Recording recording = read_recording(opened, file);
  bool device_time_rises = true;
  double last_s = 0.0;
  bool first = true;
  for (const TickRecord& tick : recording.ticks) {
    if (!is_good(tick)) continue;
    device_time_rises = device_time_rises && (first || tick.device_time_s > last_s);
    last_s = tick.device_time_s;
    first = false;
  }
  std::vector<TimedPose> poses;
  for (const TickRecord& tick : recording.ticks) {
    if (!is_good(tick)) continue;
    const double time_s =
        device_time_rises ? tick.device_time_s : 1e-9 * static_cast<double>(tick.arrived_ns);
    if (!poses.empty() && !(time_s > poses.back().time_s)) continue;
    if (!poses.empty() && time_s - poses.back().time_s > kMaxTableGap_s)
      throw RecordingError(file.string() + ": before tick " + std::to_string(tick.tick) +
                           " there is a gap of " + to_text(time_s - poses.back().time_s) +
                           " s without a pose; export a part without gaps, with --from and --to");
    poses.push_back({time_s, pose_from_numbers(tick.X_BH)});
  }
  if (poses.empty()) throw RecordingError(file.string() + ": has no valid sample of the device");
  const double start_s = poses.front().time_s;
  for (TimedPose& pose : poses) pose.time_s -= start_s;
  return poses;
}

}  // namespace

std::vector<TimedPose> read_playback(const std::filesystem::path& file) {
  constexpr std::string_view kHdf5 = "\x89HDF";
  try {
    OpenedFile opened(file);
    if (opened.peek(kHdf5.size()) == kHdf5) return of_recording(opened, file);
    std::istringstream table(opened.read(kMaxTableBytes));
    return read_timed_poses(table, file.string());
  } catch (const FileError& error) {
    throw PoseTableError(file.string() +
                         ": cannot be read; name a recording, or a CSV file of poses with times (" +
                         error.what() + ")");
  }
}

}  // namespace wrenchd
