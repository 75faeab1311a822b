// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/discovery/unusable_devices.hpp"

#include <array>

namespace wrenchd {
namespace {

constexpr std::string_view kClosed =
    "its protocol is not public; use the manufacturer's driver, or ask the manufacturer to publish the "
    "protocol";
constexpr std::string_view kNotSixAxes =
    "it is no six-axis device, although its vendor id is that of the SpaceMouse family; no action needed";

/// Sources of the ids, udev rules and drivers in public repositories: spacenavd (src/dev.c),
/// jhu-saw/sawSensablePhantom, MXHsj/ros_geomagic_touch_hid, the rules of libdhd.
constexpr std::array kKnown = {
    UnusableDevice{0x2988, 0x0302, 0x0302, "3D Systems Touch (USB)", kClosed},
    UnusableDevice{0x0301, 0x2988, 0x2988, "3D Systems Touch (USB)", kClosed},
    UnusableDevice{0x2988, 0x0304, 0x0304, "3D Systems Touch (HID)", kClosed},
    UnusableDevice{0x1451, 0x0000, 0xffff, "a Force Dimension device", kClosed},
    UnusableDevice{0x16c0, 0x0483, 0x0483, "a Teensy serial device, such as Haply Inverse3", kClosed},
    UnusableDevice{0x2fe3, 0x0100, 0x0100, "Haply VerseGrip dongle", kClosed},
    UnusableDevice{0x256f, 0xc62c, 0xc62c, "a 3Dconnexion device without six axes", kNotSixAxes},
    UnusableDevice{0x256f, 0xc650, 0xc651, "a 3Dconnexion device without six axes", kNotSixAxes},
    UnusableDevice{0x256f, 0xc654, 0xc658, "a 3Dconnexion device without six axes", kNotSixAxes},
    UnusableDevice{0x256f, 0xc664, 0xc665, "a 3Dconnexion device without six axes", kNotSixAxes},
    UnusableDevice{0x256f, 0xc668, 0xc668, "a 3Dconnexion device without six axes", kNotSixAxes},
};

}  // namespace

const UnusableDevice* find_unusable_device(UsbId id) noexcept {
  for (const UnusableDevice& known : kKnown) {
    if (known.vendor == id.vendor && known.first_product <= id.product && id.product <= known.last_product)
      return &known;
  }
  return nullptr;
}

}  // namespace wrenchd
