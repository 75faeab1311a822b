// SPDX-License-Identifier: GPL-3.0-or-later
//
// The emulated devices behind a mocked kernel: hidapi and libusb read and write them. The test controls the
// order of reports and commands, so the result does not depend on the speed of the machine.

#include <array>
#include <cmath>
#include <functional>
#include <memory>

#include <catch2/catch.hpp>

#include "config/load_profile.hpp"
#include "devices/links/hidraw_link.hpp"
#include "devices/links/usb_link.hpp"
#include "devices/profile_device.hpp"
#include "devices/simulation/emulated_polhem.hpp"
#include "devices/simulation/emulated_spacemouse.hpp"
#include "tests/devices/usb/mock_device.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/polhem_pose.hpp"

namespace wrenchd::test_emulated_devices {

using namespace wrenchd::test;
using namespace std::chrono_literals;

namespace {

TimePoint now() {
  return std::chrono::steady_clock::now();
}

/// The shipped profile without time limits, because they depend on the speed of the machine.
DeviceProfile timeless(const char* name) {
  DeviceProfile profile = load_profile(test::source_path("config/profiles/") + std::string(name) + ".toml",
                                       SearchPath({test::source_path("config")}));
  profile.stale_fault_s = 3600;
  if (profile.stream == StreamStyle::lock_step) profile.stream = StreamStyle::free_running;
  return profile;
}

/// Host and device side of a link.
struct Wire {
  MockMachine machine;
  std::unique_ptr<MockHidraw> hidraw;
  std::unique_ptr<MockUsb> usb;
  std::unique_ptr<ReportLink> link;
  bool numbered;

  Wire(bool over_hidraw, bool numbered_reports) : numbered(numbered_reports) {
    const MockIdentity identity{.numbered_reports = numbered};
    const LinkSettings patient{.write_deadline = 1h, .close_timeout = 10s};
    if (over_hidraw) {
      hidraw = std::make_unique<MockHidraw>(machine, identity);
      link = std::make_unique<HidrawLink>(list_usb_devices().at(0), patient);
    } else {
      usb = std::make_unique<MockUsb>(machine, identity);
      link = std::make_unique<UsbLink>(list_usb_devices().at(0), patient);
    }
  }
  void send(const Bytes& report) const { hidraw ? hidraw->send(report) : usb->send(report); }
  /// Returns the next report with this length; hidraw requires a zero in place of the id.
  Bytes receive(std::size_t length) const {
    if (usb) return usb->receive();
    Bytes bytes = hidraw->receive(length + (numbered ? 0 : 1));
    if (!numbered) bytes.erase(bytes.begin());
    return bytes;
  }
};

struct ToHost final : ReportSink {
  explicit ToHost(const Wire& to) : wire(to) {}
  void take_report(TimePoint, std::span<const std::uint8_t> report) noexcept override {
    wire.send({report.begin(), report.end()});
    ++sent;
  }
  const Wire& wire;
  int sent = 0;
};

}  // namespace

TEST_CASE("a Polhem over the mock kernel: encoders are read as poses, forces are written as currents",
          "[usb]") {
  const bool over_hidraw = GENERATE(true, false);
  Wire wire(over_hidraw, false);
  EmulatedPolhem board(64);
  std::array<int, 6> counts = {0, 0, -5000, 30, 40, -20};
  board.set_encoder_counts(counts);
  ProfileDevice device(timeless("polhem"), *wire.link);
  ToHost host(wire);
  TimePoint t{};
  device.open();
  device.read_newest(now());
  device.assume_trusted();    // the test writes after each report
  board.advance_to(t, host);  // report at power-on

  DeviceSample sample;
  for (int i = 0; i < 300; ++i) {
    wire.link->wait_readable(now() + 1h);
    sample = device.read_newest(now());
    REQUIRE(sample.fresh);
    REQUIRE(sample.fault == Fault::none);
    const PolhemPose place = polhem_pose(counts);
    REQUIRE((sample.X_BH.translation_m - kHalfTurn * place.p).norm() < 1e-6);
    REQUIRE(
        (sample.X_BH.rotation.toRotationMatrix() - kHalfTurn * place.R * kHalfTurn).cwiseAbs().maxCoeff() <
        1e-6);

    const Vector3d F(2 * std::sin(i), 2 * std::cos(2 * i), 2 * std::sin(3 * i));
    REQUIRE(device.write(now(), {F, Vector3d::Zero()}, true) == Fault::none);
    REQUIRE(board.take_command(t, wire.receive(64)));
    const std::array<double, 3> expected_mA = polhem_currents_mA(place, F);
    for (std::size_t j = 0; j < 3; ++j)
      REQUIRE(std::abs(board.currents_mA()[j] - expected_mA[j]) <= 0.5 + 1e-6);

    counts[static_cast<std::size_t>(i % 3)] += i % 5 < 3 ? 1 : -1;  // slow enough for every machine
    board.set_encoder_counts(counts);
    board.advance_to(t += 1ms, host);
  }
  CHECK(host.sent == 301);
}

TEST_CASE("a SpaceMouse over the mock kernel: the tool moves by velocity times time, and the LED goes off",
          "[usb]") {
  const bool over_hidraw = GENERATE(true, false);
  const bool split = GENERATE(true, false);
  Wire wire(over_hidraw, true);
  EmulatedSpaceMouse mouse(split ? EmulatedSpaceMouse::Format::split : EmulatedSpaceMouse::Format::combined);
  ProfileDevice device(timeless(split ? "spacemouse_split" : "spacemouse_combined"), *wire.link);
  ToHost host(wire);
  TimePoint t{};
  device.open();
  device.read_newest(now());
  mouse.set_deflection({280, 140, 70, 0, 0, -200});
  DeviceSample first, sample;
  for (int i = 0; i < 20; ++i) {
    for (const int before = host.sent; host.sent == before;) mouse.advance_to(t += 1ms, host);
    wire.link->wait_readable(now() + 1h);
    sample = device.read_newest(now());
    REQUIRE(sample.fault == Fault::none);
    if (i == 3) first = sample;  // both kinds of reports have arrived
  }
  const double time_s = seconds(sample.arrived - first.arrived);
  const Vector3d way = sample.X_BH.translation_m - first.X_BH.translation_m;
  const Vector3d turn = rotation_vector(sample.X_BH.rotation * first.X_BH.rotation.conjugate());
  CHECK(time_s > 0.0);
  const auto firmness = [](double share) { return std::pow((share - 0.08) / 0.92, 2.0); };
  const Vector3d pushed_m = 4e-6 * Vector3d(-140, -280, -70);
  const Vector3d V = 71.0 * 1.4e-3 * firmness(pushed_m.norm() / 1.4e-3) * pushed_m.normalized();
  CHECK((sample.V_BH.linear_m_per_s - V).norm() < 1e-12);
  CHECK((way - time_s * V).norm() < 1e-6);
  CHECK((turn - time_s * 11.4 * 0.0875 * firmness(200 * 2.5e-4 / 0.0875) * Vector3d::UnitZ()).norm() < 1e-6);
  mouse.take_command(t, std::array<std::uint8_t, 2>{4, 1});
  REQUIRE(mouse.led());
  device.release(now());
  CHECK(mouse.take_command(t, wire.receive(2)));
  CHECK_FALSE(mouse.led());
}

}  // namespace wrenchd::test_emulated_devices
