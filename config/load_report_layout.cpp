// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/load_report_layout.hpp"

#include <algorithm>
#include <cmath>

#include "config/report_bytes.hpp"

namespace wrenchd {
namespace {

/// One packet of a full-speed interrupt endpoint.
constexpr std::size_t kMaxReportBytes = 64;

/// Plausible range of the SI value of one count.
constexpr Range kStep = {1e-12, 1e3};
constexpr Range kOffset = {-1e6, 1e6};

constexpr unsigned kBitsPerNibble = 4;
constexpr std::uint8_t kNibbleA = 0x41;  ///< 'A' encodes 0

/// Required properties of a field.
struct FieldShape {
  std::size_t count = 1;       ///< number of consecutive integers
  bool is_signed = false;      ///< true for vectors; counters wrap and have no sign
  std::string_view step = {};  ///< key of the step; empty: a plain count
  double reach = 0.0;          ///< largest value that the field must represent; NaN or 0: any
  bool plain_step = false;     ///< the step is optional, default 1
  bool any_sign = false;       ///< the type decides whether the field is signed
};

struct IntegerType {
  unsigned bits = 0;
  bool is_signed = false;
};

bool read_type(const TomlValue& value, const FieldShape& shape, ReportField& field) {
  IntegerType type;
  const bool is_signed = shape.is_signed;
  if (shape.any_sign) {
    const bool good = value.choice(type, {{"i8", {8, true}},
                                          {"i16", {16, true}},
                                          {"i32", {32, true}},
                                          {"u8", {8, false}},
                                          {"u16", {16, false}},
                                          {"u32", {32, false}}});
    field.bits = type.bits;
    field.is_signed = type.is_signed;
    return good;
  }
  const bool good =
      is_signed ? value.choice(type, {{"i8", {8, true}}, {"i16", {16, true}}, {"i32", {32, true}}})
                : value.choice(type, {{"u8", {8, false}}, {"u16", {16, false}}, {"u32", {32, false}}});
  if (good) field.bits = type.bits;
  field.is_signed = is_signed;
  return good;
}

/// Rejects a field that saturates below a limit: it could not show that the limit is exceeded.
void check_reach(const TomlValue& step, const ReportField& field, double reach) {
  const double counts = std::ldexp(1.0, static_cast<int>(field.bits) - (field.is_signed ? 1 : 0)) - 1.0;
  const double largest = std::abs(field.step) * counts;
  if (!(largest < reach)) return;
  step.reject(std::to_string(field.bits) + " bits with this step reach " + step.with_unit(largest) +
              ", less than the " + step.with_unit(reach) +
              " it has to carry; use a larger step or a wider type");
}

/// Number of bits from the first to the last of a field.
std::size_t bits_of(const ReportField& field) {
  const std::size_t each =
      field.coding == Coding::nibble_ascii ? std::size_t{8} * (field.bits / kBitsPerNibble) : field.bits;
  return each * field.count;
}

/// Reads the short form `type = "i16"`, or `bits = 10` for any width.
bool read_width(TomlTable& table, ReportField& field, const FieldShape& shape) {
  const TomlValue type = table.mandatory_unless("bits", "type");
  const TomlValue bits = table.optional("bits");
  const TomlValue is_signed = table.optional("signed");
  if (type && bits) {
    bits.reject("the type determines the width; leave one of the two out");
    return false;
  }
  if (type && is_signed) is_signed.reject("the type determines the sign; leave this out, or give bits");
  if (!bits) return read_type(type, shape, field);
  field.is_signed = shape.is_signed;
  is_signed.boolean(field.is_signed);
  return bits.integer(field.bits, {1, 64});
}

/// Reads the bit layout of a field. Returns false if it is inconsistent.
bool read_coding(TomlTable& table, ReportField& field) {
  const TomlValue bit = table.optional("bit");
  bit.integer(field.bit, {0, 7});
  const TomlValue order = table.optional("order");
  order.choice(field.big_endian, {{"little_endian", false}, {"big_endian", true}});
  const TomlValue coding = table.optional("coding");
  coding.choice(field.coding, {{"binary", Coding::binary}, {"nibble_ascii", Coding::nibble_ascii}});
  if (field.coding == Coding::nibble_ascii) field.base = kNibbleA;
  table.optional("base").integer(field.base, {0, 255});
  if (field.coding == Coding::nibble_ascii && (field.bits % kBitsPerNibble != 0 || field.bit != 0)) {
    coding.reject("a nibble holds 4 bits and starts at bit 0; use bits = 4, 8, 12, 16 and so on");
    return false;
  }
  if (field.coding == Coding::binary && field.big_endian && (field.bits % 8 != 0 || field.bit != 0)) {
    order.reject("big_endian is for whole bytes; use bits = 8, 16, 24 and so on, and bit = 0");
    return false;
  }
  return true;
}

void read_sign(TomlTable& table, ReportField& field) {
  const TomlValue value = table.optional("sign");
  int sign = 1;
  if (!value.integer(sign, {-1, 1})) return;
  if (sign == 0) return value.reject("must be 1, or -1 to turn the axes round");
  field.step *= sign;
}

std::string offset_key(std::string_view step_key) {
  return "offset" + std::string(step_key.substr(std::string_view("step").size()));
}

void read_field(TomlTable& table, ReportField& field, const FieldShape& shape, std::size_t first_byte) {
  field.count = shape.count;
  const bool byte_good =
      table.mandatory("byte").integer(field.byte, {static_cast<double>(first_byte), kMaxReportBytes - 1});
  const bool type_good = read_width(table, field, shape);
  const bool coding_good = read_coding(table, field);
  field.present = byte_good && type_good && coding_good;
  if (shape.step.empty()) return;
  const TomlValue step = shape.plain_step ? table.optional(shape.step) : table.mandatory(shape.step);
  if (step.number(field.step, kStep) && field.present) check_reach(step, field, shape.reach);
  table.optional(offset_key(shape.step)).number(field.offset, kOffset);
  read_sign(table, field);
}

void read_bit(TomlTable& table, ReportBit& bit, std::size_t first_byte) {
  const bool byte_good =
      table.mandatory("byte").integer(bit.byte, {static_cast<double>(first_byte), kMaxReportBytes - 1});
  const bool bit_good = table.mandatory("bit").integer(bit.bit, {0, 7});
  table.optional("base").integer(bit.base, {0, 255});
  bit.present = byte_good && bit_good;
}

std::size_t width_of(Checksum checksum) {
  if (checksum == Checksum::none) return 0;
  return checksum == Checksum::crc16_ccitt_false ? 2 : 1;
}

/// Reads id, length and checksum of a report, and rejects fields that overlap.
class FrameReader {
 public:
  FrameReader(TomlTable& table, ReportFrame& layout) : layout_(layout) {
    const TomlValue id = table.mandatory("id");
    layout.has_id = !id.is_text("none");
    if (layout.has_id) id.integer(layout.id, {0, 255});
    const double shortest = layout.has_id ? 2 : 1;
    const bool length_good = table.mandatory("length").integer(layout.length, {shortest, kMaxReportBytes});
    const TomlValue checksum = table.optional("checksum");
    checksum.choice(layout.checksum, {{"crc16_ccitt_false", Checksum::crc16_ccitt_false},
                                      {"sum8", Checksum::sum8},
                                      {"xor8", Checksum::xor8},
                                      {"none", Checksum::none}});
    const std::size_t length = length_good ? layout.length : kMaxReportBytes;
    const TomlValue least = table.optional("min_length");
    if (least.integer(layout.min_length, {shortest, static_cast<double>(length)}) &&
        layout.checksum != Checksum::none)
      least.reject("a report with a checksum is never short; leave one of the two out");
    end_bit_ = 8 * length;
    read_checksum_place(table, length);
    read_constants(table.optional("constants"));
  }

  std::size_t first_byte() const { return layout_.has_id ? 1 : 0; }

  void field(const TomlValue& value, ReportField& field, const FieldShape& shape) {
    if (value.is_text("none")) return;
    value.table(read_field, field, shape, first_byte());
    if (field.present) claim(value, 8 * field.byte + field.bit, bits_of(field));
  }

  void bit(const TomlValue& value, ReportBit& bit) {
    if (value.is_text("none")) return;
    value.table(read_bit, bit, first_byte());
    if (bit.present) claim(value, 8 * bit.byte + bit.bit, 1);
  }

  void bits(const TomlValue& list, std::vector<ReportBit>& bits, std::size_t most) {
    const auto elements = list.elements("an array of bits, each as in { byte = 1, bit = 0 }");
    if (elements.size() > most) return list.reject("has more than " + std::to_string(most) + " bits");
    for (const TomlValue& element : elements) {
      ReportBit read;
      bit(element, read);
      bits.push_back(read);
    }
  }

  void statuses(const TomlValue& list, std::vector<NamedBit>& out) {
    for (const TomlValue& element : list.elements("an array of bits, each with a name, a byte and a bit")) {
      NamedBit named;
      element.table([&](TomlTable& table) {
        read_name(table.mandatory("name"), named.name);
        read_bit(table, named.bit, first_byte());
      });
      if (named.bit.present) claim(element, 8 * named.bit.byte + named.bit.bit, 1);
      out.push_back(named);
    }
  }

  void values(const TomlValue& list, std::vector<NamedField>& out) {
    for (const TomlValue& element : list.elements("an array of fields, each with a name")) {
      NamedField named;
      element.table([&](TomlTable& table) {
        read_name(table.mandatory("name"), named.name);
        read_field(table, named.field, {1, false, "step", 0.0, true, true}, first_byte());
      });
      if (named.field.present) claim(element, 8 * named.field.byte + named.field.bit, bits_of(named.field));
      out.push_back(named);
    }
  }

 private:
  struct Claim {
    std::string name;
    std::size_t begin, end;
  };

  static void read_name(const TomlValue& value, std::string& name) {
    if (value.line(name) && name.empty()) value.reject("must not be empty; it is what people read");
  }

  void read_checksum_place(TomlTable& table, std::size_t length) {
    const std::size_t width = width_of(layout_.checksum);
    const TomlValue at = table.optional("checksum_at");
    const TomlValue from = table.optional("checksum_from");
    if (width == 0) {
      if (at) at.reject("there is no checksum; name one, or leave this out");
      if (from) from.reject("there is no checksum; name one, or leave this out");
      return;
    }
    std::size_t slot = length >= width ? length - width : 0;
    if (at.integer(slot, {static_cast<double>(first_byte() + 1), static_cast<double>(length - width)})) {
      layout_.checksum_at = slot;
      claim(at, 8 * slot, 8 * width);
    } else {
      end_bit_ = 8 * slot;
    }
    from.integer(layout_.checksum_from, {0, static_cast<double>(slot > 0 ? slot - 1 : 0)});
  }

  void read_constants(const TomlValue& list) {
    for (const TomlValue& element : list.elements("an array of bytes and values, as in [[0, 0x3c]]")) {
      std::array<double, 2> pair{};
      if (!element.numbers(pair, {0, 255})) continue;
      const auto byte = static_cast<std::size_t>(pair[0]);
      if (static_cast<double>(byte) != pair[0] || std::trunc(pair[1]) != pair[1]) {
        element.reject_found("two whole numbers, the byte and its value");
        continue;
      }
      layout_.constants.push_back({byte, static_cast<std::uint8_t>(pair[1])});
      claim(element, 8 * byte, 8);
    }
  }

  void claim(const TomlValue& value, std::size_t begin, std::size_t bits) {
    const std::size_t end = begin + bits;
    if (end > end_bit_) {
      value.reject("its last byte is " + std::to_string((end - 1) / 8) + ", but fields end with byte " +
                   std::to_string(end_bit_ / 8 - 1) + " at the latest; move it, or lengthen the report");
    }
    if (begin < 8 * first_byte())
      value.reject("byte 0 is the report id; move it, or state id = \"none\" if the device uses no ids");
    for (const Claim& other : claims_) {
      if (begin < other.end && other.begin < end) {
        value.reject("overlaps '" + other.name + "', which has bytes " + std::to_string(other.begin / 8) +
                     " to " + std::to_string((other.end - 1) / 8) + "; move one of them");
      }
    }
    claims_.push_back({value.name(), begin, end});
  }

  ReportFrame& layout_;
  std::size_t end_bit_ = 0;
  std::vector<Claim> claims_;
};

/// Reads the optional parts of a report: parts of a pose, and everything besides a pose.
void read_parts(TomlTable& table, FrameReader& frame, PoseReportLayout& r, const DeviceProfile& profile) {
  frame.field(table.optional("linear_velocity"), r.linear_velocity,
              {3, true, "step_m_per_s", profile.max_linear_speed_m_per_s});
  frame.field(table.optional("angular_velocity"), r.angular_velocity,
              {3, true, "step_rad_per_s", profile.max_angular_speed_rad_per_s});
  const TomlValue buttons = table.optional("buttons");
  frame.field(buttons, r.buttons, {});
  if (r.buttons.present && r.buttons.bits > 32)
    buttons.reject("has more than 32 buttons; list those that matter");
  const TomlValue list = table.optional("button_list");
  frame.bits(list, r.button_bits, 32);
  if (r.buttons.present && list) list.reject("the buttons are a mask already; leave one of the two out");
  frame.field(table.optional("acknowledged"), r.acknowledged, {});
  frame.bits(table.optional("homed"), r.homed, 32);
  frame.field(table.optional("translation"), r.translation, {3, true, "step_m"});
  frame.field(table.optional("rotation"), r.rotation, {3, true, "step_rad"});
  const std::size_t joints = std::max<std::size_t>(profile.kinematics.joints, 1);
  frame.field(table.optional("joints"), r.joints, {joints, true});
  frame.statuses(table.optional("status"), r.status);
  frame.values(table.optional("values"), r.values);
  table.optional("name").line(r.name);
}

// an i16 with a step rounded down from 1/32767 reaches slightly less than 1
constexpr double kUnitQuaternion = 0.999;

std::size_t min_length(const ReportFrame& frame) {
  return frame.min_length == 0 ? frame.length : frame.min_length;
}

bool told_apart(const ReportFrame& a, const ReportFrame& b) {
  if (a.has_id && b.has_id && a.id != b.id) return true;
  return min_length(a) > b.length || min_length(b) > a.length;
}

}  // namespace

void read_pose_report(TomlTable& table, DeviceProfile& profile, const TomlValue& value) {
  PoseReportLayout& r = profile.pose_report;
  const bool whole = !value.has("joints") && !value.has("translation") && !value.has("rotation");
  const auto key = [&](std::string_view name) {
    return whole ? table.mandatory(name) : table.optional(name);
  };
  FrameReader frame(table, r);
  frame.bit(key("motors_on"), r.motors_on);
  frame.bit(key("watchdog_tripped"), r.watchdog_tripped);
  frame.field(key("sequence"), r.sequence, {});
  frame.field(key("device_time"), r.device_time, {1, false, "step_s"});
  frame.field(key("position"), r.position, {3, true, "step_m"});
  frame.field(key("orientation"), r.orientation, {4, true, "step", kUnitQuaternion});
  read_parts(table, frame, r, profile);
}

void read_more_report(TomlTable& table, PoseReportLayout& r, const DeviceProfile& profile) {
  FrameReader frame(table, r);
  frame.bit(table.optional("motors_on"), r.motors_on);
  frame.bit(table.optional("watchdog_tripped"), r.watchdog_tripped);
  frame.field(table.optional("sequence"), r.sequence, {});
  frame.field(table.optional("device_time"), r.device_time, {1, false, "step_s"});
  frame.field(table.optional("position"), r.position, {3, true, "step_m"});
  frame.field(table.optional("orientation"), r.orientation, {4, true, "step", kUnitQuaternion});
  read_parts(table, frame, r, profile);
}

void read_wrench_report(TomlTable& table, DeviceProfile& profile, const TomlValue& value) {
  WrenchReportLayout& r = profile.wrench_report;
  const bool whole = !value.has("efforts");
  const auto key = [&](std::string_view name) {
    return whole ? table.mandatory(name) : table.optional(name);
  };
  FrameReader frame(table, r);
  frame.bit(key("enable"), r.enable);
  frame.field(key("sequence"), r.sequence, {});
  const TomlValue force = key("force"), torque = key("torque"), efforts = table.optional("efforts");
  frame.field(force, r.force, {3, true, "step_N", profile.max_force_N});
  frame.field(torque, r.torque, {3, true, "step_Nm", profile.max_torque_Nm});
  if (whole && force.is_text("none"))
    force.reject("a device without force has no wrench report; state wrench_report = \"none\" above");
  if (!whole && (r.force.present || r.torque.present))
    efforts.reject("replaces force and torque; leave one of the two out");
  const bool amperes = profile.kinematics.kind != Kinematics::Kind::delta;
  frame.field(efforts, r.efforts,
              {kMaxMotors, true, amperes ? "step_A" : "step", profile.kinematics.max_effort, !amperes});
  if (!whole && profile.kinematics.kind == Kinematics::Kind::none)
    efforts.reject("need [kinematics], by which they are computed; state it");
  frame.field(key("hold_time"), r.hold_time, {1, false, "step_s"});
  const TomlValue stencil = table.optional("template");
  if (read_bytes(stencil, r.template_bytes) && r.template_bytes.size() != r.length) {
    stencil.reject("has " + std::to_string(r.template_bytes.size()) + " bytes, but the report has " +
                   std::to_string(r.length) + "; give one for each");
  }
}

void check_pose_complete(const TomlValue& pose_report, const DeviceProfile& profile) {
  std::vector<const PoseReportLayout*> layouts = {&profile.pose_report};
  for (const PoseReportLayout& layout : profile.more_reports) layouts.push_back(&layout);
  const auto any = [&](ReportField PoseReportLayout::*field) {
    return std::any_of(layouts.begin(), layouts.end(), [&](const auto* l) { return (l->*field).present; });
  };
  const bool joints = any(&PoseReportLayout::joints);
  const bool puck = any(&PoseReportLayout::translation) || any(&PoseReportLayout::rotation);
  const bool pose = any(&PoseReportLayout::position) || any(&PoseReportLayout::orientation);
  const bool kinematics = profile.kinematics.kind != Kinematics::Kind::none;
  if (static_cast<int>(joints) + static_cast<int>(puck) + static_cast<int>(pose) > 1)
    pose_report.reject(
        "a device sends poses (position, orientation), or joints, or a deflection (translation, rotation); "
        "leave all but one out");
  else if (joints && !kinematics)
    pose_report.reject("joints make a pose only by [kinematics]; state it");
  else if (kinematics && !joints && (puck || pose))
    pose_report.reject("[kinematics] needs joints in a report, or must be left out");
  else if (puck && !profile.deflection)
    pose_report.reject("a translation or rotation moves a pose only by [deflection]; state it");
  else if (profile.deflection && !puck && (joints || pose))
    pose_report.reject("[deflection] needs a translation or rotation in a report, or must be left out");
}

void check_distinguishable(const TomlValue& pose_report, const TomlValue& more_reports,
                           const DeviceProfile& profile) {
  const auto elements = more_reports.is_array() ? more_reports.elements("") : std::vector<TomlValue>{};
  std::vector<const PoseReportLayout*> layouts = {&profile.pose_report};
  for (const PoseReportLayout& layout : profile.more_reports) layouts.push_back(&layout);
  for (std::size_t i = 1; i < layouts.size() && i <= elements.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const PoseReportLayout &a = *layouts[j], &b = *layouts[i];
      const std::string other = j == 0 ? pose_report.name() : elements[j - 1].name();
      if (a.length == 0 || b.length == 0) continue;  // rejected before
      if (a.has_id != b.has_id)
        elements[i - 1].reject("'" + other + "' and this one must both have an id, or neither");
      else if (!told_apart(a, b))
        elements[i - 1].reject("cannot be distinguished from '" + other + "': same " +
                               (a.has_id ? "id" : "length") + "; a report is known by its " +
                               (a.has_id ? "id" : "length"));
    }
  }
}

}  // namespace wrenchd
