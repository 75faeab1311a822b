// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/state_layout.hpp"

#include <bit>
#include <string>

#include <nlohmann/json.hpp>

#include "daemon/servo/record_fields.hpp"

namespace wrenchd {
namespace {

using nlohmann::json;

/// The only field of StateRecord besides the tick and the contacts.
constexpr RecordField kContactCount = {
    "contact_count",
    FieldType::u64,
    1,
    offsetof(StateRecord, contact_count),
    "1",
    "",
    "contacts in this record, those with the largest multipliers; `contacts` counts all contacts",
    ValueNames::none};

json field_json(const RecordField& field, std::size_t base) {
  json out = {{"name", field.name},       {"offset", base + field.offset},
              {"type", name(field.type)}, {"count", field.count},
              {"unit", field.unit},       {"frame", field.frame},
              {"doc", field.doc}};
  if (field.values != ValueNames::none && field.values != ValueNames::flag)
    out[is_bits(field.values) ? "bits" : "values"] = value_names(field.values);
  return out;
}

json fields_json(std::span<const RecordField> fields, std::size_t base) {
  json out = json::array();
  for (const RecordField& field : fields) out.push_back(field_json(field, base));
  return out;
}

}  // namespace

json state_layout(const SharedState& state, const Reconfigurator::ObstacleNames& obstacles) {
  json fields = fields_json(tick_fields(), offsetof(StateRecord, tick));
  fields.push_back(field_json(kContactCount, 0));
  return {{"version", SharedState::kVersion},
          {"magic", std::string(SharedState::kMagic.begin(), SharedState::kMagic.end())},
          {"bytes", state.bytes()},
          {"header_bytes", SharedState::kHeaderBytes},
          {"written_offset", offsetof(SharedState::Header, written)},
          {"slots", state.slots()},
          {"slot_bytes", SharedState::kSlotBytes},
          {"record_offset", 8},
          {"record_bytes", sizeof(StateRecord)},
          {"rate_Hz", state.rate_Hz()},
          {"byte_order", std::endian::native == std::endian::little ? "little" : "big"},
          {"fields", fields},
          {"contacts",
           {{"offset", offsetof(StateRecord, contacts)},
            {"bytes", sizeof(Touch)},
            {"max_count", kMaxTouches},
            {"fields", fields_json(contact_fields(), 0)}}},
          {"obstacles", obstacles.names},
          {"rendering_id", obstacles.rendering_id}};
}

void open_state(const SharedState& state, const Reconfigurator::ObstacleNames& obstacles,
                const SendWithDescriptor& send) {
  send({{"layout", state_layout(state, obstacles)}}, state.descriptor());
}

}  // namespace wrenchd
