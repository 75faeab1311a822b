// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "config/load_profile.hpp"
#include "config/report_bytes.hpp"
#include "core/finite.hpp"
#include "daemon/option_checks.hpp"
#include "tools/commands/subcommand.hpp"
#include "tools/report_text.hpp"

namespace wrenchd {
namespace {

std::vector<std::uint8_t> parse_bytes_option(const char* option, const std::string& text) {
  const ReportBytes parsed = parse_bytes(text);
  if (parsed.error.empty()) return parsed.bytes;
  const std::string found =
      parsed.error_index < text.size() ? "'" + text.substr(parsed.error_index, 1) + "'" : "the end";
  throw std::runtime_error(std::string(option) + ": character " + std::to_string(parsed.error_index + 1) +
                           ", " + found + ", " + std::string(parsed.error) +
                           "; write bytes in hexadecimal, as in \"01 00 ff\"");
}

constexpr const char* kWrenchExample = "give force in N and torque in N.m, as in 1,0,-2.5,0,0.05,0";

/// Parses "fx,fy,fz,tx,ty,tz". Throws std::runtime_error.
Wrench parse_wrench(const std::string& text) {
  std::array<double, 6> numbers{};
  if (const auto commas = static_cast<std::size_t>(std::count(text.begin(), text.end(), ',')); commas != 5)
    throw std::runtime_error("--wrench: expected six numbers, found " + std::to_string(commas + 1) + "; " +
                             kWrenchExample);
  const char* from = text.data();
  const char* const end = from + text.size();
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto [stop, error] = std::from_chars(from, end, numbers[i]);
    const bool last = i + 1 == numbers.size();
    if (error != std::errc() || !is_finite(numbers[i]) || (last ? stop != end : stop == end || *stop != ','))
      throw std::runtime_error("--wrench: number " + std::to_string(i + 1) + " of 6 is invalid, at '" +
                               std::string(from, end) + "'; " + kWrenchExample);
    from = stop + (last ? 0 : 1);
  }
  return {{numbers[0], numbers[1], numbers[2]}, {numbers[3], numbers[4], numbers[5]}};
}

/// decode and encode.
class ReportCommands final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    add_decode(app);
    add_encode(app);
  }

 private:
  void add_decode(CLI::App& app) {
    CLI::App* decode = app.add_subcommand("decode", "Show the content of a device report in SI units");
    decode->add_option("profile", profile_, "name or file of a device profile")
        ->required()
        ->check(not_empty());
    decode->add_option("--hex", hex_, "the bytes of one report, as in \"01 00 ff\"")
        ->required()
        ->check(not_empty("give bytes in hexadecimal, as in \"01 00 ff\""));
    decode->add_flag("--to-device", to_device_,
                     "decode a report to the device, if both directions have reports of the same form");
    decode->footer(
        "Fields use the device's own axes, as transmitted. Lines that end in 'in base' are wrenchd's\n"
        "interpretation in the base frame: x forward, away from the user, y left, z up.");
    decode->callback([this] {
      std::cout << report_text(load_profile_named(profile_), parse_bytes_option("--hex", hex_), to_device_);
    });
  }

  void add_encode(CLI::App& app) {
    CLI::App* encode = app.add_subcommand("encode", "Show the bytes that a device receives for a wrench");
    encode->add_option("profile", profile_, "name or file of a device profile")
        ->required()
        ->check(not_empty());
    encode->add_option("--wrench", wrench_, "fx,fy,fz,tx,ty,tz on the hand, about the handle point [N, N.m]")
        ->required()
        ->check(not_empty(kWrenchExample));
    encode->add_option("--at", at_,
                       "a report of the device in hexadecimal, which gives the handle pose. Only devices\n"
                       "with joints use it; without it, they are at their home pose");
    encode->add_option("--sequence", sequence_, "number of the command, for devices that count commands")
        ->check(CLI::Range(1, 65535))
        ->capture_default_str();
    encode->footer(
        "The wrench is in the base frame: x forward, away from the user, y left, z up. The limits of the\n"
        "profile apply. Standard error lists the components that were clamped or dropped.");
    encode->callback([this] { run_encode(); });
  }

  void run_encode() const {
    const EncodedWrench encoded = encode_wrench(load_profile_named(profile_), parse_wrench(wrench_),
                                                parse_bytes_option("--at", at_), sequence_);
    for (const std::string& remark : encoded.remarks) print_note(remark);
    std::printf("%s\n", hex_text(encoded.bytes).c_str());
  }

  std::string profile_, hex_, wrench_, at_;
  std::uint64_t sequence_ = 1;
  bool to_device_ = false;
};

}  // namespace

std::unique_ptr<Subcommand> make_report_commands() {
  return std::make_unique<ReportCommands>();
}

}  // namespace wrenchd
