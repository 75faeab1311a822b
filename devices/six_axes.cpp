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
constexpr double kNoUnit = std::numeric_limits<double>::quiet_NaN();

// Units with one dimension, coded as in HID 1.11 section 6.2.2.7: the system, then the exponent of its
// length.
constexpr std::uint32_t kCentimetre = 0x11, kRadian = 0x12, kInch = 0x13, kDegree = 0x14;

/// Returns the unit in [m] or [rad]; NaN if it is of the wrong kind.
double unit_in_si(std::uint32_t unit, bool rotation) {
  if (!rotation && unit == kCentimetre) return 0.01;
  if (!rotation && unit == kInch) return 0.0254;
  if (rotation && unit == kRadian) return 1.0;
  if (rotation && unit == kDegree) return std::numbers::pi / 180.0;
  return kNoUnit;
}

//   step = (physical_max - physical_min) / (logical_max - logical_min) 10^exponent unit     section 6.2.2.7
double step_of(const DescribedField& field, bool rotation) {
  const bool same =
      field.physical_min == 0 && field.physical_max == 0;  // then the physical range equals the logical range
  const auto logical = static_cast<double>(field.logical_max - field.logical_min);
  const double physical = same ? logical : static_cast<double>(field.physical_max - field.physical_min);
  if (!(logical > 0.0 && physical > 0.0)) return kNoUnit;
  return physical / logical * std::pow(10.0, field.unit_exponent) * unit_in_si(field.unit, rotation);
}

/// Visits the fields of all multi-axis collections.
class Search {
 public:
  explicit Search(const ReportDescriptor& descriptor) : descriptor_(descriptor) {}

  SixAxisResult find() {
    for (const DescribedReport& report : descriptor_.reports)
      for (const DescribedField& field : report.fields) {
        if (descriptor_.application(field) != kMultiAxis) continue;
        is_multi_axis_ = true;
        if (field.constant || !field.variable) continue;
        for (std::size_t i = 0; i < field.count && rejection_.empty(); ++i) visit(report, field, i);
      }
    if (rejection_.empty()) validate();
    if (!rejection_.empty()) return {{}, rejection_};
    return {controller_, {}};
  }

 private:
  void visit(const DescribedReport& report, const DescribedField& field, std::size_t i) {
    const auto usage = field.usage(i);
    if (!usage) return;
    const std::size_t bit = field.bit + i * field.bits;
    if (report.kind == ReportKind::input && usage->page == kGenericDesktop && usage->id >= kX &&
        usage->id < kX + 6)
      add_axis(report, field, usage->id - kX, bit);
    if (report.kind == ReportKind::input && usage->page == kButtons && field.bits == 1)
      add_bit(report, bit, controller_.buttons);
    if (report.kind == ReportKind::output && usage->page == kLeds && field.bits == 1)
      add_bit(report, bit, controller_.led);
  }

  void add_axis(const DescribedReport& report, const DescribedField& field, std::size_t axis,
                std::size_t bit) {
    if (has_axis_[axis]) {
      rejection_ = std::string("it has ") + kNames[axis] + " twice, which is ambiguous";
      return;
    }
    if (field.bits > 32) {
      rejection_ = std::string("its ") + kNames[axis] + " has " + std::to_string(field.bits) +
                   " bits; the maximum is 32";
      return;
    }
    has_axis_[axis] = true;
    controller_.axes[axis] = {report.id,
                              bit,
                              field.bits,
                              field.logical_min,
                              field.logical_max,
                              field.relative,
                              step_of(field, axis >= 3)};
  }

  static void add_bit(const DescribedReport& report, std::size_t bit, std::optional<DescribedBits>& bits) {
    if (!bits) bits = {report.id, bit, 1};
    if (bits->report_id == report.id) bits->count = bit - bits->bit + 1;
  }

  void validate() {
    if (!is_multi_axis_) {
      rejection_ = "it is no multi-axis controller (01:08); its applications are " + applications();
      return;
    }
    std::string missing;
    for (std::size_t i = 0; i < 6; ++i)
      if (!has_axis_[i]) missing += (missing.empty() ? "" : ", ") + std::string(kNames[i]);
    if (!missing.empty()) {
      rejection_ = "it is a multi-axis controller (01:08) without " + missing;
      return;
    }
    const auto& a = controller_.axes;
    const auto same = [&](std::size_t i, std::size_t k) { return a[i].report_id == a[k].report_id; };
    if (!(same(0, 1) && same(0, 2) && same(3, 4) && same(3, 5))) {
      rejection_ = "its axes are not grouped as X Y Z in one report and Rx Ry Rz in one report";
      return;
    }
    controller_.layout = same(0, 3) ? AxesLayout::combined : AxesLayout::split;
  }

  std::string applications() const {
    std::string text;
    for (const DescribedCollection& collection : descriptor_.collections)
      if (collection.parent == DescribedCollection::kOutermost)
        text += (text.empty() ? "" : ", ") + to_text(collection.usage);
    return text;
  }

  const ReportDescriptor& descriptor_;
  SixAxisController controller_;
  std::array<bool, 6> has_axis_{};
  bool is_multi_axis_ = false;  ///< true if there is a field in a multi-axis collection
  std::string rejection_;
};

}  // namespace

SixAxisResult find_six_axes(const ReportDescriptor& descriptor) {
  return Search(descriptor).find();
}

}  // namespace wrenchd
