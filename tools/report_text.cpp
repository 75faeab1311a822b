// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/report_text.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <utility>

#include "devices/deflection_pose.hpp"
#include "devices/kinematics.hpp"
#include "devices/profile_device.hpp"
#include "devices/report_bits.hpp"
#include "devices/report_codec.hpp"

namespace wrenchd {
namespace {

using Bytes = std::span<const std::uint8_t>;

std::string number(double x) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.9g", x == 0.0 ? 0.0 : x);  // avoids -0
  return text.data();
}

/// Lines with a name, values and a unit.
class LineReader {
 public:
  void add(const std::string& name, const std::string& text) {
    std::array<char, 64> column{};
    std::snprintf(column.data(), column.size(), "%-20s ", name.c_str());
    text_ += column.data() + text + '\n';
  }
  void add(const std::string& name, std::span<const double> values, const std::string& unit,
           const std::string& more = {}) {
    double largest = 0.0;
    for (const double value : values) largest = std::max(largest, std::abs(value));
    std::string line;
    for (const double value : values)  // suppresses the rounding error of a rotation
      line += (line.empty() ? "" : " ") + number(std::abs(value) < 1e-14 * largest ? 0.0 : value);
    add(name, line + (unit.empty() ? "" : " " + unit) + more);
  }
  void add(const std::string& name, const Vector3d& v, const std::string& unit) {
    add(name, std::span<const double>(v.data(), 3), unit);
  }
  void field(const std::string& name, const ReportField& field, Bytes bytes, const std::string& unit) {
    if (!field.present) return;
    std::vector<double> values;
    std::string counts = "   counts";
    for (std::size_t i = 0; i < field.count; ++i) {
      const std::uint64_t raw = raw_integer(field, bytes, i);
      values.push_back(field_value(field, bytes, i));
      counts +=
          " " + (field.is_signed ? std::to_string(static_cast<std::int64_t>(raw)) : std::to_string(raw));
    }
    const bool plain = field.step == 1.0 && field.offset == 0.0;
    add(name, values, unit, plain ? "" : counts);
  }
  void bit(const std::string& name, const ReportBit& bit, Bytes bytes) {
    if (bit.present) add(name, bit_value(bit, bytes) ? "yes" : "no");
  }
  std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

std::string label(const ReportFrame& frame, const std::string& name) {
  std::array<char, 32> id{};
  if (frame.has_id) std::snprintf(id.data(), id.size(), " 0x%02x", frame.id);
  return "report" + std::string(id.data()) + (name.empty() ? "" : " (" + name + ")");
}

std::string mismatch_text(const ReportFrame& frame, Decoding outcome, Bytes bytes) {
  switch (outcome) {
    case Decoding::ok:
      return "fits";
    case Decoding::wrong_length:
      return "has " + (frame.min_length == 0 ? "" : std::to_string(frame.min_length) + " to ") +
             std::to_string(frame.length) + " bytes, found " + std::to_string(bytes.size());
    case Decoding::wrong_id:
      return "begins with another id: found " + hex_text(bytes.first(1));
    case Decoding::bad_checksum:
      return "has another checksum: at least one byte is wrong";
    case Decoding::wrong_marker:
      for (const auto& [byte, value] : frame.constants)
        if (byte < bytes.size() && bytes[byte] != value)
          return "has " + hex_text({&value, 1}) + " at byte " + std::to_string(byte) + ", found " +
                 hex_text(bytes.subspan(byte, 1));
      break;
  }
  return "does not match";
}

std::string buttons_text(std::uint32_t buttons) {
  std::string list;
  for (unsigned i = 0; i < 32; ++i)
    if ((buttons >> i & 1u) != 0) list += (list.empty() ? "" : " ") + std::to_string(i);
  return list.empty() ? "none" : list;
}

void add_pose(LineReader& lines, const std::string& where, const Pose& X) {
  const Vector3d p = X.translation_m;
  const std::array<double, 4> q = {X.rotation.x(), X.rotation.y(), X.rotation.z(), X.rotation.w()};
  lines.add("position " + where, p, "m");
  lines.add("orientation " + where, q, "(x y z w)");
}

/// Adds wrenchd's interpretation of a report, in the base frame.
void add_meaning(LineReader& lines, const DeviceProfile& profile, const PoseReportLayout& layout,
                 PoseReport report) {
  const Quaterniond& R_BD = profile.X_BD.rotation;
  if (layout.joints.present && profile.kinematics.kind != Kinematics::Kind::none) {
    const Kinematics& k = profile.kinematics;
    const JointAngles angles = joint_angles(k, strip_count_button(k, report.joints, report.buttons));
    lines.add("joint angles", std::span<const double>(angles.data(), k.joints), "rad");
    const auto X_DE = forward_kinematics(k, angles, {});
    if (!X_DE) return lines.add("position in base", "none: these angles belong to no handle pose");
    lines.add("position in device", X_DE->translation_m, "m");
    add_pose(lines, "in base", profile.X_BD * *X_DE * profile.X_EH);
  } else if (layout.position.present && layout.orientation.present) {
    report.X_BH.rotation.normalize();
    add_pose(lines, "in base", profile.X_BD * report.X_BH * profile.X_EH);
  }
  if (layout.translation.present) lines.add("translation in base", R_BD * report.translation_m, "m");
  if (layout.rotation.present) lines.add("rotation in base", R_BD * report.rotation_rad, "rad");
  if (profile.deflection && profile.deflection->mode == Deflection::Mode::rate) {
    const Deflection& d = *profile.deflection;
    const SteeringCurve linear(d, d.linear_gain, d.full_deflection_m);
    const SteeringCurve angular(d, d.angular_gain, d.full_deflection_rad);
    if (layout.translation.present)
      lines.add("tool velocity", linear.velocity(R_BD * report.translation_m), "m/s");
    if (layout.rotation.present)
      lines.add("tool angular vel.", angular.velocity(R_BD * report.rotation_rad), "rad/s");
  }
  if (layout.buttons.present || !layout.button_bits.empty() ||
      (layout.joints.present && profile.kinematics.count_button.present))
    lines.add("buttons pressed", buttons_text(report.buttons));
}

std::string pose_text(const DeviceProfile& profile, const PoseReportLayout& r, Bytes bytes) {
  PoseReport report;
  decode_into(r, bytes, report);
  LineReader lines;
  lines.add(profile.name, label(r, r.name) + ", " + std::to_string(bytes.size()) + " bytes, from the device");
  lines.field("sequence", r.sequence, bytes, "");
  lines.field("device_time", r.device_time, bytes, "s");
  lines.field("position", r.position, bytes, "m");
  lines.field("orientation", r.orientation, bytes, "(x y z w)");
  lines.field("linear_velocity", r.linear_velocity, bytes, "m/s");
  lines.field("angular_velocity", r.angular_velocity, bytes, "rad/s");
  lines.field("translation", r.translation, bytes, "m");
  lines.field("rotation", r.rotation, bytes, "rad");
  lines.field("joints", r.joints, bytes, "counts");
  lines.field("acknowledged", r.acknowledged, bytes, "");
  lines.bit("motors_on", r.motors_on, bytes);
  lines.bit("watchdog_tripped", r.watchdog_tripped, bytes);
  if (!r.homed.empty()) {
    std::string each;
    for (const ReportBit& bit : r.homed) each += bit_value(bit, bytes) ? " 1" : " 0";
    lines.add("homed", std::string(report.homed ? "yes" : "no") + "   bits" + each);
  }
  for (const NamedBit& status : r.status) lines.bit(status.name, status.bit, bytes);
  for (const NamedField& value : r.values) lines.field(value.name, value.field, bytes, "");
  add_meaning(lines, profile, r, report);
  return lines.take();
}

std::string wrench_text(const DeviceProfile& profile, Bytes bytes) {
  const WrenchReportLayout& r = profile.wrench_report;
  LineReader lines;
  lines.add(profile.name, label(r, {}) + ", " + std::to_string(bytes.size()) + " bytes, to the device");
  lines.bit("enable", r.enable, bytes);
  lines.field("sequence", r.sequence, bytes, "");
  lines.field("force", r.force, bytes, "N");
  lines.field("torque", r.torque, bytes, "N.m");
  const bool arm = profile.kinematics.kind == Kinematics::Kind::capstan_arm;
  lines.field("efforts", r.efforts, bytes, arm ? "A" : "motor counts");
  lines.field("hold_time", r.hold_time, bytes, "s");
  if (r.efforts.present)
    lines.add("joint torques", joint_torques(profile.kinematics, decode(r, bytes).report.efforts), "N.m");
  return lines.take();
}

/// Returns the report itself: without the status bytes of an FTDI chip, and without the byte 00 that host
/// libraries write for "no report id".
Bytes without_wrapping(const DeviceProfile& profile, Bytes bytes) {
  const PoseReportLayout& r = profile.pose_report;
  const std::size_t prefix = profile.endpoints.prefix_bytes;
  if (prefix > 0 && bytes.size() == r.length + prefix) return bytes.subspan(prefix);
  const bool one_more =
      bytes.size() == r.length + 1 || (r.min_length != 0 && bytes.size() == r.min_length + 1);
  if (!r.has_id && one_more && bytes[0] == 0) return bytes.subspan(1);
  return bytes;
}

/// A link that supplies one given report and stores the report that the device writes.
class BytesLink final : public ReportLink {
 public:
  void open() override {}
  LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept override {
    if (!waiting || waiting->size() > buffer.size()) return {LinkStatus::not_ready, 0, now};
    std::copy(waiting->begin(), waiting->end(), buffer.begin());
    const std::size_t length = waiting->size();
    waiting.reset();
    return {LinkStatus::ok, length, now};
  }
  LinkStatus write(TimePoint, std::span<const std::uint8_t> report) noexcept override {
    written_length = std::min(report.size(), written.size());
    std::copy_n(report.begin(), written_length, written.begin());
    return LinkStatus::ok;
  }
  void wait_readable(TimePoint) noexcept override {}
  void close() noexcept override {}

  std::optional<std::vector<std::uint8_t>> waiting;
  std::array<std::uint8_t, kMaxReportBytes> written{};
  std::size_t written_length = 0;
};

/// Returns a report of a device at its home pose.
std::vector<std::uint8_t> home_report(const DeviceProfile& profile) {
  PoseReport report;
  report.joints = profile.kinematics.home_counts;
  std::vector<std::uint8_t> bytes(kMaxReportBytes);
  bytes.resize(encode(profile.pose_report, report, bytes));
  return bytes;
}

[[noreturn]] void reject_place(const DeviceProfile& profile, Bytes at) {
  std::string reasons = "it is a report to the device, not from it";
  try {
    report_text(profile, at);
  } catch (const std::runtime_error& error) {
    reasons = error.what();
  }
  throw std::runtime_error("--at: " + reasons);
}

void add_limit_remark(std::vector<std::string>& remarks, const char* what, double requested, double limit,
                      const char* unit) {
  if (requested > limit)
    remarks.push_back(std::string(what) + " is limited from " + number(requested) + " to " + number(limit) +
                      " " + unit + ", the limit in the profile");
}

}  // namespace

std::string hex_text(Bytes bytes) {
  std::string text;
  for (const unsigned byte : bytes) {
    std::array<char, 4> pair{};
    std::snprintf(pair.data(), pair.size(), "%02x", byte & 0xffu);
    text += (text.empty() ? "" : " ") + std::string(pair.data());
  }
  return text;
}

std::string report_text(const DeviceProfile& profile, Bytes given, bool to_device) {
  if (given.empty()) throw std::runtime_error("no bytes; give a report, as in --hex \"01 00 ff\"");
  const Bytes bytes = without_wrapping(profile, given);
  std::string reasons;
  const auto reason = [&](const ReportFrame& frame, const std::string& name, Decoding outcome) {
    reasons += "\n  " + label(frame, name) + ' ' + mismatch_text(frame, outcome, bytes);
  };
  for (std::size_t i = 0; !to_device && i <= profile.more_reports.size(); ++i) {
    const PoseReportLayout& layout = i == 0 ? profile.pose_report : profile.more_reports[i - 1];
    PoseReport report;
    const Decoding outcome = decode_into(layout, bytes, report);
    if (outcome == Decoding::ok) return pose_text(profile, layout, bytes);
    reason(layout, layout.name, outcome);
  }
  if (profile.has_output) {
    const Decoding outcome = decode(profile.wrench_report, bytes).outcome;
    if (outcome == Decoding::ok) return wrench_text(profile, bytes);
    reason(profile.wrench_report, "to the device", outcome);
  }
  throw std::runtime_error("these " + std::to_string(bytes.size()) + " bytes match no report of " +
                           profile.name + ":" + reasons);
}

EncodedWrench encode_wrench(const DeviceProfile& profile, const Wrench& F, Bytes at, std::uint64_t sequence) {
  if (!profile.has_output)
    throw std::runtime_error(profile.name + " accepts no wrench: it has no motors; name another profile");
  EncodedWrench encoded;
  const bool joints = profile.kinematics.kind != Kinematics::Kind::none;
  BytesLink link;
  ProfileDevice device(profile, link);
  TimePoint now{};
  device.open();
  device.read_newest(now);
  device.assume_trusted();
  if (!at.empty() || joints) {
    const Bytes given = without_wrapping(profile, at);
    link.waiting = at.empty() ? home_report(profile) : std::vector<std::uint8_t>(given.begin(), given.end());
    const DeviceSample sample = device.read_newest(now += std::chrono::milliseconds(1));
    if (sample.rejected > 0) reject_place(profile, at);
    if (!sample.homed)
      encoded.remarks.push_back("the encoders in --at are not homed: the motors stay off");
    else if (sample.fault != Fault::none)
      throw std::runtime_error("--at: " + std::string(fault_row(sample.fault).message));
    if (at.empty())
      encoded.remarks.push_back("at the home pose, which the device reports as " +
                                hex_text(home_report(profile)));
  }
  const double authority = profile.watchdog_s > 0.0 ? 1.0 : ProfileDevice::kAuthorityWithoutWatchdog;
  if (authority < 1.0)
    encoded.remarks.push_back("the device has no watchdog, so a quarter of its limits applies");
  add_limit_remark(encoded.remarks, "the force", F.force_N.norm(), authority * profile.max_force_N, "N");
  if (profile.wrench_report.torque.present)
    add_limit_remark(encoded.remarks, "the torque", F.torque_Nm.norm(), authority * profile.max_torque_Nm,
                     "N.m");
  do device.write(now, F, true);
  while (device.commands_sent() < sequence);
  const DofMask dropped = device.read_newest(now).dropped_dofs;
  if (dropped != kNoDof)
    encoded.remarks.push_back("dropped, because there are no motors: " + dof_text(dropped));
  encoded.bytes.assign(link.written.begin(), link.written.begin() + static_cast<long>(link.written_length));
  return encoded;
}

}  // namespace wrenchd
