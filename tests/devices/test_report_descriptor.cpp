// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "devices/report_descriptor.hpp"
#include "tests/support/random_values.hpp"
#include "tests/support/sample_descriptors.hpp"

namespace wrenchd::test_report_descriptor {

namespace {

using namespace test;

ReportDescriptor parsed(const std::string& hex) {
  return parse_report_descriptor(from_hex(hex));
}

/// Returns the error of a descriptor; empty if it is valid.
std::string parse_error(const Bytes& bytes) {
  try {
    parse_report_descriptor(bytes);
  } catch (const DescriptorError& error) {
    return error.what();
  }
  return {};
}

const DescribedReport& report(const ReportDescriptor& descriptor, ReportKind kind,
                              std::optional<std::uint8_t> id) {
  const DescribedReport* found = descriptor.find(kind, id);
  REQUIRE(found != nullptr);
  return *found;
}

/// A vendor collection around items; their fields start with one byte.
std::string framed(const std::string& items) {
  return "06 00 ff 09 01 a1 01 15 00 26 ff 00 75 08 95 01" + items + "c0";
}

TEST_CASE("a SpaceNavigator's descriptor: three axes in each of two reports", "[report_descriptor]") {
  const Bytes bytes = space_navigator();
  REQUIRE(bytes.size() == 217);  // size reported by Linux
  const ReportDescriptor d = parse_report_descriptor(bytes);
  CHECK(d.has_ids());
  CHECK(d.reports.size() == 12);

  const DescribedReport& translation = report(d, ReportKind::input, 1);
  CHECK(translation.length == 7);
  REQUIRE(translation.fields.size() == 1);
  const DescribedField& axes = translation.fields[0];
  CHECK(axes.bit == 8);
  CHECK(axes.bits == 16);
  CHECK(axes.count == 3);
  CHECK(axes.is_signed());
  CHECK(axes.logical_min == -350);
  CHECK(axes.logical_max == 350);
  CHECK(axes.physical_min == -1400);
  CHECK(axes.physical_max == 1400);
  CHECK(axes.unit == 0x11);  // SI linear, centimetre
  CHECK(axes.unit_exponent == -4);
  CHECK(axes.variable);
  CHECK(axes.relative);
  CHECK_FALSE(axes.constant);
  CHECK(axes.usage(0) == Usage{0x01, 0x30});
  CHECK(axes.usage(2) == Usage{0x01, 0x32});
  CHECK(d.application(axes) == Usage{0x01, 0x08});
  CHECK(to_text(*axes.usage(2)) == "01:32 (Z)");

  // The descriptor states no unit for the rotations, so the unit of the translations still applies.
  const DescribedReport& rotation = report(d, ReportKind::input, 2);
  CHECK(rotation.length == 7);
  CHECK(rotation.fields.at(0).unit == 0x11);
  CHECK(rotation.fields.at(0).usage(1) == Usage{0x01, 0x34});

  const DescribedReport& buttons = report(d, ReportKind::input, 3);
  CHECK(buttons.length == 3);
  REQUIRE(buttons.fields.size() == 2);
  CHECK(buttons.fields[0].usage(1) == Usage{0x09, 2});
  CHECK(buttons.fields[1].bit == 10);
  CHECK(buttons.fields[1].count == 14);
  CHECK(buttons.fields[1].constant);
  CHECK_FALSE(buttons.fields[1].usage(0));

  CHECK(report(d, ReportKind::output, 4).length == 2);
  CHECK(report(d, ReportKind::feature, 8).length == 8);
  CHECK(d.find(ReportKind::output, 1) == nullptr);
  CHECK(d.find(ReportKind::input, {}) == nullptr);
}

TEST_CASE("a SpaceMouse Wireless has its six axes in one report, and a battery", "[report_descriptor]") {
  const ReportDescriptor d = parse_report_descriptor(space_mouse_wireless());
  const DescribedReport& axes = report(d, ReportKind::input, 1);
  CHECK(axes.length == 13);
  CHECK(axes.fields.at(0).count == 6);
  CHECK(axes.fields.at(0).usage(5) == Usage{0x01, 0x35});
  const DescribedReport& battery = report(d, ReportKind::input, 0x17);
  CHECK(battery.length == 3);
  CHECK(battery.fields.at(0).logical_max == 100);
  CHECK(battery.fields.at(0).unit == 0);
  CHECK(battery.fields.at(1).bit == 16);
}

TEST_CASE("without report ids, fields begin at the first bit", "[report_descriptor]") {
  const ReportDescriptor teensy = parse_report_descriptor(teensy_rawhid());
  CHECK_FALSE(teensy.has_ids());
  CHECK(teensy.reports.size() == 2);
  const DescribedReport& in = report(teensy, ReportKind::input, {});
  CHECK(in.length == 64);
  CHECK(in.fields.at(0).bit == 0);
  CHECK(in.fields.at(0).count == 64);
  CHECK(in.fields.at(0).usage(63) == Usage{0xFFAB, 1});  // one usage applies to all fields
  CHECK(teensy.application(in.fields.at(0)) == Usage{0xFFAB, 0x0200});
  CHECK(report(teensy, ReportKind::output, {}).length == 64);

  const ReportDescriptor ten = parse_report_descriptor(ten_bit_axes());
  const DescribedReport& six = report(ten, ReportKind::input, {});
  CHECK(six.length == 8);  // 63 bits
  CHECK(six.fields.at(1).bit == 3);
  CHECK(six.fields.at(1).end_bit() == 63);
  CHECK(six.fields.at(1).logical_min == -512);
}

TEST_CASE("the keyboard of the specification", "[report_descriptor]") {
  const ReportDescriptor d = parse_report_descriptor(boot_keyboard());
  const DescribedReport& keys = report(d, ReportKind::input, {});
  CHECK(keys.length == 8);
  REQUIRE(keys.fields.size() == 3);
  CHECK(keys.fields[0].usage(7) == Usage{0x07, 0xE7});
  CHECK(keys.fields[1].constant);
  const DescribedField& array = keys.fields[2];
  CHECK_FALSE(array.variable);
  CHECK(array.bit == 16);
  CHECK(array.count == 6);
  REQUIRE(array.usages.size() == 1);  // 102 usages, not expanded
  CHECK(array.usages[0].last_id == 0x65);
  CHECK(report(d, ReportKind::output, {}).length == 1);
}

TEST_CASE("a joystick with force effects", "[report_descriptor]") {
  const ReportDescriptor d = parse_report_descriptor(effects_joystick());
  CHECK(report(d, ReportKind::input, 1).length == 25);
  CHECK(report(d, ReportKind::input, 1).fields.at(1).bit == 72);
  CHECK(report(d, ReportKind::output, 0xA1).length == 25);
  CHECK(report(d, ReportKind::output, 0xA1).fields.back().bits == 64);
  CHECK(report(d, ReportKind::feature, 0x13).fields.at(0).logical_max == 0xFFFF);

  const DescribedReport& force = report(d, ReportKind::output, 5);
  CHECK(force.length == 8);
  REQUIRE(force.fields.size() == 3);
  CHECK(force.fields[0].logical_min == 1);  // although its maximum comes first in the descriptor
  CHECK(force.fields[0].logical_max == 40);
  CHECK(force.fields[1].logical_min == -32767);
  CHECK(force.fields[1].physical_min == -10000);
  const DescribedField& direction = force.fields[2];
  CHECK(direction.usage(0) == Usage{0x0A, 1});  // with its own page
  CHECK(direction.usage(1) == Usage{0x0A, 2});  // the alternative in between was skipped
  CHECK(direction.logical_max == 36000);
  CHECK(direction.unit_exponent == -2);  // a byte, not a nibble

  // A collection in a collection in a collection.
  const DescribedCollection& inner = d.collections.at(direction.collection);
  CHECK(inner.usage == Usage{0x0F, 0x57});
  CHECK(d.collections.at(inner.parent).usage == Usage{0x0F, 0x73});
  CHECK(d.application(direction) == Usage{0x01, 0x04});
}

TEST_CASE("a maximum is unsigned unless the minimum is negative", "[report_descriptor]") {
  const auto range = [](const std::string& items) {
    const DescribedField field = parsed(framed(items + "81 02")).reports.at(0).fields.at(0);
    return std::pair(field.logical_min, field.logical_max);
  };
  using Range = std::pair<std::int64_t, std::int64_t>;
  CHECK(range("15 00 25 ff") == Range(0, 255));
  CHECK(range("15 81 25 7f") == Range(-127, 127));
  CHECK(range("26 ff ff 15 00") == Range(0, 65535));
  CHECK(range("25 ff 15 80") == Range(-128, -1));
  CHECK(range("17 00 00 00 80 27 ff ff ff 7f") == Range(-2147483648LL, 2147483647));
  CHECK(range("14 27 ff ff ff ff") == Range(0, 4294967295LL));
}

TEST_CASE("a usage takes the page that is current where its field is declared", "[report_descriptor]") {
  const auto usage = [](const std::string& items) {
    return *parsed(framed(items + "81 02")).reports.at(0).fields.at(0).usage(0);
  };
  CHECK(usage("05 01 09 30") == Usage{0x01, 0x30});
  CHECK(usage("05 09 09 30 05 01") == Usage{0x01, 0x30});
  CHECK(usage("05 09 0b 30 00 01 00") == Usage{0x01, 0x30});
}

TEST_CASE("push saves the global state, and pop restores it", "[report_descriptor]") {
  const auto d = parsed(framed("a4 75 10 95 03 81 02 b4 81 02"));
  const DescribedReport& in = report(d, ReportKind::input, {});
  CHECK(in.fields.at(0).count == 3);
  CHECK(in.fields.at(1).count == 1);
  CHECK(in.fields.at(1).bits == 8);
  CHECK(in.fields.at(1).bit == 48);
}

TEST_CASE("a field without bits and a count of zero declare nothing", "[report_descriptor]") {
  CHECK(parsed(framed("95 00 81 02 95 01 81 02")).reports.at(0).fields.size() == 1);
  CHECK(parsed(framed("75 00 81 02 75 08 81 02")).reports.at(0).fields.size() == 1);
}

TEST_CASE("items of reserved types and tags are skipped, as in Linux", "[report_descriptor]") {
  CHECK(parse_error(from_hex(framed("0c 81 02 f9 01"))).empty());
  CHECK(parse_error(from_hex(framed("81 02 00 00"))).empty());
}

TEST_CASE("an invalid descriptor is rejected with the byte and the reason", "[report_descriptor]") {
  struct Bad {
    std::string hex;
    std::string message;
  };
  const std::string nested = [] {
    std::string text;
    for (int i = 0; i < 33; ++i) text += "a1 00 ";
    return text;
  }();
  const std::string pushes = [] {
    std::string text;
    for (int i = 0; i < 17; ++i) text += "a4 ";
    return text;
  }();
  const std::string fields = [] {
    std::string text;
    for (int i = 0; i < 257; ++i) text += "81 02 ";
    return text;
  }();
  const std::string long_one = [] {
    std::string text;
    for (int i = 0; i < 2049; ++i) text += "95 01 ";
    return text;
  }();
  for (const Bad& bad : std::vector<Bad>{
           {"", "byte 0: the descriptor is empty"},
           {"05", "byte 0: item 0x05 needs 1 more bytes, and the descriptor ends after 0"},
           {"05 01 27 ff ff ff", "byte 2: item 0x27 needs 4 more bytes, and the descriptor ends after 3"},
           {"05 01 fe 02 00 00 00", "byte 2: is a long item"},
           {"05 01", "byte 2: it declares no report"},
           {framed("81 02 a1 00"), "byte 21: 1 collection(s) are still open"},
           {"05 01 c0", "byte 2: ends a collection, but none is open"},
           {"75 08 95 01 81 02", "byte 4: declares a field outside every collection"},
           {"a1 01 95 01 81 02 c0", "byte 7: it declares no report"},
           {"a1 01 75 08 81 02 c0", "byte 7: it declares no report"},
           {framed("81 02 a4"), "byte 20: 1 push(es) without a pop"},
           {framed("b4 81 02"), "byte 16: is a pop without a push"},
           {framed(pushes), "byte 32: pushes are nested more than 16 deep"},
           {framed(nested), "byte 78: collections are nested more than 32 deep"},
           {framed("76 01 01 81 02"), "byte 16: fields of 257 bits; 256 is the maximum"},
           {framed("77 ff ff ff ff 81 02"), "byte 16: fields of 4294967295 bits"},
           {framed("97 ff ff ff ff 81 02"), "byte 21: 4294967295 fields of 8 bits make the report longer"},
           {framed("96 00 40 81 02 81 02"), "byte 21: 16384 fields of 8 bits make the report longer"},
           {framed(fields), "byte 528: is field 257 of its report"},
           {framed(long_one), "byte 4096: the descriptor has 4115 bytes; 4096 is the maximum"},
           {framed("85 00 81 02"), "byte 16: report id 0; 1 to 255 are allowed"},
           {framed("86 00 01 81 02"), "byte 16: report id 256; 1 to 255 are allowed"},
           {framed("81 02 85 01 81 02"), "byte 18: sets a report id, but previous fields have none"},
           {framed("a4 85 01 81 02 b4 81 02"), "byte 22: declares a field without a report id"},
           {framed("15 01 25 00 81 02"), "byte 20: the logical range 1 to 0 is empty"},
           {framed("55 20 81 02"), "byte 16: unit exponent 32; -8 to 7 are defined"},
           {framed("07 00 00 01 00 81 02"), "byte 16: usage page 0x10000 has more than 16 bits"},
           {framed("c4 81 02"), "byte 16: global item with the reserved tag 12"},
           {framed("19 01 81 02"), "byte 16: a usage minimum without its maximum"},
           {framed("29 01 81 02"), "byte 16: a usage maximum without its minimum"},
           {framed("19 01 19 02 29 03 81 02"), "byte 18: is a second end of a usage range"},
           {framed("19 03 29 01 81 02"), "byte 18: the usages ff00:03 (vendor defined) to ff00:01"},
           {framed("1b 01 00 01 00 29 03 81 02"), "no range: use one page, the smaller first"},
           {framed("a9 01 09 01 81 02"), "byte 20: is between delimiters"},
           {framed("a9 01 a9 01 81 02"), "byte 18: opens a delimiter inside another"},
           {framed("a9 00 81 02"), "byte 16: closes a delimiter, but none is open"},
           {framed("a9 02 81 02"), "byte 16: delimiter 2; 1 opens and 0 closes"},
           {framed("81 02") + "a9 01", "byte 21: a delimiter is still open"},
       }) {
    INFO(bad.hex);
    const std::string message = parse_error(from_hex(bad.hex));
    INFO(message);
    CHECK(message.find(bad.message) != std::string::npos);
  }
}

// Tablets declare a field before the first Report Size. In Linux the size is 0 until it is set.
TEST_CASE("a field before any Report Size or Report Count has no bits, as in Linux", "[report_descriptor]") {
  for (const char* empty_field : {"81 02", "95 01 81 02", "75 08 81 02", "09 30 95 02 b1 03"}) {
    const ReportDescriptor descriptor = parse_report_descriptor(from_hex(
        "05 01 09 08 a1 01 " + std::string(empty_field) + " 09 31 15 00 26 ff 00 75 08 95 02 81 02 c0"));
    REQUIRE(descriptor.reports.size() == 1);
    REQUIRE(descriptor.reports[0].fields.size() == 1);
    CHECK(descriptor.reports[0].length == 2);
    CHECK(descriptor.reports[0].fields[0].bit == 0);
    CHECK(descriptor.reports[0].fields[0].usage(0) == Usage{0x01, 0x31});
  }
}

TEST_CASE("every truncated descriptor is rejected", "[report_descriptor]") {
  for (const Bytes& whole : sample_descriptors()) {
    REQUIRE(parse_error(whole).empty());
    for (std::size_t length = 0; length < whole.size(); ++length)
      CHECK_FALSE(parse_error({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length)}).empty());
  }
}

/// Invariants of every accepted descriptor.
void check_sound(const ReportDescriptor& descriptor) {
  bool sound = !descriptor.reports.empty();
  for (const DescribedReport& r : descriptor.reports) {
    std::size_t end = r.id ? 8 : 0;
    sound = sound && r.id.has_value() == descriptor.has_ids() && r.length <= kMaxDescribedReportBytes;
    sound = sound && r.fields.size() <= kMaxFieldsPerReport;
    for (const DescribedField& field : r.fields) {
      sound = sound && field.bit == end && field.bits >= 1 && field.bits <= kMaxFieldBits && field.count >= 1;
      sound = sound && field.logical_min <= field.logical_max;
      sound = sound && field.collection < descriptor.collections.size();
      sound = sound && field.usage(field.count).has_value() == !field.usages.empty();
      static_cast<void>(descriptor.application(field));
      end = field.end_bit();
    }
    sound = sound && r.length == (end + 7) / 8;
  }
  if (!sound)
    FAIL("what was accepted contradicts itself");  // one CHECK per invariant would take longer than the
                                                   // parsing
}

TEST_CASE("a million mutated and random descriptors are fully accepted or rejected", "[report_descriptor]") {
  RandomValues random(20);
  constexpr int cases = 1'000'000;  // also under sanitizers, which detect memory errors
  int accepted = 0;
  for (int i = 0; i < cases; ++i) {
    const Bytes bytes = malformed_descriptor(random);
    try {
      check_sound(parse_report_descriptor(bytes));
      ++accepted;
    } catch (const DescriptorError& error) {
      if (error.at() > bytes.size()) FAIL("rejected at a byte that is not there");
    }
  }
  CHECK(accepted > cases / 20);  // both outcomes are frequent
  CHECK(accepted < cases / 2);
}

}  // namespace
}  // namespace wrenchd::test_report_descriptor
