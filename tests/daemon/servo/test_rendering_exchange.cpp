// SPDX-License-Identifier: GPL-3.0-or-later
#include <atomic>
#include <thread>

#include <catch2/catch.hpp>

#include "daemon/servo/rendering_exchange.hpp"
#include "tests/support/shipped_config.hpp"

namespace wrenchd::test_rendering_exchange {

namespace {

using namespace test;

/// Makes renderings of one scene. Counts the living renderings by the number of owners of the scene.
struct Maker {
  RunConfig config = shipped_config();
  std::shared_ptr<const Scene> scene = std::make_shared<const Scene>(config.scene);
  std::shared_ptr<ProxyInitializer> initializer = make_proxy_initializer(scene, ProxySearchMode::in_tick);
  long other_owners = scene.use_count();

  std::unique_ptr<Rendering> make(std::uint32_t number) {
    return std::make_unique<Rendering>(number, config.settings, config.profile, scene, initializer);
  }
  long alive() const { return scene.use_count() - other_owners; }
};

TEST_CASE("a new offer replaces an offer that was not taken", "[exchange]") {
  Maker maker;
  {
    RenderingExchange exchange;
    CHECK(exchange.take() == nullptr);
    CHECK_FALSE(exchange.offer(maker.make(1)));
    CHECK_FALSE(exchange.taken());
    CHECK(exchange.offer(maker.make(2)));
    CHECK(maker.alive() == 1);
    Rendering* taken = exchange.take();
    REQUIRE(taken != nullptr);
    CHECK(taken->id() == 2);
    CHECK(exchange.taken());
    CHECK(exchange.take() == nullptr);
    exchange.retire(taken);
    CHECK(maker.alive() == 1);  // the building thread destroys it, not the servo thread
    exchange.destroy_retired();
    CHECK(maker.alive() == 0);
    exchange.offer(maker.make(3));
    exchange.retire(maker.make(4).release());
  }
  CHECK(maker.alive() == 0);
}

TEST_CASE("between two threads no rendering is lost or taken twice", "[exchange]") {
  Maker maker;
  RenderingExchange exchange;
  std::atomic<bool> done{false};
  std::uint32_t last = 0;
  int taken = 0;
  bool ordered = true;
  std::thread servo([&] {
    Rendering* current = nullptr;
    const auto take_next = [&] {
      Rendering* next = exchange.take();
      if (next == nullptr) return;
      ordered = ordered && next->id() > last;
      last = next->id();
      ++taken;
      if (current != nullptr) exchange.retire(current);
      current = next;
    };
    while (!done.load()) take_next();
    take_next();
    exchange.retire(current);
  });
  constexpr std::uint32_t kOffers = 300;
  for (std::uint32_t i = 1; i <= kOffers; ++i) {
    exchange.offer(maker.make(i));
    while (i % 3 == 0 && !exchange.taken()) std::this_thread::yield();
  }
  done.store(true);
  servo.join();
  exchange.destroy_retired();
  CHECK(ordered);
  CHECK(last == kOffers);
  CHECK(taken >= static_cast<int>(kOffers) / 3);
  CHECK(maker.alive() == 0);
}

}  // namespace
}  // namespace wrenchd::test_rendering_exchange
