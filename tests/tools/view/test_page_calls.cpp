// SPDX-License-Identifier: GPL-3.0-or-later
#include <mutex>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "tests/support/soon.hpp"
#include "tests/support/stub_daemon.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tools/view/page_calls.hpp"

namespace wrenchd::test_page_calls {

using namespace wrenchd::test;

namespace {

/// Replies in the order of their arrival.
class Replies {
 public:
  void add(const PageCalls::Reply& reply) {
    const std::scoped_lock lock(mutex_);
    all_.push_back(reply);
  }
  std::vector<PageCalls::Reply> all() const {
    const std::scoped_lock lock(mutex_);
    return all_;
  }
  bool wait_for(std::size_t count) const {
    return soon([&] { return all().size() >= count; });
  }

 private:
  mutable std::mutex mutex_;
  std::vector<PageCalls::Reply> all_;
};

}  // namespace

TEST_CASE("the page calls the daemon, and receives each reply with the id of its call", "[view]") {
  StubDaemon daemon;
  Replies replies;
  PageCalls calls(daemon.socket(), [&](const PageCalls::Reply& reply) { replies.add(reply); });
  calls.submit({3, 1, "status", Json::object()});
  calls.submit({3, 2, "rendering.set", {{"wrench", {{"no_such", 1}}}}});  // the stub rejects it
  calls.submit({4, 7, "status", Json::object()});
  REQUIRE(replies.wait_for(3));
  const auto all = replies.all();
  CHECK(all[0].page == 3);
  CHECK(all[0].id == 1);
  CHECK(all[0].error.empty());
  CHECK(all[0].result.contains("state"));
  CHECK(all[1].id == 2);
  CHECK_FALSE(all[1].error.empty());
  CHECK(all[1].result.is_null());
  CHECK(all[2].page == 4);
  CHECK(all[2].error.empty());  // the connection has survived the rejection
}

TEST_CASE("the page cannot call what arms, moves the hand or administers", "[view]") {
  StubDaemon daemon;
  Replies replies;
  PageCalls calls(daemon.socket(), [&](const PageCalls::Reply& reply) { replies.add(reply); });
  std::uint64_t id = 0;
  for (const char* method : {"arm", "lease.acquire", "hand.set", "reload", "shutdown", "record.open", ""}) {
    INFO(method);
    CHECK_FALSE(PageCalls::permits(method));
    calls.submit({1, ++id, method, Json::object()});
    REQUIRE(replies.wait_for(id));
    CHECK(replies.all().back().error.find("may not call") != std::string::npos);
  }
  CHECK(daemon.requested_methods().empty());
}

TEST_CASE("a page that calls faster than the daemon replies receives an error, and no call is lost",
          "[view]") {
  StubDaemon daemon;
  daemon.stop_answering();
  Replies replies;
  PageCalls calls(daemon.socket(), [&](const PageCalls::Reply& reply) { replies.add(reply); });
  for (std::uint64_t id = 1; id <= PageCalls::kMaxPending + 2; ++id)
    calls.submit({1, id, "status", Json::object()});
  // One call may be on its way already; the others wait, or are rejected at once.
  const auto all = replies.all();
  REQUIRE(all.size() >= 1);
  REQUIRE(all.size() <= 2);
  CHECK(all.back().id == PageCalls::kMaxPending + 2);
  CHECK(all.back().error.find("try again later") != std::string::npos);
}

TEST_CASE("a page whose daemon is gone learns why", "[view]") {
  const TemporaryDirectory directory;
  Replies replies;
  PageCalls calls((directory.path() / "nobody.sock").string(),
                  [&](const PageCalls::Reply& reply) { replies.add(reply); });
  calls.submit({1, 1, "status", Json::object()});
  REQUIRE(replies.wait_for(1));
  CHECK(replies.all()[0].error.find("nobody.sock") != std::string::npos);
}

}  // namespace wrenchd::test_page_calls
