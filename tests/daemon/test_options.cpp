// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <catch2/catch.hpp>

#include "daemon/options.hpp"
#include "tests/support/paths.hpp"

namespace wrenchd::test_options {

namespace {

using Catch::Contains;

Options parse(std::vector<std::string> words) {
  CLI::App app;
  Options options;
  add_options(app, options);
  std::reverse(words.begin(), words.end());  // CLI11 takes the words from the end
  app.parse(words);
  return options;
}

/// Options with the shipped configuration.
Options shipped(std::vector<std::string> words = {}) {
  words.insert(words.end(), {"--config", test::source_path("config/wrenchd.toml")});
  return parse(std::move(words));
}

/// The run configuration of the first hand.
RunConfig config_of(const Options& options) {
  return load_run_configs(options).front();
}

TEST_CASE("without options the configuration applies", "[options]") {
  const RunConfig config = config_of(shipped());
  CHECK(config.simulated);
  CHECK(config.settings.servo.realtime == Settings{}.servo.realtime);
  CHECK(config.settings.recording.file.empty());
}

TEST_CASE("options replace values of the configuration", "[options]") {
  CHECK(config_of(shipped({"--realtime", "required"})).settings.servo.realtime == Realtime::required);
  CHECK(config_of(shipped({"--realtime", "best_effort"})).settings.servo.realtime == Realtime::best_effort);
  CHECK(config_of(shipped({"--record", "run.h5"})).settings.recording.file == "run.h5");
  CHECK(config_of(shipped({"--simulate", "polhem"})).profile.name == "polhem");
}

TEST_CASE("virtual time needs no real-time priority", "[options]") {
  const Options options = shipped({"--virtual-time", "--seconds", "1", "--realtime", "required"});
  CHECK(config_of(options).settings.servo.realtime == Realtime::off);
}

TEST_CASE("options that exclude each other, or are incomplete, are rejected", "[options]") {
  CHECK_THROWS_AS(parse({"--virtual-time"}), CLI::RequiresError);
  CHECK_THROWS_AS(parse({"--simulate", "loopback", "--profile", "polhem"}), CLI::ExcludesError);
  CHECK_THROWS_AS(parse({"--realtime", "soon"}), CLI::ValidationError);
  CHECK_THROWS_AS(parse({"--seconds", "0"}), CLI::ValidationError);
  CHECK_THROWS_AS(parse({"--record", ""}), CLI::ValidationError);
}

TEST_CASE("options that the device does not support are rejected with the remedy", "[options]") {
  const auto rejection = [](const std::vector<std::string>& words) -> std::string {
    try {
      config_of(shipped(words));
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return {};
  };
  CHECK_THAT(rejection({"--simulate", "auto"}), Contains("--simulate loopback"));
  CHECK_THAT(rejection({"--profile", "polhem", "--virtual-time", "--seconds", "1"}),
             Contains("--virtual-time") && Contains("--simulate polhem"));
  CHECK_THAT(rejection({"--profile", "polhem", "--loopback-script", "s.toml"}),
             Contains("--loopback-script") && Contains("--simulate polhem"));
  CHECK_THAT(rejection({"--profile", "polhem", "--playback", "p.csv"}), Contains("--playback"));
  CHECK_THAT(rejection({"--profile", "auto", "--link-fd", "3"}), Contains("--link-fd"));
  CHECK_THAT(rejection({"--playback-mode", "open"}), Contains("name one with --playback"));
}

}  // namespace
}  // namespace wrenchd::test_options
