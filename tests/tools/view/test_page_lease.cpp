// SPDX-License-Identifier: GPL-3.0-or-later
#include <chrono>
#include <mutex>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>

#include "tests/support/rate_check.hpp"
#include "tests/support/soon.hpp"
#include "tests/support/stub_daemon.hpp"
#include "tools/view/page_lease.hpp"

namespace wrenchd::test_page_lease {

using namespace wrenchd::test;
using namespace std::chrono_literals;

namespace {

using Request = PageLease::Request;

/// A daemon, a page lease, and the replies that the lease sends to its pages.
struct Rig {
  StubDaemon daemon;
  std::mutex mutex;
  std::vector<PageLease::Reply> replies;
  PageLease lease{daemon.socket(), [this](const PageLease::Reply& one) {
                    const std::scoped_lock lock(mutex);
                    replies.push_back(one);
                  }};

  Rig() {
    soon([this] { return daemon.loop().telemetry().state() == State::disarmed; });
  }
  bool was_replied(std::uint64_t page, const std::string& request, bool accepted) {
    return soon([&] {
      const std::scoped_lock lock(mutex);
      for (const PageLease::Reply& one : replies)
        if (one.page == page && one.request == request && one.accepted == accepted) return true;
      return false;
    });
  }
  /// Sends heartbeats at the frame rate for this duration.
  void send_heartbeats(std::uint64_t page, std::chrono::milliseconds time) {
    for (const auto end = std::chrono::steady_clock::now() + time; std::chrono::steady_clock::now() < end;) {
      lease.heartbeat(page);
      lease.set_loop_state(name(daemon.loop().telemetry().state()));
      std::this_thread::sleep_for(16ms);
    }
  }
};

}  // namespace

TEST_CASE("a page holds the lease as long as it sends heartbeats", "[view]") {
  const MachineLoad load;
  Rig rig;
  rig.lease.submit(1, Request::arm);
  REQUIRE(rig.was_replied(1, "arm", true));
  rig.send_heartbeats(1, 2 * PageLease::kPageTimeout);
  REQUIRE_RATE(load, rig.daemon.leased() && rig.daemon.heartbeats() > 20);
  CHECK(rig.lease.holder() == 1);
  const auto silent = std::chrono::steady_clock::now();
  CHECK(soon([&] { return !rig.daemon.leased(); }));
  CHECK(std::chrono::steady_clock::now() - silent > PageLease::kPageTimeout / 2);
  CHECK(rig.was_replied(1, "lease", false));
  CHECK(rig.lease.holder() == 0);
}

TEST_CASE("a closed page releases the lease immediately", "[view]") {
  Rig rig;
  rig.lease.submit(1, Request::arm);
  REQUIRE(rig.was_replied(1, "arm", true));
  rig.lease.heartbeat(1);
  const auto closed = std::chrono::steady_clock::now();
  rig.lease.page_closed(1);
  CHECK(soon([&] { return !rig.daemon.leased(); }));
  CHECK(std::chrono::steady_clock::now() - closed < PageLease::kPageTimeout);
}

TEST_CASE("only the page that armed keeps it armed, and any page disarms", "[view]") {
  Rig rig;
  rig.lease.submit(1, Request::arm);
  REQUIRE(rig.was_replied(1, "arm", true));
  rig.send_heartbeats(1, 200ms);
  rig.lease.submit(2, Request::arm);
  CHECK(rig.was_replied(2, "arm", false));
  CHECK(rig.lease.holder() == 1);
  rig.lease.page_closed(2);  // this page holds no lease
  rig.send_heartbeats(1, 200ms);
  CHECK(rig.daemon.leased());
  rig.lease.submit(3, Request::disarm);
  CHECK(rig.was_replied(3, "disarm", true));
  CHECK(rig.was_replied(1, "lease", false));
  CHECK(soon([&] { return !rig.daemon.leased(); }));
}

TEST_CASE("every page can stop, with or without the lease", "[view]") {
  Rig rig;
  rig.lease.submit(7, Request::stop);
  CHECK(rig.was_replied(7, "stop", true));
  const auto requested = rig.daemon.requested_methods();
  CHECK(std::find(requested.begin(), requested.end(), "stop") != requested.end());
}

TEST_CASE("the page that sent a request receives an error if the daemon is absent", "[view]") {
  Rig rig;
  std::vector<PageLease::Reply> replies;
  std::mutex mutex;
  PageLease lost("/nowhere/control.sock", [&](const PageLease::Reply& one) {
    const std::scoped_lock lock(mutex);
    replies.push_back(one);
  });
  for (const Request request : {Request::arm, Request::stop}) lost.submit(1, request);
  CHECK(soon([&] {
    const std::scoped_lock lock(mutex);
    return replies.size() == 2;
  }));
  const std::scoped_lock lock(mutex);
  for (const PageLease::Reply& one : replies) {
    CHECK_FALSE(one.accepted);
    CHECK(one.error.find("/nowhere/control.sock") != std::string::npos);
  }
}

}  // namespace wrenchd::test_page_lease
