// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>

#include <catch2/catch.hpp>

#include "core/state.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tools/plot_recording.hpp"

namespace wrenchd::test_plot_recording {

using namespace wrenchd::test;
using Catch::Matchers::Contains;

namespace {

std::string contents(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Twenty seconds of alternating force with a single peak.
Recording pressed() {
  Recording recording;
  recording.header.rate_Hz = 1000.0;
  recording.header.scene_file = "/there/it's a scene.toml";
  for (int i = 0; i < 20000; ++i) {
    TickRecord tick;
    const double t_s = 1e-3 * i;
    tick.now_ns = 1'000'000 * std::int64_t{i};
    tick.fresh = 1;
    tick.state = static_cast<std::uint8_t>(State::active);
    tick.F_out = {std::sin(t_s), 0.1, 2.0 + std::cos(3.0 * t_s), 0.0, 0.02 * std::sin(t_s), 0.0};
    if (i == 12345) tick.F_out[2] = 9.75;
    tick.X_WP = {0.02 * std::sin(t_s), 0.0, 0.02, 0, 0, 0, 1};
    tick.X_WQ = {0.02 * std::sin(t_s), 0.0, 0.0225, 0, 0, 0, 1};
    tick.energy_in_J = 1e-3 * t_s;
    tick.stage_ns = {1000, 20000 + 37 * (i % 1000), 2000, 1000, 3000};
    tick.wake_latency_ns = 5000 + i;
    recording.ticks.push_back(tick);
  }
  recording.contact_ranges.resize(recording.ticks.size());
  return recording;
}

}  // namespace

TEST_CASE("a recording is drawn as figures, each with a table of its values", "[plot]") {
  const TemporaryDirectory files;
  const auto pictures = plot_recording(pressed(), files.path() / "new/figures");
  CHECK(pictures.size() == 6);
  for (const auto& picture : pictures) {
    INFO(picture);
    const std::string svg = contents(picture);
    CHECK(svg.find("<svg") != std::string::npos);
    CHECK(svg.size() > 8000);  // an empty frame is smaller
  }
  CHECK(contents(files.path() / "new/figures/force.svg").find("force on the hand [N]") != std::string::npos);
  const std::string run = contents(files.path() / "new/figures/run.csv");
  CHECK(run.find(",9.75,") != std::string::npos);  // the export keeps every peak
  CHECK(std::count(run.begin(), run.end(), '\n') < 6002);
}

TEST_CASE("all figures are written to one file of the requested type", "[plot]") {
  const TemporaryDirectory files;
  for (const auto& [name, magic] : {std::pair<std::string, std::string>{"all.svg", "<?xml"},
                                    {"all.pdf", "%PDF"},
                                    {"all.png", "\x89PNG"}}) {
    const auto pictures = plot_recording(pressed(), files.path() / name);
    REQUIRE(pictures.size() == 1);
    CHECK(contents(pictures[0]).starts_with(magic));
    CHECK(contents(pictures[0]).size() > 20000);
  }
}

TEST_CASE("a run without contact, without arming, or with one tick is plotted", "[plot]") {
  const TemporaryDirectory files;
  Recording recording = pressed();
  for (TickRecord& tick : recording.ticks) {
    tick.X_WQ.fill(std::nan(""));
    tick.F_out.fill(0.0);
    tick.energy_in_J = 0.0;
    tick.X_WP = recording.ticks.front().X_WP;
  }
  CHECK(plot_recording(recording, files.path() / "still").size() == 6);
  recording.ticks.resize(1);
  recording.contact_ranges.resize(1);
  CHECK(plot_recording(recording, files.path() / "one").size() == 6);
}

TEST_CASE("a recording that cannot be plotted is rejected with a remedy", "[plot]") {
  const TemporaryDirectory files;
  CHECK_THROWS_WITH(plot_recording({}, files.path() / "none"), Contains("has no ticks"));
  const auto file = files.write("file", "");
  CHECK_THROWS_WITH(plot_recording(pressed(), file), Contains("is not a directory") && Contains(".svg"));
  CHECK_THROWS_WITH(plot_recording(pressed(), file / "x.png"), Contains("cannot be written"));
}

}  // namespace wrenchd::test_plot_recording
