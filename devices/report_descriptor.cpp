// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/report_descriptor.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <tuple>
#include <utility>

namespace wrenchd {
namespace {

/// Bits 2 and 3 of an item's first byte (HID 1.11 section 6.2.2.2).
enum class ItemType : std::uint8_t { main = 0, global = 1, local = 2, reserved = 3 };

/// One short item: a tag and up to four bytes of data.
struct Item {
  std::size_t at = 0;  ///< byte of the descriptor
  ItemType type = ItemType::main;
  unsigned tag = 0;
  unsigned size = 0;  ///< bytes of data: 0, 1, 2 or 4
  std::uint32_t data = 0;

  std::int64_t as_signed() const noexcept {
    if (size == 1) return static_cast<std::int8_t>(data);
    if (size == 2) return static_cast<std::int16_t>(data);
    return static_cast<std::int32_t>(data);
  }
};

constexpr std::uint8_t kLongItem = 0xFE;

// Tags, section 6.2.2.4 to 6.2.2.8.
enum MainTag : unsigned { kInput = 8, kOutput = 9, kCollection = 10, kFeature = 11, kEndCollection = 12 };
enum GlobalTag : unsigned {
  kUsagePage,
  kLogicalMinimum,
  kLogicalMaximum,
  kPhysicalMinimum,
  kPhysicalMaximum,
  kUnitExponent,
  kUnit,
  kReportSize,
  kReportId,
  kReportCount,
  kPush,
  kPop
};
enum LocalTag : unsigned { kUsage = 0, kUsageMinimum = 1, kUsageMaximum = 2, kDelimiter = 10 };

// Bits of an Input, Output or Feature item.
constexpr std::uint32_t kConstantBit = 1, kVariableBit = 2, kRelativeBit = 4;

std::string hex_digits(std::uint64_t value, int digits = 2) {
  std::array<char, 24> text{};
  std::snprintf(text.data(), text.size(), "%0*llx", digits, static_cast<unsigned long long>(value));
  return text.data();
}

[[noreturn]] void reject_item(const Item& item, const std::string& why) {
  throw DescriptorError(item.at, why);
}

/// A usage as written: with 4 bytes of data it contains its page; with fewer the current page applies.
struct WrittenUsage {
  std::uint32_t value = 0;
  bool with_page = false;

  Usage on(std::uint16_t page) const noexcept {
    return {with_page ? static_cast<std::uint16_t>(value >> 16) : page, static_cast<std::uint16_t>(value)};
  }
};

struct WrittenRange {
  WrittenUsage first, last;
  std::size_t at;
};

/// One end of a range, in both interpretations. The sign of the minimum decides, and it may come later.
struct Extent {
  std::int64_t as_signed = 0;
  std::int64_t as_unsigned = 0;
};

/// State of the global items, which Push saves.
struct GlobalState {
  std::uint16_t usage_page = 0;
  Extent logical_min, logical_max, physical_min, physical_max;
  std::uint32_t unit = 0;
  int unit_exponent = 0;
  std::uint32_t report_size = 0;  ///< 0 until the first Report Size: Linux then adds no field
  std::uint32_t report_count = 0;
  std::optional<std::uint8_t> report_id;
};

/// State of the local items, which applies to the next main item only.
struct LocalState {
  std::vector<WrittenRange> usages;
  std::optional<Item> usage_minimum;
  std::optional<Item> usage_maximum;
  bool delimited = false;        ///< between two delimiters
  std::size_t alternatives = 0;  ///< usages since the delimiter opened
};

/// Processes the items in order.
class DescriptorParser {
 public:
  explicit DescriptorParser(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  ReportDescriptor parse() {
    if (bytes_.empty()) throw DescriptorError(0, "the descriptor is empty");
    if (bytes_.size() > kMaxDescriptorBytes)
      throw DescriptorError(kMaxDescriptorBytes, "the descriptor has " + std::to_string(bytes_.size()) +
                                                     " bytes; " + std::to_string(kMaxDescriptorBytes) +
                                                     " is the maximum of Linux");
    while (next_ < bytes_.size()) process(next_item());
    close();
    return std::move(found_);
  }

 private:
  Item next_item() {
    static constexpr std::array<unsigned, 4> kSizes = {0, 1, 2, 4};
    const std::uint8_t prefix = bytes_[next_];
    const unsigned bits = prefix;
    Item item{next_, static_cast<ItemType>(bits >> 2 & 3), bits >> 4, kSizes[bits & 3], 0};
    if (prefix == kLongItem) reject_item(item, "is a long item; none is defined, and Linux accepts none");
    if (bytes_.size() - next_ - 1 < item.size)
      reject_item(item, "item 0x" + hex_digits(prefix) + " needs " + std::to_string(item.size) +
                            " more bytes, and the descriptor ends after " +
                            std::to_string(bytes_.size() - next_ - 1));
    for (unsigned i = 0; i < item.size; ++i)
      item.data |= static_cast<std::uint32_t>(bytes_[next_ + 1 + i]) << 8 * i;
    next_ += 1 + item.size;
    return item;
  }

  void process(const Item& item) {
    if (item.type == ItemType::main) main_item(item);
    if (item.type == ItemType::global) global_item(item);
    if (item.type == ItemType::local) local_item(item);
  }

  /// Checks that everything that was opened is closed.
  void close() const {
    const Item end{bytes_.size(), ItemType::main, 0, 0, 0};
    if (local_.delimited) reject_item(end, "a delimiter is still open; close it");
    if (!open_.empty())
      reject_item(end, std::to_string(open_.size()) + " collection(s) are still open; end them (c0)");
    if (!pushed_.empty())
      reject_item(end, std::to_string(pushed_.size()) + " push(es) without a pop; add pops (b4)");
    if (found_.reports.empty()) reject_item(end, "it declares no report");
  }

  // Main items

  void main_item(const Item& item) {
    if (local_.delimited) reject_item(item, "is between delimiters, where only usages are allowed");
    if (local_.usage_minimum || local_.usage_maximum) {
      const Item& half = local_.usage_minimum ? *local_.usage_minimum : *local_.usage_maximum;
      reject_item(half, std::string("a usage ") + (local_.usage_minimum ? "minimum without its maximum"
                                                                        : "maximum without its minimum"));
    }
    if (item.tag == kInput) declare(item, ReportKind::input);
    if (item.tag == kOutput) declare(item, ReportKind::output);
    if (item.tag == kFeature) declare(item, ReportKind::feature);
    if (item.tag == kCollection) open_collection(item);
    if (item.tag == kEndCollection) end_collection(item);
    local_ = {};
  }

  void open_collection(const Item& item) {
    if (open_.size() >= kMaxCollectionDepth)
      reject_item(item, "collections are nested more than " + std::to_string(kMaxCollectionDepth) + " deep");
    const Usage usage = local_.usages.empty() ? Usage{} : local_.usages.front().first.on(global_.usage_page);
    found_.collections.push_back({static_cast<std::uint8_t>(item.data), usage,
                                  open_.empty() ? DescribedCollection::kOutermost : open_.back()});
    open_.push_back(found_.collections.size() - 1);
  }

  void end_collection(const Item& item) {
    if (open_.empty()) reject_item(item, "ends a collection, but none is open");
    open_.pop_back();
  }

  void declare(const Item& item, ReportKind kind) {
    if (open_.empty()) reject_item(item, "declares a field outside every collection");
    DescribedField field;
    field.bits = global_.report_size;
    field.count = global_.report_count;
    if (field.bits == 0 || field.count == 0) return;  // no field
    const std::size_t index = report_of(item, kind);
    DescribedReport& report = found_.reports[index];
    field.bit = bits_used_[index];
    require_room(item, field);
    if (report.fields.size() >= kMaxFieldsPerReport)
      reject_item(item, "is field " + std::to_string(kMaxFieldsPerReport + 1) + " of its report; " +
                            std::to_string(kMaxFieldsPerReport) + " is the maximum of Linux");
    field.constant = (item.data & kConstantBit) != 0;
    field.variable = (item.data & kVariableBit) != 0;
    field.relative = (item.data & kRelativeBit) != 0;
    field.collection = open_.back();
    field.declared_at = item.at;
    set_ranges(item, field);
    set_usages(field);
    bits_used_[index] = field.end_bit();
    report.length = (field.end_bit() + 7) / 8;
    report.fields.push_back(std::move(field));
  }

  /// Returns the index of the report of the field; adds the report if it is new.
  std::size_t report_of(const Item& item, ReportKind kind) {
    if (!found_.reports.empty() && found_.has_ids() != global_.report_id.has_value())
      reject_item(item,
                  "declares a field without a report id, but other fields have one; give all fields an id");
    if (const DescribedReport* existing = found_.find(kind, global_.report_id))
      return static_cast<std::size_t>(existing - found_.reports.data());
    const std::size_t id_bytes = global_.report_id ? 1 : 0;
    found_.reports.push_back({kind, global_.report_id, id_bytes, {}});
    bits_used_.push_back(8 * id_bytes);
    return bits_used_.size() - 1;
  }

  /// The factors are bounded so that their product cannot overflow.
  static void require_room(const Item& item, const DescribedField& field) {
    const std::size_t most = 8 * kMaxDescribedReportBytes;
    if (field.count <= most && field.bit + field.bits * field.count <= most) return;
    reject_item(item, std::to_string(field.count) + " fields of " + std::to_string(field.bits) +
                          " bits make the report longer than " + std::to_string(kMaxDescribedReportBytes) +
                          " bytes, the maximum of Linux");
  }

  void set_ranges(const Item& item, DescribedField& field) const {
    const auto range = [](const Extent& min, const Extent& max) {
      return std::pair(min.as_signed, min.as_signed < 0 ? max.as_signed : max.as_unsigned);
    };
    std::tie(field.logical_min, field.logical_max) = range(global_.logical_min, global_.logical_max);
    std::tie(field.physical_min, field.physical_max) = range(global_.physical_min, global_.physical_max);
    if (field.logical_min > field.logical_max)
      reject_item(item, "the logical range " + std::to_string(field.logical_min) + " to " +
                            std::to_string(field.logical_max) +
                            " is empty; minimum and maximum may be exchanged");
    field.unit = global_.unit;
    field.unit_exponent = global_.unit_exponent;
  }

  void set_usages(DescribedField& field) const {
    for (const WrittenRange& range : local_.usages) {
      const Usage first = range.first.on(global_.usage_page), last = range.last.on(global_.usage_page);
      if (first.page != last.page || first.id > last.id)
        throw DescriptorError(range.at, "the usages " + to_text(first) + " to " + to_text(last) +
                                            " are no range: use one page, the smaller first");
      field.usages.push_back({first, last.id});
    }
  }

  // Global items

  void global_item(const Item& item) {
    const Extent extent{item.as_signed(), item.data};
    switch (item.tag) {
      case kUsagePage:
        if (item.data > 0xFFFF)
          reject_item(item, "usage page 0x" + hex_digits(item.data) + " has more than 16 bits");
        global_.usage_page = static_cast<std::uint16_t>(item.data);
        return;
      case kLogicalMinimum:
        global_.logical_min = extent;
        return;
      case kLogicalMaximum:
        global_.logical_max = extent;
        return;
      case kPhysicalMinimum:
        global_.physical_min = extent;
        return;
      case kPhysicalMaximum:
        global_.physical_max = extent;
        return;
      case kUnitExponent:
        return set_exponent(item);
      case kUnit:
        global_.unit = item.data;
        return;
      case kReportSize:
        if (item.data > kMaxFieldBits)
          reject_item(item, "fields of " + std::to_string(item.data) + " bits; " +
                                std::to_string(kMaxFieldBits) + " is the maximum of Linux");
        global_.report_size = item.data;
        return;
      case kReportId:
        return set_report_id(item);
      case kReportCount:
        global_.report_count = item.data;
        return;
      case kPush:
        if (pushed_.size() >= kMaxPushDepth)
          reject_item(item, "pushes are nested more than " + std::to_string(kMaxPushDepth) + " deep");
        pushed_.push_back(global_);
        return;
      case kPop:
        if (pushed_.empty()) reject_item(item, "is a pop without a push");
        global_ = pushed_.back();
        pushed_.pop_back();
        return;
      default:
        reject_item(item, "global item with the reserved tag " + std::to_string(item.tag));
    }
  }

  /// A nibble in two's complement. Many descriptors use a signed byte; both forms give the same value.
  void set_exponent(const Item& item) {
    const auto nibble = static_cast<int>(item.data & 0xF);
    const std::int64_t exponent = item.data <= 0xF ? (nibble < 8 ? nibble : nibble - 16) : item.as_signed();
    if (exponent < -8 || exponent > 7)
      reject_item(item, "unit exponent " + std::to_string(exponent) + "; -8 to 7 are defined");
    global_.unit_exponent = static_cast<int>(exponent);
  }

  void set_report_id(const Item& item) {
    if (item.data == 0 || item.data > 255)
      reject_item(item, "report id " + std::to_string(item.data) + "; 1 to 255 are allowed");
    if (!found_.reports.empty() && !found_.has_ids())
      reject_item(item, "sets a report id, but previous fields have none; give all fields an id");
    global_.report_id = static_cast<std::uint8_t>(item.data);
  }

  // Local items

  void local_item(const Item& item) {
    const WrittenUsage usage{item.data, item.size == 4};
    if (item.tag == kUsage) add_usages(item, usage, usage);
    if (item.tag == kUsageMinimum) add_range_end(item, local_.usage_minimum);
    if (item.tag == kUsageMaximum) add_range_end(item, local_.usage_maximum);
    if (item.tag == kDelimiter) set_delimiter(item);
  }

  void add_range_end(const Item& item, std::optional<Item>& end) {
    if (end) reject_item(item, "is a second end of a usage range without its other end");
    end = item;
    if (!local_.usage_minimum || !local_.usage_maximum) return;
    const Item &first = *local_.usage_minimum, &last = *local_.usage_maximum;
    add_usages(item, {first.data, first.size == 4}, {last.data, last.size == 4});
    local_.usage_minimum.reset();
    local_.usage_maximum.reset();
  }

  void add_usages(const Item& item, WrittenUsage first, WrittenUsage last) {
    if (local_.delimited && local_.alternatives++ > 0) return;
    local_.usages.push_back({first, last, item.at});
  }

  void set_delimiter(const Item& item) {
    const bool opens = item.data == 1;
    if (item.data > 1) reject_item(item, "delimiter " + std::to_string(item.data) + "; 1 opens and 0 closes");
    if (opens == local_.delimited)
      reject_item(item, opens ? "opens a delimiter inside another" : "closes a delimiter, but none is open");
    local_.delimited = opens;
    local_.alternatives = 0;
  }

  std::span<const std::uint8_t> bytes_;
  std::size_t next_ = 0;
  GlobalState global_;
  LocalState local_;
  std::vector<GlobalState> pushed_;
  std::vector<std::size_t> open_;       ///< indices of the open collections, outermost first
  std::vector<std::size_t> bits_used_;  ///< bits used so far, by index of the report
  ReportDescriptor found_;
};

const char* name_of(Usage usage) {
  static constexpr std::array<const char*, 6> kAxes = {"X", "Y", "Z", "Rx", "Ry", "Rz"};
  if (usage.page == 0x01 && usage.id >= 0x30 && usage.id < 0x36) return kAxes[usage.id - 0x30U];
  if (usage == Usage{0x01, 0x02}) return "mouse";
  if (usage == Usage{0x01, 0x04}) return "joystick";
  if (usage == Usage{0x01, 0x05}) return "game pad";
  if (usage == Usage{0x01, 0x06}) return "keyboard";
  if (usage == Usage{0x01, 0x08}) return "multi-axis controller";
  if (usage.page == 0x09) return "button";
  if (usage.page == 0x08) return "LED";
  return usage.page >= kFirstVendorPage ? "vendor defined" : "";
}

}  // namespace

const char* name(ReportKind kind) noexcept {
  switch (kind) {
    case ReportKind::input:
      return "input";
    case ReportKind::output:
      return "output";
    case ReportKind::feature:
      return "feature";
  }
  return "unknown";
}

std::string to_text(Usage usage) {
  const std::string word = name_of(usage);
  return hex_digits(usage.page) + ":" + hex_digits(usage.id) + (word.empty() ? "" : " (" + word + ")");
}

std::optional<Usage> DescribedField::usage(std::size_t i) const noexcept {
  for (const UsageRange& range : usages) {
    const std::size_t many = std::size_t{range.last_id} - range.first.id + 1;
    if (i < many) return Usage{range.first.page, static_cast<std::uint16_t>(range.first.id + i)};
    i -= many;
  }
  if (usages.empty()) return {};
  return Usage{usages.back().first.page, usages.back().last_id};
}

const DescribedReport* ReportDescriptor::find(ReportKind kind,
                                              std::optional<std::uint8_t> id) const noexcept {
  const auto found = std::find_if(reports.begin(), reports.end(), [&](const DescribedReport& report) {
    return report.kind == kind && report.id == id;
  });
  return found == reports.end() ? nullptr : &*found;
}

Usage ReportDescriptor::application(const DescribedField& field) const noexcept {
  std::size_t i = field.collection;
  while (collections[i].parent != DescribedCollection::kOutermost) i = collections[i].parent;
  return collections[i].usage;
}

DescriptorError::DescriptorError(std::size_t at, const std::string& why)
    : std::runtime_error("byte " + std::to_string(at) + ": " + why), at_(at) {}

ReportDescriptor parse_report_descriptor(std::span<const std::uint8_t> bytes) {
  return DescriptorParser(bytes).parse();
}

}  // namespace wrenchd
