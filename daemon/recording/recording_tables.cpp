// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/recording_tables.hpp"

#include <array>
#include <string>

#include "daemon/recording/recording_file.hpp"

namespace wrenchd {
namespace {

constexpr std::uint64_t kChunkContacts = 1024;

constexpr std::array kContactRangeFields = {
    RecordField{"first_contact", FieldType::u64, 1, offsetof(TickRow, first_contact), "1", "",
                "row of /contacts with the first contact of the tick", ValueNames::none},
    RecordField{
        "contact_count", FieldType::u32, 1, offsetof(TickRow, contact_count), "1", "",
        "rows of /contacts for the tick, at most 16 with the largest multipliers; `contacts` counts all",
        ValueNames::none},
};

}  // namespace

const TableKind& tick_table() {
  static const TableKind kind = [] {
    const auto fields = tick_fields();
    TableKind made{
        "/ticks", "ticks", sizeof(TickRow), {fields.begin(), fields.end()}, RecordingWriter::kChunkTicks};
    made.fields.insert(made.fields.end(), kContactRangeFields.begin(), kContactRangeFields.end());
    return made;
  }();
  return kind;
}

const TableKind& contact_table() {
  static const TableKind kind = [] {
    const auto fields = contact_fields();
    TableKind made{"/contacts", "contacts", sizeof(Touch), {}, kChunkContacts};
    for (const RecordField& field : fields)
      if (std::string(field.name) != "padding") made.fields.push_back(field);
    return made;
  }();
  return kind;
}

}  // namespace wrenchd
