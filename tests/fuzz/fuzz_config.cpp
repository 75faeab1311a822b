// SPDX-License-Identifier: GPL-3.0-or-later
// Under test: config/toml_file.cpp config/toml_files.cpp config/toml_reader.cpp config/inherited_toml.cpp
// config/load_settings.cpp config/load_scene.cpp config/load_profile.cpp config/load_report_layout.cpp
// config/load_kinematics.cpp config/load_hand_script.cpp config/calibration_store.cpp config/report_bytes.cpp
// config/nearest_key.cpp config/config_error.cpp
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
#include "tests/support/paths.hpp"

// Reads any text as each kind of configuration file. The loader throws ConfigError with a location inside the
// text, or returns values that satisfy its postconditions.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;
namespace fs = std::filesystem;

/// A file that is rewritten for each input; on a memory file system if the machine has one.
class ScratchFile {
 public:
  ScratchFile() {
    std::string path = (fs::is_directory("/dev/shm") ? fs::path("/dev/shm") : fs::temp_directory_path()) /
                       "fuzz_config.XXXXXX";
    require(mkdtemp(path.data()) != nullptr, "creates a directory");
    directory_ = path;
    file_ = directory_ / "input.toml";
    std::ofstream(directory_ / kMeshName) << "load_scene() checks only that the file exists";
    fd_ = ::open(file_.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    require(fd_ >= 0, "creates a file");
  }
  ~ScratchFile() {
    ::close(fd_);
    std::error_code error;
    fs::remove_all(directory_, error);
  }
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;

  const fs::path& put(std::string_view text) {
    require(::ftruncate(fd_, 0) == 0 &&
                ::pwrite(fd_, text.data(), text.size(), 0) == static_cast<ssize_t>(text.size()),
            "writes the file");
    return file_;
  }

 private:
  fs::path directory_, file_;
  int fd_ = -1;
};

const SearchPath& shipped() {
  static const SearchPath search({test::source_path("config")});
  return search;
}

void check_hand(const SimulationSettings& simulation) {
  require(!simulation.hand_path.empty() && simulation.hand_path.front().time_s == 0.0,
          "the hand path starts at 0 s");
  for (std::size_t i = 1; i < simulation.hand_path.size(); ++i)
    require(simulation.hand_path[i].time_s > simulation.hand_path[i - 1].time_s,
            "times of waypoints increase");
  for (const Waypoint& point : simulation.hand_path)
    require(is_finite(point.position_m) && is_finite(point.rotation_vector_rad), "waypoints are finite");
}

void check_scene(const SceneSettings& scene) {
  require(scene.tool.scale > 0.0 && scene.tool.mass_kg > 0.0, "scale and mass of the tool are positive");
  require(is_finite(scene.tool.scale) && is_finite(scene.tool.mass_kg),
          "scale and mass of the tool are finite");
  for (const HalfSpaceSettings& half_space : scene.half_spaces) {
    require(std::abs(half_space.normal_W.norm() - 1.0) < 1e-9, "normals have unit length");
    require(is_finite(half_space.offset_m), "offsets are finite");
  }
  for (const MeshObstacleSettings& mesh : scene.meshes) {
    require(mesh.scale > 0.0 && is_finite(mesh.scale), "scale of an obstacle is positive and finite");
    require(is_finite(mesh.X_WM) && std::abs(mesh.X_WM.rotation.squaredNorm() - 1.0) < 1e-9,
            "pose of an obstacle is finite, its quaternion has unit length");
    require(mesh.motion.linear_m_per_s.norm() <= ObstacleMotion::kMaxSpeed_m_per_s * (1.0 + 1e-12),
            "speed of an obstacle is limited");
  }
}

void check_settings(const Settings& s) {
  require(s.servo.rate_Hz >= 500.0 && s.servo.rate_Hz <= 8000.0, "rate_Hz");
  require(s.servo.priority >= 1 && s.servo.priority <= 49, "priority is 1 to 49, below threaded interrupts");
  require(s.servo.late_limit_s >= 0.002 && s.servo.late_limit_s <= 1.0, "late_limit_s");
  require(s.limits.soft_start_s >= 0.25 && s.limits.soft_start_s <= 5.0, "soft_start_s");
  require(s.limits.max_force_N >= 0.0 && s.limits.max_force_N <= 200.0, "max_force_N");
  require(s.limits.max_torque_Nm >= 0.0 && s.limits.max_torque_Nm <= 20.0, "max_torque_Nm");
  require(s.wrench.gains.stiffness.allFinite() && s.wrench.gains.damping.allFinite(), "gains are finite");
  check_hand(s.simulation);
}

void check_profile(const DeviceProfile& profile) {
  require(!profile.has_output || (profile.max_force_N > 0.0 && profile.max_force_N <= 200.0),
          "max_force_N is positive and at most 200");
  MemoryLink link;
  ProfileDevice device(profile, link);
  device.open();  // throws if the loader accepted an unusable profile
  device.read_newest(TimePoint{} + std::chrono::seconds(1));
  device.assume_trusted();
  device.write(TimePoint{} + std::chrono::seconds(1), {Vector3d(1, 2, 3), Vector3d(0.1, 0.2, 0.3)}, true);
  device.release(TimePoint{} + std::chrono::seconds(1));
}

/// Returns the text with a valid checksum in its last line; the fuzzer does not find one by itself.
std::string with_checksum(std::string_view text) {
  boost::crc_32_type crc;
  crc.process_bytes(text.data(), text.size());
  std::array<char, 24> line{};
  std::snprintf(line.data(), line.size(), "# crc32 %08x\n", static_cast<unsigned>(crc.checksum()));
  return std::string(text) + line.data();
}

/// Requires that a calibration survives to_text() and parse_calibration(), offsets bit for bit.
void check_calibration(const Calibration& calibration, const fs::path& file) {
  const Calibration again = parse_calibration(to_text(calibration), file);
  require(again.offsets.size() == calibration.offsets.size(), "the number of offsets is the same");
  for (std::size_t i = 0; i < again.offsets.size(); ++i)
    require(again.offsets[i].axis == calibration.offsets[i].axis &&
                again.offsets[i].offset == calibration.offsets[i].offset,
            "offsets are the same bit for bit");
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
      return check_calibration(parse_calibration(std::string(text), file), file);
    case FileKind::calibration_without_checksum:
      return check_calibration(parse_calibration(with_checksum(text), file), file);
  }
}

/// Requires that every rejection has a message and a location inside its file.
void check_rejections(const ConfigError& error, const fs::path& file, std::string_view text) {
  const auto lines = static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n')) + 1;
  require(!error.rejections().empty(), "a ConfigError has at least one rejection");
  for (const Rejection& rejection : error.rejections()) {
    require(!rejection.message.empty(), "a rejection has a message");
    require(rejection.message.size() < 4096, "a message is shorter than 4096 bytes");
    if (rejection.file == file && !rejection.location.file)
      require(rejection.location.line <= lines + 1, "a location is inside the file");
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
    check_rejections(error, file, text);
  }
  return 0;
}
