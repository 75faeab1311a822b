// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/conform.hpp"

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <optional>
#include <stdexcept>

#include <spdlog/fmt/fmt.h>

#include "config/load_profile.hpp"
#include "config/settings.hpp"
#include "daemon/wall_clock.hpp"
#include "devices/links/hidraw_link.hpp"
#include "devices/links/link_settings.hpp"
#include "devices/links/socket_link.hpp"
#include "devices/links/usb_link.hpp"
#include "tools/connected_device.hpp"
#include "tools/end_signals.hpp"

namespace wrenchd {
namespace {

/// The session sends a command every millisecond. If this process is stopped for longer during a pulse, the
/// writer thread of the link sends zeros.
constexpr Duration kHostWatchdog = std::chrono::milliseconds(20);

const char* text(Judgement judgement) {
  return judgement == Judgement::pass ? "pass" : judgement == Judgement::fail ? "FAIL" : "not judged";
}

/// The end of the session releases the device, so nothing else may end or suspend the program.
void catch_signals() {
  catch_end_signals();
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGTSTP, SIG_IGN);  // a suspended process cannot release the device
}

/// The device under test, with the link to it.
struct Target {
  DeviceProfile profile;
  std::optional<UsbDevice> device;  ///< empty: a device in another process
  std::unique_ptr<ReportLink> link;
};

Target find_target(const ConformOptions& options) {
  Target target;
  if (options.link_fd >= 0) {
    if (options.profile == kAnyProfile)
      throw std::runtime_error(
          "--link-fd: wrenchctl cannot identify the device at the other end; name its profile, for example "
          "reference_full_speed");
    target.profile = load_profile_named(options.profile);
    target.link = std::make_unique<SocketLink>(options.link_fd, link_settings(target.profile, kHostWatchdog));
    return target;
  }
  const ConnectedDevice found = find_connected_device(options.profile, options.serial, options.hidraw_node);
  target.profile = found.profile;
  target.device = found.device;
  const LinkSettings settings = link_settings(found.profile, kHostWatchdog);
  if (found.profile.transport == Transport::libusb)
    target.link = std::make_unique<UsbLink>(found.device, settings);
  else
    target.link = std::make_unique<HidrawLink>(found.device, settings);
  return target;
}

}  // namespace

std::string conformance_text(std::span<const RuleResult> results) {
  std::string lines;
  for (const RuleResult& r : results) {
    lines += fmt::format("{:<10}  {:<20}  {}", text(r.judgement), r.rule, r.seen);
    if (r.judgement == Judgement::fail) lines += fmt::format(" (breaks devices/README.md, {})", r.section);
    lines += '\n';
  }
  const auto count = [results](Judgement wanted) {
    return std::count_if(results.begin(), results.end(),
                         [wanted](const RuleResult& r) { return r.judgement == wanted; });
  };
  return lines + fmt::format("{} rules passed, {} failed, {} could not be judged\n", count(Judgement::pass),
                             count(Judgement::fail), count(Judgement::not_judged));
}

bool run_conform(const ConformOptions& options) {
  catch_signals();
  const Target target = find_target(options);
  require_open_layout(target.profile);
  WallClock clock;
  const ConformanceUser user = {
      [](const std::string& instruction) { std::fprintf(stderr, "%s\n", instruction.c_str()); },
      end_requested};
  const auto results =
      check_conformance(target.profile, *target.link, target.device ? &*target.device : nullptr, clock, user,
                        {from_seconds(options.motion_s), options.pulses});
  std::fputs(conformance_text(results).c_str(), stdout);
  return std::none_of(results.begin(), results.end(),
                      [](const RuleResult& r) { return r.judgement == Judgement::fail; });
}

}  // namespace wrenchd
