// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cmath>
#include <deque>
#include <functional>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include <catch2/catch.hpp>

#include "devices/profile_device.hpp"
#include "devices/report_codec.hpp"
#include "devices/simulation/reference_profile.hpp"

namespace wrenchd::test_profile_device {

using namespace std::chrono_literals;

namespace {

const DeviceProfile kProfile = reference_profile();

/// Link with scripted reports: reads return queued reports, writes are recorded.
class ScriptedLink final : public ReportLink {
 public:
  void open() override { ++opened; }
  LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept override {
    if (gone) return {LinkStatus::disconnected, 0, now};
    if (reports.empty()) return {LinkStatus::not_ready, 0, now};
    const auto [bytes, arrived] = reports.front();
    reports.pop_front();
    std::copy_n(bytes.begin(), std::min(bytes.size(), buffer.size()), buffer.begin());
    return {LinkStatus::ok, bytes.size(), arrived};
  }
  LinkStatus write(TimePoint, std::span<const std::uint8_t> report) noexcept override {
    if (write_status == LinkStatus::ok) {
      written.push_back(decode(kProfile.wrench_report, report));
      written_bytes.emplace_back(report.begin(), report.end());
    }
    return write_status;
  }
  void wait_readable(TimePoint) noexcept override {}
  void close() noexcept override { ++closed; }
  bool declares(std::span<const std::uint8_t>) const noexcept override { return declares_all; }

  std::deque<std::pair<std::vector<std::uint8_t>, TimePoint>> reports;
  std::vector<Decoded<WrenchReport>> written;
  std::vector<std::vector<std::uint8_t>> written_bytes;
  bool declares_all = false;
  LinkStatus write_status = LinkStatus::ok;
  bool gone = false;
  int opened = 0, closed = 0;
};

/// A device opened on a scripted link. The far end counts like a correct firmware.
struct Bench {
  ScriptedLink link;
  ProfileDevice device{kProfile, link};
  PoseReport report;  ///< next report of push(); its counters are those at the start of the last millisecond
  TimePoint now{};

  Bench() {
    device.open();
    device.read_newest(now);  // the first read only discards waiting reports
    device.assume_trusted();
  }

  /// Advances one millisecond and sends a report at its end.
  void push() {
    now += 1ms;
    ++report.sequence;
    report.device_time += 1000;
    send();
  }
  void send() {
    std::vector<std::uint8_t> bytes(kProfile.pose_report.length);
    encode(kProfile.pose_report, report, bytes);
    link.reports.emplace_back(bytes, now);
  }
  DeviceSample step() {
    push();
    return device.read_newest(now);
  }
};

Wrench last_wrench(const Bench& bench) {
  return bench.link.written.back().report.F;
}

}  // namespace

TEST_CASE("a read uses the newest of several waiting reports and counts the others") {
  Bench bench;
  for (int i = 0; i < 5; ++i) {
    bench.report.X_BH.translation_m.x() += 1e-4;
    bench.push();
  }
  const DeviceSample sample = bench.device.read_newest(bench.now);
  CHECK(sample.fault == Fault::none);
  CHECK(sample.fresh);
  CHECK(sample.superseded == 4);
  CHECK(sample.missing == 0);
  CHECK(sample.X_BH.translation_m.x() == Approx(5e-4));
  CHECK(sample.arrived == bench.now);

  const DeviceSample none = bench.device.read_newest(bench.now);
  CHECK_FALSE(none.fresh);
  CHECK(none.fault == Fault::none);
  CHECK(none.superseded == 0);
  CHECK(none.X_BH.translation_m.x() == Approx(5e-4));
}

TEST_CASE("a read processes at most one ring of reports") {
  Bench bench;
  for (int i = 0; i < 200; ++i) bench.push();
  bench.device.read_newest(bench.now);
  CHECK(bench.link.reports.size() == 200 - ProfileDevice::kMaxReportsPerRead);
}

TEST_CASE("sequence, clock and lost reports are unwrapped correctly") {
  Bench bench;
  bench.report.sequence = 65'530;
  bench.report.device_time = 0xffff'ffff - 3000;
  DeviceSample sample = bench.step();
  CHECK(sample.sequence == 65'531);
  const double start_s = sample.device_time_s;
  std::uint64_t lost = 0;
  for (int i = 1; i <= 200'000; ++i) {
    if (i % 7 == 0) {  // one report in seven is lost on the way
      bench.push();
      bench.link.reports.clear();
      lost += 1;
      continue;
    }
    sample = bench.step();
    REQUIRE(sample.fault == Fault::none);
    REQUIRE(sample.missing == (i > 1 && (i - 1) % 7 == 0 ? 1 : 0));
    REQUIRE(sample.sequence == 65'531 + static_cast<std::uint64_t>(i));
    REQUIRE(sample.device_time_s - start_s == Approx(1e-3 * i).epsilon(1e-9));
  }
  CHECK(lost == 28'571);
}

TEST_CASE("repeated, backward and damaged reports are dropped and counted") {
  Bench bench;
  bench.report.sequence = 100;
  bench.report.device_time = 500'000;
  const DeviceSample first = bench.step();
  const auto rejects = [&] {
    bench.now += 1ms;
    const DeviceSample sample = bench.device.read_newest(bench.now);
    return !sample.fresh && sample.rejected == 1 && sample.fault == Fault::none &&
           sample.sequence == first.sequence;
  };
  SECTION("repeated") {
    bench.send();
  }
  SECTION("backward") {
    bench.report.sequence -= 1;
    bench.report.device_time += 1000;
    bench.send();
  }
  SECTION("the device's clock runs backward") {
    bench.report.sequence += 1;
    bench.report.device_time -= 1;
    bench.send();
  }
  SECTION("short") {
    bench.push();
    bench.link.reports.back().first.resize(63);
  }
  SECTION("long") {
    bench.push();
    bench.link.reports.back().first.resize(65);
  }
  SECTION("empty") {
    bench.push();
    bench.link.reports.back().first.clear();
  }
  SECTION("wrong id") {
    bench.push();
    bench.link.reports.back().first[0] = 3;
  }
  SECTION("wrong checksum") {
    bench.push();
    bench.link.reports.back().first[63] ^= 1;
  }
  CHECK(rejects());
}

TEST_CASE("if the newest report is damaged, the previous one is used") {
  Bench bench;
  bench.step();
  bench.report.X_BH.translation_m.y() = 1e-4;
  bench.push();
  bench.report.X_BH.translation_m.y() = 2e-4;
  bench.push();
  bench.link.reports.back().first[10] ^= 1;
  const DeviceSample sample = bench.device.read_newest(bench.now);
  CHECK(sample.fresh);
  CHECK(sample.rejected == 1);
  CHECK(sample.superseded == 0);
  CHECK(sample.X_BH.translation_m.y() == Approx(1e-4));
}

TEST_CASE("silence longer than stale_fault_s is a fault, from the first read and from each report") {
  Bench bench;
  CHECK(bench.device.read_newest(bench.now).fault == Fault::none);
  CHECK(bench.device.read_newest(bench.now + 20ms).fault == Fault::none);
  CHECK(bench.device.read_newest(bench.now + 20ms + 1ns).fault == Fault::sample_stale);

  bench.report.X_BH.translation_m.x() = 0.1;
  CHECK(bench.step().fault == Fault::none);
  CHECK(bench.device.read_newest(bench.now + 20ms).fault == Fault::none);
  const DeviceSample stale = bench.device.read_newest(bench.now + 21ms);
  CHECK(stale.fault == Fault::sample_stale);
  CHECK_FALSE(stale.fresh);
  CHECK(stale.X_BH.translation_m.x() == Approx(0.1));
}

TEST_CASE("a stream of invalid reports counts as silence") {
  Bench bench;
  bench.step();
  DeviceSample sample;
  for (int i = 0; i < 21; ++i) {
    CHECK(sample.fault == Fault::none);
    bench.push();
    bench.link.reports.back().first[20] ^= 4;
    sample = bench.device.read_newest(bench.now);
  }
  CHECK(sample.fault == Fault::sample_stale);
}

TEST_CASE("a report that waited too long is stale although it is new") {
  Bench bench;
  bench.step();
  bench.push();
  const DeviceSample sample = bench.device.read_newest(bench.now + 500ms);
  CHECK(sample.fresh);
  CHECK(sample.fault == Fault::sample_stale);
}

TEST_CASE("a disconnected link stays lost until the device is opened again") {
  Bench bench;
  bench.step();
  bench.push();
  bench.link.gone = true;
  CHECK(bench.device.read_newest(bench.now).fault == Fault::device_lost);
  bench.link.gone = false;
  CHECK(bench.device.read_newest(bench.now).fault == Fault::device_lost);
  bench.device.open();
  CHECK(bench.step().fault == Fault::none);
}

TEST_CASE("the first read discards waiting reports") {
  Bench bench;
  bench.device.open();
  for (int i = 0; i < 10; ++i) bench.push();
  DeviceSample sample = bench.device.read_newest(bench.now + 1s);
  CHECK_FALSE(sample.fresh);
  CHECK(sample.fault == Fault::none);
  CHECK(sample.superseded == 0);
  bench.now += 1s;
  sample = bench.step();
  CHECK(sample.fresh);
  CHECK(sample.missing == 0);
  CHECK(sample.fault == Fault::none);
}

TEST_CASE(
    "the first read discards all waiting reports, so reports that the full link dropped are not missing") {
  Bench bench;
  bench.device.open();
  for (int i = 0; i < 280; ++i) bench.push();
  CHECK_FALSE(bench.device.read_newest(bench.now).fresh);
  CHECK(bench.link.reports.empty());
  bench.report.sequence += 100;  // the dropped reports
  bench.report.device_time += 100'000;
  bench.now += 100ms;
  std::uint32_t missing = 0;
  for (int i = 0; i < 5; ++i) missing += bench.step().missing;
  CHECK(missing == 0);
}

TEST_CASE("a device that restarts its counters is accepted after stale_fault_s") {
  Bench bench;
  bench.report.sequence = 5000;
  bench.report.device_time = 9'000'000;
  bench.step();
  bench.report.sequence = 0;
  bench.report.device_time = 0;
  for (int i = 0; i < 20; ++i) {
    const DeviceSample sample = bench.step();
    REQUIRE_FALSE(sample.fresh);
    REQUIRE(sample.fault == Fault::none);
  }
  DeviceSample sample = bench.step();
  CHECK(sample.fresh);
  CHECK(sample.fault == Fault::sample_stale);
  sample = bench.step();
  CHECK(sample.fresh);
  CHECK(sample.fault == Fault::none);
  CHECK(sample.missing == 0);
}

TEST_CASE("a repeated report is never accepted") {
  Bench bench;
  bench.step();
  for (int i = 1; i <= 100; ++i) {
    bench.now += 1ms;
    bench.send();
    const DeviceSample sample = bench.device.read_newest(bench.now);
    REQUIRE_FALSE(sample.fresh);
    REQUIRE(sample.fault == (i > 20 ? Fault::sample_stale : Fault::none));
  }
}

TEST_CASE("an invalid orientation is a fault, and the last valid pose stays") {
  for (const double length : {0.0, 0.5, 0.89, 1.1, 1.9}) {
    Bench bench;
    bench.report.X_BH.translation_m.z() = 0.1;
    bench.step();
    bench.report.X_BH.rotation.coeffs() = length * Quaterniond::Identity().coeffs();
    const DeviceSample sample = bench.step();
    CAPTURE(length);
    CHECK(sample.fault == Fault::pose_not_a_rotation);
    CHECK(sample.fresh);
    CHECK(sample.X_BH.translation_m.z() == Approx(0.1));
    bench.report.X_BH.rotation = Quaterniond::Identity();
    CHECK(bench.step().fault == Fault::none);
  }
}

TEST_CASE("an orientation of nearly unit norm is normalised, with either sign") {
  Bench bench;
  bench.step();
  bench.report.X_BH.rotation.coeffs() *= -1.05;
  const DeviceSample sample = bench.step();
  CHECK(sample.fault == Fault::none);
  CHECK(sample.X_BH.rotation.norm() == Approx(1.0).epsilon(1e-12));
}

TEST_CASE("a pose jump beyond the speed limits is a fault, in both directions") {
  Bench bench;
  bench.step();
  SECTION("position") {
    bench.report.X_BH.translation_m.x() = 0.0038;
  }                      // 3 * 1.2 m/s * 1 ms + 0.1 mm = 3.7 mm
  SECTION("rotation") {  // 3 * 12 rad/s * 1 ms + 2 mrad = 38 mrad
    bench.report.X_BH.rotation = Quaterniond(Eigen::AngleAxisd(0.039, Vector3d::UnitY()));
  }
  const DeviceSample there = bench.step();
  CHECK(there.fault == Fault::pose_jumped);
  CHECK(there.X_BH.translation_m == Vector3d::Zero());
  CHECK(there.X_BH.rotation.isApprox(Quaterniond::Identity()));
  CHECK(bench.step().fault == Fault::none);
  bench.report.X_BH = {};
  CHECK(bench.step().fault == Fault::pose_jumped);
}

TEST_CASE("a large displacement after lost reports is no jump") {
  Bench bench;
  bench.step();
  for (int i = 0; i < 9; ++i) bench.push();
  bench.link.reports.clear();
  bench.report.X_BH.translation_m.x() = 0.010;  // 1 m/s for 10 ms
  const DeviceSample sample = bench.step();
  CHECK(sample.missing == 9);
  CHECK(sample.fault == Fault::none);
}

TEST_CASE("motion during invalid samples does not make the next valid sample a jump") {
  Bench bench;
  bench.step();
  bench.report.X_BH.rotation.coeffs() *= 0.5;
  for (int i = 0; i < 12; ++i) bench.step();
  bench.report.X_BH = {};
  bench.report.X_BH.translation_m.x() = 0.012;  // 0.9 m/s for 13 ms
  CHECK(bench.step().fault == Fault::none);
}

TEST_CASE("two consecutive samples above the speed limit are a fault") {
  Bench bench;
  bench.step();
  std::function<void()> move;
  SECTION("reported linear") {
    move = [&] { bench.report.V_BH.linear_m_per_s.x() = 1.21; };
  }
  SECTION("reported angular") {
    move = [&] { bench.report.V_BH.angular_rad_per_s.z() = -12.1; };
  }
  SECTION("differenced linear") {
    move = [&] { bench.report.X_BH.translation_m.z() += 1.35e-3; };
  }
  SECTION("differenced angular") {
    move = [&] {
      const Quaterniond turn(Eigen::AngleAxisd(15e-3, Vector3d::UnitX()));
      bench.report.X_BH.rotation = turn * bench.report.X_BH.rotation;
    };
  }
  move();
  CHECK(bench.step().fault == Fault::none);
  move();
  CHECK(bench.step().fault == Fault::overspeed);
  move();
  CHECK(bench.step().fault == Fault::overspeed);
  bench.report.V_BH = {};
  CHECK(bench.step().fault == Fault::none);
  move();
  CHECK(bench.step().fault == Fault::none);
}

TEST_CASE("motion just within the speeds is no fault") {
  Bench bench;
  bench.report.V_BH = {{1.19, 0, 0}, {0, 11.9, 0}};
  for (int i = 0; i < 100; ++i) {
    bench.report.X_BH.translation_m.x() += 1.19e-3;
    CHECK(bench.step().fault == Fault::none);
  }
}

TEST_CASE("acknowledged is the last command that the device accepted") {
  Bench bench;
  bench.report.acknowledged = 57;  // of a previous session
  CHECK(bench.step().acknowledged == 0);
  for (std::uint64_t sent = 1; sent <= 1000; ++sent) {
    bench.device.write(bench.now, {}, true);
    REQUIRE(bench.device.commands_sent() == sent);
    if (sent < 4) continue;
    bench.report.acknowledged = static_cast<std::uint32_t>((sent - 2) & 0xff);
    REQUIRE(bench.step().acknowledged == sent - 2);
  }
}

TEST_CASE("a wrench within the limits is sent unchanged, with rising sequence and the profile's hold time") {
  Bench bench;
  for (std::uint32_t i = 1; i <= 3; ++i) {
    CHECK(bench.device.write(bench.now, {{1, -2, 3}, {0.1, 0, -0.2}}, true) == Fault::none);
    const auto& [outcome, report] = bench.link.written.back();
    CHECK(outcome == Decoding::ok);
    CHECK(report.enable);
    CHECK(report.sequence == i);
    CHECK(report.hold_time_s == Approx(0.008));
    CHECK(report.F.force_N.isApprox(Vector3d(1, -2, 3), 1e-9));
    CHECK(report.F.torque_Nm.isApprox(Vector3d(0.1, 0, -0.2), 1e-9));
  }
}

TEST_CASE("a wrench beyond the limits is scaled to them and keeps its direction") {
  Bench bench;
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto vector = [&](double size) {
    return Vector3d(size * unit(random), size * unit(random), size * unit(random));
  };
  for (int i = 0; i < 20'000; ++i) {
    const Wrench F{vector(std::pow(10.0, 3.0 * unit(random))), vector(std::pow(10.0, 3.0 * unit(random)))};
    REQUIRE(bench.device.write(bench.now, F, true) == Fault::none);
    const Wrench sent = last_wrench(bench);
    REQUIRE(sent.force_N.norm() <= kProfile.max_force_N);
    REQUIRE(sent.torque_Nm.norm() <= kProfile.max_torque_Nm);
    REQUIRE((F.force_N.normalized() * sent.force_N.norm() - sent.force_N).norm() < 2e-6);
    REQUIRE((F.torque_Nm.normalized() * sent.torque_Nm.norm() - sent.torque_Nm).norm() < 2e-6);
    REQUIRE(sent.force_N.norm() >= std::min(F.force_N.norm(), kProfile.max_force_N) - 2e-6);
    bench.link.written.clear();
  }
  for (const double huge : {1e160, 1e300, std::numeric_limits<double>::max()}) {
    bench.device.write(bench.now, {{huge, huge, 0}, {0, 0, -huge}}, true);
    CHECK(last_wrench(bench).force_N.norm() <= kProfile.max_force_N);
    CHECK(last_wrench(bench).torque_Nm.norm() <= kProfile.max_torque_Nm);
  }
}

TEST_CASE("a wrench that is not finite is sent as zero with the motors off") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  for (const double bad : {nan, inf, -inf}) {
    for (int component = 0; component < 6; ++component) {
      Bench bench;
      Wrench F{{1, 1, 1}, {0.1, 0.1, 0.1}};
      (component < 3 ? F.force_N : F.torque_Nm)[component % 3] = bad;
      CHECK(bench.device.write(bench.now, F, true) == Fault::wrench_not_finite);
      REQUIRE(bench.link.written.size() == 1);
      CHECK_FALSE(bench.link.written.back().report.enable);
      CHECK(last_wrench(bench).force_N == Vector3d::Zero());
      CHECK(last_wrench(bench).torque_Nm == Vector3d::Zero());
    }
  }
}

TEST_CASE("with the motors off no wrench is sent") {
  Bench bench;
  bench.device.write(bench.now, {{5, 0, 0}, {0, 0, 0}}, false);
  CHECK(last_wrench(bench).force_N == Vector3d::Zero());
  CHECK_FALSE(bench.link.written.back().report.enable);
}

TEST_CASE("a rejected wrench is a fault") {
  Bench bench;
  bench.link.write_status = LinkStatus::not_ready;
  CHECK(bench.device.write(bench.now, {}, true) == Fault::write_failed);
  bench.link.write_status = LinkStatus::disconnected;
  CHECK(bench.device.write(bench.now, {}, true) == Fault::device_lost);
}

TEST_CASE("release sends five zero wrenches with the motors off, in every state") {
  Bench bench;
  bench.device.write(bench.now, {{5, 0, 0}, {0, 0, 0.1}}, true);
  bench.link.written.clear();
  bench.device.release(bench.now);
  REQUIRE(bench.link.written.size() == 5);
  for (std::size_t i = 0; i < 5; ++i) {
    CHECK(bench.link.written[i].report.sequence == 2 + i);
    CHECK_FALSE(bench.link.written[i].report.enable);
    CHECK(bench.link.written[i].report.F.force_N == Vector3d::Zero());
    CHECK(bench.link.written[i].report.F.torque_Nm == Vector3d::Zero());
  }
  bench.link.write_status = LinkStatus::disconnected;
  bench.device.release(bench.now);
  bench.device.close();
  bench.device.release(bench.now);
  bench.device.close();
  CHECK(bench.link.written.size() == 5);

  ScriptedLink link;
  ProfileDevice never_opened(kProfile, link);
  never_opened.release({});
  CHECK(link.written.empty());
  CHECK(never_opened.read_newest({}).fault == Fault::device_lost);
}

TEST_CASE("an invalid profile is rejected before the link is opened") {
  using Catch::Contains;
  const auto rejects = [](const std::function<void(DeviceProfile&)>& spoil, const std::string& word) {
    DeviceProfile profile = kProfile;
    spoil(profile);
    ScriptedLink link;
    ProfileDevice device(profile, link);
    CHECK_THROWS_WITH(device.open(), Contains("loopback") && Contains(word));
    CHECK(link.opened == 0);
  };
  rejects([](DeviceProfile& p) { p.max_force_N = DeviceProfile::kNotStated; }, "max_force_N");
  rejects([](DeviceProfile& p) { p.max_torque_Nm = -1; }, "max_torque_Nm");
  rejects([](DeviceProfile& p) { p.max_linear_speed_m_per_s = 0; }, "max_linear_speed");
  rejects([](DeviceProfile& p) { p.max_angular_speed_rad_per_s = 0; }, "max_angular_speed");
  rejects([](DeviceProfile& p) { p.stale_fault_s = DeviceProfile::kNotStated; }, "stale_fault_s");
  rejects([](DeviceProfile& p) { p.pose_report.position.byte = 20; }, "overlaps");
  rejects([](DeviceProfile& p) { p.wrench_report.torque.present = false; }, "torque");
}

TEST_CASE("a device with keep-alive gets it at its period, and its shutdown report at the end") {
  DeviceProfile profile = kProfile;
  profile.keep_alive.bytes = {0x26};
  profile.keep_alive_period_s = 0.5;
  profile.shutdown.bytes = {0x24, 0x00};
  ScriptedLink link;
  ProfileDevice device(profile, link);
  device.open();
  TimePoint now{};
  device.read_newest(now);
  device.assume_trusted();
  for (int i = 0; i <= 2000; ++i) device.read_newest(now += 1ms);
  CHECK(link.written.size() == 4);
  for (const auto& written : link.written) CHECK(written.outcome == Decoding::wrong_length);
  link.written.clear();
  device.release(now);
  REQUIRE(link.written.size() == 6);
  CHECK(link.written[4].outcome == Decoding::ok);
  CHECK(link.written[5].outcome == Decoding::wrong_length);
}

TEST_CASE("a device without torque drops it, and a device without a watchdog gets a quarter of its limits") {
  DeviceProfile profile = kProfile;
  profile.wrench_report.torque.present = false;
  profile.max_torque_Nm = 0.0;
  ScriptedLink link;
  ProfileDevice device(profile, link);
  device.open();
  TimePoint now{};
  device.read_newest(now);
  device.assume_trusted();
  CHECK(device.write(now, {{20, 0, 0}, {0, 0.1, 0}}, true) == Fault::none);
  const DeviceSample sample = device.read_newest(now);
  CHECK(dof_text(sample.driven_dofs) == "x y z");
  CHECK(dof_text(sample.dropped_dofs) == "ry");

  profile = kProfile;
  profile.watchdog_s = DeviceProfile::kNotStated;
  ScriptedLink other;
  ProfileDevice unwatched(profile, other);
  unwatched.open();
  unwatched.read_newest(now);
  unwatched.assume_trusted();
  unwatched.write(now, {{20, 0, 0}, {0, 9, 0}}, true);
  CHECK(other.written.back().report.F.force_N.x() == Approx(2.5).epsilon(1e-6));
  CHECK(other.written.back().report.F.torque_Nm.y() == Approx(0.125).epsilon(1e-4));
}

TEST_CASE("the frames of the device convert to base and handle in both directions") {
  DeviceProfile profile = kProfile;
  Matrix3d R;  // x right, y toward the user, z down
  R << 0, -1, 0, -1, 0, 0, 0, 0, -1;
  profile.X_BD = {Quaterniond(R), {0.5, 0, 0}};
  profile.X_EH = {Quaterniond::Identity(), {0, 0, 0.1}};
  ScriptedLink link;
  ProfileDevice device(profile, link);
  device.open();
  TimePoint now{};
  device.read_newest(now);
  device.assume_trusted();
  PoseReport report;
  report.sequence = 1;
  report.X_BH.translation_m = {0.01, 0.02, 0.03};
  report.X_BH.rotation = Quaterniond(Eigen::AngleAxisd(std::acos(0.0), Vector3d::UnitX()));
  report.V_BH = {{0.1, 0.2, 0.3}, {0, 0, 1}};
  std::vector<std::uint8_t> bytes(profile.pose_report.length);
  encode(profile.pose_report, report, bytes);
  link.reports.emplace_back(bytes, now += 1ms);
  const DeviceSample sample = device.read_newest(now);
  REQUIRE(sample.fault == Fault::none);
  // A quarter turn about the device's x takes the handle point from 0.1 m along z to 0.1 m along -y.
  const Vector3d p_D(0.01, 0.02 - 0.1, 0.03), w_D(0, 0, 1);
  CHECK((sample.X_BH.translation_m - (R * p_D + Vector3d(0.5, 0, 0))).norm() < 1e-6);
  CHECK((sample.V_BH.angular_rad_per_s - R * w_D).norm() < 1e-6);
  CHECK(
      (sample.V_BH.linear_m_per_s - R * (Vector3d(0.1, 0.2, 0.3) + w_D.cross(Vector3d(0, -0.1, 0)))).norm() <
      1e-6);

  const Wrench F{{1, 2, 3}, {0.01, 0.02, 0.03}};
  device.write(now, F, true);
  const Wrench sent = link.written.back().report.F;
  CHECK((sent.force_N - R.transpose() * F.force_N).norm() < 1e-5);
  const Vector3d about_E =
      R.transpose() * F.torque_Nm + Vector3d(0, -0.1, 0).cross(R.transpose() * F.force_N);
  CHECK((sent.torque_Nm - about_E).norm() < 1e-5);
}

TEST_CASE("nothing is written before the reports have been those of the profile", "[trust]") {
  ScriptedLink link;
  DeviceProfile profile = kProfile;
  profile.shutdown.bytes = {4, 0};
  profile.keep_alive.bytes = {5, 1};
  profile.keep_alive_period_s = 0.001;
  ProfileDevice device(profile, link);
  TimePoint now{};
  device.open();
  device.read_newest(now);
  PoseReport report;
  const auto step = [&](bool valid) {
    now += 1ms;
    ++report.sequence;
    report.device_time += 1000;
    std::vector<std::uint8_t> bytes(profile.pose_report.length);
    encode(profile.pose_report, report, bytes);
    if (!valid) bytes[10] ^= 1;
    link.reports.emplace_back(bytes, now);
    device.read_newest(now);
    return device.write(now, {{0, 0, 1.0}, {}}, true);
  };
  SECTION("another device: reports that are not those of the profile") {
    for (int i = 0; i < 500; ++i) {
      CHECK(step(false) == Fault::none);
      if (i % 50 == 0) device.release(now);
    }
    CHECK_FALSE(device.trusted());
    CHECK(link.written_bytes.empty());
  }
  SECTION("one valid report is not enough, and an invalid one starts the count again") {
    for (int i = 0; i < 20; ++i) step(i % ProfileDevice::kTrustReports != 0);
    CHECK(link.written_bytes.empty());
    CHECK(device.commands_sent() == 0);
  }
  SECTION("the device of the profile") {
    for (int i = 0; i < ProfileDevice::kTrustReports - 1; ++i) step(true);
    CHECK(link.written_bytes.empty());
    step(true);
    CHECK(device.trusted());
    REQUIRE_FALSE(link.written.empty());
    CHECK(link.written.back().report.F.force_N.z() == Approx(1.0));
    step(false);  // a bad report later changes nothing
    CHECK(device.trusted());
    device.close();
    device.open();  // it may be another device now
    CHECK_FALSE(device.trusted());
  }
}

TEST_CASE("a lock-step device gets zeros with the motors off before it is trusted", "[trust]") {
  ScriptedLink link;
  DeviceProfile profile = kProfile;
  profile.stream = StreamStyle::lock_step;
  ProfileDevice device(profile, link);
  TimePoint now{};
  device.open();
  for (int i = 0; i < 100; ++i) {
    device.read_newest(now += 1ms);
    device.write(now, {{0, 0, 1.0}, {0.01, 0, 0}}, true);
  }
  REQUIRE_FALSE(link.written.empty());
  for (const auto& command : link.written) {
    CHECK_FALSE(command.report.enable);
    CHECK(command.report.F.force_N.norm() == 0.0);
    CHECK(command.report.F.torque_Nm.norm() == 0.0);
  }
}

TEST_CASE("a report that the device declares and the profile does not need is no error", "[spacemouse]") {
  Bench bench;
  for (int i = 0; i < 10; ++i) bench.step();
  const std::vector<std::uint8_t> keys = {0x1c, 7, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  bench.link.reports.emplace_back(keys, bench.now);
  CHECK(bench.step().rejected == 1);
  bench.link.declares_all = true;
  bench.link.reports.emplace_back(keys, bench.now);
  const DeviceSample sample = bench.step();
  CHECK(sample.rejected == 0);
  CHECK(sample.fresh);
  bench.link.reports.emplace_back(std::vector<std::uint8_t>{1, 2, 3},
                                  bench.now);  // a report of the profile, damaged
  CHECK(bench.step().rejected == 1);
}

}  // namespace wrenchd::test_profile_device
