// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/record_fields.hpp"

#include <array>
#include <bit>
#include <type_traits>

#include "collision/touch.hpp"
#include "core/command.hpp"
#include "core/fault.hpp"
#include "core/limits.hpp"
#include "core/state.hpp"
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

/// Do the fields lie one behind the other, with nothing between them but what alignment takes?
template <std::size_t N>
constexpr bool are_all(const std::array<RecordField, N>& fields, std::size_t size, std::size_t alignment) {
  const auto aligned = [](std::size_t at, std::size_t to) { return (at + to - 1) / to * to; };
  std::size_t at = 0;
  for (const RecordField& field : fields) {
    const std::size_t one = kSizes[static_cast<std::size_t>(field.type)];
    if (field.offset != aligned(at, one)) return false;
    at = field.offset + one * field.count;
  }
  return aligned(at, alignment) == size;
}

#define WRENCHD_FIELD(record, member, unit, frame, values, doc)                                   \
  RecordField {                                                                                   \
#member, Shape < decltype(record::member)> ::type, Shape < decltype(record::member)> ::count, \
        offsetof(record, member), unit, frame, doc, ValueNames::values                            \
  }
#define WRENCHD_TICK(member, unit, frame, values, doc) \
  WRENCHD_FIELD(TickRecord, member, unit, frame, values, doc)
#define WRENCHD_TOUCH(member, unit, frame, values, doc) WRENCHD_FIELD(Touch, member, unit, frame, values, doc)

constexpr const char* kPose = "m m m, qx qy qz qw";
constexpr const char* kWrench = "N x3, N.m x3";

constexpr std::array kTick = {
    WRENCHD_TICK(tick, "1", "", none, "number of the tick"),
    WRENCHD_TICK(now_ns, "ns", "", none, "CLOCK_MONOTONIC at which the tick started"),
    WRENCHD_TICK(arrived_ns, "ns", "", none,
                 "when the sample reached the host; its age is answered_ns - arrived_ns"),
    WRENCHD_TICK(device_time_s, "s", "", none, "the device's own clock"),
    WRENCHD_TICK(sequence, "1", "", none, "number of the sample, by the device"),
    WRENCHD_TICK(acknowledged_command, "1", "", none,
                 "number of the last command that the device says it took"),
    WRENCHD_TICK(superseded, "1", "", none, "older samples that came at once with this one"),
    WRENCHD_TICK(missing, "1", "", none, "samples that never came, by their sequence numbers"),
    WRENCHD_TICK(rejected, "1", "", none, "reports that could not be used"),
    WRENCHD_TICK(repeated, "1", "", none, "reports that were there already"),
    WRENCHD_TICK(buttons, "bits", "", none, "buttons held, the first in bit 0"),
    WRENCHD_TICK(fresh, "bool", "", flag, "1: the tick had a new sample"),
    WRENCHD_TICK(motors_on, "bool", "", flag, "1: the device says that its motors are on"),
    WRENCHD_TICK(watchdog_tripped, "bool", "", flag, "1: the device says that its watchdog has tripped"),
    WRENCHD_TICK(homed, "bool", "", flag, "1: the encoders know where they are"),
    WRENCHD_TICK(sample_fault, "enum", "", fault, "what the device found in its reports"),
    WRENCHD_TICK(write_fault, "enum", "", fault, "what the write came to"),
    WRENCHD_TICK(commands, "bits", "", command_bits, "what was asked for since the last tick"),
    WRENCHD_TICK(last_command_sent, "1", "", none, "number of the last command sent before this tick"),
    WRENCHD_TICK(suspended_ns, "ns", "", none, "how long the machine has slept since it was switched on"),
    WRENCHD_TICK(X_BH, kPose, "handle H in device base B", none, "pose of the handle"),
    WRENCHD_TICK(V_BH, "m/s x3, rad/s x3", "handle H in axes of B", none, "twist: linear, angular"),
    WRENCHD_TICK(X_WP, kPose, "tool body T in world W", none, "p: what the hand asks for"),
    WRENCHD_TICK(X_WQ, kPose, "tool body T in world W", none,
                 "q, the proxy: what the world allows; NaN while it has no place"),
    WRENCHD_TICK(eps, "m x3, rad x3", "axes of T at p", none, "from p to q, Eq. (15); NaN without a proxy"),
    WRENCHD_TICK(F_T, kWrench, "axes of T, about its centre of mass", none,
                 "wrench of the law, Eq. (16), before all limits"),
    WRENCHD_TICK(energy, "kg m^2", "", none, "T of Eq. (8), between p and q; NaN without a proxy"),
    WRENCHD_TICK(kkt_residual, "1", "", none, "what the projection left over; NaN without a proxy"),
    WRENCHD_TICK(contacts, "1", "", none, "contacts that hold q; 0 in free space"),
    WRENCHD_TICK(iterations, "1", "", none, "Newton steps of the projection"),
    WRENCHD_TICK(projection_status, "enum", "", projection_status, "how the projection ended"),
    WRENCHD_TICK(proxy_initialization, "enum", "", placing, "where the proxy stands"),
    WRENCHD_TICK(rendering_id, "1", "", none,
                 "number of the rendering that this is of; 0: that of the start, others were made since"),
    WRENCHD_TICK(change_count, "1", "", none, "how often anything was changed while the loop ran"),
    WRENCHD_TICK(rendering_checksum, "1", "", none, "sum over what the rendering was made with"),
    WRENCHD_TICK(next_rendering_weight, "1", "", none,
                 "of F_out that another rendering has, which takes its place"),
    WRENCHD_TICK(contact_gain, "1", "", none,
                 "share of the contact's wrench that the workspace lets through"),
    WRENCHD_TICK(state, "enum", "", state, "state of the loop"),
    WRENCHD_TICK(state_cause, "enum", "", fault, "the fault that led to it"),
    WRENCHD_TICK(faults, "bits", "", fault_bits, "all that was found in this tick"),
    WRENCHD_TICK(limit_causes, "bits", "", limit_bits, "why F_out is not what the law asked for"),
    WRENCHD_TICK(undriven_dofs, "bits", "", dof_bits,
                 "components of the wrench that the device has no motors for"),
    WRENCHD_TICK(motors_commanded, "bool", "", flag, "1: the command says motors on"),
    WRENCHD_TICK(released, "bool", "", flag, "1: the hand was released; F_out is zero"),
    WRENCHD_TICK(authority, "1", "", none, "share of the wrench that goes out, 0 to 1"),
    WRENCHD_TICK(stiffness_scale, "1", "", none, "of the spring that the configuration asks for"),
    WRENCHD_TICK(passivity_scale, "1", "", none, "of the wrench that the passivity guard leaves"),
    WRENCHD_TICK(energy_in_J, "J", "", none, "work of the hand on the loop since the force began"),
    WRENCHD_TICK(energy_out_J, "J", "", none, "work of the loop on the hand, likewise"),
    WRENCHD_TICK(injected_J, "J", "", none, "what of it came from nowhere, net of the device's friction"),
    WRENCHD_TICK(F_out, kWrench, "about the point and in the axes the profile names", none,
                 "wrench told to the device"),
    WRENCHD_TICK(wrench_ready_ns, "ns", "", none,
                 "CLOCK_MONOTONIC at which the wrench was ready, before limits"),
    WRENCHD_TICK(wake_latency_ns, "ns", "", none, "from the time the tick was due to its start"),
    WRENCHD_TICK(stage_ns, "ns x5: read projection wrench limits write", "", none, "what the tick took"),
};
static_assert(are_all(kTick, sizeof(TickRecord), alignof(TickRecord)),
              "TickRecord has a field that is not listed");

constexpr std::array kTouch = {
    WRENCHD_TOUCH(point_W_m, "m x3", "world W", none, "where tool and obstacle touch, with the tool at q"),
    WRENCHD_TOUCH(normal_W, "1 x3", "world W", none, "unit normal, from the obstacle to the tool"),
    WRENCHD_TOUCH(multiplier_kg_m, "kg m", "", none,
                  "d T / d gap: the sum of multiplier times normal is 2 m (x_q - x_p)"),
    WRENCHD_TOUCH(share, "1", "", none, "of what all contacts carry, 0 to 1"),
    WRENCHD_TOUCH(obstacle, "1", "", none, "number of the obstacle; `obstacles` of the layout names it"),
    WRENCHD_TOUCH(tool_first, "1", "", none, "vertex, face, or first vertex of the edge of the tool"),
    WRENCHD_TOUCH(tool_second, "1", "", none, "second vertex of the edge of the tool"),
    WRENCHD_TOUCH(obstacle_first, "1", "", none, "vertex, face, or first vertex of the edge of the obstacle"),
    WRENCHD_TOUCH(obstacle_second, "1", "", none, "second vertex of the edge of the obstacle"),
    WRENCHD_TOUCH(contact_kind, "enum", "", contact_kind, "features of the tool and of the obstacle"),
    WRENCHD_TOUCH(tool_feature_kind, "enum", "", feature_kind, "what tool_first and tool_second number"),
    WRENCHD_TOUCH(obstacle_feature_kind, "enum", "", feature_kind,
                  "what obstacle_first and obstacle_second number"),
    WRENCHD_TOUCH(padding, "1", "", none, "0"),
};
static_assert(are_all(kTouch, sizeof(Touch), alignof(Touch)), "Touch has a field that is not listed");

template <class Name>
std::vector<std::string> names_of(std::size_t count, const Name& name_of) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < count; ++i) names.emplace_back(name_of(i));
  return names;
}

std::vector<std::string> fault_names() {
  return names_of(kFaultCount, [](std::size_t i) {
    return i == 0 ? std::string("none") : std::string(fault_row(static_cast<Fault>(i)).name);
  });
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
      return {"free", "converged", "budget spent", "infeasible"};
    case ValueNames::placing:
      return names_of(4, [](std::size_t i) { return name(static_cast<ProxyInitialization>(i)); });
    case ValueNames::contact_kind:
      return {"vertex on face", "face on vertex", "edge on edge"};
    case ValueNames::feature_kind:
      return names_of(kFeatureKindCount, [](std::size_t i) { return name(static_cast<FeatureKind>(i)); });
    case ValueNames::command_bits:
      return {"arm", "disarm", "start over", "stop", "acknowledge", "quit", "lease", "beat", "let go"};
    case ValueNames::limit_bits:
      return names_of(std::bit_width(unsigned{kPassivity}),
                      [](std::size_t i) { return text(static_cast<LimitCause>(1U << i)); });
    case ValueNames::dof_bits:
      return {"x", "y", "z", "rx", "ry", "rz"};
  }
  return {};
}

std::span<const RecordField> tick_fields() noexcept {
  return kTick;
}

std::span<const RecordField> contact_fields() noexcept {
  return kTouch;
}

}  // namespace wrenchd
