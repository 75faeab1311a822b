// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "config/load_profile.hpp"
#include "devices/links/link_settings.hpp"
#include "devices/links/loopback_link.hpp"
#include "devices/profile_device.hpp"
#include "devices/simulation/emulated_falcon.hpp"
#include "devices/simulation/emulated_polhem.hpp"
#include "devices/simulation/emulated_spacemouse.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/polhem_pose.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_emulators {

using namespace wrenchd::test;
using namespace std::chrono_literals;

namespace {

DeviceProfile shipped(const std::string& name) {
  return load_profile(test::source_path("config/profiles/") + name + ".toml");
}

/// The device of a shipped profile on its emulator, opened and read once.
template <class Emulator>
struct Bench {
  template <class... Args>
  explicit Bench(const std::string& profile_name, Args&&... args)
      : profile(shipped(profile_name)), emulator(std::forward<Args>(args)...) {}

  void open() {
    device.open();
    sample = device.read_newest(clock.now());
  }
  void pass(Duration time) { clock.sleep_until(clock.now() + time); }
  /// Reads, then writes, once per millisecond.
  void step(const Wrench& F = {}, bool motors_on = false) {
    pass(1ms);
    sample = device.read_newest(clock.now());
    last_write = device.write(clock.now(), F, motors_on);
  }
  void steps(int count) {
    for (int i = 0; i < count; ++i) step();
  }

  DeviceProfile profile;
  VirtualClock clock;
  Emulator emulator;
  LoopbackLink link{emulator, clock};
  ProfileDevice device{profile, link};
  DeviceSample sample;
  Fault last_write = Fault::none;
};

using Mouse = EmulatedSpaceMouse;

}  // namespace

// --- SpaceMouse -------------------------------------------------------------------------------------------

TEST_CASE("an untouched SpaceMouse sends nothing, which is no fault", "[emulators]") {
  for (const auto& [name, format] : {std::pair("spacemouse_split", Mouse::Format::split),
                                     {"spacemouse_combined", Mouse::Format::combined}}) {
    Bench<Mouse> bench(name, format);
    bench.open();
    for (int i = 0; i < 3000; ++i) {
      bench.step();
      REQUIRE(bench.sample.fault == Fault::none);
    }
    CHECK(same_bits(bench.sample.X_BH, {}));
    CHECK(bench.sample.sequence == 0);
    CHECK(bench.sample.sensed_dofs == kAllDofs);
    CHECK(bench.sample.driven_dofs == kNoDof);
  }
}

TEST_CASE("keys and the 31st button of a SpaceMouse Enterprise are read, and are no motion", "[emulators]") {
  Bench<Mouse> bench("spacemouse_combined", Mouse::Format::enterprise);
  bench.open();
  bench.steps(100);
  for (const std::uint16_t key : {std::uint16_t{30}, std::uint16_t{0}}) {
    bench.emulator.set_keys({key});
    for (int i = 0; i < 50; ++i) {
      bench.step();
      REQUIRE(bench.sample.fault == Fault::none);
      REQUIRE(bench.sample.rejected == 0);
    }
  }
  CHECK(same_bits(bench.sample.X_BH, {}));
  bench.emulator.set_buttons(1u << 30);
  bench.steps(50);
  CHECK(bench.sample.buttons == 1u << 30);
}

TEST_CASE("the deflection of the puck moves the tool, in both formats", "[emulators]") {
  // To the right, half as much toward the user, a quarter down: -y, -x / 2, -z / 4 in the base.
  const Vector3d pushed_m = 4e-6 * Vector3d(-140, -280, -70);
  for (const auto& [name, format] : {std::pair("spacemouse_split", Mouse::Format::split),
                                     {"spacemouse_combined", Mouse::Format::combined}}) {
    Bench<Mouse> bench(name, format);
    bench.open();
    bench.steps(100);
    bench.emulator.set_deflection({280, 140, 70, 0, 0, 0});
    const TimePoint pushed = bench.clock.now();
    while (bench.sample.V_BH.linear_m_per_s.isZero()) bench.step();
    CHECK(bench.clock.now() - pushed <= 17ms);
    const Vector3d start = bench.sample.X_BH.translation_m;
    bench.steps(1000);
    const Vector3d way = bench.sample.X_BH.translation_m - start;
    const double firmness = std::pow((pushed_m.norm() / 1.4e-3 - 0.08) / 0.92, 2.0);
    const Vector3d expected = 71.0 * 1.4e-3 * firmness * pushed_m.normalized();  // after one second
    INFO(name << ": " << way.transpose() << " is not " << expected.transpose());
    CHECK((way - expected).norm() < 1e-6);
    CHECK(bench.sample.X_BH.rotation.angularDistance(Quaterniond::Identity()) < 1e-9);

    bench.emulator.set_deflection({0, 0, 0, 0, 0, -200});  // about z down: the opposite rotation about z up
    bench.steps(40);
    const Quaterniond before = bench.sample.X_BH.rotation;
    bench.steps(500);
    const Vector3d turn = rotation_vector(bench.sample.X_BH.rotation * before.conjugate());
    const double turned = std::pow((200 * 2.5e-4 / 0.0875 - 0.08) / 0.92, 2.0);
    CHECK((turn - Vector3d(0, 0, 0.5 * 11.4 * 0.0875 * turned)).norm() < 1e-6);
  }
}

TEST_CASE("the buttons of the puck recentre the pose and reduce its speed", "[emulators]") {
  Bench<Mouse> bench("spacemouse_combined", Mouse::Format::combined);
  bench.open();
  bench.emulator.set_deflection({0, -350, 0, 0, 0, 100});
  bench.steps(500);
  const double fast_m_per_s = bench.sample.V_BH.linear_m_per_s.norm();
  CHECK(fast_m_per_s == Approx(71.0 * 1.4e-3));
  REQUIRE(bench.sample.X_BH.translation_m.x() > 0.02);

  bench.emulator.set_buttons(2);
  bench.steps(20);
  CHECK(bench.sample.V_BH.linear_m_per_s.norm() == Approx(0.2 * fast_m_per_s));
  bench.emulator.set_buttons(0);
  bench.steps(20);
  CHECK(bench.sample.V_BH.linear_m_per_s.norm() == Approx(fast_m_per_s));

  bench.emulator.set_deflection({});
  bench.steps(60);
  bench.emulator.set_buttons(1);
  bench.steps(20);
  CHECK(same_bits(bench.sample.X_BH, {}));
  bench.emulator.set_deflection(
      {0, -350, 0, 0, 0, 0});  // with the button held, the pose continues from there
  bench.steps(500);
  CHECK(bench.sample.X_BH.translation_m.x() > 0.02);
}

TEST_CASE("a released puck sends three packets of zeros and the pose stays", "[emulators]") {
  Bench<Mouse> bench("spacemouse_split", Mouse::Format::split);
  bench.open();
  bench.emulator.set_deflection({100, 0, 0, 50, 0, 0});
  bench.steps(100);
  bench.emulator.set_deflection({});
  bench.steps(40);
  const std::uint64_t sequence = bench.sample.sequence;
  const Pose left = bench.sample.X_BH;
  bench.steps(2000);
  CHECK(bench.sample.sequence == sequence);
  CHECK(same_bits(bench.sample.X_BH, left));
  CHECK(bench.sample.fault == Fault::none);
}

TEST_CASE("a SpaceMouse that stops sending while deflected stops the tool, with a fault", "[emulators]") {
  Bench<Mouse> bench("spacemouse_split", Mouse::Format::split);
  bench.open();
  bench.emulator.set_deflection({100, 0, 0, 0, 0, 0});
  bench.steps(100);
  REQUIRE_FALSE(bench.sample.V_BH.linear_m_per_s.isZero());
  bench.emulator.stop_sending();  // battery or radio failure
  int faults = 0;
  for (int i = 0; i < 1000; ++i) {
    bench.step();
    faults += bench.sample.fault == Fault::sample_stale ? 1 : 0;
    if (i < 190) REQUIRE(bench.sample.fault == Fault::none);
  }
  CHECK(faults == 1);
  CHECK(bench.sample.V_BH.linear_m_per_s.isZero());
}

TEST_CASE("buttons arrive, and the LED is off at the end", "[emulators]") {
  Bench<Mouse> bench("spacemouse_combined", Mouse::Format::combined);
  bench.open();
  bench.emulator.set_buttons(2);
  bench.steps(20);
  CHECK(bench.sample.buttons == 2);
  bench.emulator.set_buttons(0);
  bench.steps(20);
  CHECK(bench.sample.buttons == 0);
  CHECK(bench.emulator.take_command(bench.clock.now(), std::array<std::uint8_t, 2>{4, 1}));
  CHECK(bench.emulator.led());
  bench.device.release(bench.clock.now());
  CHECK_FALSE(bench.emulator.led());
}

TEST_CASE("a wrench for a device without motors is dropped and reported", "[emulators]") {
  Bench<Mouse> bench("spacemouse_split", Mouse::Format::split);
  bench.open();
  bench.step({{1, 0, 0}, {0, 0, 0.1}}, true);
  CHECK(bench.last_write == Fault::none);
  bench.step();
  CHECK(dof_text(bench.sample.dropped_dofs) == "x rz");  // of the previous write
  bench.step();
  CHECK(bench.sample.dropped_dofs == kNoDof);
}

// --- Polhem -----------------------------------------------------------------------------------------------

TEST_CASE("encoder counts give the pose of the manufacturer's formulas", "[emulators]") {
  std::mt19937 random(5);
  const auto between = [&](int low, int high) {
    return std::uniform_int_distribution<int>(low, high)(random);
  };
  for (const auto& [name, bytes] : {std::pair("polhem", 64u), {"polhem_lpc1768", 14u}}) {
    Bench<EmulatedPolhem> bench(name, bytes);
    bench.emulator.set_encoder_counts({0, 0, -5000, 0, 0, 0});
    bench.open();
    bench.steps(5);
    std::array<int, 6> counts = {0, 0, -5000, 0, 0, 0};
    for (int i = 0; i < 2000; ++i) {
      for (int j = 0; j < 3; ++j) {  // within the speed limits
        auto& base = counts[static_cast<std::size_t>(j)];
        base = std::clamp(base + between(-20, 20), j == 2 ? -6500 : -1500, j == 2 ? -3500 : 1500);
        auto& wrist = counts[static_cast<std::size_t>(j + 3)];
        wrist = std::clamp(wrist + between(-1, 1), -300, 300);
      }
      bench.emulator.set_encoder_counts(counts);
      bench.emulator.set_handle_button(i % 100 < 50);
      bench.steps(2);
      REQUIRE(bench.sample.fault == Fault::none);
      const PolhemPose place = polhem_pose(counts);
      REQUIRE((bench.sample.X_BH.translation_m - kHalfTurn * place.p).norm() < 1e-9);
      const Matrix3d R = kHalfTurn * place.R * kHalfTurn;
      REQUIRE((bench.sample.X_BH.rotation.toRotationMatrix() - R).cwiseAbs().maxCoeff() < 1e-9);
      REQUIRE(bench.sample.buttons == (i % 100 < 50 ? 1u : 0u));
    }
    CHECK(bench.link.dropped() == 0);
  }
}

TEST_CASE("a force on a Polhem gives the currents of the manufacturer's formulas", "[emulators]") {
  std::mt19937_64 random(6);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  Bench<EmulatedPolhem> bench("polhem", 64u);
  const std::array<int, 6> counts = {700, -400, -4600, 20, 60, -40};
  bench.emulator.set_encoder_counts(counts);
  bench.open();
  bench.steps(5);
  const PolhemPose place = polhem_pose(counts);
  for (int i = 0; i < 500; ++i) {
    const Vector3d F(2 * unit(random), 2 * unit(random), 2 * unit(random));
    bench.step({F, {0, 0, 0}}, true);
    const std::array<double, 3> expected_mA = polhem_currents_mA(place, F);
    for (std::size_t j = 0; j < 3; ++j)
      REQUIRE(std::abs(bench.emulator.currents_mA()[j] - expected_mA[j]) <= 0.5 + 1e-6);
  }
  bench.step({{1, 0, 0}, {0, 0.2, 0}}, true);
  CHECK(dof_text(bench.device.read_newest(bench.clock.now()).dropped_dofs) == "ry");
}

TEST_CASE("a Polhem answers commands only, and wrenchd sends the first one", "[emulators]") {
  Bench<EmulatedPolhem> bench("polhem", 64u);
  bench.emulator.set_encoder_counts({0, 0, -5000, 0, 0, 0});
  struct NullSink final : ReportSink {
    void take_report(TimePoint, std::span<const std::uint8_t>) noexcept override {}
  } sink;
  bench.emulator.advance_to(bench.clock.now(), sink);  // its first report, at power-on, is lost
  bench.pass(5s);
  CHECK(bench.emulator.reports_sent() == 1);
  bench.open();  // the first read sends zeros
  CHECK(bench.emulator.reports_sent() == 1);
  for (int i = 0; i < 30; ++i) {  // reading only: one report per prompt of wrenchd
    bench.pass(1ms);
    bench.sample = bench.device.read_newest(bench.clock.now());
    REQUIRE(bench.sample.fault == Fault::none);
  }
  CHECK(bench.emulator.reports_sent() >= 3);
  CHECK(bench.emulator.reports_sent() <= 4);
  const std::uint64_t before = bench.emulator.reports_sent();
  bench.steps(100);
  CHECK(bench.emulator.reports_sent() - before >= 99);
}

TEST_CASE("a Polhem's amplifiers are off half a second after the last report, and at once after a release",
          "[emulators]") {
  Bench<EmulatedPolhem> bench("polhem", 64u);
  bench.emulator.set_encoder_counts({0, 0, -5000, 0, 0, 0});
  bench.open();
  bench.steps(5);
  bench.step({{0, 0, 1}, {0, 0, 0}}, true);
  CHECK(bench.emulator.currents_mA()[2] == -247);
  SECTION("the host hangs") {
    const TimePoint last = bench.clock.now();
    std::array<std::uint8_t, 64> buffer;
    bench.link.read(last + 499ms, buffer);
    CHECK(bench.emulator.amplifiers_on());
    CHECK(bench.emulator.currents_mA()[2] == -247);
    bench.link.read(last + 501ms, buffer);
    CHECK_FALSE(bench.emulator.amplifiers_on());
    CHECK(bench.emulator.currents_mA()[2] == 0);
  }
  SECTION("release") {
    bench.device.release(bench.clock.now());
    CHECK(bench.emulator.currents_mA() == std::array<int, 3>{});
  }
  SECTION("a wrench that is not finite") {
    bench.step({{NAN, 0, 0}, {0, 0, 0}}, true);
    CHECK(bench.last_write == Fault::wrench_not_finite);
    CHECK(bench.emulator.currents_mA() == std::array<int, 3>{});
  }
}

TEST_CASE("the profile's calibration sets the counters to home", "[emulators]") {
  Bench<EmulatedPolhem> bench("polhem", 64u);
  bench.emulator.set_encoder_counts({12, 34, 56, 7, 8, 9});  // powered on at home, with arbitrary counters
  bench.emulator.press_calibration_button();
  bench.link.open();
  CHECK(bench.link.write(bench.clock.now(), bench.profile.calibration.bytes) == LinkStatus::ok);
  CHECK(bench.emulator.currents_mA() == std::array<int, 3>{});
  bench.open();
  bench.steps(5);
  CHECK((bench.sample.X_BH.translation_m - Vector3d(0.007, 0, 0.132)).norm() < 1e-12);
  CHECK(bench.sample.X_BH.rotation.angularDistance(Quaterniond::Identity()) < 1e-7);
}

// --- Falcon -----------------------------------------------------------------------------------------------

TEST_CASE("a Falcon starts: handshake, firmware with echo, baud rate", "[emulators]") {
  std::vector<std::uint8_t> firmware(1000);
  std::mt19937 random(8);
  for (std::uint8_t& byte : firmware) byte = static_cast<std::uint8_t>(random() & 0xffu);
  EmulatedFalcon falcon;
  SECTION("at once") {}
  SECTION("with blocks that come back wrong, as real ones do") {
    falcon.corrupt_firmware_echoes(3);
  }
  SECTION("with a loader that is slow to answer") {
    falcon.ignore_handshakes(42);
  }
  falcon_start(falcon, firmware);
  CHECK(falcon.state() == EmulatedFalcon::State::running);
  CHECK(falcon.firmware() == firmware);
}

TEST_CASE("a Falcon that does not start gives an error with the reason", "[emulators]") {
  using Catch::Contains;
  const std::vector<std::uint8_t> firmware(300, 7);
  EmulatedFalcon dead;
  dead.ignore_handshakes(1'000'000);
  CHECK_THROWS_WITH(falcon_start(dead, firmware, 2),
                    Contains("its boot loader does not answer") && Contains("2 attempts"));
  EmulatedFalcon deaf;
  deaf.corrupt_firmware_echoes(1'000'000);
  CHECK_THROWS_WITH(falcon_start(deaf, firmware), Contains("were echoed wrongly"));
  CHECK_THROWS_WITH(falcon_start(deaf, {}), Contains("the firmware is empty"));
  CHECK(deaf.state() != EmulatedFalcon::State::running);
}

TEST_CASE("a Falcon can be opened in every state, and firmware is loaded only if needed", "[emulators]") {
  using Catch::Contains;
  const TemporaryDirectory dir;
  const std::string file = dir.write("firmware.bin", std::string(700, 'x')).string();
  EmulatedFalcon falcon;
  CHECK_THROWS_WITH(falcon_open(falcon, ""), Contains("none is named") && Contains("inherits falcon"));
  CHECK_THROWS_WITH(falcon_open(falcon, file + "x"), Contains("cannot read the firmware " + file + "x"));
  CHECK(falcon.state() != EmulatedFalcon::State::running);
  falcon_open(falcon, file);
  CHECK(falcon.state() == EmulatedFalcon::State::running);
  CHECK(falcon.firmware() == std::vector<std::uint8_t>(700, 'x'));
  falcon.write(std::vector<std::uint8_t>{'<', 'A', 'A', 'A', 'A', 'A', 'A', 'A', 'A', 'A', 'A', 'A', 'A', 'B',
                                         'A', '>'});
  falcon.perform_homing();
  falcon_open(falcon, "");  // a firmware runs and is homed
  CHECK(falcon.homed());
  CHECK(falcon.firmware().size() == 700);
  CHECK(falcon.efforts() == std::array<int, 3>{});
}

TEST_CASE("the Falcon's profile gives its link settings", "[emulators]") {
  const LinkSettings settings = link_settings(shipped("falcon"));
  CHECK(settings.in_endpoint == 0x81);
  CHECK(settings.out_endpoint == 0x02);
  CHECK(settings.prefix_bytes == 2);
  CHECK(settings.max_report_bytes == 18);
  CHECK(settings.frame.length == 16);
  CHECK(settings.frame.first == '<');
  CHECK(settings.frame.last == '>');
  CHECK(settings.start_serial);
  const LinkSettings polhem = link_settings(shipped("polhem"));
  CHECK(polhem.max_report_bytes == 64);
  CHECK(polhem.in_endpoint == 0);
  CHECK_FALSE(polhem.start_serial);
}

TEST_CASE("before homing, the pose of a Falcon is not used and it is not driven", "[emulators]") {
  Bench<EmulatedFalcon> bench("falcon");
  bench.emulator.run();
  bench.emulator.set_true_counts({100, 100, 100});
  bench.emulator.set_power_on_counts({500, -200, 30});
  bench.open();
  for (int i = 0; i < 50; ++i) {
    bench.step({{1, 0, 0}, {0, 0, 0}}, true);
    REQUIRE_FALSE(bench.sample.fresh);
    REQUIRE(bench.sample.fault == Fault::none);
    REQUIRE(bench.emulator.efforts() == std::array<int, 3>{});
  }
  CHECK_FALSE(bench.sample.homed);
  bench.emulator.perform_homing_motion();
  CHECK(bench.emulator.homed());
  bench.steps(2);
  CHECK(bench.sample.homed);
  CHECK(bench.sample.fresh);
  CHECK(bench.sample.fault == Fault::none);
  bench.step({{1, 0, 0}, {0, 0, 0}}, true);
  CHECK(bench.emulator.efforts()[0] > 0);
}

TEST_CASE("the pose of a Falcon follows its handle, and undriven components are reported", "[emulators]") {
  Bench<EmulatedFalcon> bench("falcon");
  bench.emulator.run();
  bench.open();
  bench.steps(3);
  bench.emulator.perform_homing_motion();
  bench.steps(3);
  std::mt19937 random(9);
  std::array<int, 3> counts{};
  for (int i = 0; i < 2000; ++i) {
    for (int& count : counts)
      count = std::clamp(count + std::uniform_int_distribution<int>(-15, 15)(random), -350, 350);
    bench.emulator.set_true_counts(counts);
    bench.emulator.set_buttons(static_cast<unsigned>(i / 10) & 0xfu);
    bench.steps(2);
    REQUIRE(bench.sample.fault == Fault::none);
    REQUIRE(bench.sample.buttons == (static_cast<unsigned>(i / 10) & 0xfu));
    // Back to the device's axes, and through the constraint between each leg's angle and the handle position.
    const Vector3d b = bench.sample.X_BH.translation_m;
    const Vector3d p(-b.y(), b.z(), 0.1346 - b.x());
    for (int leg = 0; leg < 3; ++leg) {
      const double phi = (105.0 - 120.0 * leg) * std::numbers::pi / 180;
      const double t = (35.0 + counts[static_cast<std::size_t>(leg)] * 360.0 / 1280 * 14.25 / 110) *
                       std::numbers::pi / 180;
      const double u = p.x() * std::cos(phi) + p.y() * std::sin(phi) - 0.040;
      const double v = p.y() * std::cos(phi) - p.x() * std::sin(phi) + 0.02309;
      const double rho = 0.0225 + std::sqrt(0.1025 * 0.1025 - (v - 0.025) * (v - 0.025));
      const double away = std::hypot(u + 0.01443 - 0.060 * std::cos(t), p.z() - 0.060 * std::sin(t)) - rho;
      REQUIRE(std::abs(away) < 1e-6);
    }
    REQUIRE(bench.sample.X_BH.rotation.angularDistance(Quaterniond::Identity()) < 1e-7);
  }
  CHECK(dof_text(bench.sample.sensed_dofs) == "x y z");
  CHECK(dof_text(bench.sample.driven_dofs) == "x y z");
}

TEST_CASE("short packets of a Falcon are dropped, and its buttons do not flicker", "[emulators]") {
  Bench<EmulatedFalcon> bench("falcon");
  bench.emulator.run();
  bench.open();
  bench.steps(3);
  bench.emulator.perform_homing_motion();
  bench.emulator.set_buttons(5);
  bench.steps(3);
  REQUIRE(bench.sample.buttons == 5);
  bench.emulator.truncate_packets(4);
  std::uint32_t rejected = 0;
  for (int i = 0; i < 10; ++i) {
    bench.step();
    rejected += bench.sample.rejected;
    CHECK(bench.sample.buttons == 5);
    CHECK(bench.sample.fault == Fault::none);
  }
  CHECK(rejected == 4);
}

TEST_CASE("a Falcon has no watchdog and gets a quarter of its limits, at most 4096 motor counts",
          "[emulators]") {
  Bench<EmulatedFalcon> bench("falcon");
  bench.emulator.run();
  bench.open();
  bench.steps(3);
  bench.emulator.perform_homing_motion();
  bench.steps(3);
  bench.step({{100, 0, 0}, {0, 0, 0}}, true);
  const std::array<int, 3> most = bench.emulator.efforts();
  bench.step({{2, 0, 0}, {0, 0, 0}}, true);
  CHECK(bench.emulator.efforts() == most);
  bench.step({{1, 0, 0}, {0, 0, 0}}, true);
  CHECK(std::abs(2 * bench.emulator.efforts()[0] - most[0]) <= 2);
}

TEST_CASE("an unplugged device is lost until it is opened again", "[emulators]") {
  Bench<EmulatedPolhem> bench("polhem", 64u);
  bench.emulator.set_encoder_counts({0, 0, -5000, 0, 0, 0});
  bench.emulator.inject({SimulatedFault::Kind::unplug, 10500us, 100ms});
  bench.open();
  bench.steps(10);
  CHECK(bench.sample.fault == Fault::none);
  bench.step();
  CHECK(bench.sample.fault == Fault::device_lost);
  CHECK(bench.last_write == Fault::device_lost);
  CHECK_THROWS_WITH(bench.device.open(), Catch::Contains("unplugged"));
  bench.pass(1s);
  bench.open();
  bench.steps(10);
  CHECK(bench.sample.fault == Fault::none);
  CHECK(bench.sample.fresh);
}

}  // namespace wrenchd::test_emulators
