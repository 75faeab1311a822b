// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <chrono>
#include <span>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>
#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "devices/links/socket_link.hpp"
#include "tests/support/no_allocation.hpp"

namespace wrenchd::test_socket_link {

namespace {

using namespace test;
using Bytes = std::vector<std::uint8_t>;

constexpr TimePoint kNow = TimePoint{} + std::chrono::seconds(5);

/// A link and the device at its other end.
struct Pair {
  explicit Pair(int type = SOCK_SEQPACKET) {
    std::array<int, 2> ends{};
    REQUIRE(socketpair(AF_UNIX, type, 0, ends.data()) == 0);
    far = ends[0];
    near = ends[1];
  }
  ~Pair() { disconnect(); }
  void disconnect() {
    if (far >= 0) ::close(far);
    far = -1;
  }
  void say(const Bytes& report) const {
    REQUIRE(send(far, report.data(), report.size(), MSG_DONTWAIT) == static_cast<ssize_t>(report.size()));
  }
  /// Returns the next report of the link's thread; empty after a timeout.
  Bytes receive() const {
    constexpr int kPatience_ms = 2000;
    pollfd waits{far, POLLIN, 0};
    poll(&waits, 1, kPatience_ms);
    return hear_now();
  }
  Bytes hear_now() const {
    Bytes report(100);
    const ssize_t length = recv(far, report.data(), report.size(), MSG_DONTWAIT);
    report.resize(length > 0 ? static_cast<std::size_t>(length) : 0);
    return report;
  }
  int far = -1, near = -1;
};

/// Writes until the link reports the expected status: the result of a write appears with a later one.
bool written_until(SocketLink& link, const Bytes& report, LinkStatus wanted) {
  for (int i = 0; i < 20'000; ++i) {
    if (link.write(kNow, report) == wanted) return true;
    std::this_thread::sleep_for(std::chrono::microseconds(100));
  }
  return false;
}

TEST_CASE("a socket transfers reports in both directions and keeps their boundaries", "[socket_link]") {
  const Pair pair;
  SocketLink link(pair.near);
  link.open();
  std::array<std::uint8_t, 4> buffer{};
  CHECK(link.read(kNow, buffer).status == LinkStatus::not_ready);
  pair.say({1, 2, 3});
  pair.say({4, 5, 6, 7, 8, 9});
  pair.say({});
  pair.say({10});

  LinkRead read = link.read(kNow, buffer);
  CHECK(read.status == LinkStatus::ok);
  CHECK(read.length == 3);
  CHECK(read.arrived == kNow);
  CHECK(buffer[2] == 3);
  read = link.read(kNow, buffer);
  CHECK(read.length == 6);  // truncated, with its full length
  CHECK(buffer[3] == 7);
  read = link.read(kNow, buffer);
  CHECK(read.status == LinkStatus::ok);  // an empty report is no end of the connection
  CHECK(read.length == 0);
  CHECK(link.read(kNow, buffer).length == 1);
  CHECK(link.read(kNow, buffer).status == LinkStatus::not_ready);

  CHECK(link.write(kNow, Bytes{7, 8}) == LinkStatus::ok);
  CHECK(pair.receive() == Bytes{7, 8});
  CHECK(link.write(kNow, Bytes{9}) == LinkStatus::ok);
  CHECK(pair.receive() == Bytes{9});
}

TEST_CASE("if the device does not read, a write fails without waiting", "[socket_link]") {
  const Pair pair;
  SocketLink link(pair.near);
  link.open();
  const Bytes report(32, 1);
  CHECK(written_until(link, report, LinkStatus::not_ready));
  CHECK(pair.receive() == report);
  CHECK(written_until(link, report, LinkStatus::ok));  // there is space again
}

TEST_CASE("when the other end of a socket closes, the device is disconnected", "[socket_link]") {
  Pair pair;
  SocketLink link(pair.near);
  link.open();
  std::array<std::uint8_t, 4> buffer{};
  pair.say({1});
  pair.disconnect();
  CHECK(link.read(kNow, buffer).status == LinkStatus::ok);  // a report sent before the end
  CHECK(link.read(kNow, buffer).status == LinkStatus::disconnected);
  CHECK(written_until(link, Bytes{1}, LinkStatus::disconnected));
  CHECK_THROWS_WITH(link.open(), Catch::Contains("the other end is closed"));
}

TEST_CASE("a closed socket link transfers nothing until it is opened again", "[socket_link]") {
  const Pair pair;
  SocketLink link(pair.near);
  std::array<std::uint8_t, 4> buffer{};
  CHECK(link.write(kNow, Bytes{1}) == LinkStatus::disconnected);
  link.open();
  link.close();
  CHECK(link.write(kNow, Bytes{1}) == LinkStatus::disconnected);
  CHECK(link.read(kNow, buffer).status == LinkStatus::disconnected);
  CHECK(pair.hear_now().empty());
  link.open();
  CHECK(link.write(kNow, Bytes{1}) == LinkStatus::ok);
  CHECK(pair.receive() == Bytes{1});
}

TEST_CASE("a descriptor that is no packet socket is rejected with the remedy", "[socket_link]") {
  const Pair stream(SOCK_STREAM);
  SocketLink of_stream(stream.near);
  CHECK_THROWS_WITH(of_stream.open(),
                    Catch::Contains("no SOCK_SEQPACKET socket") && Catch::Contains("socketpair"));
  SocketLink of_file(::open("/dev/null", O_RDWR | O_CLOEXEC));
  CHECK_THROWS_WITH(of_file.open(), Catch::Contains("no SOCK_SEQPACKET socket"));
  SocketLink of_nothing(-1);
  CHECK_THROWS_WITH(of_nothing.open(), Catch::Contains("device socket -1"));
}

TEST_CASE("waiting on a socket ends with a report, and with the deadline", "[socket_link]") {
  const Pair pair;
  SocketLink link(pair.near);
  link.open();
  const TimePoint start = std::chrono::steady_clock::now();
  link.wait_readable(start + std::chrono::milliseconds(20));
  CHECK(std::chrono::steady_clock::now() - start >= std::chrono::milliseconds(20));
  pair.say({1});
  link.wait_readable(std::chrono::steady_clock::now() +
                     std::chrono::hours(1));  // otherwise the test would never end
}

TEST_CASE("reading and writing a socket does not allocate or lock", "[socket_link]") {
  const Pair pair;
  SocketLink link(pair.near);
  link.open();
  pair.say({1, 2, 3});
  std::array<std::uint8_t, 64> buffer{};
  std::uint64_t allocations = 0, locks = 0;
  {
    const RealtimeGuard guard;
    link.read(kNow, buffer);
    link.read(kNow, buffer);
    link.write(kNow, std::span(buffer).first(3));
    link.wait_readable(kNow);
    allocations = guard.allocations(), locks = guard.locks();
  }
  CHECK(allocations == 0);
  CHECK(locks == 0);
}

}  // namespace
}  // namespace wrenchd::test_socket_link
