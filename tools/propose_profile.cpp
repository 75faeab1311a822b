// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/propose_profile.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <utility>

#include "config/config_error.hpp"
#include "config/toml_file.hpp"
#include "devices/layout_check.hpp"
#include "devices/profile_reports.hpp"
#include "devices/report_frame.hpp"
#include "devices/six_axes.hpp"

namespace wrenchd {
namespace {

// A profile has at most this number of buttons; config/load_profile.cpp rejects more.
constexpr std::size_t kMostButtons = 32;
constexpr double kLeastStep = 1e-12, kLargestStep = 1e3;
constexpr double kLargestOffset = 1e6;
constexpr double kLeastGain = 1e-3, kLargestGain = 1e6;

constexpr std::size_t kCommentColumn = 34;
constexpr std::uint16_t kLedPage = 0x08;

std::string id_text(std::optional<std::uint8_t> id) {
  if (!id) return "\"none\"";
  std::array<char, 8> text{};
  std::snprintf(text.data(), text.size(), "0x%02x", *id);
  return text.data();
}

std::string place_text(std::size_t bit) {
  return "byte " + std::to_string(bit / 8) + (bit % 8 == 0 ? "" : " bit " + std::to_string(bit % 8));
}

/// Makes a device's name fit for a TOML comment: one line of valid UTF-8.
std::string to_printable(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < ' ' || c > '~'; }, '?');
  return printable(text, 200);
}

// Comments that repeat the descriptor

std::string field_text(const DescribedField& field) {
  const std::string where = "#     " + place_text(field.bit) + ": ";
  if (field.constant) return where + std::to_string(field.bits * field.count) + " bits of padding\n";
  const auto first = field.usage(0), last = field.usage(field.count - 1);
  std::string usages = first ? to_text(*first) : "unnamed";
  if (first && *first != *last) usages += " to " + to_text(*last);
  return where + std::to_string(field.count) + " x " + std::to_string(field.bits) + " bits, " +
         std::to_string(field.logical_min) + " to " + std::to_string(field.logical_max) + ", " + usages +
         (field.relative ? ", relative" : "") + (field.variable ? "" : ", an array") + "\n";
}

std::string report_text(const DescribedReport& report) {
  std::string text = std::string("#   ") + name(report.kind) + " report " + id_text(report.id) + ", " +
                     std::to_string(report.length) + " bytes\n";
  for (const DescribedField& field : report.fields) text += field_text(field);
  return text;
}

std::string head(const DescriptorSource& source, const ReportDescriptor& descriptor) {
  std::string text =
      "# wrenchd device profile: a PROPOSAL from a report descriptor, by `wrenchctl profile`.\n"
      "#\n"
      "# A descriptor contains the layout of the reports, but little of their meaning. Check the lines "
      "marked "
      "GUESSED.\n"
      "# Complete the lines marked FILL IN, which no descriptor contains; the profile does not load before.\n"
      "# profiles/example.toml explains every key.\n"
      "#\n";
  text += "# Made from " + to_printable(source.file) + "\n";
  if (!source.device.empty()) text += "# Device: " + to_printable(source.device) + "\n";
  text += "# The device's reports";
  if (!descriptor.has_ids()) text += ", without ids";
  text += ":\n";
  for (const DescribedReport& report : descriptor.reports) text += report_text(report);
  return text;
}

bool of_maker(const DescribedReport& report) {
  return std::any_of(report.fields.begin(), report.fields.end(), [](const DescribedField& field) {
    const auto usage = field.usage(0);
    return !field.constant && usage && usage->page >= kFirstVendorPage;
  });
}

/// Returns the output report that most likely drives motors: the longest one that does more than set LEDs,
/// preferably vendor-defined.
const DescribedReport* driving_report(const ReportDescriptor& descriptor) {
  const DescribedReport* found = nullptr;
  const auto drives = [](const DescribedField& field) {
    const auto usage = field.usage(0);
    return !field.constant && !(usage && usage->page == kLedPage);
  };
  for (const DescribedReport& report : descriptor.reports) {
    if (report.kind != ReportKind::output || std::none_of(report.fields.begin(), report.fields.end(), drives))
      continue;
    if (found == nullptr ||
        std::pair(of_maker(report), report.length) > std::pair(of_maker(*found), found->length))
      found = &report;
  }
  return found;
}

// Keys of every profile

std::string match_table(const DescriptorSource& source, const ReportDescriptor& descriptor) {
  std::array<char, 80> line{};
  std::string text =
      "\n[match]\n# FILL IN: usb =                   vendor and product, as in [\"1209:0003\"]\n";
  if (source.id) {
    std::snprintf(line.data(), line.size(), "\n[match]\nusb = [\"%04x:%04x\"]\n", unsigned{source.id->vendor},
                  unsigned{source.id->product});
    text = line.data();
  }
  // The kernel names a device after its first collection.
  const Usage usage = descriptor.collections.empty() ? Usage{} : descriptor.collections.front().usage;
  if (usage == Usage{}) return text;
  std::snprintf(line.data(), line.size(), "usage_page = 0x%02x\nusage = 0x%02x\n", unsigned{usage.page},
                unsigned{usage.id});
  return text + line.data();
}

/// Returns the keys above the reports.
std::string general_keys(const DescriptorSource& source, const ReportDescriptor& descriptor,
                         const std::string& description, const char* stream) {
  const bool driven = driving_report(descriptor) != nullptr;
  std::string text =
      "\nname = \"unnamed\"                  # FILL IN: name in status and recordings\n"
      "description = \"" +
      description +
      "\"\n"
      "transport = \"hidraw\"              # GUESSED: \"libusb\" goes past the kernel\n"
      "# FILL IN: report_rate_Hz =        measured: count the reports over ten "
      "seconds\n" +
      stream + "# FILL IN: stale_fault_s =         longest silence before a fault\n";
  text += driven ? "# FILL IN: watchdog_s =            of the firmware; ask its maker, or read its source\n"
                 : "wrench_report = \"none\"            # the device has no output report that could drive a "
                   "motor\n";
  text += match_table(source, descriptor);
  text +=
      "\n# Limits of the device and the hand. No descriptor contains them, and no tool guesses them: a "
      "number\n"
      "# that is too large can injure a person.\n"
      "[limits]\n";
  if (driven) text += "# FILL IN: max_force_N =\n# FILL IN: max_torque_Nm =\n";
  return text + "# FILL IN: max_linear_speed_m_per_s =\n# FILL IN: max_angular_speed_rad_per_s =\n";
}

/// Returns id and length of a report. `guess`: text that marks which part is a guess.
std::string frame_keys(const DescribedReport& report, const std::string& guess = {}) {
  const std::string length = std::to_string(report.length);
  std::string text = "id = " + id_text(report.id) + guess + "\n";
  if (report.length <= kMaxReportBytes) return text + "length = " + length + "\n";
  return text + "# FILL IN: length. The device's report has " + length +
         " bytes, but a profile's report has at most " + std::to_string(kMaxReportBytes) + ".\n";
}

std::string vendor_table(const char* table, const DescribedReport* report, const char* fields) {
  if (report == nullptr) return std::string("\n# FILL IN: [") + table + "]. The device has no such report.\n";
  return std::string("\n[") + table + "]\n" +
         frame_keys(*report, "                          # GUESSED: the longest report of its kind") +
         "# FILL IN: " + fields + "\n" +
         "#   Only the maker knows the meaning of the fields. Write \"none\" for absent ones; joints, "
         "parts of a\n"
         "#   pose and motor currents are in profiles/example.toml.\n";
}

std::string wrench_table(const ReportDescriptor& descriptor) {
  const DescribedReport* report = driving_report(descriptor);
  if (report == nullptr) return {};
  return vendor_table("wrench_report", report, "enable, sequence, force, torque, hold_time, checksum") +
         "#   If the report drives no motor, delete this table, force, torque and watchdog, and write "
         "wrench_report "
         "= "
         "\"none\"\n#   above [match].\n";
}

// Multi-axis controllers

/// Half of the six axes: a profile describes them as two fields.
struct Half {
  const char* key;       ///< name of the field
  const char* step_key;  ///< key of the size of one count [m] or [rad]
  const char* offset_key;
  const char* gain_key;
  const char* step_description;  ///< description of the step for the comment
  const char* full_text;
  double full;   ///< assumed full deflection if the device gives no unit
  double speed;  ///< commanded speed at full deflection
  const char* speed_text;
  std::size_t first;  ///< index of the first of its three axes
};

// Default values, which the proposal marks as guesses. If a device gives no unit, only the product of step
// and gain has an effect, so the full deflections are arbitrary. The speeds are slow enough to follow by eye.
constexpr Half kTranslation = {"translation", "step_m", "offset_m", "linear_gain", "length",
                               "10 mm",       0.01,     0.1,        "0.1 m/s",     0};
constexpr Half kRotation = {"rotation", "step_rad", "offset_rad", "angular_gain", "angle",
                            "0.1 rad",  0.1,        1.0,          "1 rad/s",      3};

/// Returns the count of the undeflected puck: 0, or the middle if 0 is outside its range.
double centre_count(const DescribedNumber& axis) {
  if (axis.logical_min < 0 && axis.logical_max > 0) return 0.0;
  return std::ceil(0.5 * (static_cast<double>(axis.logical_min) + static_cast<double>(axis.logical_max)));
}

/// Returns the counts from rest to the farther end, for the axis with the widest range.
double counts_to_end(const SixAxisController& device, const Half& half) {
  double most = 0.0;
  for (std::size_t i = half.first; i < half.first + 3; ++i) {
    const DescribedNumber& axis = device.axes[i];
    const double rest = centre_count(axis);
    most = std::max(
        {most, static_cast<double>(axis.logical_max) - rest, rest - static_cast<double>(axis.logical_min)});
  }
  return most;
}

/// Returns true if the three axes are equal and adjacent, as a field of a profile requires. They share one
/// step.
bool is_field(const SixAxisController& device, const Half& half) {
  const DescribedNumber& a = device.axes[half.first];
  for (std::size_t i = 1; i < 3; ++i) {
    const DescribedNumber& b = device.axes[half.first + i];
    const bool same_step = a.step == b.step || (!std::isfinite(a.step) && !std::isfinite(b.step));
    if (b.bit != a.bit + i * a.bits || b.bits != a.bits || b.is_signed() != a.is_signed() || !same_step ||
        centre_count(a) != centre_count(b))
      return false;
  }
  return counts_to_end(device, half) > 0.0;
}

/// Size of a count [m] or [rad]: the device's own, or a guess if the device gives none that a profile
/// accepts.
struct Step {
  double si = 0.0;
  bool guessed = false;
};

Step step_of(const SixAxisController& device, const Half& half) {
  const double own = device.axes[half.first].step;
  const double offset = std::abs(centre_count(device.axes[half.first]) * own);
  if (own >= kLeastStep && own <= kLargestStep && offset <= kLargestOffset) return {own, false};
  return {half.full / counts_to_end(device, half), true};
}

std::string number_text(double x, int digits) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.*g", digits, x);
  return text.data();
}

std::string axes_places(const SixAxisController& device, std::size_t first) {
  static constexpr std::array<const char*, 6> kNames = {"X", "Y", "Z", "Rx", "Ry", "Rz"};
  std::string text;
  for (std::size_t i = first; i < first + 3; ++i) {
    const DescribedNumber& axis = device.axes[i];
    text += std::string(i > first ? "; " : "") + kNames[i] + " " + std::to_string(axis.bits) + " bits from " +
            place_text(axis.bit) + ", " + std::to_string(axis.logical_min) + " to " +
            std::to_string(axis.logical_max);
  }
  return text;
}

/// Returns position and width of a field: `byte = 1, type = "i16"`, or `byte = 0, bit = 3, bits = 10`.
std::string place_keys(std::size_t bit, unsigned bits, bool is_signed, bool signed_by_itself) {
  std::string text = "byte = " + std::to_string(bit / 8);
  const bool plain_width = bits == 8 || bits == 16 || bits == 32;
  if (bit % 8 == 0 && plain_width && is_signed == signed_by_itself)
    return text + ", type = \"" + (is_signed ? "i" : "u") + std::to_string(bits) + '"';
  if (bit % 8 != 0) text += ", bit = " + std::to_string(bit % 8);
  text += ", bits = " + std::to_string(bits);
  return is_signed == signed_by_itself ? text : text + ", signed = " + (is_signed ? "true" : "false");
}

std::string axes_field(const SixAxisController& device, const Half& half) {
  const DescribedNumber& axis = device.axes[half.first];
  if (!is_field(device, half))
    return std::string("# FILL IN: ") + half.key + ". " + axes_places(device, half.first) +
           ":\n#   not three equal, adjacent numbers with a common step, as a field requires\n";
  const Step step = step_of(device, half);
  const double rest = centre_count(axis);
  std::string text = "# " + axes_places(device, half.first) + ".\n";
  if (step.guessed)
    text += std::string("# GUESSED: the step. The descriptor gives no ") + half.step_description +
            " per count; the proposal assumes a full deflection of " + half.full_text + ".\n";
  else
    text += "# The step comes from the descriptor.\n";
  if (rest != 0.0)
    text += "# GUESSED: the offset, which assumes the count " + number_text(rest, 12) +
            " for the undeflected puck.\n";
  text += std::string(half.key) + " = { " + place_keys(axis.bit, axis.bits, axis.is_signed(), true) + ", " +
          half.step_key + " = " + number_text(step.si, 9);
  if (rest != 0.0) text += std::string(", ") + half.offset_key + " = " + number_text(-rest * step.si, 12);
  return text + " }\n";
}

/// Returns the gain per metre or radian for which full deflection gives the intended speed.
std::string gain(const SixAxisController& device, const Half& half) {
  const double value =
      is_field(device, half) ? half.speed / (step_of(device, half).si * counts_to_end(device, half)) : 0.0;
  if (!(value >= kLeastGain && value <= kLargestGain))
    return std::string("# FILL IN: ") + half.gain_key + " =\n";
  std::string key = std::string(half.gain_key) + " = " + number_text(value, 3) + ' ';
  key.resize(std::max(key.size(), kCommentColumn), ' ');
  return key + "# GUESSED: " + half.speed_text + " at full deflection\n";
}

/// Returns the full deflection [m] or [rad]; 0 if it is unknown.
double full_deflection(const SixAxisController& device, const Half& half) {
  return is_field(device, half) ? step_of(device, half).si * counts_to_end(device, half) : 0.0;
}

/// Returns the steering keys, with the values of the shipped SpaceMouse profiles.
std::string steering(const SixAxisController& device) {
  const double full_m = full_deflection(device, kTranslation), full_rad = full_deflection(device, kRotation);
  if (!(full_m >= 1e-5 && full_m <= 1.0 && full_rad >= 1e-4 && full_rad <= 3.2)) return {};
  return "full_deflection_m = " + number_text(full_m, 4) +
         "\nfull_deflection_rad = " + number_text(full_rad, 4) +
         "\n# GUESSED: values of the shipped SpaceMouse profiles. A push includes some twist.\n"
         "dead_zone = 0.08\nresponse_exponent = 2.0\nmax_proxy_distance_m = 0.010\nmax_proxy_angle_rad = "
         "0.2\n";
}

std::string deflection_table(const SixAxisController& device) {
  return "\n# GUESSED: that the axes are the deflections of a puck with return springs. If they "
         "say "
         "where a\n"
         "# handle is, mode = \"position\" with gains of 1.\n"
         "[deflection]\nmode = \"rate\"\n" +
         gain(device, kTranslation) + gain(device, kRotation) + steering(device);
}

/// Returns true if the field contains only buttons and padding, as a mask requires.
bool is_mask(const DescribedReport& report, const DescribedBits& bits) {
  return std::all_of(report.fields.begin(), report.fields.end(), [&](const DescribedField& field) {
    const bool apart = field.end_bit() <= bits.bit || field.bit >= bits.bit + bits.count;
    return apart || field.constant || field.bits == 1;
  });
}

std::string buttons_field(const SixAxisController& device, const DescribedReport& report) {
  const DescribedBits& bits = *device.buttons;
  const std::string which =
      "# Buttons: " + std::to_string(bits.count) + " bits from " + place_text(bits.bit) + ".";
  if (!is_mask(report, bits)) return which + " Other fields lie between them:\n# FILL IN: button_list\n";
  const auto count = static_cast<unsigned>(std::min(bits.count, kMostButtons));
  return which + (count < bits.count ? " Only the first 32, the capacity of a mask." : "") +
         "\nbuttons = { " + place_keys(bits.bit, count, false, false) + " }\n";
}

/// Returns the axes and buttons of an input report.
std::string report_fields(const SixAxisController& device, const DescribedReport& report) {
  std::string text;
  for (const Half& half : {kTranslation, kRotation})
    if (device.axes[half.first].report_id == report.id) text += axes_field(device, half);
  if (device.buttons && device.buttons->report_id == report.id) text += buttons_field(device, report);
  return text;
}

std::string more_report(const SixAxisController& device, const DescribedReport& report, const char* name) {
  return std::string("\n[[more_reports]]\nname = \"") + name + "\"\n" + frame_keys(report) +
         report_fields(device, report);
}

std::string multi_axis(const DescriptorSource& source, const SixAxisController& device,
                       const ReportDescriptor& descriptor) {
  const auto input = [&](std::optional<std::uint8_t> id) -> const DescribedReport& {
    return *descriptor.find(ReportKind::input, id);
  };
  const DescribedReport &first = input(device.axes[0].report_id), &second = input(device.axes[3].report_id);
  const bool split = device.layout == AxesLayout::split;
  std::string text = general_keys(source, descriptor,
                                  split ? "Multi-axis controller, X Y Z and Rx Ry Rz in two reports"
                                        : "Multi-axis controller, six axes in one report",
                                  "stream = \"silent_at_rest\"         # GUESSED: such devices are silent at "
                                  "rest\n");
  text +=
      "\n# GUESSED: that the device uses HID's axes, x right, y towards the user, z down; wrenchd's are x "
      "forward,\n"
      "# y left, z up.\n"
      "[frames]\nbase_axes = [\"-y\", \"-x\", \"-z\"]\n" +
      deflection_table(device) + "\n[pose_report]\n" + frame_keys(first) + report_fields(device, first);
  if (split) text += more_report(device, second, "rotation");
  if (device.buttons && device.buttons->report_id != first.id && device.buttons->report_id != second.id)
    text += more_report(device, input(device.buttons->report_id), "buttons");
  text += wrench_table(descriptor);
  if (device.led)
    text += "\n# LED: " + place_text(device.led->bit) + " of output report " +
            id_text(device.led->report_id) + "; [shutdown] may switch it off.\n";
  return text;
}

// Devices with vendor-defined reports

/// Returns the longest report of a kind, which most likely carries poses or wrenches.
const DescribedReport* longest(const ReportDescriptor& descriptor, ReportKind kind) {
  const DescribedReport* found = nullptr;
  for (const DescribedReport& report : descriptor.reports)
    if (report.kind == kind && of_maker(report) && (found == nullptr || report.length > found->length))
      found = &report;
  return found;
}

std::string makers_own(const DescriptorSource& source, const ReportDescriptor& descriptor) {
  const DescribedReport* pose = longest(descriptor, ReportKind::input);
  const DescribedReport* wrench = driving_report(descriptor);
  std::string text = general_keys(source, descriptor, "Vendor-defined reports",
                                  "stream = \"free_running\"           # GUESSED\n");
  const bool reference = pose != nullptr && wrench != nullptr && pose->id == 1 && pose->length == 64 &&
                         wrench->id == 2 && wrench->length == 32;
  if (reference)
    text +=
        "\n# GUESSED: ids and lengths are those of the wrenchd reference report layout.\n"
        "# If the device uses it, copy both tables below from profiles/loopback.toml.\n";
  return text +
         vendor_table("pose_report", pose,
                      "motors_on, watchdog_tripped, sequence, device_time, position, orientation, checksum") +
         wrench_table(descriptor);
}

/// The first lines: profiles that need no new file.
std::string already_fitting(const DescriptorSource& source, const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names)
    text += "# The profile " + name + " already fits this device" +
            (source.id ? "" : ", if its ids match or you name it") + ": set profile = \"" + name +
            "\" in [device] of wrenchd.toml.\n";
  return text.empty() ? text
                      : text + "# You need the proposal below only for a device with other properties.\n#\n";
}

}  // namespace

std::vector<std::string> fitting_profiles(const DescriptorSource& source,
                                          const std::vector<DeviceProfile>& profiles) {
  const ReportDescriptor descriptor = parse_descriptor(source);
  const Usage usage = descriptor.collections.empty() ? Usage{} : descriptor.collections.front().usage;
  std::vector<std::string> names;
  for (const DeviceProfile& profile : profiles) {
    const DeviceMatch& match = profile.match;
    if (profile.transport == Transport::loopback || (source.id && !lists_id(profile, *source.id))) continue;
    if (match.usage_page && *match.usage_page != usage.page) continue;
    if (match.usage && *match.usage != usage.id) continue;
    if (find_differences(descriptor, expected_reports(profile)).empty()) names.push_back(profile.name);
  }
  return names;
}

std::string propose_profile(const DescriptorSource& source, const std::vector<std::string>& fitting) {
  const ReportDescriptor descriptor = parse_descriptor(source);
  const SixAxisResult axes = find_six_axes(descriptor);
  const std::string first = already_fitting(source, fitting);
  if (axes.controller)
    return first + head(source, descriptor) + multi_axis(source, *axes.controller, descriptor);
  if (std::none_of(descriptor.reports.begin(), descriptor.reports.end(), of_maker))
    throw std::runtime_error(source.file + ": nothing to propose: " + axes.rejection +
                             ", and no report is vendor-defined; name another device");
  return first + head(source, descriptor) + makers_own(source, descriptor);
}

}  // namespace wrenchd
