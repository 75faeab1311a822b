// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/six_axes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace wrenchd {
namespace {

constexpr Usage kMultiAxis{0x01, 0x08};
constexpr std::uint16_t kX = 0x30;
constexpr std::uint16_t kGenericDesktop = 0x01, kLeds = 0x08, kButtons = 0x09;
constexpr std::array<const char*, 6> kNames = {"X", "Y", "Z", "Rx", "Ry", "Rz"};
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// Units of one dimension, as HID 1.11 section 6.2.2.7 codes them: the system, then the power of its length.
constexpr std::uint32_t kCentimetre = 0x11, kRadian = 0x12, kInch = 0x13, kDegree = 0x14;

/// The unit in [m] or [rad]; NaN where it is not of the kind that is asked for.
double unit_in_si(std::uint32_t unit, bool rotation) {
  if (!rotation && unit == kCentimetre) return 0.01;
  if (!rotation && unit == kInch) return 0.0254;
  if (rotation && unit == kRadian) return 1.0;
  if (rotation && unit == kDegree) return std::numbers::pi / 180.0;
  return kUnknown;
}

//   step = (physical_max - physical_min) / (logical_max - logical_min) 10^exponent unit     section 6.2.2.7
double step_of(const DescribedField& field, bool rotation) {
  const bool same = field.physical_min == 0 && field.physical_max == 0;  // then physical is logical
  const auto logical = static_cast<double>(field.logical_max - field.logical_min);
  const double physical = same ? logical : static_cast<double>(field.physical_max - field.physical_min);
  if (!(logical > 0.0 && physical > 0.0)) return kUnknown;
  return physical / logical * std::pow(10.0, field.unit_exponent) * unit_in_si(field.unit, rotation);
}

/// Walks every field of the multi-axis collections, and keeps what it knows.
class Search {
 public:
  explicit Search(const ReportDescriptor& descriptor) : descriptor_(descriptor) {}

  SixAxisResult find() {
    for (const DescribedReport& report : descriptor_.reports)
      for (const DescribedField& field : report.fields) {
        if (descriptor_.application(field) != kMultiAxis) continue;
        met_ = true;
        if (field.constant || !field.variable) continue;
        for (std::size_t i = 0; i < field.count && why_not_.empty(); ++i) look_at(report, field, i);
      }
    if (why_not_.empty()) judge();
    if (!why_not_.empty()) return {{}, why_not_};
    return {found_, {}};
  }

 private:
  void look_at(const DescribedReport& report, const DescribedField& field, std::size_t i) {
    const auto usage = field.usage(i);
    if (!usage) return;
    const std::size_t bit = field.bit + i * field.bits;
    if (report.kind == ReportKind::input && usage->page == kGenericDesktop && usage->id >= kX &&
        usage->id < kX + 6)
      take_axis(report, field, usage->id - kX, bit);
    if (report.kind == ReportKind::input && usage->page == kButtons && field.bits == 1)
      take_bit(report, bit, found_.buttons);
    if (report.kind == ReportKind::output && usage->page == kLeds && field.bits == 1)
      take_bit(report, bit, found_.led);
  }

  void take_axis(const DescribedReport& report, const DescribedField& field, std::size_t axis,
                 std::size_t bit) {
    if (seen_[axis]) {
      why_not_ = std::string("it has ") + kNames[axis] + " twice; which of them is meant, nobody can tell";
      return;
    }
    if (field.bits > 32) {
      why_not_ = std::string("its ") + kNames[axis] + " has " + std::to_string(field.bits) +
                 " bits; 32 are the most that wrenchd reads";
      return;
    }
    seen_[axis] = true;
    found_.axes[axis] = {report.id,
                         bit,
                         field.bits,
                         field.logical_min,
                         field.logical_max,
                         field.relative,
                         step_of(field, axis >= 3)};
  }

  static void take_bit(const DescribedReport& report, std::size_t bit, std::optional<DescribedBits>& bits) {
    if (!bits) bits = {report.id, bit, 1};
    if (bits->report_id == report.id) bits->count = bit - bits->bit + 1;
  }

  void judge() {
    if (!met_) {
      why_not_ = "it is no multi-axis controller (01:08); it wants to be " + applications();
      return;
    }
    std::string missing;
    for (std::size_t i = 0; i < 6; ++i)
      if (!seen_[i]) missing += (missing.empty() ? "" : ", ") + std::string(kNames[i]);
    if (!missing.empty()) {
      why_not_ = "it is a multi-axis controller (01:08) without " + missing;
      return;
    }
    const auto& a = found_.axes;
    const auto same = [&](std::size_t i, std::size_t k) { return a[i].report_id == a[k].report_id; };
    if (!(same(0, 1) && same(0, 2) && same(3, 4) && same(3, 5))) {
      why_not_ = "its axes are spread over its reports otherwise than X Y Z together and Rx Ry Rz together";
      return;
    }
    found_.layout = same(0, 3) ? AxesLayout::combined : AxesLayout::split;
  }

  std::string applications() const {
    std::string text;
    for (const DescribedCollection& collection : descriptor_.collections)
      if (collection.parent == DescribedCollection::kOutermost)
        text += (text.empty() ? "" : ", ") + to_text(collection.usage);
    return text;
  }

  const ReportDescriptor& descriptor_;
  SixAxisController found_;
  std::array<bool, 6> seen_{};
  bool met_ = false;  ///< some field of a multi-axis collection
  std::string why_not_;
};

}  // namespace

SixAxisResult find_six_axes(const ReportDescriptor& descriptor) {
  return Search(descriptor).find();
}

}  // namespace wrenchd
