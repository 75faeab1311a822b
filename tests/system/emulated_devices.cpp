// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/system/emulated_devices.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <fstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "config/load_profile.hpp"
#include "devices/discovery/choose_device.hpp"
#include "devices/discovery/inspected_device.hpp"
#include "devices/discovery/match_profile.hpp"
#include "devices/links/link_settings.hpp"
#include "devices/profile_device.hpp"
#include "devices/profile_reports.hpp"
#include "devices/simulation/emulated_falcon.hpp"
#include "devices/simulation/emulated_polhem.hpp"
#include "devices/simulation/emulated_spacemouse.hpp"
#include "tests/support/polhem_pose.hpp"
#include "tests/support/sample_descriptors.hpp"
#include "tests/system/usbip_emulator.hpp"

namespace wrenchd::test {
namespace {

using namespace std::chrono_literals;
using SteadyClock = std::chrono::steady_clock;

constexpr int kPriority = 60;  ///< as in kernel_test.cpp
constexpr int kPort = 0;

const std::vector<DeviceProfile>& shipped() {
  static const std::vector<DeviceProfile> profiles = [] {
    const SearchPath search({"/usr/share/wrenchd"});
    std::vector<DeviceProfile> all;
    for (const auto& file : profile_files(search)) all.push_back(load_profile(file, search));
    return all;
  }();
  return profiles;
}

/// Returns the profile that wrenchd selects for the device, if the configuration names `named` or no profile.
/// Throws if there is none.
const DeviceProfile& profile_of(const UsbDevice& device, std::string_view named = {}) {
  const MatchResult match = match_profile(inspect_device(device).identity, shipped(), named);
  if (!match.profile) throw std::runtime_error("no profile matches " + describe(device));
  return shipped()[*match.profile];
}

/// An open link to a device, and a host that reads and writes.
struct Driven {
  std::unique_ptr<ReportLink> link;
  ProfileDevice device;
  DeviceSample sample;
  Fault fault = Fault::none;  ///< the first one

  Driven(const DeviceProfile& profile, std::unique_ptr<ReportLink> over)
      : link(std::move(over)), device(profile, *link) {
    device.open();
    ticks(20);
  }

  /// Runs one tick per report of the device; without reports every 1.5 ms.
  void ticks(int n, const Wrench& F = {}, bool motors_on = false) {
    set_own_priority(kPriority);
    for (int i = 0; i < n; ++i) {
      device.wait_readable(SteadyClock::now() + 1500us);
      sample = device.read_newest(SteadyClock::now());
      const Fault written = device.write(SteadyClock::now(), F, motors_on);
      if (fault == Fault::none) fault = sample.fault != Fault::none ? sample.fault : written;
    }
    set_own_priority(0);
  }
};

/// An emulated HID device that is connected, found, matched and opened, with its first report read.
struct Plugged {
  UsbipEmulator far;
  UsbDevice listed;
  Driven host;

  Plugged(Backend backend, EmulatedDevice& emulator, const UsbIdentity& identity, const UsbShape& shape,
          std::string_view named = {})
      : far(emulator, identity, shape, kPriority),
        listed((far.plug(kPort), await_listed(identity))),
        host(profile_of(listed, named), make_link(backend, listed, kPriority)) {}

  /// Returns the differences between the profile and the device's descriptor.
  std::size_t disagreements() const {
    const InspectedDevice facts = inspect_device(listed);
    return facts.descriptor
               ? find_differences(*facts.descriptor, expected_reports(host.device.profile())).size()
               : 1;
  }
};

// --- Polhem -----------------------------------------------------------------------------------------------

using Counts = std::array<int, 6>;

/// Encoder counts of a slow random motion of a hand.
Counts wandering(int i) {
  const auto wave = [i](double amplitude, double period) {
    return static_cast<int>(std::lround(amplitude * std::sin(6.283185307179586 * i / period)));
  };
  return {wave(900, 400), wave(700, 300), -5000 + wave(900, 350),
          wave(150, 270), wave(120, 310), wave(140, 330)};
}

void polhem(Backend backend) {
  Row row(backend, "Polhem emulator",
          "found by its profile; 400 encoder positions agree with the manufacturer's formulas to 1e-6, 100 "
          "forces with its currents; amplifiers off 0.5 s after the last report, zeros at release");
  EmulatedPolhem board(64);
  board.set_encoder_counts(wandering(0));
  UsbShape shape;
  shape.report_descriptor = teensy_rawhid();
  shape.out_bytes = 64;
  shape.product = "Teensyduino RawHID";
  shape.high_speed = false;
  Plugged p(backend, board, {0x16c0, 0x0486, "P1"}, shape, "polhem");
  CHECK_THAT(row, p.host.device.profile().name == "polhem");
  CHECK_THAT(row, p.disagreements() == 0);

  double worst_m = 0.0, worst_R = 0.0;
  for (int i = 0; i < 400; ++i) {
    p.far.with([&] { board.set_encoder_counts(wandering(i)); });
    p.host.ticks(3);
    const PolhemPose place = polhem_pose(wandering(i));
    worst_m = std::max(worst_m, (p.host.sample.X_BH.translation_m - kHalfTurn * place.p).norm());
    const Matrix3d R = kHalfTurn * place.R * kHalfTurn;
    worst_R = std::max(worst_R, (p.host.sample.X_BH.rotation.toRotationMatrix() - R).cwiseAbs().maxCoeff());
  }
  double worst_mA = 0.0;
  const PolhemPose place = polhem_pose(wandering(399));
  for (int i = 0; i < 100; ++i) {
    const Vector3d F(2 * std::sin(i), 2 * std::sin(2 * i), 2 * std::cos(3 * i));
    p.host.ticks(2, {F, Vector3d::Zero()}, true);
    std::this_thread::sleep_for(1ms);
    const auto currents_mA = p.far.with([&] { return board.currents_mA(); });
    const auto expected_mA = polhem_currents_mA(place, F);
    for (std::size_t j = 0; j < 3; ++j)
      worst_mA = std::max(worst_mA, std::abs(currents_mA[j] - expected_mA[j]));
  }
  const std::vector<std::uint8_t> last = p.far.last_taken();
  row.saw(format("places to %s, rotations to %s, currents to %.1f mA", worst_m < 1e-6 ? "1e-6 m" : "more",
                 worst_R < 1e-6 ? "1e-6" : "more", std::ceil(10 * worst_mA) / 10));
  CHECK_THAT(row, p.host.fault == Fault::none);
  CHECK_THAT(row, worst_m < 1e-6 && worst_R < 1e-6);
  CHECK_THAT(row, worst_mA <= 0.5 + 1e-6);
  CHECK_THAT(row,
             last.size() == 64 && std::all_of(last.begin() + 6, last.end(), [](auto b) { return b == 0; }));

  p.host.ticks(5, {{0, 0, 1}, {0, 0, 0}}, true);
  const auto on = [&] { return p.far.with([&] { return board.amplifiers_on(); }); };
  std::this_thread::sleep_for(450ms);
  CHECK_THAT(row, on());
  std::this_thread::sleep_for(100ms);
  CHECK_THAT(row, !on());
  p.host.ticks(5, {{0, 0, 1}, {0, 0, 0}}, true);
  CHECK_THAT(row, on() && p.far.with([&] { return board.currents_mA()[2]; }) != 0);
  p.host.device.release(SteadyClock::now());
  p.host.device.close();
  CHECK_THAT(row, p.far.with([&] { return board.currents_mA(); }) == (std::array<int, 3>{}));
  row.saw(format("%llu reports taken", static_cast<unsigned long long>(p.far.taken())));
}

// --- SpaceMouse -------------------------------------------------------------------------------------------

/// Fraction of the maximum speed for a fraction of the puck's deflection, as in its profiles.
double firmness(double share) {
  return std::pow((share - 0.08) / 0.92, 2.0);
}

/// Runs ticks until the device has sent for this time.
double run_for(Driven& host, Duration d) {
  const TimePoint began = host.sample.arrived;
  while (host.sample.arrived < began + d && host.fault == Fault::none) host.ticks(1);
  return seconds(host.sample.arrived - began);
}

/// The interface of a SpaceMouse: full speed, without an OUT endpoint.
UsbShape space_mouse_shape(std::vector<std::uint8_t> report_descriptor, std::string product,
                           std::uint8_t in_bytes) {
  UsbShape shape;
  shape.report_descriptor = std::move(report_descriptor);
  shape.out = 0;
  shape.in_bytes = in_bytes;
  shape.product = std::move(product);
  shape.high_speed = false;
  return shape;
}

void space_mouse(Backend backend, EmulatedSpaceMouse::Format format_of, const char* profile) {
  const bool split = format_of == EmulatedSpaceMouse::Format::split;
  Row row(
      backend, format("SpaceMouse emulator, %s", split ? "split" : "combined"),
      "found by its profile; silent at rest without a fault; deflected for 0.5 s the tool moves by velocity "
      "times time to 1e-6; released it stops; a button returns it to its start; the LED goes off at "
      "release, by SET_REPORT");
  EmulatedSpaceMouse mouse(format_of);
  const UsbShape shape = split ? space_mouse_shape(space_navigator(), "SpaceNavigator", 8)
                               : space_mouse_shape(space_mouse_wireless(), "SpaceMouse Wireless", 32);
  const UsbIdentity identity = split ? UsbIdentity{0x046d, 0xc626, ""} : UsbIdentity{0x256f, 0xc62e, ""};
  Plugged p(backend, mouse, identity, shape);
  CHECK_THAT(row, p.host.device.profile().name == profile);
  CHECK_THAT(row, p.disagreements() == 0);

  p.host.ticks(300);
  CHECK_THAT(row,
             p.host.fault == Fault::none && same_bits(p.host.sample.X_BH, {}) && p.host.sample.sequence == 0);
  p.far.with([&] { mouse.set_deflection({280, 140, 70, 0, 0, -200}); });
  p.host.ticks(50);
  const DeviceSample before = p.host.sample;
  const double time_s = run_for(p.host, 500ms);
  const Vector3d way = p.host.sample.X_BH.translation_m - before.X_BH.translation_m;
  const Vector3d turn = rotation_vector(p.host.sample.X_BH.rotation * before.X_BH.rotation.conjugate());
  const Vector3d pushed_m = 4e-6 * Vector3d(-140, -280, -70);
  const Vector3d expected_way =
      time_s * 71.0 * 1.4e-3 * firmness(pushed_m.norm() / 1.4e-3) * pushed_m.normalized();
  const Vector3d expected_turn = time_s * 11.4 * 0.0875 * firmness(200 * 2.5e-4 / 0.0875) * Vector3d::UnitZ();
  row.saw(format("way to %s, turn to %s", (way - expected_way).norm() < 1e-6 ? "1e-6 m" : "more",
                 (turn - expected_turn).norm() < 1e-6 ? "1e-6 rad" : "more"));
  CHECK_THAT(row, p.host.fault == Fault::none && time_s > 0.49);
  CHECK_THAT(row, (way - expected_way).norm() < 1e-6 && (turn - expected_turn).norm() < 1e-6);

  p.far.with([&] {
    mouse.set_deflection({});
    mouse.take_command({}, std::array<std::uint8_t, 2>{4, 1});
  });
  p.host.ticks(60);
  const DeviceSample left = p.host.sample;
  p.host.ticks(300);
  CHECK_THAT(row, p.host.fault == Fault::none && same_bits(p.host.sample.X_BH, left.X_BH));
  CHECK_THAT(row, p.host.sample.sequence == left.sequence);
  CHECK_THAT(row, p.far.with([&] { return mouse.led(); }) && p.far.taken() == 0);
  p.far.with([&] { mouse.set_buttons(1); });
  p.host.ticks(60);
  CHECK_THAT(row, p.host.fault == Fault::none && p.host.sample.buttons == 1);
  CHECK_THAT(row, same_bits(p.host.sample.X_BH, {}) && !same_bits(left.X_BH, {}));
  p.host.device.release(SteadyClock::now());
  p.host.device.close();
  const std::vector<std::uint8_t> last = p.far.last_taken();
  CHECK_THAT(row, !p.far.with([&] { return mouse.led(); }));
  CHECK_THAT(row, (last == std::vector<std::uint8_t>{4, 0}));
  row.saw(format("%llu reports", static_cast<unsigned long long>(left.sequence)));
}

void enterprise_keys(Backend backend) {
  Row row(
      backend, "SpaceMouse Enterprise, keys",
      "found by its profile; keys pressed at rest and in motion are no fault and no rejected report, and the "
      "motion is the same as without; buttons up to the 31st are read");
  EmulatedSpaceMouse mouse(EmulatedSpaceMouse::Format::enterprise);
  Plugged p(backend, mouse, {0x256f, 0xc633, ""},
            space_mouse_shape(space_mouse_enterprise(), "SpaceMouse Enterprise", 32));
  CHECK_THAT(row, p.host.device.profile().name == "spacemouse_combined");

  std::uint32_t rejected = 0;
  int keys_sent = 0;
  const auto press = [&](int key) {
    const auto number = static_cast<std::uint16_t>(key);
    p.far.with([&] { mouse.set_keys({number}); });
    ++keys_sent;
    for (int i = 0; i < 20; ++i) {
      p.host.ticks(1);
      rejected += p.host.sample.rejected;
    }
  };
  for (const int key : {7, 0, 30, 0}) press(key);
  CHECK_THAT(row, p.host.fault == Fault::none && same_bits(p.host.sample.X_BH, {}));
  p.far.with([&] { mouse.set_deflection({0, 0, 0, 0, 0, 200}); });
  p.host.ticks(50);
  const DeviceSample before = p.host.sample;
  for (const int key : {1, 2, 0}) press(key);
  run_for(p.host, 200ms);
  const double time_s = seconds(p.host.sample.arrived - before.arrived);
  const Vector3d turn = rotation_vector(p.host.sample.X_BH.rotation * before.X_BH.rotation.conjugate());
  const Vector3d expected = -time_s * 11.4 * 0.0875 * firmness(200 * 2.5e-4 / 0.0875) * Vector3d::UnitZ();
  p.far.with([&] {
    mouse.set_deflection({});
    mouse.set_buttons(1u << 30);
  });
  p.host.ticks(60);
  row.saw(format("%d key reports, %u rejected; turn to %s", keys_sent, rejected,
                 (turn - expected).norm() < 1e-6 ? "1e-6 rad" : "more"));
  CHECK_THAT(row, p.host.fault == Fault::none && rejected == 0);
  CHECK_THAT(row, time_s > 0.2 && (turn - expected).norm() < 1e-6);
  CHECK_THAT(row, p.host.sample.buttons == 1u << 30);
  p.host.device.close();
}

/// Two devices that differ in nothing but their USB port.
void two_equal_space_mice(Backend backend) {
  Row row(
      backend, "two equal SpaceMice",
      "without a serial number none is selected, and both ports are named; each is selected by usb_port and "
      "reads its own puck; one is unplugged, the other one continues; it is not taken for its twin");
  const UsbIdentity identity{0x046d, 0xc626, ""};
  const UsbShape shape = space_mouse_shape(space_navigator(), "SpaceNavigator", 8);
  std::array mice = {EmulatedSpaceMouse(EmulatedSpaceMouse::Format::split),
                     EmulatedSpaceMouse(EmulatedSpaceMouse::Format::split)};
  UsbipEmulator left(mice[0], identity, shape, kPriority);
  UsbipEmulator right(mice[1], identity, shape, kPriority);
  left.plug(kPort);
  await_listed(identity);
  right.plug(kPort + 1);
  const auto listed = [&](std::size_t n) {
    std::vector<UsbDevice> all;
    for (int i = 0; i < 500 && all.size() != n; ++i) {
      std::this_thread::sleep_for(10ms);
      all = list_usb_devices();
      std::erase_if(all, [](const UsbDevice& d) {
        return d.hidraw_node.empty() || !open_error(d, d.hidraw_node).empty() ||
               !open_error(d, d.usb_node).empty();
      });
    }
    std::sort(all.begin(), all.end(),
              [](const UsbDevice& a, const UsbDevice& b) { return a.port_path < b.port_path; });
    return all;
  };
  const std::vector<UsbDevice> both = listed(2);
  CHECK_THAT(row, both.size() == 2);
  if (both.size() != 2) return;

  const DeviceChoice unclear = choose_device(both, shipped(), {});
  CHECK_THAT(row, !unclear.selection);
  for (std::size_t i = 0; i < 2; ++i) {
    const std::string cure = "usb_port = \"" + both[i].port_path + "\"";
    CHECK_THAT(row, unclear.rejections[i].find(cure) != std::string::npos);
    const DeviceChoice clear = choose_device(both, shipped(), {.usb_port = both[i].port_path});
    CHECK_THAT(row, clear.selection && clear.selection->device == i);
  }

  Driven host_left(profile_of(both[0]), make_link(backend, both[0], kPriority));
  Driven host_right(profile_of(both[1]), make_link(backend, both[1], kPriority));
  left.with([&] { mice[0].set_deflection({0, 0, 0, 0, 0, 200}); });
  right.with([&] { mice[1].set_deflection({280, 0, 0, 0, 0, 0}); });
  for (int i = 0; i < 100; ++i) {
    host_left.ticks(1);
    host_right.ticks(1);
  }
  CHECK_THAT(row, host_left.fault == Fault::none && host_right.fault == Fault::none);
  CHECK_THAT(row, host_left.sample.X_BH.translation_m.norm() == 0.0 &&
                      rotation_vector(host_left.sample.X_BH.rotation).norm() > 0.01);
  CHECK_THAT(row, rotation_vector(host_right.sample.X_BH.rotation).norm() == 0.0 &&
                      host_right.sample.X_BH.translation_m.norm() > 1e-4);

  left.unplug();
  host_left.ticks(20);
  const std::uint64_t sequence = host_right.sample.sequence;
  host_right.ticks(40);
  CHECK_THAT(row, host_left.fault == Fault::device_lost);
  CHECK_THAT(row, host_right.fault == Fault::none && host_right.sample.sequence > sequence);
  host_left.device.close();
  host_right.device.close();
  const std::vector<UsbDevice> one = listed(1);
  CHECK_THAT(row, one.size() == 1 && one[0].port_path == both[1].port_path);
  const DeviceChoice twin =
      choose_device(one, shipped(), {.usb_port = both[0].port_path, .previous = both[0]});
  CHECK_THAT(row, !twin.selection);
  row.saw(twin.rejections.empty() ? "none is left" : twin.rejections[0]);
}

// --- Falcon -----------------------------------------------------------------------------------------------

/// Returns the residual of a leg's constraint in the manufacturer's geometry: 0 at the correct position.
/// Letters as in devices/kinematics.hpp.
double leg_error_m(const Vector3d& p_B, const std::array<int, 3>& counts, int leg) {
  constexpr double kTurn = 6.283185307179586;
  const Vector3d p(-p_B.y(), p_B.z(), 0.1346 - p_B.x());  // the device's own axes
  const double phi = kTurn * (105.0 - 120.0 * leg) / 360;
  const double t = kTurn * (35.0 / 360 + counts[static_cast<std::size_t>(leg)] / 1280.0 * 14.25 / 110);
  const double u = p.x() * std::cos(phi) + p.y() * std::sin(phi) - 0.040;
  const double v = p.y() * std::cos(phi) - p.x() * std::sin(phi) + 0.02309;
  const double rho = 0.0225 + std::sqrt(0.1025 * 0.1025 - (v - 0.025) * (v - 0.025));
  return std::hypot(u + 0.01443 - 0.060 * std::cos(t), p.z() - 0.060 * std::sin(t)) - rho;
}

void falcon() {
  Row row(
      Backend::libusb, "Falcon emulator",
      "found by its profile; handshake and firmware through its serial chip; homed; 200 positions satisfy "
      "the legs' constraint to 1e-6, forces arrive as efforts; on reopening the firmware is not loaded "
      "again");
  EmulatedFalcon falcon;
  falcon.corrupt_firmware_echoes(1);
  UsbShape shape;
  shape.out = 0x02;
  shape.out_bytes = 64;
  shape.product = "FALCON HAPTIC";
  shape.high_speed = false;
  const UsbIdentity identity{0x0403, 0xcb48, "F1"};
  UsbipEmulator far(falcon, falcon, identity, shape, kPriority);
  far.plug(kPort);
  const UsbDevice listed = await_listed(identity, false);
  DeviceProfile profile = profile_of(listed);
  CHECK_THAT(row, profile.name == "falcon");
  std::string rejection;
  try {
    make_link(Backend::libusb, listed, kPriority, link_settings(profile))->open();
  } catch (const std::runtime_error& e) {
    rejection = e.what();
  }
  CHECK_THAT(row, rejection.find("it runs no firmware, and none is named") != std::string::npos);

  profile.endpoints.firmware = "/tmp/firmware";
  std::vector<std::uint8_t> firmware(1000);
  for (std::size_t i = 0; i < firmware.size(); ++i) firmware[i] = static_cast<std::uint8_t>(i * i + 7 * i);
  std::ofstream(profile.endpoints.firmware, std::ios::binary)
      .write(reinterpret_cast<const char*>(firmware.data()), static_cast<std::streamsize>(firmware.size()));
  Driven p(profile, make_link(Backend::libusb, listed, kPriority, link_settings(profile)));
  CHECK_THAT(row, far.with([&] { return falcon.state() == EmulatedFalcon::State::running; }));
  CHECK_THAT(row, far.with([&] { return falcon.firmware() == firmware; }));
  p.ticks(20);
  CHECK_THAT(row, !p.sample.homed && far.with([&] { return falcon.homing_requested(); }));
  far.with([&] { falcon.perform_homing(); });
  p.ticks(20);
  CHECK_THAT(row, p.sample.homed && p.fault == Fault::none);

  double worst_m = 0.0;
  for (int i = 0; i < 200; ++i) {
    const std::array<int, 3> counts = {wandering(2 * i)[3], wandering(2 * i)[4], wandering(2 * i)[5]};
    far.with([&] { falcon.set_true_counts(counts); });
    p.ticks(3);
    for (int leg = 0; leg < 3; ++leg)
      worst_m = std::max(worst_m, std::abs(leg_error_m(p.sample.X_BH.translation_m, counts, leg)));
  }
  p.ticks(3, {{1.0, 0.0, 0.0}, Vector3d::Zero()}, true);
  std::this_thread::sleep_for(2ms);
  const auto efforts = far.with([&] { return falcon.efforts(); });
  row.saw(format("firmware of 1000 bytes loaded, places to %s, efforts %d %d %d for 1 N forward",
                 worst_m < 1e-6 ? "1e-6 m" : "more", efforts[0], efforts[1], efforts[2]));
  CHECK_THAT(row, p.fault == Fault::none && worst_m < 1e-6);
  CHECK_THAT(row, efforts[0] > 0 && efforts[1] > 0 && efforts[2] > 0);
  p.device.release(SteadyClock::now());
  p.device.close();
  CHECK_THAT(row, far.with([&] { return falcon.efforts(); }) == (std::array<int, 3>{}));
  p.device.open();
  p.ticks(20);
  CHECK_THAT(row, p.fault == Fault::none && p.sample.homed);
  CHECK_THAT(row, far.with([&] { return falcon.firmware().size(); }) == firmware.size());
  p.device.close();
}

}  // namespace

void emulated_devices(Backend backend) {
  polhem(backend);
  space_mouse(backend, EmulatedSpaceMouse::Format::split, "spacemouse_split");
  space_mouse(backend, EmulatedSpaceMouse::Format::combined, "spacemouse_combined");
  enterprise_keys(backend);
  two_equal_space_mice(backend);
  if (backend == Backend::libusb) falcon();
}

}  // namespace wrenchd::test
