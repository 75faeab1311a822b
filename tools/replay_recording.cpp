// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/replay_recording.hpp"

#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <system_error>

#include "daemon/recorded_files.hpp"
#include "daemon/replay.hpp"
#include "daemon/version.hpp"

namespace wrenchd {
namespace {

/// Where the files of a recording are unpacked; gone with this.
class Unpacked {
 public:
  Unpacked() {
    std::string name = (std::filesystem::temp_directory_path() / "wrenchctl-replay-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::system_error(errno, std::generic_category(), name);
    path_ = name;
  }
  ~Unpacked() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  Unpacked(const Unpacked&) = delete;
  Unpacked& operator=(const Unpacked&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace

bool replay_recording(const std::filesystem::path& file, const std::optional<PlanFiles>& files) {
  const Recording recording = read_recording(file);
  std::optional<Unpacked> unpacked;
  Plan plan;
  if (files) {
    plan = read_plan(*files, SearchPath());
    if (plan.profile.name.empty())
      throw std::runtime_error(
          "the configuration leaves the profile to the device that is plugged in; name the one of the "
          "recording with --profile");
  } else {
    unpacked.emplace();
    plan = recorded_plan(recording.header, unpacked->path());
  }
  if (recording.header.version != kVersion)
    std::printf("recorded by wrenchd %s, replayed by %s: the bits may differ for that\n",
                recording.header.version.c_str(), kVersion);
  const auto difference = replay(recording, plan);
  std::printf("compared: %s\nwith: %s\n", compared_fields(),
              files ? "the files named" : "what is in the recording");
  if (!difference) {
    std::printf("%zu ticks, all the same, bit for bit\n", recording.ticks.size());
    return true;
  }
  std::printf("tick %llu differs first: %s was %.17g and is %.17g\n",
              static_cast<unsigned long long>(difference->tick), difference->field.c_str(),
              difference->recorded, difference->replayed);
  return false;
}

}  // namespace wrenchd
