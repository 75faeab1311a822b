// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/replay_recording.hpp"

#include <array>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <utility>

#include "daemon/hand_file.hpp"
#include "daemon/recording/recorded_run.hpp"
#include "daemon/recording/replay.hpp"
#include "daemon/version.hpp"

namespace wrenchd {
namespace {

/// Returns the recording of the other hand of the same run. It is beside the file, with the name of its hand.
std::filesystem::path file_of_other_hand(const std::filesystem::path& file, const Recording& recording,
                                         const RunConfig& config) {
  if (recording.header.hand.empty()) return file_of_hand(file, config.second_hand);
  std::string stem = file.stem().string();
  const std::string ending = "-" + recording.header.hand;
  if (!stem.ends_with(ending))
    throw std::runtime_error(file.string() + ": is the recording of hand '" + recording.header.hand +
                             "' of two, and a replay needs both; its name must end in " + ending +
                             file.extension().string() + ", so that the one of the first hand is found");
  stem.resize(stem.size() - ending.size());
  return file.parent_path() / (stem + file.extension().string());
}

/// Prints the result. Returns true if all bits are equal.
bool report(const std::optional<Difference>& difference, std::size_t ticks, const char* with) {
  std::printf("compared: %s\nwith: %s\n", compared_fields(), with);
  if (!difference) {
    std::printf("%zu ticks, all bits are equal\n", ticks);
    return true;
  }
  std::printf("first difference at tick %llu%s: %s was %.17g and is %.17g\n",
              static_cast<unsigned long long>(difference->tick),
              difference->hand == 0 ? "" : " of the second hand", difference->field.c_str(),
              difference->recorded, difference->replayed);
  return false;
}

void warn_of_version(const Recording& recording) {
  if (recording.header.version != kVersion)
    std::printf("recorded by wrenchd %s, replayed by %s: the versions differ, so the bits may differ\n",
                recording.header.version.c_str(), kVersion);
}

/// Both hands of a run, whose world is the same.
bool replay_both(const std::filesystem::path& file, Recording named) {
  const RecordedRun named_run(named.header);
  Recording other = read_recording(file_of_other_hand(file, named, named_run.config()));
  if (other.header.hands != 2 || other.header.hand.empty() == named.header.hand.empty())
    throw std::runtime_error(file.string() + ": the recording of the other hand beside it is of another run");
  const RecordedRun other_run(other.header);
  const bool named_is_first = named.header.hand.empty();
  warn_of_version(named);
  const std::size_t ticks = named.ticks.size() + other.ticks.size();
  const std::array<RunConfig, 2> configs = {(named_is_first ? named_run : other_run).config(),
                                            (named_is_first ? other_run : named_run).config()};
  std::array<Recording, 2> recordings = {std::move(named_is_first ? named : other),
                                         std::move(named_is_first ? other : named)};
  return report(replay_two_hands(recordings, configs), ticks, "the files in the recordings of both hands");
}

}  // namespace

bool replay_recording(const std::filesystem::path& file, const std::optional<RunConfigFiles>& files) {
  Recording recording = read_recording(file);
  if (recording.header.hands > 1) {
    if (files)
      throw std::runtime_error(
          file.string() +
          ": a run with two hands is replayed with the files in its recordings; leave out "
          "--config, --scene and --profile");
    return replay_both(file, std::move(recording));
  }
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
  warn_of_version(recording);
  return report(replay(recording, plan), recording.ticks.size(),
                files ? "the named files" : "the files in the recording");
}

}  // namespace wrenchd
