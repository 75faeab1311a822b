// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/record_fields.hpp"

#include <array>
#include <bit>
#include <tuple>
#include <type_traits>

#include "collision/touch.hpp"
#include "core/command.hpp"
#include "core/fault.hpp"
#include "core/limits.hpp"
#include "core/state.hpp"
#include "daemon/servo/loop_timing.hpp"
#include "daemon/servo/proxy_initializer.hpp"
#include "daemon/servo/tick_record.hpp"

namespace wrenchd {
namespace {

constexpr std::array<std::size_t, 6> kSizes = {1, 2, 4, 8, 8, 8};

template <class T>
constexpr FieldType type_of() {
  if constexpr (std::is_same_v<T, std::uint8_t>) return FieldType::u8;
  if constexpr (std::is_same_v<T, std::uint16_t>) return FieldType::u16;
  if constexpr (std::is_same_v<T, std::uint32_t>) return FieldType::u32;
  if constexpr (std::is_same_v<T, std::uint64_t>) return FieldType::u64;
  if constexpr (std::is_same_v<T, std::int64_t>) return FieldType::i64;
  if constexpr (std::is_same_v<T, double>) return FieldType::f64;
  if constexpr (std::is_enum_v<T>) return type_of<std::underlying_type_t<T>>();
}

template <class T>
struct Shape {
  static constexpr FieldType type = type_of<T>();
  static constexpr std::uint16_t count = 1;
};
template <class T, std::size_t N>
struct Shape<std::array<T, N>> {
  static constexpr FieldType type = type_of<T>();
  static constexpr std::uint16_t count = N;
};

/// Returns true if the fields fill the record in order, with alignment padding only. Then no member is
/// missing.
template <std::size_t N>
constexpr bool are_contiguous(const std::array<RecordField, N>& fields, std::size_t size,
                              std::size_t alignment) {
  const auto aligned = [](std::size_t at, std::size_t to) { return (at + to - 1) / to * to; };
  std::size_t at = 0;
  for (const RecordField& field : fields) {
    const std::size_t one = kSizes[static_cast<std::size_t>(field.type)];
    if (field.offset != aligned(at, one)) return false;
    at = field.offset + one * field.count;
  }
  return aligned(at, alignment) == size;
}

/// A unit, and the names and units of the components of an array.
struct Unit {
  const char* text;
  std::span<const FieldComponent> components = {};
};

constexpr Unit scalar(const char* text) {
  return {text};
}

constexpr std::array<FieldComponent, 7> kPoseComponents = {
    {{"px", "m"}, {"py", "m"}, {"pz", "m"}, {"qx", "1"}, {"qy", "1"}, {"qz", "1"}, {"qw", "1"}}};
#define WRENCHD_BODY(i)                                                                           \
  {"body" #i ".px", "m"}, {"body" #i ".py", "m"}, {"body" #i ".pz", "m"}, {"body" #i ".qx", "1"}, \
      {"body" #i ".qy", "1"}, {"body" #i ".qz", "1"}, {                                           \
    "body" #i ".qw", "1"                                                                          \
  }
constexpr std::array<FieldComponent, std::tuple_size_v<TickRecord::BodyNumbers>> kBodyPoseComponents = {
    {WRENCHD_BODY(0), WRENCHD_BODY(1), WRENCHD_BODY(2), WRENCHD_BODY(3), WRENCHD_BODY(4), WRENCHD_BODY(5),
     WRENCHD_BODY(6), WRENCHD_BODY(7)}};
#undef WRENCHD_BODY
constexpr std::array<FieldComponent, 6> kWrenchComponents = {
    {{"fx", "N"}, {"fy", "N"}, {"fz", "N"}, {"tx", "N.m"}, {"ty", "N.m"}, {"tz", "N.m"}}};
constexpr std::array<FieldComponent, 6> kTwistComponents = {
    {{"vx", "m/s"}, {"vy", "m/s"}, {"vz", "m/s"}, {"wx", "rad/s"}, {"wy", "rad/s"}, {"wz", "rad/s"}}};
constexpr std::array<FieldComponent, 6> kDisplacementComponents = {
    {{"x", "m"}, {"y", "m"}, {"z", "m"}, {"rx", "rad"}, {"ry", "rad"}, {"rz", "rad"}}};
constexpr std::array<FieldComponent, kStageCount> kStageComponents = {
    {{"read", "ns"}, {"projection", "ns"}, {"wrench", "ns"}, {"limits", "ns"}, {"write", "ns"}}};

constexpr Unit kPose = {"m m m, qx qy qz qw", kPoseComponents};
constexpr Unit kBodyPoses = {"m m m, qx qy qz qw, of each body", kBodyPoseComponents};
constexpr Unit kWrench = {"N x3, N.m x3", kWrenchComponents};
constexpr Unit kTwist = {"m/s x3, rad/s x3", kTwistComponents};
constexpr Unit kDisplacement = {"m x3, rad x3", kDisplacementComponents};
constexpr Unit kStages = {"ns x5: read projection wrench limits write", kStageComponents};
constexpr Unit kVector_m = {"m x3"};
constexpr Unit kUnitVector = {"1 x3"};

template <class Member>
constexpr RecordField make_field(const char* name, std::size_t offset, const Unit& unit, const char* frame,
                                 ValueNames values, const char* doc) {
  return {name,   Shape<Member>::type, Shape<Member>::count, offset, unit.text, frame, doc,
          values, unit.components};
}

#define WRENCHD_TICK_FIELD(type, name, initial, unit, frame, values, meaning)                                \
  make_field<decltype(TickRecord::name)>(#name, offsetof(TickRecord, name), unit, frame, ValueNames::values, \
                                         meaning),
#define WRENCHD_CONTACT_FIELD(name, unit, frame, values, meaning) \
  make_field<decltype(Touch::name)>(#name, offsetof(Touch, name), unit, frame, ValueNames::values, meaning)

constexpr std::array kTickFields = {
#include "daemon/servo/tick_fields.def"
};
static_assert(are_contiguous(kTickFields, sizeof(TickRecord), alignof(TickRecord)));

constexpr std::array kContactFields = {
    WRENCHD_CONTACT_FIELD(point_W_m, kVector_m, "world W", none,
                          "contact point of tool and obstacle, with the tool at q"),
    WRENCHD_CONTACT_FIELD(normal_W, kUnitVector, "world W", none,
                          "unit normal, from the obstacle to the tool"),
    WRENCHD_CONTACT_FIELD(multiplier_kg_m, scalar("kg m"), "", none,
                          "d T / d gap; the sum of multiplier times normal is 2 m (x_q - x_p)"),
    WRENCHD_CONTACT_FIELD(load_fraction, scalar("1"), "", none,
                          "multiplier divided by the sum of all multipliers, 0 to 1"),
    WRENCHD_CONTACT_FIELD(obstacle, scalar("1"), "", none,
                          "number of the obstacle; the names of the obstacles are in this order"),
    WRENCHD_CONTACT_FIELD(tool_first, scalar("1"), "", none,
                          "vertex, face, or first vertex of the edge of the tool"),
    WRENCHD_CONTACT_FIELD(tool_second, scalar("1"), "", none, "second vertex of the edge of the tool"),
    WRENCHD_CONTACT_FIELD(obstacle_first, scalar("1"), "", none,
                          "vertex, face, or first vertex of the edge of the obstacle"),
    WRENCHD_CONTACT_FIELD(obstacle_second, scalar("1"), "", none,
                          "second vertex of the edge of the obstacle"),
    WRENCHD_CONTACT_FIELD(contact_kind, scalar("enum"), "", contact_kind,
                          "kinds of the features of tool and obstacle"),
    WRENCHD_CONTACT_FIELD(tool_feature_kind, scalar("enum"), "", feature_kind,
                          "kind of feature that tool_first and tool_second number"),
    WRENCHD_CONTACT_FIELD(obstacle_feature_kind, scalar("enum"), "", feature_kind,
                          "kind of feature that obstacle_first and obstacle_second number"),
    WRENCHD_CONTACT_FIELD(padding, scalar("1"), "", none, "always 0"),
};
static_assert(are_contiguous(kContactFields, sizeof(Touch), alignof(Touch)),
              "Touch has a field that is not in the table");

/// Names of the bits of CommandSet, lowest bit first.
constexpr std::array kCommandNames = {"arm",   "disarm", "reinitialize proxy", "stop",    "acknowledge",
                                      "quit",  "lease",  "heartbeat",          "release", "client lost",
                                      "grasp", "let go", "other hand released"};
static_assert(kCommandNames.size() == std::bit_width(unsigned{kOtherHandReleased}));

template <class Name>
std::vector<std::string> names_of(std::size_t count, const Name& name_of) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < count; ++i) names.emplace_back(name_of(i));
  return names;
}

std::vector<std::string> fault_names() {
  std::vector<std::string> names{std::string(fault_row(Fault::none).name)};
  for (const FaultRow& row : fault_rows()) names.emplace_back(row.name);
  return names;
}

}  // namespace

const char* name(FieldType type) noexcept {
  constexpr std::array kNames = {"u8", "u16", "u32", "u64", "i64", "f64"};
  return kNames[static_cast<std::size_t>(type)];
}

std::size_t size_of(FieldType type) noexcept {
  return kSizes[static_cast<std::size_t>(type)];
}

std::vector<std::string> value_names(ValueNames names) {
  switch (names) {
    case ValueNames::none:
    case ValueNames::flag:
      return {};
    case ValueNames::state:
      return names_of(kStateCount, [](std::size_t i) { return name(static_cast<State>(i)); });
    case ValueNames::fault:
    case ValueNames::fault_bits:
      return fault_names();
    case ValueNames::projection_status:
      return {"free", "converged", "iteration limit", "infeasible"};
    case ValueNames::proxy_initialization:
      return names_of(4, [](std::size_t i) { return name(static_cast<ProxyInitialization>(i)); });
    case ValueNames::contact_kind:
      return {"vertex on face", "face on vertex", "edge on edge"};
    case ValueNames::feature_kind:
      return names_of(kFeatureKindCount, [](std::size_t i) { return name(static_cast<FeatureKind>(i)); });
    case ValueNames::command_bits:
      return {kCommandNames.begin(), kCommandNames.end()};
    case ValueNames::limit_bits:
      return names_of(std::bit_width(unsigned{kPassivity}),
                      [](std::size_t i) { return text(static_cast<LimitCause>(1U << i)); });
    case ValueNames::dof_bits:
      return {"x", "y", "z", "rx", "ry", "rz"};
  }
  return {};
}

std::span<const RecordField> tick_fields() noexcept {
  return kTickFields;
}

std::span<const RecordField> contact_fields() noexcept {
  return kContactFields;
}

}  // namespace wrenchd
