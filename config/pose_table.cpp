// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/pose_table.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <span>
#include <string_view>

#include "config/config_error.hpp"
#include "config/toml_file.hpp"
#include "core/finite.hpp"

namespace wrenchd {
namespace {

/// Columns of both tables; a table without times omits the first.
constexpr std::array<std::string_view, 8> kAllColumns = {"time_s", "px", "py", "pz", "qx", "qy", "qz", "qw"};
using Columns = std::span<const std::string_view>;
constexpr Columns kPoseColumns = Columns(kAllColumns).subspan(1);
constexpr Columns kTimedColumns = Columns(kAllColumns);
/// Tolerance on the norm of a quaternion: rounding of three printed digits.
constexpr double kNormTolerance = 1e-3;
/// Above this coordinate [m] the value is a typing mistake or has another unit.
constexpr double kFarthest_m = 1e9;
constexpr std::size_t kMostMessages = 10;

std::string_view trimmed(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

/// Collects messages with line and column.
class Reader {
 public:
  explicit Reader(std::string name) : name_(std::move(name)) {}

  void reject(std::size_t line, std::size_t column, const std::string& message) {
    if (count_++ >= kMostMessages) return;
    text_ += (text_.empty() ? "" : "\n") + name_ + ':' + std::to_string(line) + ':' + std::to_string(column) +
             ": " + message;
  }
  void throw_if_any() const {
    if (count_ == 0) return;
    std::string text = text_;
    if (count_ > kMostMessages) text += "\nand " + std::to_string(count_ - kMostMessages) + " more";
    throw PoseTableError(text);
  }
  bool number(std::string_view field, std::size_t line, std::size_t column, std::string_view what,
              double& out) {
    std::string_view text = trimmed(field);
    const std::string found = text.empty() ? "nothing" : "'" + printable(std::string(text), 40) + "'";
    if (text.size() > 1 && text[0] == '+' && text[1] != '-')
      text.remove_prefix(1);  // from_chars accepts no plus
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
    if (error == std::errc{} && end == text.data() + text.size() && is_finite(out)) return true;
    reject(line, column, std::string(what) + " must be a finite number, found " + found);
    return false;
  }

 private:
  std::string name_;
  std::string text_;
  std::size_t count_ = 0;
};

/// Splits a line at its commas. Returns each field with its column, from 1.
std::vector<std::pair<std::size_t, std::string_view>> fields_of(std::string_view line) {
  std::vector<std::pair<std::size_t, std::string_view>> fields;
  std::size_t start = 0;
  for (;;) {
    const std::size_t comma = line.find(',', start);
    fields.emplace_back(start + 1, line.substr(start, comma - start));
    if (comma == std::string_view::npos) return fields;
    start = comma + 1;
  }
}

std::string header_of(Columns columns) {
  std::string header;
  for (const std::string_view column : columns) header += (header.empty() ? "" : ",") + std::string(column);
  return header;
}

/// Parses a line of a table; without a time column the time is 0.
bool read_pose(Reader& reader, Columns columns, std::string_view text, std::size_t line, TimedPose& out) {
  const auto fields = fields_of(text);
  if (fields.size() != columns.size()) {
    reader.reject(line, 1,
                  "expected " + std::to_string(columns.size()) + " numbers (" + header_of(columns) +
                      "), found " + std::to_string(fields.size()) +
                      (fields.size() == 1 ? "; separate them with commas" : ""));
    return false;
  }
  const std::size_t first = columns.size() - kPoseColumns.size();  // index of the first pose column
  std::array<double, kAllColumns.size()> numbers{};
  bool good = true;
  for (std::size_t i = 0; i < fields.size(); ++i)
    good = reader.number(fields[i].second, line, fields[i].first, columns[i], numbers[i]) && good;
  const double* const x = numbers.data() + first;
  for (std::size_t i = 0; i < 3 && good; ++i) {
    if (std::abs(x[i]) <= kFarthest_m) continue;
    reader.reject(
        line, fields[first + i].first,
        std::string(columns[first + i]) + " is " + to_text(x[i]) + ", farther out than 1e9 m; give metres");
    good = false;
  }
  if (!good) return false;
  const Quaterniond q(x[6], x[3], x[4], x[5]);
  if (!(std::abs(q.norm() - 1.0) <= kNormTolerance)) {
    reader.reject(
        line, fields[first + 3].first,
        "the quaternion qx,qy,qz,qw has norm " + to_text(q.norm()) + "; it must be 1 (is the scalar last?)");
    return false;
  }
  out = {first > 0 ? numbers[0] : 0.0, {q.normalized(), {x[0], x[1], x[2]}}};
  return true;
}

bool is_header(Columns columns, std::string_view line) {
  const auto fields = fields_of(line);
  if (fields.size() != columns.size()) return false;
  for (std::size_t i = 0; i < fields.size(); ++i)
    if (trimmed(fields[i].second) != columns[i]) return false;
  return true;
}

/// Rejects a step from one pose to the next that no hand can make.
void check_step(Reader& reader, std::size_t line, const TimedPose& from, const TimedPose& to) {
  const double h_s = to.time_s - from.time_s;
  const double distance_m = (to.X.translation_m - from.X.translation_m).norm();
  const double rotation_rad = from.X.rotation.angularDistance(to.X.rotation);
  if (!(h_s > 0.0))
    reader.reject(line, 1,
                  "time_s is " + to_text(to.time_s) + ", and " + to_text(from.time_s) +
                      " in the line before; times must ascend: sort the lines, and leave out repeated ones");
  else if (h_s > kMaxTableGap_s)
    reader.reject(line, 1,
                  "a gap of " + to_text(h_s) + " s; give a pose at least every " + to_text(kMaxTableGap_s) +
                      " s, or use a hand script, which interpolates between distant waypoints");
  else if (distance_m > kMaxTableSpeed_m_per_s * h_s)
    reader.reject(line, 1,
                  "a jump of " + to_text(distance_m) + " m in " + to_text(h_s) +
                      " s, which no hand makes; give metres and seconds");
  else if (rotation_rad > kMaxTableRotation_rad)
    reader.reject(line, 1,
                  "a rotation of " + to_text(rotation_rad) +
                      " rad in one step; add poses between, so that the "
                      "direction of rotation is unique");
}

std::vector<TimedPose> read_table(std::istream& in, const std::string& name, Columns columns) {
  Reader reader(name);
  const bool timed = columns.size() == kTimedColumns.size();
  std::vector<TimedPose> poses;
  std::string line;
  std::size_t number = 0;
  bool header = false;
  while (std::getline(in, line)) {
    ++number;
    if (number == 1 && line.starts_with("\xEF\xBB\xBF")) line.erase(0, 3);  // byte order mark
    if (trimmed(line).empty()) continue;
    if (!header) {
      if (!is_header(columns, line)) {
        reader.reject(number, 1,
                      "expected the header '" + header_of(columns) + "', found '" +
                          printable(std::string(trimmed(line))) + "'");
        reader.throw_if_any();
      }
      header = true;
      continue;
    }
    TimedPose pose;
    if (!read_pose(reader, columns, line, number, pose)) continue;
    if (timed && !poses.empty()) check_step(reader, number, poses.back(), pose);
    poses.push_back(pose);
  }
  if (!header)
    reader.reject(1, 1, "is empty; expected the header '" + header_of(columns) + "'");
  else if (timed && poses.empty())
    reader.reject(number, 1, "has no poses; give at least one line after the header");
  reader.throw_if_any();
  return poses;
}

}  // namespace

std::vector<Pose> read_poses(std::istream& in, const std::string& name) {
  std::vector<Pose> poses;
  for (const TimedPose& pose : read_table(in, name, kPoseColumns)) poses.push_back(pose.X);
  return poses;
}

std::vector<TimedPose> read_timed_poses(std::istream& in, const std::string& name) {
  std::vector<TimedPose> poses = read_table(in, name, kTimedColumns);
  const double start_s = poses.front().time_s;
  for (TimedPose& pose : poses) pose.time_s -= start_s;
  return poses;
}

}  // namespace wrenchd
