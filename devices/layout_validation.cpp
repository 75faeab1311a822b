// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/layout_validation.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/finite.hpp"
#include "devices/report_bits.hpp"
#include "devices/report_frame.hpp"

namespace wrenchd {
namespace {

/// Maps each bit of a report to its field, and rejects overlaps.
class FieldMap {
 public:
  FieldMap(std::string report, const ReportFrame& frame) : report_(std::move(report)) {
    const std::size_t tail_bytes = frame.checksum_at ? 0 : checksum_bytes(frame.checksum);
    const std::size_t min_length = std::max<std::size_t>((frame.has_id ? 1 : 0) + tail_bytes, 1);
    if (frame.length < min_length || frame.length > kMaxReportBytes)
      reject("length = " + std::to_string(frame.length) + " must be " + std::to_string(min_length) + " to " +
             std::to_string(kMaxReportBytes) + " bytes");
    if (frame.min_length > frame.length || (frame.min_length != 0 && frame.checksum != Checksum::none))
      reject("min_length = " + std::to_string(frame.min_length) +
             " must not exceed length, and must not be stated together with a checksum");
    if (frame.min_length == 0 && frame.length < min_length) reject("is empty");
    field_bits_ = 8 * (frame.length - tail_bytes);
    if (frame.has_id) claim("the report id", 0, 8);
    if (frame.checksum_at) {
      if (*frame.checksum_at >= kMaxReportBytes) reject("the checksum does not fit");
      claim("the checksum", 8 * *frame.checksum_at, 8 * checksum_bytes(frame.checksum));
    }
    if (frame.checksum != Checksum::none && frame.checksum_from >= checksum_offset(frame))
      reject("the checksum covers nothing: checksum_from = " + std::to_string(frame.checksum_from) +
             " must be before it");
    for (const ReportConstant& constant : frame.constants) claim_byte("a constant byte", constant.byte);
  }

  void claim(const char* name, const ReportField& field, std::size_t count) {
    if (!field.present) return;
    const std::string field_name = name;
    if (field.bits < 1 || field.bits > 64)
      reject(field_name + " must be 1 to 64 bits wide, not " + std::to_string(field.bits));
    if (field.bit > 7) reject(field_name + " must start at one of the bits 0 to 7 of its byte");
    if (field.coding == Coding::nibble_ascii && (field.bits % kBitsPerNibble != 0 || field.bit != 0))
      reject(field_name +
             " is coded as nibbles, so its width must be a multiple of 4 and it starts at bit 0");
    if (field.big_endian && field.coding == Coding::binary && (field.bits % 8 != 0 || field.bit != 0))
      reject(field_name + " is big-endian, so it must be made of whole bytes");
    if (!is_finite(field.step) || field.step == 0.0) reject(field_name + " needs a finite step other than 0");
    if (!is_finite(field.offset)) reject(field_name + " needs a finite offset");
    if (field.count != count)
      reject(field_name + " must hold " + std::to_string(count) + " integers, not " +
             std::to_string(field.count));
    if (field.byte >= kMaxReportBytes) reject_position(name, field.byte);
    claim(name, 8 * field.byte + field.bit, integer_stride(field) * count);
  }

  void claim(const char* name, const ReportBit& field) {
    if (!field.present) return;
    if (field.bit > 7) reject(std::string(name) + " must be one of the bits 0 to 7 of its byte");
    if (field.byte >= kMaxReportBytes) reject_position(name, field.byte);
    claim(name, 8 * field.byte + field.bit, 1);
  }

  void claim(const char* name, const std::vector<ReportBit>& bits) {
    for (const ReportBit& bit : bits) claim(name, bit);
  }

  void require(const char* name, const ReportField& field) const {
    if (!field.present) reject(std::string(name) + " is missing; a device without it cannot be used");
  }

  [[noreturn]] void reject(const std::string& why) const {
    throw std::invalid_argument(report_ + ": " + why);
  }

 private:
  void claim_byte(const char* name, std::size_t byte) {
    if (byte >= kMaxReportBytes) reject_position(name, byte);
    claim(name, 8 * byte, 8);
  }

  [[noreturn]] void reject_position(const char* name, std::size_t byte) const {
    reject(std::string(name) + " at byte " + std::to_string(byte) + " does not fit: the fields end at byte " +
           std::to_string(field_bits_ / 8) + ", before the checksum if there is one");
  }

  void claim(const char* name, std::size_t first, std::size_t bits) {
    if (first >= field_bits_ || bits > field_bits_ - first) reject_position(name, first / 8);
    for (std::size_t i = first; i < first + bits; ++i) {
      if (owner_[i] != nullptr)
        reject(std::string(name) + " overlaps " + owner_[i] + " at byte " + std::to_string(i / 8));
      owner_[i] = name;
    }
  }

  std::string report_;
  std::size_t field_bits_ = 0;                            ///< bits before a checksum at the end of the report
  std::array<const char*, 8 * kMaxReportBytes> owner_{};  ///< name of the field of each bit; null: none
};

/// Returns true if the pose is computed from this report, by kinematics or by integration.
bool is_raw(const PoseReportLayout& layout) noexcept {
  return layout.joints.present || layout.translation.present || layout.rotation.present;
}

FieldMap map_fields(const PoseReportLayout& layout) {
  FieldMap map(layout.name.empty() ? "pose_report" : "report " + layout.name, layout);
  map.claim("motors_on", layout.motors_on);
  map.claim("watchdog_tripped", layout.watchdog_tripped);
  map.claim("sequence", layout.sequence, 1);
  map.claim("device_time", layout.device_time, 1);
  map.claim("position", layout.position, 3);
  map.claim("orientation", layout.orientation, 4);
  map.claim("linear_velocity", layout.linear_velocity, 3);
  map.claim("angular_velocity", layout.angular_velocity, 3);
  map.claim("buttons", layout.buttons, 1);
  map.claim("acknowledged", layout.acknowledged, 1);
  map.claim("translation", layout.translation, 3);
  map.claim("rotation", layout.rotation, 3);
  map.claim("joints", layout.joints, std::min(layout.joints.count, kMaxJoints));
  map.claim("a button", layout.button_bits);
  map.claim("a bit of homed", layout.homed);
  for (const NamedBit& status : layout.status) map.claim("a status bit", status.bit);
  for (const NamedField& named : layout.values) map.claim("a value", named.field, 1);
  if (layout.button_bits.size() > 32) map.reject("has more than 32 buttons");
  return map;
}

void validate_distinguishable(const PoseReportLayout& a, const PoseReportLayout& b) {
  const bool ids = a.has_id && b.has_id;
  if (a.has_id != b.has_id)
    throw std::invalid_argument(
        "reports with an id and without one cannot be distinguished; a device has either kind");
  if (ids && a.id != b.id) return;
  if (min_report_length(a) > b.length || min_report_length(b) > a.length) return;
  throw std::invalid_argument("two reports have the same " + std::string(ids ? "id" : "length") +
                              " and cannot be distinguished");
}

/// Checks that the reports together give a pose.
void validate_pose(const DeviceProfile& profile, const std::vector<const PoseReportLayout*>& layouts) {
  const auto any = [&](ReportField PoseReportLayout::*field) {
    return std::any_of(layouts.begin(), layouts.end(), [&](const auto* l) { return (l->*field).present; });
  };
  const auto reject = [](const char* why) { throw std::invalid_argument(why); };
  const bool joints = any(&PoseReportLayout::joints);
  const bool deflection = any(&PoseReportLayout::translation) || any(&PoseReportLayout::rotation);
  switch (pose_source(profile)) {
    case PoseSource::joints:
      if (!joints) reject("kinematics is stated, but no report carries joints");
      for (const auto* l : layouts)
        if (l->joints.present && l->joints.count < profile.kinematics.joints)
          reject("joints holds fewer integers than kinematics has joints");
      return;
    case PoseSource::deflection:
      if (!deflection) reject("deflection is stated, but no report carries a translation or a rotation");
      return;
    case PoseSource::pose:
      if (joints) reject("a report carries joints, but kinematics is not stated");
      if (deflection) reject("a report carries a translation or rotation, but deflection is not stated");
      if (!any(&PoseReportLayout::position))
        reject("position is missing; a device without it cannot be used");
      return;
  }
}

}  // namespace

void validate(const PoseReportLayout& layout) {
  const FieldMap map = map_fields(layout);
  if (!is_raw(layout)) map.require("position", layout.position);
}

void validate(const WrenchReportLayout& layout) {
  FieldMap map("wrench_report", layout);
  if (!layout.template_bytes.empty() && layout.template_bytes.size() != layout.length)
    map.reject("template has " + std::to_string(layout.template_bytes.size()) +
               " bytes and must have the length of the report, " + std::to_string(layout.length));
  if (!layout.efforts.present) map.require("force", layout.force);
  if (layout.efforts.present && (layout.force.present || layout.torque.present))
    map.reject("efforts replace force and torque; leave one of the two out");
  map.claim("enable", layout.enable);
  map.claim("sequence", layout.sequence, 1);
  map.claim("force", layout.force, 3);
  map.claim("torque", layout.torque, 3);
  map.claim("efforts", layout.efforts, kMaxMotors);
  map.claim("hold_time", layout.hold_time, 1);
}

void validate_reports(const DeviceProfile& profile) {
  std::vector<const PoseReportLayout*> layouts = {&profile.pose_report};
  for (const PoseReportLayout& layout : profile.more_reports) layouts.push_back(&layout);
  for (std::size_t i = 0; i < layouts.size(); ++i) {
    map_fields(*layouts[i]);
    for (std::size_t j = 0; j < i; ++j) validate_distinguishable(*layouts[j], *layouts[i]);
  }
  validate_pose(profile, layouts);
  if (!profile.has_output) return;
  validate(profile.wrench_report);
  if (profile.wrench_report.efforts.present && profile.kinematics.kind == Kinematics::Kind::none)
    throw std::invalid_argument("wrench_report: efforts require [kinematics]");
  if (profile.max_torque_Nm > 0.0 && !profile.wrench_report.torque.present)
    throw std::invalid_argument(
        "wrench_report: torque is missing, though max_torque_Nm is stated; a device without torque states "
        "no such limit");
}

}  // namespace wrenchd
