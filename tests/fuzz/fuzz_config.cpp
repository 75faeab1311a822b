// SPDX-License-Identifier: GPL-3.0-or-later
// Under test: config/toml_file.cpp config/toml_reader.cpp config/inherited_toml.cpp config/load_settings.cpp
// config/load_scene.cpp config/load_profile.cpp config/load_report_layout.cpp config/load_kinematics.cpp
// config/load_hand_script.cpp config/calibration_store.cpp config/report_bytes.cpp config/nearest_key.cpp
// config/config_error.cpp
#include "tests/fuzz/fuzz_config.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include <boost/crc.hpp>
#include <fcntl.h>
#include <unistd.h>

#include "config/calibration_store.hpp"
#include "config/load_hand_script.hpp"
#include "config/load_profile.hpp"
#include "config/load_scene.hpp"
#include "config/load_settings.hpp"
#include "core/finite.hpp"
#include "devices/profile_device.hpp"
#include "tests/fuzz/feed.hpp"
#include "tests/fuzz/memory_link.hpp"

// Any text as each of our files: taken, or refused with a ConfigError at a place that is there. What was
// taken keeps its loader's promises.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;
namespace fs = std::filesystem;

/// One file, written anew for each input; in memory where the system offers it.
class ScratchFile {
 public:
  ScratchFile() {
    std::string path = (fs::is_directory("/dev/shm") ? fs::path("/dev/shm") : fs::temp_directory_path()) /
                       "fuzz_config.XXXXXX";
    hold(mkdtemp(path.data()) != nullptr, "a directory can be made");
    directory_ = path;
    file_ = directory_ / "input.toml";
    std::ofstream(directory_ / kMeshName) << "a scene only asks whether its mesh is there";
    fd_ = ::open(file_.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    hold(fd_ >= 0, "a file can be made");
  }
  ~ScratchFile() {
    ::close(fd_);
    std::error_code error;
    fs::remove_all(directory_, error);
  }
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;

  const fs::path& put(std::string_view text) {
    hold(::ftruncate(fd_, 0) == 0 &&
             ::pwrite(fd_, text.data(), text.size(), 0) == static_cast<ssize_t>(text.size()),
         "the file can be written");
    return file_;
  }

 private:
  fs::path directory_, file_;
  int fd_ = -1;
};

const SearchPath& shipped() {
  static const SearchPath search({WRENCHD_SOURCE_DIR "/config"});
  return search;
}

void check_hand(const SimulationSettings& simulation) {
  hold(!simulation.hand_path.empty() && simulation.hand_path.front().time_s == 0.0, "a path begins at 0");
  for (std::size_t i = 1; i < simulation.hand_path.size(); ++i)
    hold(simulation.hand_path[i].time_s > simulation.hand_path[i - 1].time_s, "times rise");
  for (const Waypoint& point : simulation.hand_path)
    hold(is_finite(point.position_m) && is_finite(point.rotation_vector_rad), "waypoints are finite");
}

void check_scene(const SceneSettings& scene) {
  hold(scene.tool.scale > 0.0 && scene.tool.mass_kg > 0.0, "a tool has size and mass");
  hold(is_finite(scene.tool.scale) && is_finite(scene.tool.mass_kg), "a tool is finite");
  for (const HalfSpaceSettings& half_space : scene.half_spaces) {
    hold(std::abs(half_space.normal_W.norm() - 1.0) < 1e-9, "a normal is a unit");
    hold(is_finite(half_space.offset_m), "an offset is finite");
  }
  for (const MeshObstacleSettings& mesh : scene.meshes) {
    hold(mesh.scale > 0.0 && is_finite(mesh.scale), "an obstacle has a size");
    hold(is_finite(mesh.X_WM) && std::abs(mesh.X_WM.rotation.squaredNorm() - 1.0) < 1e-9,
         "an obstacle has a pose");
    hold(mesh.motion.linear_m_per_s.norm() <= ObstacleMotion::kMaxSpeed_m_per_s * (1.0 + 1e-12), "speed");
  }
}

void check_settings(const Settings& s) {
  hold(s.servo.rate_Hz >= 500.0 && s.servo.rate_Hz <= 8000.0, "rate_Hz");
  hold(s.servo.priority >= 1 && s.servo.priority <= 49, "priority stays below threaded interrupts");
  hold(s.servo.late_limit_s >= 0.002 && s.servo.late_limit_s <= 1.0, "late_limit_s");
  hold(s.limits.soft_start_s >= 0.25 && s.limits.soft_start_s <= 5.0, "soft_start_s");
  hold(s.limits.max_force_N >= 0.0 && s.limits.max_force_N <= 200.0, "max_force_N");
  hold(s.limits.max_torque_Nm >= 0.0 && s.limits.max_torque_Nm <= 20.0, "max_torque_Nm");
  hold(s.wrench.gains.stiffness.allFinite() && s.wrench.gains.damping.allFinite(), "gains are finite");
  check_hand(s.simulation);
}

void check_profile(const DeviceProfile& profile) {
  hold(!profile.has_output || (profile.max_force_N > 0.0 && profile.max_force_N <= 200.0),
       "max_force_N is stated");
  MemoryLink link;
  ProfileDevice device(profile, link);
  device.open();  // throws where the loader let something pass that cannot work
  device.read_newest(TimePoint{} + std::chrono::seconds(1));
  device.write(TimePoint{} + std::chrono::seconds(1), {Vector3d(1, 2, 3), Vector3d(0.1, 0.2, 0.3)}, true);
  device.release(TimePoint{} + std::chrono::seconds(1));
}

/// With the checksum in its last line, which no fuzzer guesses.
std::string sealed(std::string_view text) {
  boost::crc_32_type crc;
  crc.process_bytes(text.data(), text.size());
  std::array<char, 24> line{};
  std::snprintf(line.data(), line.size(), "# crc32 %08x\n", static_cast<unsigned>(crc.checksum()));
  return std::string(text) + line.data();
}

/// Names come back as the file has them; offsets come back to the bit.
void check_calibration(const Calibration& calibration, const fs::path& file) {
  const Calibration again = calibration_of(to_text(calibration), file);
  hold(again.offsets.size() == calibration.offsets.size(), "offsets are kept");
  for (std::size_t i = 0; i < again.offsets.size(); ++i)
    hold(again.offsets[i].axis == calibration.offsets[i].axis &&
             again.offsets[i].offset == calibration.offsets[i].offset,
         "what was read can be kept");
}

void load(FileKind kind, const fs::path& file, std::string_view text) {
  switch (kind) {
    case FileKind::settings:
      return check_settings(load_settings(file, shipped()));
    case FileKind::scene:
      return check_scene(load_scene(file));
    case FileKind::profile:
      return check_profile(load_profile(file, shipped()));
    case FileKind::hand_script: {
      SimulationSettings simulation;
      load_hand_script(file, simulation);
      return check_hand(simulation);
    }
    case FileKind::calibration:
      return check_calibration(calibration_of(std::string(text), file), file);
    case FileKind::sealed_calibration:
      return check_calibration(calibration_of(sealed(text), file), file);
  }
}

/// Every refusal has words and a place in the text, or in the file it came from.
void check_refusals(const ConfigError& error, const fs::path& file, std::string_view text) {
  const auto lines = static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n')) + 1;
  hold(!error.refusals().empty(), "a refusal says why");
  for (const Refusal& refusal : error.refusals()) {
    hold(!refusal.message.empty(), "a refusal has words");
    hold(refusal.message.size() < 4096, "a refusal is short enough to be read");
    if (refusal.file == file && !refusal.place.file)
      hold(refusal.place.line <= lines + 1, "a place is in the file");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static ScratchFile scratch;
  Feed feed({data, size});
  const auto kind = static_cast<FileKind>(feed.byte() % kFileKinds);
  const std::string_view text(reinterpret_cast<const char*>(feed.rest().data()), feed.rest().size());
  const fs::path& file = scratch.put(text);
  try {
    load(kind, file, text);
  } catch (const ConfigError& error) {
    check_refusals(error, file, text);
  }
  return 0;
}
