// SPDX-License-Identifier: GPL-3.0-or-later
#include <chrono>
#include <cmath>
#include <mutex>
#include <numbers>
#include <string>
#include <thread>

#include <catch2/catch.hpp>

#include "tests/support/soon.hpp"
#include "tests/support/stub_daemon.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tools/view/page_hand.hpp"

namespace wrenchd::test_page_hand {

using namespace wrenchd::test;
using namespace std::chrono_literals;

namespace {

struct Rejections {
  std::mutex mutex;
  std::uint64_t page = 0;
  std::string error;

  std::string text() {
    const std::scoped_lock lock(mutex);
    return error;
  }
};

}  // namespace

TEST_CASE("a drag in the world is a goal in the device base", "[view]") {
  const Quaterniond R_WB = rotation_from(Vector3d(0.0, 0.0, std::numbers::pi / 2));  // x_B is y_W
  const Pose X_BH{rotation_from(Vector3d(0.3, 0.0, 0.0)), {0.01, 0.02, 0.03}};
  const Pose moved = dragged(X_BH, R_WB, {0.0, 0.05, 0.0}, Vector3d::Zero());
  CHECK((moved.translation_m - Vector3d(0.06, 0.02, 0.03)).norm() < 1e-12);
  CHECK(moved.rotation.angularDistance(X_BH.rotation) < 1e-12);
  const Pose rotated = dragged(X_BH, R_WB, Vector3d::Zero(), {0.0, 0.4, 0.0});
  CHECK((rotated.translation_m - X_BH.translation_m).norm() < 1e-12);
  CHECK((rotation_vector(rotated.rotation) - Vector3d(0.7, 0.0, 0.0)).norm() < 1e-12);
}

TEST_CASE("the page moves the hand of the simulated device, which returns when the page sends no more",
          "[view]") {
  StubDaemon daemon;
  Rejections rejections;
  PageHand hand(daemon.socket(), [&](std::uint64_t, const std::string& error) {
    const std::scoped_lock lock(rejections.mutex);
    rejections.error = error;
  });
  Client client(daemon.socket());
  StateReader state = client.open_state();
  TickState tick;
  const auto x_m = [&] { return state.latest(tick) ? tick.number("X_BH", 0) : 0.0; };
  const Pose aside{Quaterniond::Identity(), {0.1, 0.0, 0.1}};
  CHECK(soon([&] {
    hand.move(1, aside);
    return std::abs(x_m() - 0.1) < 2e-3;
  }));
  CHECK(soon([&] { return std::abs(x_m()) < 0.05; }));
  CHECK(rejections.text().empty());
}

TEST_CASE("a page whose goal cannot be sent learns why", "[view]") {
  const TemporaryDirectory directory;
  Rejections rejections;
  PageHand hand((directory.path() / "nobody.sock").string(),
                [&](std::uint64_t page, const std::string& error) {
                  const std::scoped_lock lock(rejections.mutex);
                  rejections.page = page;
                  rejections.error = error;
                });
  hand.move(7, {});
  REQUIRE(soon([&] { return !rejections.text().empty(); }));
  CHECK(rejections.text().find("nobody.sock") != std::string::npos);
  CHECK(rejections.page == 7);
}

}  // namespace wrenchd::test_page_hand
