// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "tests/support/random_values.hpp"

namespace wrenchd::test {

using Bytes = std::vector<std::uint8_t>;

/// Parses "05 01 a1": two hexadecimal digits per byte, with any blanks between them.
inline Bytes from_hex(std::string_view text) {
  Bytes bytes;
  std::string digits;
  for (const char c : text) {
    if (c == ' ' || c == '\n') continue;
    digits += c;
    if (digits.size() < 2) continue;
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(digits, nullptr, 16)));
    digits.clear();
  }
  return bytes;
}

/// Returns the descriptor that devices/README.md recommends to makers.
inline Bytes reference_descriptor() {
  return from_hex(
      "06 00 ff 09 01 a1 01 15 00 26 ff 00 75 08 85 01 09 02 95 3f 81 02 85 02 09 03 95 1f 91 02 c0");
}

// Published captures of real devices.

/// The axes of 3Dconnexion's devices, X Y Z in report 1 and Rx Ry Rz in report 2.
inline const std::string kSplitAxes =
    "05 01 09 08 a1 01 a1 00 85 01 16 a2 fe 26 5e 01 36 88 fa 46 78 05 55 0c 65 11 09 30 09 31 09 32"
    "75 10 95 03 81 06 c0 a1 00 85 02 09 33 09 34 09 35 75 10 95 03 81 06 c0";
/// All six axes in report 1.
inline const std::string kCombinedAxes =
    "05 01 09 08 a1 01 a1 00 85 01 16 a2 fe 26 5e 01 36 88 fa 46 78 05 55 0c 65 11 09 30 09 31 09 32"
    "09 33 09 34 09 35 75 10 95 06 81 02 c0";
/// Report 3: two buttons; report 4: the LED.
inline const std::string kButtonsAndLed =
    "a1 02 85 03 05 01 05 09 19 01 29 02 15 00 25 01 35 00 45 01 75 01 95 02 81 02 95 0e 81 03 c0"
    "a1 02 85 04 05 08 09 4b 15 00 25 01 95 01 75 01 91 02 95 01 75 07 91 03 c0";
/// Reports 5 to 11 and 19: vendor-defined feature reports.
inline const std::string kMakersFeatures =
    "06 00 ff 09 01 a1 02 15 80 25 7f 75 08 09 3a a1 02 85 05 09 20 95 01 b1 02 c0 a1 02 85 06 09 21"
    "95 01 b1 02 c0 a1 02 85 07 09 22 95 01 b1 02 c0 a1 02 85 08 09 23 95 07 b1 02 c0 a1 02 85 09 09"
    "24 95 07 b1 02 c0 a1 02 85 0a 09 25 95 07 b1 02 c0 a1 02 85 0b 09 26 95 01 b1 02 c0 a1 02 85 13"
    "09 2e 95 01 b1 02 c0";
/// Report 0x17: battery level in percent, and a vendor-defined bit.
inline const std::string kBattery =
    "a1 02 85 17 15 00 25 64 55 00 65 00 05 06 09 20 75 08 95 01 81 02 15 00 25 01 06 00 ff 09 27 75"
    "01 95 01 81 02 75 07 81 03 c0";

/// SpaceNavigator (046d:c626), 217 bytes.
inline Bytes space_navigator() {
  return from_hex(kSplitAxes + kButtonsAndLed + kMakersFeatures + "c0 c0");
}

/// SpaceMouse Wireless on its cable (256f:c62e), without its last two feature reports.
inline Bytes space_mouse_wireless() {
  return from_hex(kCombinedAxes + kButtonsAndLed + kBattery + kMakersFeatures + "c0 c0");
}

/// SpaceMouse Enterprise (256f:c633), without its feature reports: 31 buttons in report 3, numbers of pressed
/// keys in report 0x1c, two LEDs in report 4.
inline Bytes space_mouse_enterprise() {
  return from_hex(
      kCombinedAxes +
      "a1 02 85 03 05 01 05 09 19 01 29 1f 15 00 25 01 35 00 45 01 75 01 95 1f 81 02 95 01 81 03 c0"
      "a1 02 85 1c 05 01 05 09 19 00 2a ff 00 15 00 26 ff 00 35 00 46 ff 00 75 10 95 06 81 00 c0"
      "a1 02 85 04 05 08 09 4b 09 4c 15 00 25 01 95 02 75 01 91 02 95 01 75 06 91 03 c0 c0");
}

/// A home-made firmware under the id of a SpaceMouse Pro, which splits the axes; this firmware combines them.
/// 32 buttons.
inline Bytes home_made_combined() {
  return from_hex(kCombinedAxes +
                  "a1 00 85 03 15 00 25 01 75 01 95 20 05 09 19 01 29 20 81 02 c0"
                  "a1 02 85 04 05 08 09 4b 15 00 25 01 95 01 75 01 91 02 95 01 75 07 91 03 c0 c0");
}

/// A home-made firmware under the id of a SpaceMouse Pro Wireless, which combines the axes; this firmware
/// splits them. No units.
inline Bytes home_made_split() {
  return from_hex(
      "05 01 09 08 a1 01 a1 00 85 01 16 a2 fe 26 5e 01 36 88 fa 46 78 05 09 30 09 31 09 32 75 10 95 03"
      "81 02 c0 a1 00 85 02 16 a2 fe 26 5e 01 36 88 fa 46 78 05 09 33 09 34 09 35 75 10 95 03 81 02 c0"
      "a1 00 85 03 15 00 25 01 75 01 95 18 05 09 19 01 29 18 81 02 c0 c0");
}

/// A home-made six-axis mouse with ten bits per axis, preceded by three buttons, without report ids.
inline Bytes ten_bit_axes() {
  return from_hex(
      "05 01 09 08 a1 01 a1 00 05 09 19 01 29 03 15 00 25 01 95 03 75 01 81 02 05 01 09 30 09 31 09 32"
      "09 33 09 34 09 35 16 00 fe 26 00 02 75 0a 95 06 81 06 c0 c0");
}

/// Teensy RawHID (16c0:0486): 64 bytes each way, no report id, usage 0x0200 of page 0xFFAB.
inline Bytes teensy_rawhid() {
  return from_hex("06 ab ff 0a 00 02 a1 01 75 08 15 00 26 ff 00 95 40 09 01 81 02 95 40 09 02 91 02 c0");
}

/// The boot keyboard of HID 1.11 appendix B.1: eight modifier keys, five LEDs, an array of six keys.
inline Bytes boot_keyboard() {
  return from_hex(
      "05 01 09 06 a1 01 05 07 19 e0 29 e7 15 00 25 01 75 01 95 08 81 02 95 01 75 08 81 01 95 05 75 01"
      "05 08 19 01 29 05 91 02 95 01 75 03 91 01 95 06 75 08 15 00 25 65 05 07 19 00 29 65 81 00 c0");
}

/// A joystick with force effects, similar to OpenFFBoard: eight axes after 64 buttons, the state of the
/// actuators, a constant force, vendor commands of up to 64 bits, and a pool of effects. It contains features
/// that make parsing hard: usages with their page, an exponent written as a byte, a maximum before its
/// minimum, push and pop, alternatives between delimiters, nested collections.
inline Bytes effects_joystick() {
  return from_hex(
      "05 01 09 04 a1 01 a1 00 85 01 05 09 19 01 29 40 15 00 25 01 95 40 75 01 81 02"  // buttons
      "05 01 09 30 09 31 09 32 09 33 09 34 09 35 09 37 09 36 16 01 80 26 ff 7f 75 10 95 08 81 02 c0"
      "a4 06 00 ff 09 00 a1 01 85 a1 09 01 15 00 26 04 00 75 08 95 01 91 02 09 02 75 10 91 02"  // commands
      "09 03 75 08 91 02 09 04 75 20 91 02 19 05 29 06 75 40 95 02 91 02 c0 b4"
      "05 0f 09 92 a1 02 85 02 09 9f 09 a0 09 a4 09 a6 09 94 15 00 25 01 35 00 45 01 75 01 95 05 81 02"
      "95 03 81 03 c0"                                                     // state of the actuators
      "09 73 a1 02 85 05 09 22 25 28 15 01 35 01 45 28 75 08 95 01 91 02"  // constant force
      "09 70 16 01 80 26 ff 7f 36 f0 d8 46 10 27 75 10 91 02"
      "09 57 a1 02 a9 01 0b 01 00 0a 00 0a 01 00 a9 00 0b 02 00 0a 00 66 14 00 55 fe 15 00 27 a0 8c 00 00"
      "35 00 47 a0 8c 00 00 75 10 95 02 91 02 55 00 64 c0 c0"
      "09 7f a1 02 85 13 09 80 75 10 95 01 15 00 27 ff ff 00 00 35 00 47 ff ff 00 00 b1 02 c0 c0");
}

inline std::vector<Bytes> sample_descriptors() {
  return {space_navigator(), space_mouse_wireless(), home_made_combined(), home_made_split(),
          ten_bit_axes(),    teensy_rawhid(),        boot_keyboard(),      effects_joystick()};
}

/// Changes, inserts, removes or repeats bytes of a descriptor, or joins it with another one.
inline void mutate(RandomValues& random, const std::vector<Bytes>& samples, Bytes& bytes) {
  const auto place = [&](const Bytes& in) { return random.integer(0, static_cast<int>(in.size()) - 1); };
  const auto at = [&] { return bytes.begin() + place(bytes); };
  const auto byte = [&] { return static_cast<std::uint8_t>(random.bits()); };
  if (bytes.empty()) bytes.push_back(byte());
  switch (random.integer(0, 5)) {
    case 0:
      *at() = byte();
      return;
    case 1:
      *at() ^= static_cast<std::uint8_t>(1 << random.integer(0, 7));
      return;
    case 2:
      bytes.insert(at(), byte());
      return;
    case 3:
      bytes.erase(at());
      return;
    case 4: {
      const Bytes copy(at(), bytes.end());
      bytes.insert(at(), copy.begin(), copy.end());
      return;
    }
    default: {
      const Bytes& other = samples[static_cast<std::size_t>(random.integer(0, 7))];
      bytes.insert(at(), other.begin() + place(other), other.end());
      return;
    }
  }
}

/// Returns a sample with one to four mutations (75 %) or noise (25 %).
inline Bytes malformed_descriptor(RandomValues& random) {
  static const std::vector<Bytes> kSamples = sample_descriptors();
  Bytes bytes;
  if (random.chance(0.25)) {
    bytes.resize(static_cast<std::size_t>(random.integer(0, 80)));
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random.bits());
    return bytes;
  }
  bytes = kSamples[static_cast<std::size_t>(random.integer(0, 7))];
  for (int k = random.integer(1, 4); k > 0; --k) mutate(random, kSamples, bytes);
  return bytes;
}

}  // namespace wrenchd::test
