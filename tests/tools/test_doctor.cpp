// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "config/known_profiles.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/run_program.hpp"
#include "tools/doctor.hpp"
#include "tools/udev_rules.hpp"

namespace wrenchd::test_doctor {

namespace {

using namespace test;
using namespace std::chrono_literals;

const KnownProfiles kShipped = known_profiles(SearchPath({test::source_path("config")}));

/// A machine without problems. Each test changes one property.
struct Healthy {
  TemporaryDirectory dir;
  MachineState machine;

  Healthy() {
    dir.write("proc/sys/kernel/osrelease", "6.1.0-rt\n");
    dir.write("sys/kernel/realtime", "1\n");
    dir.write("proc/cmdline", "quiet isolcpus=3 threadirqs\n");
    dir.write("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance\n");
    dir.write("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "performance\n");
    dir.write("proc/sys/kernel/sched_rt_runtime_us", "950000\n");
    dir.write("lib/systemd/system/wrenchd.service", "[Service]\nLimitRTPRIO=49\nLimitMEMLOCK=infinity\n");
    dir.write("lib/udev/rules.d/70-wrenchd.rules", udev_rules(kShipped.profiles));
    dir.write("etc/group", "root:x:0:\nwrenchd:x:990:\nwrench:x:991:ann\n");
    dir.write("sys/bus/usb/devices/3-1/power/control", "on\n");
    machine.root = dir.path();
    machine.user = "ann";
    machine.groups = {"ann", "wrench"};
    machine.rtprio_limit = 49;
    machine.memlock_limit_bytes = ~std::uint64_t{0};
    machine.nodes = {{"polhem", "/dev/hidraw3", "3-1", "wrenchd", 0660}};
    machine.profiles = kShipped.profiles;
    machine.wake_latency = WakeLatency{true, 5us, 40us, 90us};
  }

  /// Returns the only finding that is not ok.
  Finding worst() const {
    Finding found;
    for (const Finding& f : check_machine(machine)) {
      if (f.health == Health::ok) continue;
      INFO(text(check_machine(machine)));
      CHECK(found.summary == "");  // no other finding changes
      found = f;
    }
    return found;
  }
};

bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// Checks that the finding has this severity and that its summary and remedy contain these texts.
void check(const Finding& found, Health health, const std::string& what, const std::string& cure) {
  INFO(found.summary << " -> " << found.cure);
  CHECK(found.health == health);
  CHECK(has(found.summary, what));
  CHECK(has(found.cure, cure));
}

TEST_CASE("a machine without problems has only ok findings", "[doctor]") {
  const Healthy h;
  const auto findings = check_machine(h.machine);
  INFO(text(findings));
  CHECK(findings.size() == 13);
  for (const Finding& f : findings) {
    CHECK(f.health == Health::ok);
    CHECK(f.cure == "");
  }
  CHECK_FALSE(has_failure(findings));
}

TEST_CASE("kernel and processors cause warnings; a throttled real-time share is an error", "[doctor]") {
  SECTION("kernel") {
    Healthy h;
    h.dir.write("sys/kernel/realtime", "0\n");
    check(h.worst(), Health::warning, "6.1.0-rt is not PREEMPT_RT", "linux-image-rt");
  }
  SECTION("governor") {
    Healthy h;
    h.dir.write("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave\n");
    check(h.worst(), Health::warning, "powersave on 1 of 2", "frequency-set -g performance");
  }
  SECTION("boot options") {
    Healthy h;
    h.dir.write("proc/cmdline", "quiet\n");
    check(h.worst(), Health::warning, "no processor is reserved for the servo thread", "isolcpus=N");
  }
  SECTION("share") {
    Healthy h;
    h.dir.write("proc/sys/kernel/sched_rt_runtime_us", "100000\n");
    check(h.worst(), Health::failure, "only 10 %", "sched_rt_runtime_us=950000");
    CHECK(has_failure(check_machine(h.machine)));
  }
}

TEST_CASE("limits of the user cause warnings, limits of the service cause errors", "[doctor]") {
  SECTION("priority") {
    Healthy h;
    h.machine.rtprio_limit = 0;
    check(h.worst(), Health::warning, "real-time priority of ann: up to 0", "ann - rtprio 49");
    h.machine.is_root = true;
    CHECK(h.worst().summary == "");
  }
  SECTION("memory") {
    Healthy h;
    h.machine.memlock_limit_bytes = std::uint64_t{8} << 20U;
    check(h.worst(), Health::warning, "ann may lock: 8 MiB", "ann - memlock unlimited");
  }
  SECTION("unit") {
    Healthy h;
    h.dir.write("etc/systemd/system/wrenchd.service.d/mine.conf", "[Service]\nLimitRTPRIO=10\n");
    check(h.worst(), Health::failure, "LimitRTPRIO=10", "LimitRTPRIO=49");
  }
}

TEST_CASE("groups determine access to devices and arming", "[doctor]") {
  SECTION("a user outside the operators' group") {
    Healthy h;
    h.machine.groups = {"ann"};
    check(h.worst(), Health::warning, "ann is not in wrench", "usermod -aG wrench ann");
  }
  SECTION("a user in the service's group") {
    Healthy h;
    h.machine.groups = {"ann", "wrench", "wrenchd"};
    check(h.worst(), Health::failure, "ann is in wrenchd", "gpasswd -d ann wrenchd");
  }
  SECTION("a missing group") {
    Healthy h;
    h.dir.write("etc/group", "root:x:0:\nwrenchds:x:1:\n");
    check(h.worst(), Health::failure, "no group wrenchd", "groupadd --system wrenchd");
  }
}

TEST_CASE("missing or outdated udev rules are errors", "[doctor]") {
  const std::string cure = "wrenchctl udev-rules -o /etc/udev/rules.d/70-wrenchd.rules";
  SECTION("none") {
    Healthy h;
    std::filesystem::remove(h.dir.path() / "lib/udev/rules.d/70-wrenchd.rules");
    check(h.worst(), Health::failure, "udev rules: none, so only root can open a device", cure);
  }
  SECTION("outdated rules of an administrator") {
    Healthy h;
    h.dir.write("etc/udev/rules.d/70-wrenchd.rules", udev_rules(std::span(kShipped.profiles).first(2)));
    check(h.worst(), Health::failure, "/etc/udev/rules.d/70-wrenchd.rules lacks ", cure);
  }
}

TEST_CASE("inaccessible nodes, world-accessible nodes and autosuspend are errors", "[doctor]") {
  Healthy h;
  SECTION("group root") {
    h.machine.nodes[0].group = "root";
    check(h.worst(), Health::failure, "/dev/hidraw3 is of group root, mode 0660: the service cannot open it",
          "udevadm trigger");
  }
  SECTION("world-accessible") {
    h.machine.nodes[0].mode = 0666;
    check(h.worst(), Health::failure, "mode 0666: any user can apply force beyond all limits", "0666");
  }
  SECTION("autosuspend") {
    h.dir.write("sys/bus/usb/devices/3-1/power/control", "auto\n");
    check(h.worst(), Health::failure, "polhem in 3-1: autosuspend is on", "power/control");
  }
}

TEST_CASE("wake latency is compared with the tick period only if real time was granted", "[doctor]") {
  Healthy h;
  h.machine.wake_latency = WakeLatency{true, 5us, 300us, 2ms};
  check(h.worst(), Health::warning, "p50 5 us, p99.9 300 us, at most 2000 us, with SCHED_FIFO", "heavy");
  h.machine.wake_latency = WakeLatency{true, 5us, 1500us, 2ms};
  check(h.worst(), Health::failure, "p99.9 1500 us", "heavy");
  h.machine.wake_latency = WakeLatency{false, 5us, 1500us, 2ms};
  check(h.worst(), Health::warning, "without SCHED_FIFO", "run as root, or raise the limits above");
}

TEST_CASE("the wake latency is measured", "[doctor]") {
  const WakeLatency seen = measure_wake_latency(100ms);
  CHECK(seen.max > 0ns);
  CHECK(seen.p50 > 0ns);
  CHECK(seen.p50 <= seen.p999);
}

TEST_CASE("findings are printed as lines with their remedies", "[doctor]") {
  const std::vector<Finding> findings = {{Health::ok, "a: fine", ""},
                                         {Health::warning, "b: so so", "do c"},
                                         {Health::failure, "d: bad", "do e"}};
  CHECK(text(findings) ==
        "ok      a: fine\nwarning b: so so\n        -> do c\nERROR   d: bad\n        -> do e\n");
  CHECK(has_failure(findings));
}

TEST_CASE("wrenchctl doctor checks this machine; its exit code reports failures", "[doctor][wrenchctl]") {
  const ProgramResult result = run_program("wrenchctl", {"doctor"});
  INFO(result.out << result.err);
  CHECK(result.err == "");
  CHECK(has(result.out, "kernel: "));
  CHECK(has(result.out, "wake latency: p50 "));
  CHECK(result.exit_code == (has(result.out, "ERROR   ") ? 5 : 0));
}

}  // namespace
}  // namespace wrenchd::test_doctor
