// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/report_bytes.hpp"

#include <string>

namespace wrenchd {
namespace {

/// One packet of a full-speed interrupt endpoint.
constexpr std::size_t kMostReportBytes = 64;

int digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

bool parts(char c) {
  return c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == ',' || c == ':';
}

}  // namespace

ReportBytes parse_bytes(std::string_view text) {
  ReportBytes parsed;
  const auto reject = [&](std::size_t at, std::string_view problem) {
    parsed.error_index = at;
    parsed.error = problem;
    return parsed;
  };
  for (std::size_t i = 0; i < text.size();) {
    if (parts(text[i])) {
      ++i;
      continue;
    }
    if (text[i] == '0' && i + 1 < text.size() && (text[i + 1] == 'x' || text[i + 1] == 'X')) i += 2;
    if (i >= text.size() || digit(text[i]) < 0) return reject(i, "is not a hexadecimal digit");
    if (i + 1 >= text.size() || digit(text[i + 1]) < 0)
      return reject(i, "is a single digit; a byte is two hexadecimal digits, as in 0a");
    parsed.bytes.push_back(static_cast<std::uint8_t>(16 * digit(text[i]) + digit(text[i + 1])));
    i += 2;
  }
  return parsed;
}

bool read_bytes(const TomlValue& value, std::vector<std::uint8_t>& out) {
  std::string text;
  if (!value.paragraphs(text)) return false;
  const ReportBytes parsed = parse_bytes(text);
  if (!parsed.error.empty()) {
    value.reject("character " + std::to_string(parsed.error_index + 1) + " " + std::string(parsed.error) +
                 "; write bytes as in \"04 00\"");
    return false;
  }
  if (parsed.bytes.empty() || parsed.bytes.size() > kMostReportBytes) {
    value.reject("has " + std::to_string(parsed.bytes.size()) + " bytes; a report has 1 to " +
                 std::to_string(kMostReportBytes));
    return false;
  }
  out = parsed.bytes;
  return true;
}

}  // namespace wrenchd
