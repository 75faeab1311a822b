// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/calibration_store.hpp"

#include <algorithm>
#include <set>
#include <stdexcept>

#include "config/toml_reader.hpp"
#include "core/finite.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kTitle = "# wrenchd calibration ";
constexpr int kFormat = 1;
constexpr std::size_t kMostOffsets = 32;
constexpr std::size_t kLongestAxis = 32;
constexpr double kMaxOffset = 1e4;  ///< [m] or [rad]; no valid offset is larger

constexpr const char* kCure = "; remove it and calibrate the device again";

bool is_axis_name(std::string_view name) {
  return !name.empty() && name.size() <= kLongestAxis && std::all_of(name.begin(), name.end(), [](char c) {
    return is_letter_or_digit(c) || c == '_' || c == '-';
  });
}

/// The first line states the format; it distinguishes a file of another version or program from a damaged
/// one.
void require_title(const std::string& text, const fs::path& file) {
  const std::string expected = std::string(kTitle) + std::to_string(kFormat) + "\n";
  if (text.starts_with(expected)) return;
  if (text.starts_with(kTitle) && text.find('\n') != std::string::npos)
    throw ConfigError(file, {1, 1},
                      "is a calibration of format " +
                          printable(text.substr(kTitle.size(), text.find('\n') - kTitle.size()), 20) +
                          ", and this wrenchd supports format " + std::to_string(kFormat) + kCure);
  throw ConfigError(file, {}, std::string("is no calibration of a device, or is damaged") + kCure);
}

void require_checksum(const std::string& text, const fs::path& file) {
  if (!has_valid_checksum(text))
    throw ConfigError(file, {}, std::string("is damaged: its checksum does not fit") + kCure);
}

void read_offset(TomlTable& table, AxisOffset& offset) {
  table.mandatory("axis").text(offset.axis);
  table.mandatory("value").number(offset.offset, {-kMaxOffset, kMaxOffset});
}

void read_calibration(TomlTable& table, Calibration& calibration) {
  table.mandatory("profile").text(calibration.profile);
  table.mandatory("serial").text(calibration.serial);
  const TomlValue offsets = table.optional("offset");
  for (const TomlValue& element : offsets.elements("tables [[offset]]"))
    element.table(read_offset, calibration.offsets.emplace_back());
}

/// Description of the first defect of a calibration; empty if it is valid.
std::string defect_of(const Calibration& calibration) {
  if (calibration.offsets.size() > kMostOffsets)
    return "more than " + std::to_string(kMostOffsets) + " axes have an offset";
  std::set<std::string> seen;
  for (const AxisOffset& offset : calibration.offsets) {
    if (!is_axis_name(offset.axis)) return "'" + printable(offset.axis) + "' is no name of an axis";
    if (!seen.insert(offset.axis).second) return "axis '" + offset.axis + "' has two offsets";
    if (!is_finite(offset.offset) || std::abs(offset.offset) > kMaxOffset)
      return "the offset of axis '" + offset.axis + "' is not within 10,000 m or rad";
  }
  return {};
}

}  // namespace

std::string to_text(const Calibration& calibration) {
  std::string text = std::string(kTitle) + std::to_string(kFormat) + "\nprofile = \"" +
                     encoded_device_name(calibration.profile) + "\"\nserial = \"" +
                     encoded_device_name(calibration.serial) + "\"\n";
  for (const AxisOffset& offset : calibration.offsets)
    text += "[[offset]]\naxis = \"" + offset.axis + "\"\nvalue = " + to_text(offset.offset) + "\n";
  return with_checksum(text);
}

Calibration parse_calibration(const std::string& text, const fs::path& file) {
  require_title(text, file);
  require_checksum(text, file);
  Calibration calibration;
  read_toml_text(text, file, read_calibration, calibration);
  if (const std::string fault = defect_of(calibration); !fault.empty())
    throw ConfigError(file, {}, "cannot be used: " + fault + kCure);
  return calibration;
}

std::optional<Calibration> CalibrationStore::read(const std::string& profile,
                                                  const std::string& serial) const {
  const fs::path file = file_of(profile, serial);
  const auto text = read_device_file(file, kCure);
  if (!text) return {};
  Calibration calibration = parse_calibration(*text, file);
  if (calibration.profile != encoded_device_name(profile) ||
      calibration.serial != encoded_device_name(serial))
    throw ConfigError(file, {},
                      "is of device '" + printable(calibration.serial) + "' with profile '" +
                          printable(calibration.profile) + "'" + kCure);
  calibration.profile = profile;
  calibration.serial = serial;
  return calibration;
}

void CalibrationStore::write(const Calibration& calibration) const {
  const fs::path file = file_of(calibration.profile, calibration.serial);
  if (const std::string fault = defect_of(calibration); !fault.empty())
    throw std::invalid_argument("calibration of '" + printable(calibration.serial) + "': " + fault);
  write_device_file(file, to_text(calibration));
}

fs::path CalibrationStore::file_of(std::string_view profile, std::string_view serial) const {
  return device_file(directory_, "calibration", profile, serial);
}

}  // namespace wrenchd
