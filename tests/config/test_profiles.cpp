// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>

#include <catch2/catch.hpp>

#include "config/load_hand_script.hpp"
#include "config/load_profile.hpp"
#include "core/finite.hpp"
#include "devices/layout_validation.hpp"
#include "devices/profile_device.hpp"
#include "devices/report_codec.hpp"
#include "devices/simulation/reference_profile.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_profiles {

namespace {

void check_same(const ReportField& a, const ReportField& b) {
  CHECK(a.present == b.present);
  if (!a.present) return;
  CHECK(a.byte == b.byte);
  CHECK(a.bits == b.bits);
  CHECK(a.is_signed == b.is_signed);
  CHECK(a.step == b.step);
  CHECK(a.count == b.count);
}

void check_same(const ReportBit& a, const ReportBit& b) {
  CHECK(a.present == b.present);
  CHECK(a.byte == b.byte);
  CHECK(a.bit == b.bit);
}

const SearchPath kShipped({test::source_path("config")});

std::vector<DeviceProfile> all_shipped() {
  std::vector<DeviceProfile> profiles;
  for (const auto& file : profile_files(kShipped)) {
    INFO(file);
    profiles.push_back(load_profile(file, kShipped));
    CHECK(profiles.back().name == file.stem());
  }
  return profiles;
}

}  // namespace

TEST_CASE("every shipped profile loads, has the name of its file, and has usable reports", "[profiles]") {
  const auto profiles = all_shipped();
  CHECK(profiles.size() == 10);
  for (const DeviceProfile& p : profiles) {
    INFO(p.name);
    CHECK_NOTHROW(validate_reports(p));
    CHECK_FALSE(p.description.empty());
    CHECK(p.max_linear_speed_m_per_s > 0);
    CHECK(p.max_angular_speed_rad_per_s > 0);
    CHECK(p.has_output == (driven_dofs(p) != kNoDof));
    if (p.has_output) CHECK(p.max_force_N > 0);
    if (p.transport != Transport::loopback) CHECK_FALSE(p.match.usb.empty());
    CHECK((p.X_BD.rotation.toRotationMatrix().determinant() - 1) < 1e-12);
  }
}

TEST_CASE("no id belongs to two shipped profiles that are selected automatically", "[profiles]") {
  std::set<std::pair<std::uint16_t, std::uint16_t>> seen;
  for (const DeviceProfile& p : all_shipped()) {
    if (p.match.only_when_named) continue;
    for (const UsbId id : p.match.usb) {
      INFO(p.name << " " << std::hex << id.vendor << ":" << id.product);
      CHECK(seen.insert({id.vendor, id.product}).second);
    }
  }
}

TEST_CASE("each shipped profile senses and drives what its device does", "[profiles]") {
  const auto dofs = [](const char* name) {
    const DeviceProfile p =
        load_profile(test::source_path("config/profiles/") + std::string(name) + ".toml", kShipped);
    return std::pair(dof_text(sensed_dofs(p)), dof_text(driven_dofs(p)));
  };
  using Pair = std::pair<std::string, std::string>;
  CHECK(dofs("loopback") == Pair("x y z rx ry rz", "x y z rx ry rz"));
  CHECK(dofs("reference_high_speed") == Pair("x y z rx ry rz", "x y z rx ry rz"));
  CHECK(dofs("spacemouse_split") == Pair("x y z rx ry rz", "none"));
  CHECK(dofs("spacemouse_combined") == Pair("x y z rx ry rz", "none"));
  CHECK(dofs("polhem") == Pair("x y z rx ry rz", "x y z"));
  CHECK(dofs("woodenhaptics") == Pair("x y z", "x y z"));
  CHECK(dofs("falcon") == Pair("x y z", "x y z"));
}

TEST_CASE("the reference profiles have the report format of the loopback device at both speeds",
          "[profiles]") {
  for (const char* name : {"reference_full_speed", "reference_high_speed"}) {
    const DeviceProfile p =
        load_profile(test::source_path("config/profiles/") + std::string(name) + ".toml", kShipped);
    check_same(p.pose_report.position, reference_profile().pose_report.position);
    check_same(p.wrench_report.torque, reference_profile().wrench_report.torque);
    CHECK(p.pose_report.checksum == Checksum::crc16_ccitt_false);
  }
}

TEST_CASE("the other devices in the example are valid profiles", "[profiles]") {
  std::ifstream example(test::source_path("config/profiles/example.toml"));
  std::vector<std::string> blocks;
  for (std::string line; std::getline(example, line);) {
    if (!line.starts_with("#| ")) continue;
    if (line.starts_with("#| name = \"example_")) blocks.emplace_back();
    REQUIRE_FALSE(blocks.empty());
    blocks.back() += line.substr(3) + '\n';
  }
  REQUIRE(blocks.size() == 2);
  const test::TemporaryDirectory dir;
  for (const std::string& block : blocks) {
    INFO(block);
    const DeviceProfile profile = load_profile(dir.write("block.toml", block), kShipped);
    CHECK_NOTHROW(validate_reports(profile));
  }
}

TEST_CASE("the shipped loopback profile is the reference report layout", "[profiles]") {
  const DeviceProfile file = load_profile(test::source_path("config/profiles/loopback.toml"));
  const DeviceProfile code = reference_profile();
  const PoseReportLayout& p = file.pose_report;
  const PoseReportLayout& q = code.pose_report;
  CHECK(p.id == q.id);
  CHECK(p.length == q.length);
  CHECK(p.checksum == q.checksum);
  check_same(p.sequence, q.sequence);
  check_same(p.device_time, q.device_time);
  check_same(p.position, q.position);
  check_same(p.orientation, q.orientation);
  check_same(p.linear_velocity, q.linear_velocity);
  check_same(p.angular_velocity, q.angular_velocity);
  check_same(p.acknowledged, q.acknowledged);
  check_same(p.buttons, q.buttons);
  check_same(p.motors_on, q.motors_on);
  check_same(p.watchdog_tripped, q.watchdog_tripped);
  const WrenchReportLayout& w = file.wrench_report;
  const WrenchReportLayout& v = code.wrench_report;
  CHECK(w.id == v.id);
  CHECK(w.length == v.length);
  CHECK(w.checksum == v.checksum);
  check_same(w.sequence, v.sequence);
  check_same(w.force, v.force);
  check_same(w.torque, v.torque);
  check_same(w.hold_time, v.hold_time);
  check_same(w.enable, v.enable);
  CHECK(file.max_force_N == code.max_force_N);
  CHECK(file.max_torque_Nm == code.max_torque_Nm);
  CHECK(file.report_rate_Hz == code.report_rate_Hz);
  CHECK(file.watchdog_s == code.watchdog_s);
}

TEST_CASE("a profile may state additional limits and the meaning of its buttons", "[profiles]") {
  const auto load = [](const std::string& name) {
    return load_profile(test::source_path("config/profiles/") + name + ".toml", kShipped);
  };
  const DeviceProfile example = load("example");
  CHECK(example.workspace_radius_m == 0.3);
  CHECK(example.workspace_centre_m == Vector3d::Zero());
  CHECK(example.max_power_W == 5.0);
  CHECK(example.continuous_force_N == 2.7);
  CHECK(example.continuous_torque_Nm == 0.1);
  CHECK(example.thermal_time_s == 20.0);
  CHECK(example.deadman_button == 0);
  CHECK(example.stop_button == 1);
  for (const char* name : {"loopback", "reference_full_speed", "reference_high_speed"}) {
    const DeviceProfile p = load(name);
    INFO(name);
    CHECK(p.workspace_radius_m == 0.25);
    CHECK(p.max_power_W == 10.0);
    CHECK(p.continuous_force_N == 4.0);
    CHECK(p.continuous_torque_Nm == 0.2);
    CHECK(p.thermal_time_s == 20.0);
    CHECK(p.deadman_button == -1);
    CHECK(p.stop_button == -1);
  }
  for (const char* name : {"polhem", "polhem_lpc1768", "falcon", "woodenhaptics", "spacemouse_split"}) {
    const DeviceProfile p = load(name);
    INFO(name);
    for (const double limit : {p.workspace_radius_m, p.max_power_W, p.continuous_force_N,
                               p.continuous_torque_Nm, p.thermal_time_s})
      CHECK(std::isnan(limit));
    CHECK(p.deadman_button == -1);
    CHECK(p.stop_button == -1);
  }
}

TEST_CASE("the shipped hands stay inside the loopback's workspace", "[profiles]") {
  const DeviceProfile p = load_profile(test::source_path("config/profiles/loopback.toml"), kShipped);
  int hands = 0;
  for (const auto& entry : std::filesystem::directory_iterator(test::source_path("config/hands"))) {
    SimulationSettings hand;
    load_hand_script(entry.path(), hand);
    INFO(entry.path());
    for (const Waypoint& waypoint : hand.hand_path)
      CHECK((waypoint.position_m - p.workspace_centre_m).norm() < p.workspace_radius_m);
    ++hands;
  }
  CHECK(hands > 0);
}

TEST_CASE("an inherited limit may be removed, and a lower maximum lowers the rating", "[profiles]") {
  const test::TemporaryDirectory dir;
  const auto load = [&](const std::string& parent, const std::string& text) {
    return load_profile(dir.write("mine.toml", "inherits = \"" + parent + "\"\nname = \"mine\"\n" + text),
                        kShipped);
  };
  const DeviceProfile none = load("example",
                                  "[limits]\nworkspace_radius_m = \"none\"\nmax_power_W = \"none\"\n"
                                  "continuous_force_N = \"none\"\ncontinuous_torque_Nm = \"none\"\n"
                                  "thermal_time_s = \"none\"\n[buttons]\ndeadman = \"none\"\n");
  for (const double limit : {none.workspace_radius_m, none.max_power_W, none.continuous_force_N,
                             none.continuous_torque_Nm, none.thermal_time_s})
    CHECK(std::isnan(limit));
  CHECK(none.deadman_button == -1);
  CHECK(none.stop_button == 1);
  const DeviceProfile weak = load("loopback", "[limits]\nmax_force_N = 3.0\n");
  CHECK(weak.continuous_force_N == 3.0);
  CHECK(weak.continuous_torque_Nm == 0.2);
  CHECK_THROWS_WITH(load("loopback", "[limits]\nmax_force_N = 3.0\ncontinuous_force_N = 3.5\n"),
                    Catch::Contains("mine.toml:5:22") && Catch::Contains("is more than the maximum, 3 N"));
}

TEST_CASE("a deadman or stop button may come in any report, as a bit, from a list or out of a count",
          "[profiles]") {
  const test::TemporaryDirectory dir;
  const auto load = [&](const std::string& text) {
    return load_profile(dir.write("mine.toml", text), kShipped);
  };
  const DeviceProfile arm = load("inherits = \"polhem\"\nname = \"mine\"\n[buttons]\ndeadman = 0\n");
  CHECK(arm.deadman_button == 0);
  const DeviceProfile delta =
      load("inherits = \"falcon\"\nname = \"mine\"\n[buttons]\ndeadman = 2\nstop = 3\n");
  CHECK(delta.deadman_button == 2);
  CHECK(delta.stop_button == 3);
  const DeviceProfile highest = load("inherits = \"loopback\"\nname = \"mine\"\n[buttons]\nstop = 7\n");
  CHECK(highest.stop_button == 7);
  CHECK(highest.grasp_button == 6);
}

TEST_CASE("a million fuzzed reports are decoded or rejected, and every sample is finite", "[profiles]") {
  /// A link that returns random bytes, and valid reports with some bytes changed.
  class Noise final : public ReportLink {
   public:
    explicit Noise(const DeviceProfile& profile) : profile_(profile) {}
    void open() override {}
    LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept override {
      if (left_ == 0) return {LinkStatus::not_ready, 0, now};
      --left_;
      for (std::uint8_t& byte : buffer) byte = static_cast<std::uint8_t>(random_() & 0xffu);
      const PoseReportLayout& r = profile_.more_reports.empty() || random_() % 2 == 0
                                      ? profile_.pose_report
                                      : profile_.more_reports[random_() % profile_.more_reports.size()];
      if (random_() % 2 == 0) encode(r, {}, buffer);
      if (r.has_id && random_() % 8 != 0) buffer[0] = r.id;
      for (auto n = random_() % 4; n > 0; --n)
        buffer[random_() % r.length] = static_cast<std::uint8_t>(random_() & 0xffu);
      return {LinkStatus::ok, random_() % 8 == 0 ? random_() % 80 : r.length, now};
    }
    LinkStatus write(TimePoint, std::span<const std::uint8_t>) noexcept override { return LinkStatus::ok; }
    void wait_readable(TimePoint) noexcept override {}
    void close() noexcept override {}
    void refill(int reports) { left_ = reports; }

   private:
    const DeviceProfile& profile_;
    std::mt19937 random_{12};
    int left_ = 0;
  };
  constexpr int kReports = 100'000, kAtOnce = 4;
  const auto profiles = all_shipped();
  for (const DeviceProfile& profile : profiles) {
    INFO(profile.name);
    Noise noise(profile);
    ProfileDevice device(profile, noise);
    device.open();
    TimePoint now{};
    device.read_newest(now);
    device.assume_trusted();
    std::uint64_t rejected = 0;
    for (int i = 0; i < kReports / kAtOnce; ++i) {
      noise.refill(kAtOnce);
      const DeviceSample sample = device.read_newest(now += std::chrono::milliseconds(1));
      rejected += sample.rejected;
      const bool sane = is_finite(sample.X_BH) && is_finite(sample.V_BH) && is_finite(sample.device_time_s) &&
                        std::abs(sample.X_BH.rotation.norm() - 1) < 1e-9;
      if (!sane) FAIL("report " << i);
      device.write(now, {{1, 2, 3}, {0.1, 0.2, 0.3}}, true);
    }
    CHECK(rejected > 0);
    CHECK(rejected < kReports);
  }
  CHECK(profiles.size() * kReports >= 1'000'000);
}

TEST_CASE("a firmware requires a serial chip that loads it", "[profiles]") {
  const test::TemporaryDirectory dir;
  const auto load = [&](const std::string& endpoints) {
    return load_profile(
        dir.write("mine.toml", "inherits = \"falcon\"\nname = \"mine\"\n[endpoints]\n" + endpoints),
        kShipped);
  };
  const DeviceProfile mine = load("firmware = \"/somewhere/falcon.bin\"\n");
  CHECK(mine.endpoints.serial_chip);
  CHECK(mine.endpoints.firmware == "/somewhere/falcon.bin");
  CHECK(mine.endpoints.prefix_bytes == 2);
  CHECK_THROWS_WITH(load("serial_chip = \"none\"\nfirmware = \"/somewhere/falcon.bin\"\n"),
                    Catch::Contains("mine.toml:5") && Catch::Contains("serial_chip = \"ftdi\""));
  CHECK_THROWS_WITH(load("serial_chip = \"prolific\"\n"), Catch::Contains("ftdi"));
}

}  // namespace wrenchd::test_profiles
