// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/pose_table.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <string_view>

#include "config/config_error.hpp"
#include "config/toml_file.hpp"
#include "core/finite.hpp"

namespace wrenchd {
namespace {

constexpr std::string_view kHeader = "px,py,pz,qx,qy,qz,qw";
constexpr std::array<std::string_view, 7> kColumns = {"px", "py", "pz", "qx", "qy", "qz", "qw"};
/// How far from 1 a quaternion's norm may be: the rounding of three printed digits.
constexpr double kNormTolerance = 1e-3;
/// Farther out [m] a double cannot tell a millimetre; such a number is a slip, or in another unit.
constexpr double kFarthest_m = 1e9;
constexpr std::size_t kMostMessages = 10;

std::string_view trimmed(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

/// Line and column of a message, and the messages so far.
class Reader {
 public:
  explicit Reader(std::string name) : name_(std::move(name)) {}

  void refuse(std::size_t line, std::size_t column, const std::string& message) {
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
      text.remove_prefix(1);  // from_chars knows no plus
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
    if (error == std::errc{} && end == text.data() + text.size() && is_finite(out)) return true;
    refuse(line, column, std::string(what) + " must be a finite number, found " + found);
    return false;
  }

 private:
  std::string name_;
  std::string text_;
  std::size_t count_ = 0;
};

/// Splits a line at its commas; gives each field's column, from 1.
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

bool read_pose(Reader& reader, std::string_view text, std::size_t line, Pose& out) {
  const auto fields = fields_of(text);
  if (fields.size() != kColumns.size()) {
    reader.refuse(line, 1,
                  "expected 7 numbers (" + std::string(kHeader) + "), found " +
                      std::to_string(fields.size()) +
                      (fields.size() == 1 ? "; separate them with commas" : ""));
    return false;
  }
  std::array<double, 7> x{};
  bool good = true;
  for (std::size_t i = 0; i < x.size(); ++i)
    good = reader.number(fields[i].second, line, fields[i].first, kColumns[i], x[i]) && good;
  for (std::size_t i = 0; i < 3 && good; ++i) {
    if (std::abs(x[i]) <= kFarthest_m) continue;
    reader.refuse(
        line, fields[i].first,
        std::string(kColumns[i]) + " is " + to_text(x[i]) + ", farther out than 1e9 m; give metres");
    good = false;
  }
  if (!good) return false;
  const Quaterniond q(x[6], x[3], x[4], x[5]);
  if (!(std::abs(q.norm() - 1.0) <= kNormTolerance)) {
    reader.refuse(
        line, fields[3].first,
        "the quaternion qx,qy,qz,qw has norm " + to_text(q.norm()) + "; it must be 1 (is the scalar last?)");
    return false;
  }
  out = {q.normalized(), {x[0], x[1], x[2]}};
  return true;
}

bool is_header(std::string_view line) {
  const auto fields = fields_of(line);
  if (fields.size() != kColumns.size()) return false;
  for (std::size_t i = 0; i < fields.size(); ++i)
    if (trimmed(fields[i].second) != kColumns[i]) return false;
  return true;
}

}  // namespace

std::vector<Pose> read_poses(std::istream& in, const std::string& name) {
  Reader reader(name);
  std::vector<Pose> poses;
  std::string line;
  std::size_t number = 0;
  bool header = false;
  while (std::getline(in, line)) {
    ++number;
    if (number == 1 && line.starts_with("\xEF\xBB\xBF")) line.erase(0, 3);  // a byte order mark is no text
    if (trimmed(line).empty()) continue;
    if (!header) {
      if (!is_header(line)) {
        reader.refuse(number, 1,
                      "expected the header '" + std::string(kHeader) + "', found '" +
                          printable(std::string(trimmed(line))) + "'");
        reader.throw_if_any();
      }
      header = true;
      continue;
    }
    Pose pose;
    if (read_pose(reader, line, number, pose)) poses.push_back(pose);
  }
  if (!header) reader.refuse(1, 1, "is empty; expected the header '" + std::string(kHeader) + "'");
  reader.throw_if_any();
  return poses;
}

}  // namespace wrenchd
