// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/replay_recording.hpp"

#include <cstdio>
#include <stdexcept>
#include <string>

#include "daemon/recording/recorded_run.hpp"
#include "daemon/recording/replay.hpp"
#include "daemon/version.hpp"

namespace wrenchd {
bool replay_recording(const std::filesystem::path& file, const std::optional<RunConfigFiles>& files) {
  const Recording recording = read_recording(file);
  if (recording.header.hands > 1)
    throw std::runtime_error(file.string() +
                             ": is a recording of a run with two hands, and a replay computes one hand "
                             "alone; record a run without "
                             "[[hand]] to replay it");
  std::optional<RecordedRun> recorded;
  RunConfig plan;
  if (files) {
    plan = load_run_config(*files, SearchPath());
    if (plan.profile.name.empty())
      throw std::runtime_error(
          "the configuration selects the profile by the connected device; name the profile of the "
          "recording with --profile");
  } else {
    recorded.emplace(recording.header);
    plan = recorded->config();
  }
  if (recording.header.version != kVersion)
    std::printf("recorded by wrenchd %s, replayed by %s: the versions differ, so the bits may differ\n",
                recording.header.version.c_str(), kVersion);
  const auto difference = replay(recording, plan);
  std::printf("compared: %s\nwith: %s\n", compared_fields(),
              files ? "the named files" : "the files in the recording");
  if (!difference) {
    std::printf("%zu ticks, all bits are equal\n", recording.ticks.size());
    return true;
  }
  std::printf("first difference at tick %llu: %s was %.17g and is %.17g\n",
              static_cast<unsigned long long>(difference->tick), difference->field.c_str(),
              difference->recorded, difference->replayed);
  return false;
}

}  // namespace wrenchd
