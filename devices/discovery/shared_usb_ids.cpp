// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/discovery/shared_usb_ids.hpp"

#include <algorithm>
#include <array>

namespace wrenchd {
namespace {

/// Sources: the lists that the owners of these ids publish, and the defaults of the libraries named.
constexpr std::array kShared = {
    SharedUsbIds{0x16c0, 0x0476, 0x04d4, "every Teensy of PJRC"},
    SharedUsbIds{0x16c0, 0x05dc, 0x05e4, "devices that use the free ids of V-USB"},
    SharedUsbIds{0x16c0, 0x27d8, 0x27e4, "devices that use the free ids of V-USB"},
    SharedUsbIds{0x1209, 0x0000, 0x0010, "devices under test, by the test ids of pid.codes"},
    SharedUsbIds{0x1234, 0x0000, 0xffff, "devices with the default id of the mbed library"},
    SharedUsbIds{0x03eb, 0x2040, 0x206f, "devices made from the examples of LUFA"},
    SharedUsbIds{0x0483, 0x5750, 0x5750, "devices made from the HID example of STMicroelectronics"},
    SharedUsbIds{0x04d8, 0x003f, 0x003f, "devices made from the HID example of Microchip"},
    SharedUsbIds{0xcafe, 0x0000, 0xffff, "devices made from the examples of TinyUSB"},
    SharedUsbIds{0xf055, 0x0000, 0xffff, "hobby devices without an assigned vendor id"},
};

}  // namespace

const SharedUsbIds* find_shared_usb_id(UsbId id) noexcept {
  const auto* const found = std::find_if(kShared.begin(), kShared.end(), [id](const SharedUsbIds& ids) {
    return ids.vendor == id.vendor && ids.first_product <= id.product && id.product <= ids.last_product;
  });
  return found == kShared.end() ? nullptr : found;
}

}  // namespace wrenchd
