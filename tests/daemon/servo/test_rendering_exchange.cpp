// SPDX-License-Identifier: GPL-3.0-or-later
#include <atomic>
#include <thread>

#include <catch2/catch.hpp>

#include "daemon/servo/rendering_exchange.hpp"
#include "tests/support/shipped_config.hpp"

namespace wrenchd {
namespace {

using namespace test;

/// Makes renderings of one scene, and counts those that are there by the users of the scene.
struct Maker {
  RunConfig plan = shipped_config();
  std::shared_ptr<const Scene> scene = std::make_shared<const Scene>(plan.scene);
  std::shared_ptr<ProxyInitializer> placer = make_proxy_initializer(scene, ProxySearchMode::in_tick);
  long without = scene.use_count();

  std::unique_ptr<Rendering> make(std::uint32_t number) {
    return std::make_unique<Rendering>(number, plan.settings, plan.profile, scene, placer);
  }
  long alive() const { return scene.use_count() - without; }
};

TEST_CASE("what was not taken yet gives way to what is offered next", "[exchange]") {
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
    CHECK(maker.alive() == 1);  // it is destroyed by whoever offers, and not by whoever gives back
    exchange.destroy_retired();
    CHECK(maker.alive() == 0);
    exchange.offer(maker.make(3));
    exchange.retire(maker.make(4).release());
  }
  CHECK(maker.alive() == 0);
}

TEST_CASE("between two threads none is lost, and none is there twice", "[exchange]") {
  Maker maker;
  RenderingExchange exchange;
  std::atomic<bool> done{false};
  std::uint32_t last = 0;
  int taken = 0;
  bool ordered = true;
  std::thread servo([&] {
    Rendering* held = nullptr;
    const auto look = [&] {
      Rendering* next = exchange.take();
      if (next == nullptr) return;
      ordered = ordered && next->id() > last;
      last = next->id();
      ++taken;
      if (held != nullptr) exchange.retire(held);
      held = next;
    };
    while (!done.load()) look();
    look();
    exchange.retire(held);
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
}  // namespace wrenchd
