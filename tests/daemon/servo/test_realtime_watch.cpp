// SPDX-License-Identifier: GPL-3.0-or-later
#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include <catch2/catch.hpp>
#include <sched.h>
#include <unistd.h>

#include "daemon/servo/realtime_watch.hpp"
#include "tests/support/rate_check.hpp"
#include "tests/support/run_program.hpp"

namespace wrenchd::test_realtime_watch {

namespace {

using namespace test;
using namespace std::chrono_literals;

/// Sets the SCHED_FIFO priority of a thread; 0 makes it an ordinary thread. Returns false without permission.
bool set_priority(pid_t thread, int priority) {
  sched_param param{};
  param.sched_priority = priority;
  return sched_setscheduler(thread, priority > 0 ? SCHED_FIFO : SCHED_OTHER, &param) == 0;
}

TEST_CASE("a lowered priority is reported once, and so is its return", "[realtime_watch]") {
  std::thread([] {  // a separate thread keeps the priority of the test thread
    if (!set_priority(gettid(), 12)) {
      WARN("this user may not use SCHED_FIFO: not checked");
      return;
    }
    RealtimeWatch watch(gettid());
    CHECK_FALSE(watch.check());
    REQUIRE(set_priority(gettid(), 0));
    const auto lost = watch.check();
    REQUIRE(lost);
    CHECK(lost->lost);
    CHECK(lost->message.find("SCHED_FIFO priority 12") != std::string::npos);
    CHECK(lost->message.find("chrt -f -p 12 " + std::to_string(gettid())) != std::string::npos);
    CHECK_FALSE(watch.check());
    REQUIRE(set_priority(gettid(), 5));
    CHECK_FALSE(watch.check());  // a lower priority than granted still counts as lost
    REQUIRE(set_priority(gettid(), 12));
    const auto back = watch.check();
    REQUIRE(back);
    CHECK_FALSE(back->lost);
    CHECK_FALSE(watch.check());
  })
      .join();
}

TEST_CASE("an ordinary thread and an ended thread report no change", "[realtime_watch]") {
  pid_t number = 0;
  std::thread thread([&] { number = gettid(); });
  thread.join();
  RealtimeWatch ended(number);
  CHECK_FALSE(ended.check());
  RealtimeWatch ordinary(gettid());
  CHECK_FALSE(ordinary.check());
}

/// Returns the kernel id of the thread with this name in a process; 0 if there is none.
pid_t thread_named(pid_t process, const std::string& name) {
  for (const auto& task : std::filesystem::directory_iterator("/proc/" + std::to_string(process) + "/task")) {
    std::string comm;
    std::getline(std::ifstream(task.path() / "comm"), comm);
    if (comm == name) return std::stoi(task.path().filename());
  }
  return 0;
}

TEST_CASE("a daemon whose servo thread lost its priority logs it, and disarms if priority is required",
          "[realtime_watch][program][wall_time]") {
  const MachineLoad load;
  const TemporaryDirectory files;
  const RunningProgram program(
      "wrenchd", {"--arm", "--realtime", "required", "--control", (files.path() / "s").string()});
  const bool active = program.wait_for_output("state: active", 10s);
  if (program.err().find("granted: SCHED_FIFO") == std::string::npos) {
    WARN("this user may not use SCHED_FIFO: " << program.err());
    return;
  }
  REQUIRE_RATE(load, active);
  const pid_t servo = thread_named(program.pid(), "wrenchd-servo");
  REQUIRE(servo > 0);
  REQUIRE(set_priority(servo, 0));
  CHECK(program.wait_for_output("another process lowered the servo thread from SCHED_FIFO priority 45"));
  CHECK(program.wait_for_output("; disarmed, because realtime = \"required\""));
  // On a busy machine the ticks of an ordinary thread may be so late that a fault comes first.
  CHECK((program.wait_for_output("state: releasing", 5s) || program.wait_for_output("state: fault", 1s)));
  REQUIRE(set_priority(servo, 45));
  CHECK(program.wait_for_output("has SCHED_FIFO priority 45 again"));
}

}  // namespace
}  // namespace wrenchd::test_realtime_watch
