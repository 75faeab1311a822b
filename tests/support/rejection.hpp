// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include <catch2/catch.hpp>

namespace wrenchd::test {

/// Returns the message of the exception of type Error that `load` throws; empty if `load` returns. Other
/// exceptions pass through.
template <class Error, class Load>
std::string rejection_message(Load&& load) {
  try {
    load();
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

/// Returns true if a part of the message begins with `start` (file, line and column) and contains `remedy`
/// before its line ends.
inline bool rejects_at(const std::string& message, const std::string& start, const std::string& remedy) {
  for (std::size_t at = message.find(start); at != std::string::npos; at = message.find(start, at + 1))
    if (message.substr(at, message.find('\n', at) - at).find(remedy) != std::string::npos) return true;
  return false;
}

/// Checks that a message rejects an input at `start` with `remedy`. input: shown if the check fails.
inline void check_rejection(const std::string& message, const std::string& start, const std::string& remedy,
                            const std::string& input) {
  INFO(input << "\nexpected " << start << " ... " << remedy << "\ngot " << message);
  CHECK(rejects_at(message, start, remedy));
}

/// Returns `text` with its only occurrence of `from` replaced. Fails the test if there is not exactly one.
inline std::string with(std::string text, const std::string& from, const std::string& to) {
  INFO("changing " << from << " in\n" << text);
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  REQUIRE(text.find(from, at + 1) == std::string::npos);
  return text.replace(at, from.size(), to);
}

/// Returns "line:column" of an offset in a text, both counted from 1.
inline std::string line_and_column(std::string_view text, std::size_t offset) {
  std::size_t line = 1, column = 1;
  for (std::size_t i = 0; i < offset; ++i) {
    ++column;
    if (text[i] != '\n') continue;
    ++line;
    column = 1;
  }
  return std::to_string(line) + ":" + std::to_string(column);
}

}  // namespace wrenchd::test
