// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>
#include <wrenchd/client.hpp>

#include "tests/support/run_program.hpp"
#include "tests/support/soon.hpp"
#include "tests/support/stub_daemon.hpp"

namespace wrenchd::test_client {

using namespace wrenchd::test;
using namespace std::chrono_literals;

namespace {

template <class Act>
int code_of(const Act& act) {
  try {
    act();
  } catch (const ClientError& error) {
    INFO(error.what());
    return error.code();
  }
  return 0;
}

/// A busy machine may delay the loop, which then raises a fault.
void arm_despite_faults(Client& client) {
  const std::string state = client.state();
  if (state == "fault") client.acknowledge();
  if (state == "disarmed") client.arm();
}

bool is_disarmed(Client& client) {
  if (client.state() == "fault") client.acknowledge();
  return client.state() == "disarmed";
}

std::size_t open_descriptors() {
  const std::filesystem::directory_iterator all("/proc/self/fd");
  return static_cast<std::size_t>(std::distance(begin(all), end(all)));
}

}  // namespace

TEST_CASE("a client acquires the lease, arms, and reads the wrench on the hand", "[client]") {
  StubDaemon daemon;
  Client client(daemon.socket());
  CHECK(soon([&] { return client.state() == "disarmed"; }));
  CHECK(code_of([&] { client.arm(); }) == ClientError::kInvalidState);
  client.acquire_lease();
  StateReader state = client.open_state();
  TickState tick;
  std::uint64_t last = 0;
  bool pushed = false;
  for (int i = 0; i < 20'000 && !pushed; ++i) {
    REQUIRE(state.next(tick));
    if (i > 0) CHECK(tick.tick() == last + 1);
    last = tick.tick();
    if (last % 100 == 0) arm_despite_faults(client);
    pushed = tick.state() == "active" && tick.wrench()[2] > 0.1 && tick.contacts().size() == 4;
  }
  CHECK(pushed);
  CHECK(state.missed() == 0);
  CHECK(daemon.heartbeats() > 10);
  CHECK(soon([&] {
    client.disarm();
    return is_disarmed(client);
  }));
  client.stop();
  CHECK(soon([&] { return client.state() == "stopped"; }));
  client.acknowledge();
  CHECK(soon([&] { return client.state() == "disarmed"; }));
  client.release_lease();
  CHECK_FALSE(daemon.leased());
  const int heartbeats = daemon.heartbeats();
  std::this_thread::sleep_for(100ms);
  CHECK(daemon.heartbeats() == heartbeats);
}

TEST_CASE("a client moves the hand of the simulated device", "[client]") {
  StubDaemon daemon;
  Client client(daemon.socket());
  StateReader state = client.open_state();
  TickState tick;
  CHECK(soon([&] {
    client.move_hand({0.1, 0.0, 0.1});
    return state.latest(tick) && std::abs(tick.number("X_BH", 0) - 0.1) < 2e-3;
  }));
  CHECK(soon([&] { return state.latest(tick) && std::abs(tick.number("X_BH", 0)) < 0.05; }));
}

TEST_CASE("if a client dies, its lease ends with its connection and the force fades", "[client]") {
  StubDaemon daemon;
  {
    Client client(daemon.socket());
    client.acquire_lease();
    REQUIRE(soon([&] {
      arm_despite_faults(client);
      return client.state() == "active";
    }));
  }
  CHECK(soon([&] { return !is_driving(daemon.loop().telemetry().state()); }));
  CHECK_FALSE(daemon.leased());
}

TEST_CASE("arming without the lease is an error; releasing a lost lease is not", "[client]") {
  StubDaemon daemon;
  Client client(daemon.socket());
  client.acquire_lease();
  daemon.expire_lease();
  CHECK(code_of([&] { client.arm(); }) == ClientError::kInvalidState);
  CHECK_NOTHROW(client.release_lease());
  CHECK_NOTHROW(client.acquire_lease());
}

TEST_CASE("a rejected request throws with the daemon's message and code", "[client]") {
  StubDaemon daemon;
  Client first(daemon.socket());
  Client second(daemon.socket());
  first.acquire_lease();
  CHECK(code_of([&] { second.acquire_lease(); }) == ClientError::kLeaseHeld);
  CHECK(code_of([&] { second.reload(); }) == ClientError::kRejected);
  CHECK(code_of([&] { second.call("dance"); }) == -32601);
  CHECK(code_of([&] { second.call("status", "no JSON"); }) == ClientError::kProtocol);
  CHECK_THROWS_WITH(second.reload(), "wrenchd.toml:3: no such key; delete it");
  CHECK(second.state() == "disarmed");  // the connection remains usable
}

TEST_CASE("subscribed events come in order, also between responses", "[client]") {
  StubDaemon daemon;
  Client client(daemon.socket());
  const auto snapshot = nlohmann::json::parse(client.subscribe({"state", "fault"}));
  CHECK(snapshot["state"] == "disarmed");
  const auto sequence = snapshot["sequence"].get<std::uint64_t>();
  ClientEvent event;
  CHECK_FALSE(client.poll_event(event, 1ms));
  daemon.send_event("state", "info");
  daemon.send_event("scene", "info");
  daemon.send_event("fault", "error");
  CHECK(client.state() == "disarmed");
  REQUIRE(client.poll_event(event));
  CHECK(event.name == "state");
  CHECK(event.sequence == sequence + 1);
  CHECK(event.time_ns == 7);
  REQUIRE(client.poll_event(event));
  CHECK(event.name == "fault");
  CHECK(event.level == "error");
  CHECK(nlohmann::json::parse(event.json)["sequence"] == sequence + 3);
  daemon.send_raw(
      "{\"jsonrpc\":\"2.0\",\"method\":\"event\",\"params\":{\"name\":\"device\"}}\n");  // in many parts
  REQUIRE(client.poll_event(event));
  CHECK(event.name == "device");
  client.unsubscribe();
  daemon.send_event("state", "info");
  CHECK_FALSE(client.poll_event(event, 20ms));
}

TEST_CASE("a daemon that ends, hangs or sends invalid data is an error after a bounded time", "[client]") {
  StubDaemon daemon;
  Client client(daemon.socket(), 200ms);
  StateReader state = client.open_state();
  TickState tick;
  REQUIRE(state.next(tick));
  SECTION("hangs") {
    daemon.stop_answering();
    CHECK(code_of([&] { client.status(); }) == ClientError::kTimeout);
  }
  SECTION("sends invalid data") {
    daemon.send_raw("[1]\n");
    CHECK(code_of([&] { client.status(); }) == ClientError::kProtocol);
  }
  SECTION("ends") {
    daemon.disconnect_all();
    CHECK(code_of([&] { client.status(); }) == ClientError::kDisconnected);
    CHECK(code_of([&] { client.status(); }) == ClientError::kDisconnected);
    ClientEvent event;
    CHECK(code_of([&] { client.poll_event(event); }) == ClientError::kDisconnected);
    // The shared memory remains readable. next() would report the loss once all ticks are read.
    CHECK(state.latest(tick));
  }
}

TEST_CASE("a reader detects that the daemon is gone, also if it never waits", "[client]") {
  const auto timeout = GENERATE(10'000ms, 0ms);
  auto daemon = std::make_unique<StubDaemon>();
  Client client(daemon->socket());
  StateReader state = client.open_state();
  TickState tick;
  REQUIRE(state.next(tick));
  daemon.reset();
  CHECK(code_of([&] {
          for (const auto end = std::chrono::steady_clock::now() + 10s;
               std::chrono::steady_clock::now() < end;)
            state.next(tick, timeout);
        }) == ClientError::kDisconnected);
  CHECK(state.latest(tick));  // the last ticks remain readable
  CHECK(tick.integer("released") == 1);
}

TEST_CASE("without a daemon the error names the searched sockets and the remedy", "[client]") {
  CHECK(code_of([] { Client("/nowhere/control.sock"); }) == ClientError::kNoDaemon);
  CHECK_THROWS_WITH(Client("/nowhere/control.sock"),
                    Catch::Contains("/nowhere/control.sock: No such file") && Catch::Contains("start it"));
  CHECK_THROWS_AS(Client(std::string(200, 'x')), ClientError);
}

TEST_CASE("clients leak no descriptor, used or unused", "[client]") {
  StubDaemon daemon;
  { const Client client(daemon.socket()); }
  CHECK(soon([&] { return daemon.requested_methods().empty(); }));
  std::this_thread::sleep_for(50ms);
  const std::size_t before = open_descriptors();
  for (int i = 0; i < 20; ++i) {
    Client client(daemon.socket());
    client.call("state.open");  // the client discards the descriptor
    client.status();
    StateReader state = client.open_state();
    StateReader moved = std::move(state);
    TickState tick;
    CHECK(moved.next(tick));
  }
  CHECK(soon([&] { return open_descriptors() == before; }));
}

TEST_CASE("the example prints wrench and contacts", "[client]") {
  const StubDaemon daemon;
  setenv("WRENCHD_SOCKET", daemon.socket().c_str(), 1);
  const ProgramResult ran = run_program("wrenchd_client_example", {"3"});
  setenv("WRENCHD_SOCKET", "/nowhere/control.sock", 1);
  const ProgramResult alone = run_program("wrenchd_client_example", {"3"});
  unsetenv("WRENCHD_SOCKET");
  INFO(ran.out << ran.err);
  CHECK(ran.exit_code == 0);
  CHECK(ran.out.starts_with("wrenchd is disarmed\ntick "));
  CHECK(std::count(ran.out.begin(), ran.out.end(), '\n') == 4);
  CHECK(alone.exit_code == 1);
  CHECK(alone.err.find("no wrenchd responds (") == 0);
}

}  // namespace wrenchd::test_client
