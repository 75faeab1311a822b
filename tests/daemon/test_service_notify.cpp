// SPDX-License-Identifier: GPL-3.0-or-later
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <vector>

#include <catch2/catch.hpp>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "daemon/service_notify.hpp"
#include "tests/support/rate_check.hpp"
#include "tests/support/run_program.hpp"

namespace wrenchd::test_service_notify {

namespace {

using namespace test;
using namespace std::chrono_literals;
using Catch::Contains;

std::optional<LoopStatus> loop(State state, std::uint64_t ticks, Fault cause = Fault::none) {
  return LoopStatus{state, cause, ticks};
}

TEST_CASE("the service is ready after the self-test, not before", "[service_notify]") {
  ServiceReport report;
  CHECK(report.next_message({}) == "STATUS=starting\n");
  report.running("loopback");
  CHECK(report.next_message(loop(State::disconnected, 0)) == "STATUS=disconnected; device loopback\n");
  CHECK(report.next_message(loop(State::self_test, 10)) == "STATUS=self-test; device loopback\n");
  CHECK(report.next_message(loop(State::self_test, 20)) == "");
  CHECK(report.next_message(loop(State::disarmed, 30)) ==
        "READY=1\nWATCHDOG=1\nSTATUS=disarmed; device loopback\n");
  CHECK(report.next_message(loop(State::disarmed, 40)) == "WATCHDOG=1\n");
}

TEST_CASE("after a failed self-test the service is ready, with the fault and its cure as status",
          "[service_notify]") {
  ServiceReport report;
  report.running("loopback");
  report.next_message(loop(State::self_test, 10));
  const FaultRow& row = fault_row(Fault::self_test_rate);
  CHECK(report.next_message(loop(State::fault, 20, Fault::self_test_rate)) ==
        "READY=1\nWATCHDOG=1\nSTATUS=fault: self_test_rate: " + std::string(row.message) + "; " +
            std::string(row.cure) + "; device loopback\n");
}

TEST_CASE("a service that waits for a device is ready and alive", "[service_notify]") {
  ServiceReport report;
  report.waiting("no device is\nplugged in");
  CHECK(report.next_message({}) == "READY=1\nWATCHDOG=1\nSTATUS=waiting: no device is plugged in\n");
  CHECK(report.next_message({}) == "WATCHDOG=1\n");
}

TEST_CASE("without ticks of the loop the service sends no watchdog message", "[service_notify]") {
  ServiceReport report;
  report.running("loopback");
  report.next_message(loop(State::disarmed, 7));
  CHECK(report.next_message(loop(State::disarmed, 7)) == "");
  CHECK(report.next_message(loop(State::disarmed, 7)) == "");
  CHECK(report.next_message(loop(State::disarmed, 8)) == "WATCHDOG=1\n");
}

TEST_CASE("after a reconnection the service watches the new loop, and reports readiness only once",
          "[service_notify]") {
  ServiceReport report;
  report.running("a");
  report.next_message(loop(State::disarmed, 7));
  report.waiting("the device was unplugged");
  CHECK(report.next_message({}) == "WATCHDOG=1\nSTATUS=waiting: the device was unplugged\n");
  report.running("a");
  CHECK(report.next_message(loop(State::self_test, 7)) == "WATCHDOG=1\nSTATUS=self-test; device a\n");
  CHECK(report.next_message(loop(State::self_test, 7)) == "");
  CHECK(report.next_message(loop(State::disarmed, 9)) == "WATCHDOG=1\nSTATUS=disarmed; device a\n");
}

TEST_CASE("reloading and stopping are reported once each", "[service_notify]") {
  ServiceReport report;
  report.running("a");
  report.next_message(loop(State::disarmed, 7));
  report.reloading(123456);
  CHECK(report.next_message(loop(State::disarmed, 8)) == "RELOADING=1\nMONOTONIC_USEC=123456\nWATCHDOG=1\n");
  CHECK(report.next_message(loop(State::disarmed, 9)) == "WATCHDOG=1\n");
  report.reloaded();
  CHECK(report.next_message(loop(State::disarmed, 10)) == "READY=1\nWATCHDOG=1\n");
  report.stopping("stopping");
  CHECK(report.next_message({}) == "STOPPING=1\nWATCHDOG=1\nSTATUS=stopping\n");
  report.stopping("rejected: x.toml:1:1: no");
  CHECK(report.next_message({}) == "WATCHDOG=1\nSTATUS=rejected: x.toml:1:1: no\n");
}

TEST_CASE("with two hands the service is ready when both are, and its status names both",
          "[service_notify]") {
  ServiceReport report;
  report.add_second_hand("left");
  report.running("a", 0);
  CHECK(report.next_message(loop(State::disarmed, 1)) == "STATUS=disarmed; device a | left: starting\n");
  report.waiting("no device is plugged in", 1);
  CHECK(report.next_message(loop(State::disarmed, 2)) ==
        "READY=1\nWATCHDOG=1\nSTATUS=disarmed; device a | left: waiting: no device is plugged in\n");
  report.running("b", 1);
  CHECK(report.next_message(loop(State::disarmed, 3), loop(State::disarmed, 1)) ==
        "WATCHDOG=1\nSTATUS=disarmed; device a | left: disarmed; device b\n");
  CHECK(report.next_message(loop(State::disarmed, 4), loop(State::disarmed, 1)) == "");  // one loop hangs
  CHECK(report.next_message(loop(State::disarmed, 5), loop(State::disarmed, 2)) == "WATCHDOG=1\n");
  report.stopping("stopping");
  report.waiting("the device was unplugged", 1);
  CHECK(report.next_message({}) == "STOPPING=1\nWATCHDOG=1\nSTATUS=stopping\n");
}

/// Replaces the service manager: a socket and the messages sent to it.
class Manager {
 public:
  Manager() : socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    const std::string path = (dir_.path() / "notify").string();
    std::strncpy(address.sun_path, path.c_str(), sizeof(address.sun_path) - 1);
    REQUIRE(::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0);
    ::setenv("NOTIFY_SOCKET", path.c_str(), 1);
    ::setenv("WATCHDOG_USEC", "400000", 1);
  }
  ~Manager() {
    ::unsetenv("NOTIFY_SOCKET");
    ::unsetenv("WATCHDOG_USEC");
    ::close(socket_);
  }
  Manager(const Manager&) = delete;
  Manager& operator=(const Manager&) = delete;

  /// Returns the messages since the previous call, one per line.
  std::string received() {
    std::string text;
    char message[4096];
    for (ssize_t n; (n = ::recv(socket_, message, sizeof(message), 0)) > 0;)
      text.append(message, static_cast<std::size_t>(n));
    return text;
  }
  /// Waits up to 20 s for the text. Returns true if it arrived.
  bool receives(const std::string& text) {
    for (const auto end = std::chrono::steady_clock::now() + 20s; std::chrono::steady_clock::now() < end;) {
      all_ += received();
      if (all_.find(text) != std::string::npos) return true;
      std::this_thread::sleep_for(5ms);
    }
    return false;
  }
  const std::string& all() const { return all_; }
  void forget() {
    received();
    all_.clear();
  }

 private:
  TemporaryDirectory dir_;
  int socket_;
  std::string all_;
};

TEST_CASE("the manager gets the messages on its socket, and no watchdog message without ticks",
          "[service_notify]") {
  Manager manager;
  std::atomic<std::uint64_t> ticks{0};
  std::atomic<bool> ticking{true};
  ServiceNotify service;
  CHECK(manager.receives("STATUS=starting\n"));
  service.running(
      [&] {
        return LoopStatus{State::disarmed, Fault::none, ticking ? ++ticks : ticks.load()};
      },
      "loopback");
  CHECK(manager.receives("READY=1\n"));
  manager.forget();
  CHECK(manager.receives("WATCHDOG=1\nWATCHDOG=1\nWATCHDOG=1\n"));
  ticking = false;
  service.running([&] { return LoopStatus{State::disarmed, Fault::none, ticks.load()}; }, "loopback");
  std::this_thread::sleep_for(150ms);
  manager.forget();
  std::this_thread::sleep_for(300ms);
  CHECK(manager.received() == "");
  service.waiting("nothing is plugged in");
  CHECK(manager.receives("WATCHDOG=1\nSTATUS=waiting: nothing is plugged in\n"));
}

TEST_CASE("without a service manager no message is sent and no thread runs", "[service_notify]") {
  ::unsetenv("NOTIFY_SOCKET");
  ServiceNotify service;
  bool status_read = false;
  service.running(
      [&] {
        status_read = true;
        return LoopStatus{};
      },
      "loopback");
  std::this_thread::sleep_for(150ms);
  service.loop_ended();
  CHECK_FALSE(status_read);
}

TEST_CASE("wrenchd reports to its manager: ready after the self-test, alive, stopping",
          "[service_notify][wall_time]") {
  const MachineLoad load;
  Manager manager;
  RunningProgram wrenchd("wrenchd", {"--simulate", "loopback", "--realtime", "best_effort"});
  REQUIRE_RATE(load, manager.receives("READY=1\n"));
  CHECK_THAT(manager.all(), Contains("STATUS=self-test; device loopback, simulated\n"));
  REQUIRE_RATE(load, manager.receives("STATUS=disarmed; device loopback, simulated\n"));
  manager.forget();
  REQUIRE_RATE(load, manager.receives("WATCHDOG=1\nWATCHDOG=1\n"));
  wrenchd.signal(SIGUSR1);
  REQUIRE_RATE(load, manager.receives("STATUS=stopped: stop_requested: "));
  wrenchd.signal(SIGUSR2);
  REQUIRE_RATE(load, manager.receives("STATUS=disarmed; device loopback, simulated\n"));
  manager.forget();
  wrenchd.signal(SIGTERM);
  const int exit_code = wrenchd.wait().exit_code;
  CHECK(manager.receives("STOPPING=1\n"));
  REQUIRE_RATE(load, exit_code == 0);
}

TEST_CASE("wrenchd that does not start reports the reason as status, and is never ready",
          "[service_notify]") {
  Manager manager;
  const TemporaryDirectory dir;
  const std::string file = dir.write("typo.toml", "[servo]\nrat_Hz = 1000\n").string();
  CHECK(run_program("wrenchd", {"--config", file}).exit_code == 1);
  CHECK(manager.receives("STATUS=rejected: " + file + ":2:1: key 'servo.rat_Hz' is not known"));
  CHECK_THAT(manager.all(), !Contains("READY=1"));
}

TEST_CASE("wrenchd without a device is ready, and reports what it waits for", "[service_notify]") {
  Manager manager;
  RunningProgram wrenchd("wrenchd", {"--profile", "reference_full_speed", "--realtime", "best_effort"});
  CHECK(manager.receives("STATUS=waiting: "));
  CHECK_THAT(manager.all(),
             Contains("READY=1\n") && Contains("no device of profile reference_full_speed is connected\n"));
  wrenchd.signal(SIGTERM);
  CHECK(wrenchd.wait().exit_code == 0);
}

}  // namespace
}  // namespace wrenchd::test_service_notify
