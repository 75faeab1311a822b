// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cstdio>
#include <fstream>
#include <iterator>

#include <catch2/catch.hpp>
#include <fcntl.h>
#include <unistd.h>

#include "daemon/live_view.hpp"
#include "tests/support/shipped_config.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd {
namespace {

using namespace test;

/// Runs `print` with standard output redirected to a file. Returns what it printed.
template <class Print>
std::string printed(const Print& print) {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "out";
  std::fflush(stdout);
  const int terminal = ::dup(STDOUT_FILENO);
  const int out = ::open(file.c_str(), O_WRONLY | O_CREAT, 0600);
  ::dup2(out, STDOUT_FILENO);
  print();
  std::fflush(stdout);
  ::dup2(terminal, STDOUT_FILENO);
  ::close(out);
  ::close(terminal);
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// Runs a tick, and leaves its record to the live view: a record is taken once.
void tick(VirtualRuntime& r) {
  r.clock.sleep_until(r.clock.now() + std::chrono::milliseconds(1));
  r.runtime.loop().tick(r.clock.now(), r.clock.now());
}

TEST_CASE("without a terminal the live view prints every fifth sample, and a summary", "[live_view]") {
  VirtualRuntime r;
  const std::string all = printed([&] {
    LiveView view(true, r.runtime.config().profile);
    view.sample(r.runtime.loop());  // no tick yet
    for (int sample = 0; sample < 10; ++sample) {
      tick(r);
      view.sample(r.runtime.loop());
    }
    std::puts("summary:");
    view.close(r.runtime.loop(), 1.0);
  });
  const std::size_t end = all.find("summary:");
  REQUIRE(end != std::string::npos);
  CHECK(std::count(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(end), '\n') == 2);
  CHECK(std::count(all.begin() + static_cast<std::ptrdiff_t>(end), all.end(), '\n') > 2);
}

TEST_CASE("a hidden live view prints nothing", "[live_view]") {
  VirtualRuntime r;
  CHECK(printed([&] {
          LiveView view(false, r.runtime.config().profile);
          for (int sample = 0; sample < 10; ++sample) {
            tick(r);
            view.sample(r.runtime.loop());
          }
          view.close(r.runtime.loop(), 1.0);
        }).empty());
}

}  // namespace
}  // namespace wrenchd
