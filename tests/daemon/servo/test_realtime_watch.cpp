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
#include "tests/support/run_program.hpp"

namespace wrenchd {
namespace {

using namespace test;
using namespace std::chrono_literals;

/// Gives a thread a SCHED_FIFO priority, or with 0 takes it away. False: the kernel does not let us.
bool give(pid_t thread, int priority) {
  sched_param param{};
  param.sched_priority = priority;
  return sched_setscheduler(thread, priority > 0 ? SCHED_FIFO : SCHED_OTHER, &param) == 0;
}

TEST_CASE("a priority that is taken away is told once, and so is its return", "[realtime_watch]") {
  std::thread([] {  // on a thread of its own, so that the test's stays as it was
    if (!give(gettid(), 12)) {
      WARN("this user may not have SCHED_FIFO: not looked at");
      return;
    }
    RealtimeWatch watch(gettid());
    CHECK_FALSE(watch.check());
    REQUIRE(give(gettid(), 0));
    const auto lost = watch.check();
    REQUIRE(lost);
    CHECK(lost->lost);
    CHECK(lost->message.find("SCHED_FIFO priority 12") != std::string::npos);
    CHECK(lost->message.find("chrt -f -p 12 " + std::to_string(gettid())) != std::string::npos);
    CHECK_FALSE(watch.check());
    REQUIRE(give(gettid(), 5));
    CHECK_FALSE(watch.check());  // less than it was granted is still lost
    REQUIRE(give(gettid(), 12));
    const auto back = watch.check();
    REQUIRE(back);
    CHECK_FALSE(back->lost);
    CHECK_FALSE(watch.check());
  })
      .join();
}

TEST_CASE("a thread that has none has nothing to lose, nor has one that is gone", "[realtime_watch]") {
  pid_t number = 0;
  std::thread thread([&] { number = gettid(); });
  thread.join();
  RealtimeWatch gone(number);
  CHECK_FALSE(gone.check());
  RealtimeWatch ordinary(gettid());
  CHECK_FALSE(ordinary.check());
}

/// The kernel's number of the thread of that name in a process; 0: there is none.
pid_t thread_named(pid_t process, const std::string& name) {
  for (const auto& task : std::filesystem::directory_iterator("/proc/" + std::to_string(process) + "/task")) {
    std::string comm;
    std::getline(std::ifstream(task.path() / "comm"), comm);
    if (comm == name) return std::stoi(task.path().filename());
  }
  return 0;
}

TEST_CASE("a daemon whose servo thread lost its priority says so, and disarms where it is required",
          "[realtime_watch][program][wall_time]") {
  const TemporaryDirectory files;
  const RunningProgram program(
      "wrenchd", {"--arm", "--realtime", "required", "--control", (files.path() / "s").string()});
  if (!program.wait_for_output("state: active", 10s)) {
    WARN("this user may not have SCHED_FIFO: " << program.err());
    return;
  }
  const pid_t servo = thread_named(program.pid(), "wrenchd-servo");
  REQUIRE(servo > 0);
  REQUIRE(give(servo, 0));
  CHECK(program.wait_for_output("somebody took the servo thread's SCHED_FIFO priority 45"));
  CHECK(program.wait_for_output("; disarmed, as realtime = \"required\""));
  // Beside other work the ticks of an ordinary thread may be so late that a fault was quicker.
  CHECK((program.wait_for_output("state: releasing", 5s) || program.wait_for_output("state: fault", 1s)));
  REQUIRE(give(servo, 45));
  CHECK(program.wait_for_output("has its SCHED_FIFO priority 45 again"));
}

}  // namespace
}  // namespace wrenchd
