// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/load_report_layout.hpp"

#include <cmath>

namespace wrenchd {
namespace {

/// One packet of a full-speed interrupt endpoint.
constexpr std::size_t kMaxReportBytes = 64;

/// Smallest and largest SI value of one count that can be meant.
constexpr Range kStep = {1e-12, 1e3};

/// What a field of a given name must look like.
struct FieldShape {
  std::size_t count = 1;       ///< integers in a row
  bool is_signed = false;      ///< counters wrap, so they have no sign; vectors have one
  std::string_view step = {};  ///< key of the step; empty: a plain count
  double reach = 0.0;          ///< the largest value it has to carry; NaN or 0: any
};

struct IntegerType {
  unsigned bits = 0;
  bool is_signed = false;
};

bool read_type(const TomlValue& value, bool is_signed, ReportField& field) {
  IntegerType type;
  const bool good =
      is_signed ? value.choice(type, {{"i8", {8, true}}, {"i16", {16, true}}, {"i32", {32, true}}})
                : value.choice(type, {{"u8", {8, false}}, {"u16", {16, false}}, {"u32", {32, false}}});
  if (good) field.bits = type.bits;
  field.is_signed = is_signed;
  return good;
}

/// A field that saturates below a limit would hide that the limit is passed.
void check_reach(const TomlValue& step, const ReportField& field, double reach) {
  const double largest = field.step * (std::ldexp(1.0, static_cast<int>(field.bits) - 1) - 1.0);
  if (!(largest < reach)) return;
  step.refuse(std::to_string(field.bits) + " bits with this step reach " + step.with_unit(largest) +
              ", less than the " + step.with_unit(reach) +
              " it has to carry; use a larger step or a wider type");
}

void read_field(TomlTable& table, ReportField& field, const FieldShape& shape) {
  field.count = shape.count;
  const bool byte_good = table.mandatory("byte").integer(field.byte, {1, kMaxReportBytes - 1});
  const bool type_good = read_type(table.mandatory("type"), shape.is_signed, field);
  field.present = byte_good && type_good;
  if (shape.step.empty()) return;
  const TomlValue step = table.mandatory(shape.step);
  if (step.number(field.step, kStep) && field.present) check_reach(step, field, shape.reach);
}

void read_bit(TomlTable& table, ReportBit& bit) {
  const bool byte_good = table.mandatory("byte").integer(bit.byte, {1, kMaxReportBytes - 1});
  const bool bit_good = table.mandatory("bit").integer(bit.bit, {0, 7});
  bit.present = byte_good && bit_good;
}

/// A report's id, length and checksum, and who owns each of its bits.
class ReportFrame {
 public:
  template <typename Layout>
  ReportFrame(TomlTable& table, Layout& layout) {
    table.mandatory("id").integer(layout.id, {0, 255});
    const bool length_good = table.mandatory("length").integer(layout.length, {4, kMaxReportBytes});
    table.optional("checksum")
        .choice(layout.checksum,
                {{"crc16_ccitt_false", Checksum::crc16_ccitt_false}, {"none", Checksum::none}});
    const std::size_t tail = layout.checksum == Checksum::none ? 0 : 2;
    end_bit_ = 8 * ((length_good ? layout.length : kMaxReportBytes) - tail);
  }

  void field(const TomlValue& value, ReportField& field, const FieldShape& shape) {
    value.table(read_field, field, shape);
    if (field.present) claim(value, 8 * field.byte, field.bits * field.count);
  }

  void bit(const TomlValue& value, ReportBit& bit) {
    value.table(read_bit, bit);
    if (bit.present) claim(value, 8 * bit.byte + bit.bit, 1);
  }

 private:
  struct Claim {
    std::string name;
    std::size_t begin, end;
  };

  void claim(const TomlValue& value, std::size_t begin, std::size_t bits) {
    const std::size_t end = begin + bits;
    if (end > end_bit_) {
      value.refuse("its last byte is " + std::to_string((end - 1) / 8) + ", but fields end with byte " +
                   std::to_string(end_bit_ / 8 - 1) + " at the latest; move it, or lengthen the report");
    }
    for (const Claim& other : claims_) {
      if (begin < other.end && other.begin < end) {
        value.refuse("overlaps '" + other.name + "', which has bytes " + std::to_string(other.begin / 8) +
                     " to " + std::to_string((other.end - 1) / 8) + "; move one of them");
      }
    }
    claims_.push_back({value.name(), begin, end});
  }

  std::size_t end_bit_ = 0;
  std::vector<Claim> claims_;
};

}  // namespace

void read_pose_report(TomlTable& table, DeviceProfile& profile) {
  PoseReportLayout& r = profile.pose_report;
  const double max_speed = profile.max_linear_speed_m_per_s;
  const double max_turn = profile.max_angular_speed_rad_per_s;
  constexpr double kUnitQuaternion = 0.999;  // i16 with a step rounded down from 1/32767 ends just below one

  ReportFrame frame(table, r);
  frame.bit(table.mandatory("motors_on"), r.motors_on);
  frame.bit(table.mandatory("watchdog_tripped"), r.watchdog_tripped);
  frame.field(table.mandatory("sequence"), r.sequence, {});
  frame.field(table.mandatory("device_time"), r.device_time, {1, false, "step_s"});
  frame.field(table.mandatory("position"), r.position, {3, true, "step_m"});
  frame.field(table.mandatory("orientation"), r.orientation, {4, true, "step", kUnitQuaternion});
  frame.field(table.optional("linear_velocity"), r.linear_velocity, {3, true, "step_m_per_s", max_speed});
  frame.field(table.optional("angular_velocity"), r.angular_velocity, {3, true, "step_rad_per_s", max_turn});
  frame.field(table.optional("buttons"), r.buttons, {});
  frame.field(table.optional("acknowledged"), r.acknowledged, {});
}

void read_wrench_report(TomlTable& table, DeviceProfile& profile) {
  WrenchReportLayout& r = profile.wrench_report;

  ReportFrame frame(table, r);
  frame.bit(table.mandatory("enable"), r.enable);
  frame.field(table.mandatory("sequence"), r.sequence, {});
  frame.field(table.mandatory("force"), r.force, {3, true, "step_N", profile.max_force_N});
  frame.field(table.mandatory("torque"), r.torque, {3, true, "step_Nm", profile.max_torque_Nm});
  frame.field(table.mandatory("hold_time"), r.hold_time, {1, false, "step_s"});
}

}  // namespace wrenchd
