// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/report_codec.hpp"

#include <algorithm>

#include "devices/report_bits.hpp"

namespace wrenchd {

Decoding decode_into(const PoseReportLayout& layout, std::span<const std::uint8_t> bytes,
                     PoseReport& report) noexcept {
  const Decoding outcome = check_frame(layout, bytes);
  if (outcome != Decoding::ok) return outcome;
  if (layout.position.present) report.X_BH.translation_m = field_vector(layout.position, bytes);
  if (layout.orientation.present)
    report.X_BH.rotation.coeffs() << field_vector(layout.orientation, bytes),
        field_value(layout.orientation, bytes, 3);
  if (layout.linear_velocity.present)
    report.V_BH.linear_m_per_s = field_vector(layout.linear_velocity, bytes);
  if (layout.angular_velocity.present)
    report.V_BH.angular_rad_per_s = field_vector(layout.angular_velocity, bytes);
  if (layout.translation.present) report.translation_m = field_vector(layout.translation, bytes);
  if (layout.rotation.present) report.rotation_rad = field_vector(layout.rotation, bytes);
  if (layout.joints.present)
    for (std::size_t i = 0; i < std::min(layout.joints.count, kMaxJoints); ++i)
      report.joints[i] = field_value(layout.joints, bytes, i);
  if (layout.sequence.present) report.sequence = raw_integer(layout.sequence, bytes);
  if (layout.device_time.present) report.device_time = raw_integer(layout.device_time, bytes);
  if (layout.acknowledged.present) report.acknowledged = raw_integer(layout.acknowledged, bytes);
  if (layout.buttons.present) report.buttons = static_cast<std::uint32_t>(raw_integer(layout.buttons, bytes));
  if (!layout.button_bits.empty()) report.buttons = 0;
  for (std::size_t i = 0; i < layout.button_bits.size(); ++i)
    if (bit_value(layout.button_bits[i], bytes)) report.buttons |= std::uint32_t{1} << i;
  if (layout.motors_on.present) report.motors_on = bit_value(layout.motors_on, bytes);
  if (layout.watchdog_tripped.present) report.watchdog_tripped = bit_value(layout.watchdog_tripped, bytes);
  if (!layout.homed.empty())
    report.homed = std::all_of(layout.homed.begin(), layout.homed.end(),
                               [&](const ReportBit& bit) { return bit_value(bit, bytes); });
  return outcome;
}

Decoded<PoseReport> decode(const PoseReportLayout& layout, std::span<const std::uint8_t> bytes) noexcept {
  Decoded<PoseReport> decoded;
  decoded.outcome = decode_into(layout, bytes, decoded.report);
  return decoded;
}

Decoded<WrenchReport> decode(const WrenchReportLayout& layout, std::span<const std::uint8_t> bytes) noexcept {
  const Decoding outcome = check_frame(layout, bytes);
  if (outcome != Decoding::ok) return {outcome, {}};
  WrenchReport report;
  if (layout.force.present) report.F.force_N = field_vector(layout.force, bytes);
  if (layout.torque.present) report.F.torque_Nm = field_vector(layout.torque, bytes);
  if (layout.efforts.present)
    for (std::size_t i = 0; i < kMaxMotors; ++i) report.efforts[i] = field_value(layout.efforts, bytes, i);
  report.hold_time_s = field_value(layout.hold_time, bytes);
  report.sequence = raw_integer(layout.sequence, bytes);
  report.enable = bit_value(layout.enable, bytes);
  return {outcome, report};
}

std::size_t encode(const PoseReportLayout& layout, const PoseReport& report,
                   std::span<std::uint8_t> bytes) noexcept {
  if (bytes.size() < layout.length) return 0;
  const std::span<std::uint8_t> out = begin_frame(layout, {}, bytes);
  for (const ReportField* field :
       {&layout.sequence, &layout.device_time, &layout.position, &layout.orientation, &layout.linear_velocity,
        &layout.angular_velocity, &layout.acknowledged, &layout.buttons, &layout.translation,
        &layout.rotation, &layout.joints})
    put_base(*field, out);
  put_base(layout.motors_on, out);
  put_base(layout.watchdog_tripped, out);
  for (const ReportBit& bit : layout.button_bits) put_base(bit, out);
  for (const ReportBit& bit : layout.homed) put_base(bit, out);
  put_vector(layout.position, report.X_BH.translation_m, out);
  put_vector(layout.orientation, report.X_BH.rotation.vec(), out);
  put_value(layout.orientation, report.X_BH.rotation.w(), out, 3);
  put_vector(layout.linear_velocity, report.V_BH.linear_m_per_s, out);
  put_vector(layout.angular_velocity, report.V_BH.angular_rad_per_s, out);
  put_vector(layout.translation, report.translation_m, out);
  put_vector(layout.rotation, report.rotation_rad, out);
  for (std::size_t i = 0; i < std::min(layout.joints.count, kMaxJoints); ++i)
    put_value(layout.joints, report.joints[i], out, i);
  put_raw(layout.sequence, report.sequence, out);
  put_raw(layout.device_time, report.device_time, out);
  put_raw(layout.acknowledged, report.acknowledged, out);
  put_raw(layout.buttons, report.buttons, out);
  for (std::size_t i = 0; i < layout.button_bits.size(); ++i)
    put_bit(layout.button_bits[i], (report.buttons >> i & 1u) != 0, out);
  put_bit(layout.motors_on, report.motors_on, out);
  put_bit(layout.watchdog_tripped, report.watchdog_tripped, out);
  for (const ReportBit& bit : layout.homed) put_bit(bit, report.homed, out);
  finish_frame(layout, out);
  return layout.length;
}

std::size_t encode(const WrenchReportLayout& layout, const WrenchReport& report,
                   std::span<std::uint8_t> bytes) noexcept {
  if (bytes.size() < layout.length) return 0;
  const std::span<std::uint8_t> out = begin_frame(layout, layout.template_bytes, bytes);
  for (const ReportField* field :
       {&layout.sequence, &layout.force, &layout.torque, &layout.efforts, &layout.hold_time})
    put_base(*field, out);
  put_base(layout.enable, out);
  put_vector(layout.force, report.F.force_N, out);
  put_vector(layout.torque, report.F.torque_Nm, out);
  for (std::size_t i = 0; i < kMaxMotors; ++i) put_value(layout.efforts, report.efforts[i], out, i);
  put_value(layout.hold_time, report.hold_time_s, out);
  put_raw(layout.sequence, report.sequence, out);
  put_bit(layout.enable, report.enable, out);
  finish_frame(layout, out);
  return layout.length;
}

}  // namespace wrenchd
