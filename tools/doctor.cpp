// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/doctor.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <set>
#include <sstream>
#include <thread>
#include <utility>

#include <grp.h>
#include <pthread.h>
#include <pwd.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/files/opened_file.hpp"
#include "daemon/realtime.hpp"
#include "daemon/servo/loop_timing.hpp"
#include "daemon/version.hpp"
#include "daemon/wall_clock.hpp"
#include "devices/discovery/inspected_device.hpp"
#include "devices/discovery/match_profile.hpp"
#include "devices/discovery/usb_devices.hpp"
#include "tools/udev_rules.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

/// Acceptable p99.9 wake latency for a 1 kHz servo thread: a tenth of its period has no noticeable effect; a
/// whole period loses a tick.
constexpr Duration kGoodWakeLatency = std::chrono::microseconds(100);
constexpr Duration kBadWakeLatency = std::chrono::milliseconds(1);
constexpr std::uint64_t kServoPriority = 45;  ///< as in wrenchd.toml
constexpr std::uint64_t kLeastMemory_bytes = std::uint64_t{512} << 20U;
constexpr std::uint64_t kNoLimit = ~std::uint64_t{0};

constexpr const char* kGroup = "wrenchd";
constexpr const char* kOperators = "wrench";

Finding ok(std::string summary) {
  return {Health::ok, std::move(summary), {}};
}

/// Returns the text of a file without its line end; empty if the file cannot be read.
std::string content(const fs::path& file) {
  std::string text = read_file_if_readable(file).value_or("");
  while (!text.empty() && (text.back() == '\n' || text.back() == '\0')) text.pop_back();
  return text;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// Returns the first of these directories that contains the file.
std::optional<fs::path> first_of(const fs::path& root, std::initializer_list<const char*> directories,
                                 const std::string& name) {
  for (const char* directory : directories) {
    std::error_code ignored;
    if (fs::exists(root / directory / name, ignored)) return root / directory / name;
  }
  return {};
}

std::optional<fs::path> unit_file(const fs::path& root) {
  return first_of(root, {"etc/systemd/system", "lib/systemd/system", "usr/lib/systemd/system"},
                  "wrenchd.service");
}

// --- kernel and processors --------------------------------------------------------------------------------

Finding kernel(const MachineState& p) {
  const std::string release = content(p.root / "proc/sys/kernel/osrelease");
  if (content(p.root / "sys/kernel/realtime") == "1") return ok("kernel: " + release + ", PREEMPT_RT");
  return {Health::warning,
          "kernel: " + release + " is not PREEMPT_RT: it may wake the servo thread late under load",
          "apt install linux-image-rt-amd64, then boot that kernel"};
}

/// Further kernel options improve the latency by microseconds only, so this check ignores them.
Finding boot_options(const MachineState& p) {
  std::istringstream line(content(p.root / "proc/cmdline"));
  bool isolated = false, threaded = content(p.root / "sys/kernel/realtime") == "1";
  for (std::string word; line >> word;) {
    isolated = isolated || word.starts_with("isolcpus=");
    threaded = threaded || word == "threadirqs";
  }
  if (isolated && threaded) return ok("boot options: a processor is isolated, and interrupts run in threads");
  std::string summary = "boot options:", remedy;
  if (!isolated) {
    summary += " no processor is reserved for the servo thread";
    remedy =
        "isolcpus=N on the kernel command line and cpu = N in [servo], if at least two processors are "
        "available";
  }
  if (!threaded) {
    summary += std::string(isolated ? "" : ";") + " interrupts preempt the servo thread";
    remedy += std::string(remedy.empty() ? "" : "; ") +
              "threadirqs on the kernel command line, or a PREEMPT_RT kernel";
  }
  return {Health::warning, summary, remedy};
}

Finding governor(const MachineState& p) {
  std::set<std::string> others;
  int processors = 0, slow = 0;
  std::error_code error;
  for (fs::directory_iterator entry(p.root / "sys/devices/system/cpu", error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = content(entry->path() / "cpufreq/scaling_governor");
    if (name.empty()) continue;
    ++processors;
    if (name == "performance") continue;
    ++slow;
    others.insert(name);
  }
  if (processors == 0) return ok("governor: the kernel does not control the processor frequency");
  if (slow == 0) return ok("governor: performance on all " + std::to_string(processors) + " processors");
  std::string names;
  for (const std::string& name : others) names += (names.empty() ? "" : ", ") + name;
  return {Health::warning,
          "governor: " + names + " on " + std::to_string(slow) + " of " + std::to_string(processors) +
              " processors: they are slow when the servo thread wakes up",
          "cpupower frequency-set -g performance (package linux-cpupower)"};
}

Finding realtime_share(const MachineState& p) {
  const std::string text = content(p.root / "proc/sys/kernel/sched_rt_runtime_us");
  const long us = text.empty() ? -1 : std::atol(text.c_str());
  if (us < 0 || us >= 500000)
    return ok("real-time share: " +
              (us < 0 ? std::string("all processor time") : std::to_string(us / 10000) + " %"));
  return {Health::failure, "real-time share: only " + std::to_string(us / 10000) + " % of processor time",
          "sysctl -w kernel.sched_rt_runtime_us=950000"};
}

// --- limits -----------------------------------------------------------------------------------------------

std::string size_text(std::uint64_t bytes) {
  return bytes == kNoLimit ? "unlimited" : std::to_string(bytes >> 20U) + " MiB";
}

std::vector<Finding> user_limits(const MachineState& p) {
  if (p.is_root) return {ok("limits of " + p.user + ": root has none")};
  const std::string remedy =
      "none if wrenchd runs as a service; otherwise add a line to /etc/security/limits.d and log in again: " +
      p.user;
  std::vector<Finding> findings;
  if (p.rtprio_limit >= kServoPriority)
    findings.push_back(ok("real-time priority of " + p.user + ": up to " + std::to_string(p.rtprio_limit)));
  else
    findings.push_back({Health::warning,
                        "real-time priority of " + p.user + ": up to " + std::to_string(p.rtprio_limit) +
                            ", but the servo thread requires " + std::to_string(kServoPriority),
                        remedy + " - rtprio 49"});
  const std::string memory = "memory that " + p.user + " may lock: " + size_text(p.memlock_limit_bytes);
  if (p.memlock_limit_bytes >= kLeastMemory_bytes)
    findings.push_back(ok(memory));
  else
    findings.push_back({Health::warning, memory, remedy + " - memlock unlimited"});
  return findings;
}

/// Returns the value of a setting in a unit file and its drop-ins; the last one wins.
std::string setting(const MachineState& p, const fs::path& unit, const std::string& key) {
  std::vector<fs::path> files = {unit};
  std::vector<fs::path> more;
  std::error_code error;
  for (fs::directory_iterator entry(p.root / "etc/systemd/system/wrenchd.service.d", error), end;
       !error && entry != end; entry.increment(error))
    if (entry->path().extension() == ".conf") more.push_back(entry->path());
  std::sort(more.begin(), more.end());
  files.insert(files.end(), more.begin(), more.end());
  std::string value;
  for (const fs::path& file : files)
    for (const std::string& line : lines_of(content(file)))
      if (line.starts_with(key + "=")) value = line.substr(key.size() + 1);
  return value;
}

std::vector<Finding> service(const MachineState& p) {
  const auto unit = unit_file(p.root);
  if (!unit)
    return {{Health::warning,
             "service: wrenchd.service is not installed: wrenchd runs only after a manual start",
             "install the package: tools/package, then apt install ./build/package/wrenchd_*.deb"}};
  std::vector<Finding> findings;
  const std::string priority = setting(p, *unit, "LimitRTPRIO"), memory = setting(p, *unit, "LimitMEMLOCK");
  const std::string remedy = "systemctl edit wrenchd: in [Service], ";
  const bool may = priority == "infinity" || std::strtoul(priority.c_str(), nullptr, 10) >= kServoPriority;
  findings.push_back(may ? ok("service: LimitRTPRIO=" + priority)
                         : Finding{Health::failure,
                                   "service: LimitRTPRIO=" + priority + ", but the servo thread requires " +
                                       std::to_string(kServoPriority),
                                   remedy + "LimitRTPRIO=49"});
  findings.push_back(memory == "infinity"
                         ? ok("service: LimitMEMLOCK=infinity")
                         : Finding{Health::warning,
                                   "service: LimitMEMLOCK=" + memory + ": too little for a large mesh",
                                   remedy + "LimitMEMLOCK=infinity"});
  return findings;
}

// --- groups, rules and devices ----------------------------------------------------------------------------

bool has_group(const MachineState& p, const std::string& name) {
  for (const std::string& line : lines_of(content(p.root / "etc/group")))
    if (line.starts_with(name + ":")) return true;
  return false;
}

Finding groups(const MachineState& p) {
  if (!has_group(p, kGroup))
    return {unit_file(p.root) ? Health::failure : Health::warning,
            std::string("groups: there is no group ") + kGroup + ", which the udev rules require",
            std::string("install the package, which runs systemd-sysusers; or groupadd --system ") + kGroup};
  const auto in = [&p](const char* group) {
    return std::find(p.groups.begin(), p.groups.end(), group) != p.groups.end();
  };
  if (!p.is_root && in(kGroup))
    return {Health::failure,
            "groups: " + p.user + " is in " + kGroup + ", and can apply force beyond all limits",
            "gpasswd -d " + p.user + " " + kGroup + "; only the service belongs to this group"};
  if (p.is_root || in(kOperators)) return ok("groups: " + p.user + " may arm");
  return {Health::warning,
          "groups: " + p.user + " is not in " + kOperators + ", and may only observe and stop",
          "usermod -aG " + std::string(kOperators) + " " + p.user + ", and log in again"};
}

/// Returns the effective lines: no comments and no blank lines.
std::set<std::string> effective_lines(const std::string& rules) {
  std::set<std::string> lines;
  for (const std::string& line : lines_of(rules))
    if (!line.empty() && line[0] != '#') lines.insert(line);
  return lines;
}

Finding rules(const MachineState& p) {
  const auto file =
      first_of(p.root, {"etc/udev/rules.d", "run/udev/rules.d", "lib/udev/rules.d", "usr/lib/udev/rules.d"},
               "70-wrenchd.rules");
  const std::string remedy =
      "wrenchctl udev-rules -o /etc/udev/rules.d/70-wrenchd.rules, then udevadm trigger";
  if (!file)
    return {p.nodes.empty() && !unit_file(p.root) ? Health::warning : Health::failure,
            "udev rules: none, so only root can open a device", remedy};
  const std::string name = "/" + file->lexically_relative(p.root).string(), installed = content(*file);
  const std::set<std::string> there = effective_lines(installed);
  std::size_t missing = 0;
  const std::set<std::string> wanted = effective_lines(udev_rules(p.profiles));
  for (const std::string& line : wanted) missing += there.count(line) == 0 ? 1 : 0;
  if (missing > 0)
    return {Health::failure,
            "udev rules: " + name + " lacks " + std::to_string(missing) + " of the " +
                std::to_string(wanted.size()) + " rules for the profiles of wrenchd " + kVersion,
            remedy};
  return ok("udev rules: " + name + " covers all profiles");
}

std::vector<Finding> devices(const MachineState& p) {
  if (p.nodes.empty()) return {ok("devices: no device with a profile is connected")};
  std::vector<Finding> findings;
  for (const DeviceNode& node : p.nodes) {
    std::array<char, 8> mode{};
    std::snprintf(mode.data(), mode.size(), "%04o", node.mode);
    const std::string who =
        "device " + node.profile + ": " + node.node + " is of group " + node.group + ", mode " + mode.data();
    if (node.group != kGroup || (node.mode & 0060U) != 0060U)
      findings.push_back({Health::failure, who + ": the service cannot open it",
                          "correct the udev rules, then udevadm trigger, or reconnect the device"});
    else if ((node.mode & 0006U) != 0)
      findings.push_back({Health::failure, who + ": any user can apply force beyond all limits",
                          "find the rule that grants access: grep -l 0666 /etc/udev/rules.d/*"});
    else
      findings.push_back(ok(who));
    if (node.port_path.empty()) continue;
    const std::string control = content(p.root / "sys/bus/usb/devices" / node.port_path / "power/control");
    if (control == "auto")
      findings.push_back(
          {Health::failure, "device " + node.profile + " in " + node.port_path + ": autosuspend is on",
           "udevadm trigger, or: echo on > /sys/bus/usb/devices/" + node.port_path + "/power/control"});
    else if (!control.empty())
      findings.push_back(ok("device " + node.profile + " in " + node.port_path + ": autosuspend is off"));
  }
  return findings;
}

// --- wake latency
// -----------------------------------------------------------------------------------------

std::string us_text(Duration d) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.0f us", static_cast<double>(d.count()) / 1e3);
  return text.data();
}

Finding wake_latency_finding(const WakeLatency& measured) {
  const std::string summary = "wake latency: p50 " + us_text(measured.p50) + ", p99.9 " +
                              us_text(measured.p999) + ", at most " + us_text(measured.max) + ", " +
                              (measured.fifo ? "with" : "without") + " SCHED_FIFO";
  if (measured.p999 <= kGoodWakeLatency) return ok(summary);
  if (!measured.fifo)
    return {Health::warning, summary,
            "run as root, or raise the limits above, to measure the service's latency"};
  return {measured.p999 <= kBadWakeLatency ? Health::warning : Health::failure, summary,
          "apply the remedies above; stop other heavy programs; avoid virtual machines"};
}

}  // namespace

std::vector<Finding> check_machine(const MachineState& machine) {
  std::vector<Finding> all = {kernel(machine), boot_options(machine), governor(machine),
                              realtime_share(machine)};
  const auto add = [&all](std::vector<Finding> more) {
    all.insert(all.end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
  };
  add(user_limits(machine));
  add(service(machine));
  add({groups(machine), rules(machine)});
  add(devices(machine));
  if (machine.wake_latency) add({wake_latency_finding(*machine.wake_latency)});
  return all;
}

std::string text(std::span<const Finding> findings) {
  std::string text;
  for (const Finding& f : findings) {
    text += f.health == Health::ok ? "ok      " : f.health == Health::warning ? "warning " : "ERROR   ";
    text += f.summary + "\n";
    if (!f.cure.empty()) text += "        -> " + f.cure + "\n";
  }
  return text;
}

bool has_failure(std::span<const Finding> findings) noexcept {
  return std::any_of(findings.begin(), findings.end(),
                     [](const Finding& f) { return f.health == Health::failure; });
}

MachineState read_machine_state(std::vector<DeviceProfile> profiles) {
  MachineState p;
  const uid_t uid = ::geteuid();
  p.is_root = uid == 0;
  const passwd* const user = ::getpwuid(uid);
  p.user = user != nullptr ? user->pw_name : std::to_string(uid);
  std::vector<gid_t> ids(256);
  const int count = ::getgroups(static_cast<int>(ids.size()), ids.data());
  ids.resize(count > 0 ? static_cast<std::size_t>(count) : 0);
  for (const gid_t id : ids)
    if (const group* const g = ::getgrgid(id); g != nullptr) p.groups.emplace_back(g->gr_name);
  rlimit limit{};
  if (::getrlimit(RLIMIT_RTPRIO, &limit) == 0) p.rtprio_limit = limit.rlim_cur;
  if (::getrlimit(RLIMIT_MEMLOCK, &limit) == 0)
    p.memlock_limit_bytes = limit.rlim_cur == RLIM_INFINITY ? kNoLimit : limit.rlim_cur;
  p.profiles = std::move(profiles);
  for (const UsbDevice& device : list_usb_devices()) {
    const MatchResult match = match_profile(inspect_device(device).identity, p.profiles);
    if (!match.profile) continue;
    const DeviceProfile& profile = p.profiles[*match.profile];
    const std::string& node = profile.transport == Transport::libusb ? device.usb_node : device.hidraw_node;
    struct stat status {};
    if (node.empty() || ::stat(node.c_str(), &status) != 0) continue;
    const group* const g = ::getgrgid(status.st_gid);
    p.nodes.push_back({profile.name, node, device.port_path,
                       g != nullptr ? g->gr_name : std::to_string(status.st_gid), status.st_mode & 0777U});
  }
  return p;
}

WakeLatency measure_wake_latency(Duration for_so_long) {
  constexpr Duration kTick = std::chrono::milliseconds(1);
  WakeLatency measured;
  DurationHistogram late;
  std::thread([&] {
    sched_param priority{};
    priority.sched_priority = static_cast<int>(kServoPriority);
    measured.fifo = ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &priority) == 0;
    WallClock clock;
    const TimePoint end = clock.now() + for_so_long;
    for (TimePoint due = clock.now() + kTick; due < end; due = std::max(due, clock.now()) + kTick) {
      clock.sleep_until(due);
      late.add(std::max<Duration>(clock.now() - due, Duration::zero()));
    }
  }).join();
  measured.p50 = late.quantile(0.5);
  measured.p999 = late.quantile(0.999);
  measured.max = late.max();
  return measured;
}

}  // namespace wrenchd
