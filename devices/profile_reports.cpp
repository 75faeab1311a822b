// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/profile_reports.hpp"

#include <cmath>

#include "devices/discovery/match_profile.hpp"

namespace wrenchd {
namespace {

/// Collects the fields of one layout.
class FieldCollector {
 public:
  FieldCollector(ReportKind kind, const ReportFrame& frame) {
    report_.kind = kind;
    if (frame.has_id) report_.id = frame.id;
    report_.length = frame.length;
    report_.min_length = frame.min_length;
    const unsigned checksum_bits = frame.checksum == Checksum::crc16_ccitt_false ? 16 : 8;
    if (frame.checksum != Checksum::none)
      add("checksum", 8 * frame.checksum_at.value_or(frame.length - checksum_bits / 8), checksum_bits, 1,
          false);
    for (const ReportConstant& constant : frame.constants) add("constant", 8 * constant.byte, 8, 1, false);
  }

  void field(const std::string& name, const ReportField& field) {
    if (!field.present) return;
    const unsigned bits_each = field.coding == Coding::nibble_ascii ? 2 * field.bits : field.bits;
    add(name, 8 * field.byte + field.bit, bits_each, field.count, field.is_signed);
  }
  /// full: value of the field at the full deflection of a puck; NaN if it is not stated.
  void deflection(const std::string& name, const ReportField& deflected, double full) {
    field(name, deflected);
    const double counts = full / std::abs(deflected.step);
    if (deflected.present && counts > 0.0) report_.fields.back().full_counts = counts;
  }
  void bit(const std::string& name, const ReportBit& bit) {
    if (bit.present) add(name, 8 * bit.byte + bit.bit, 1, 1, false);
  }
  void bits(const std::string& name, const std::vector<ReportBit>& bits) {
    for (std::size_t i = 0; i < bits.size(); ++i) bit(name + "[" + std::to_string(i) + "]", bits[i]);
  }

  const ExpectedReport& report() const { return report_; }

 private:
  void add(const std::string& name, std::size_t bit, unsigned bits, std::size_t count, bool is_signed) {
    report_.fields.push_back({name, bit, bits, count, is_signed, 0.0});
  }

  ExpectedReport report_;
};

ExpectedReport expected_report(const PoseReportLayout& p, const Deflection& full) {
  FieldCollector pose(ReportKind::input, p);
  pose.bit("motors_on", p.motors_on);
  pose.bit("watchdog_tripped", p.watchdog_tripped);
  pose.field("sequence", p.sequence);
  pose.field("device_time", p.device_time);
  pose.field("position", p.position);
  pose.field("orientation", p.orientation);
  pose.field("linear_velocity", p.linear_velocity);
  pose.field("angular_velocity", p.angular_velocity);
  pose.deflection("translation", p.translation, full.full_deflection_m);
  pose.deflection("rotation", p.rotation, full.full_deflection_rad);
  pose.field("joints", p.joints);
  pose.field("buttons", p.buttons);
  pose.bits("buttons", p.button_bits);
  pose.bits("homed", p.homed);
  pose.field("acknowledged", p.acknowledged);
  for (const NamedBit& status : p.status) pose.bit(status.name, status.bit);
  for (const NamedField& value : p.values) pose.field(value.name, value.field);
  return pose.report();
}

ExpectedReport expected_report(const WrenchReportLayout& w) {
  FieldCollector wrench(ReportKind::output, w);
  wrench.bit("enable", w.enable);
  wrench.field("sequence", w.sequence);
  wrench.field("force", w.force);
  wrench.field("torque", w.torque);
  wrench.field("efforts", w.efforts);
  wrench.field("hold_time", w.hold_time);
  return wrench.report();
}

}  // namespace

std::vector<ExpectedReport> expected_reports(const DeviceProfile& profile) {
  const Deflection full = profile.deflection.value_or(Deflection{});
  std::vector<ExpectedReport> reports = {expected_report(profile.pose_report, full)};
  for (const PoseReportLayout& more : profile.more_reports) {
    reports.push_back(expected_report(more, full));
    reports.back().may_be_absent = !carries_pose(more);
  }
  if (profile.has_output) reports.push_back(expected_report(profile.wrench_report));
  return reports;
}

}  // namespace wrenchd
