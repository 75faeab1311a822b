// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/prove/stop_latency.hpp"

#include <algorithm>
#include <chrono>
#include <limits>
#include <string>
#include <thread>

#include <wrenchd/client.hpp>

#include "core/transitions.hpp"
#include "tests/prove/other_user.hpp"

namespace wrenchd::test {
namespace {

using Clock = std::chrono::steady_clock;

/// Longest time until the loop is armed again, and until a stop has its effect.
constexpr auto kMostWait = 5s;

/// The other user: waits until the loop is active, and stops it. Reports the time of each request.
void stop_often(const fs::path& socket, int times, const OtherUser::Report& report) {
  Client client(socket);
  for (int i = 0; i < times; ++i) {
    for (const auto end = Clock::now() + kMostWait; client.state() != "active" && Clock::now() < end;)
      std::this_thread::sleep_for(10ms);
    const auto sent = Clock::now().time_since_epoch();
    client.stop();
    report(std::chrono::nanoseconds(sent).count());
    for (const auto end = Clock::now() + kMostWait; client.state() != "disarmed" && Clock::now() < end;)
      std::this_thread::sleep_for(10ms);
  }
}

/// Keeps the loop armed, and clears stops. Abuse may delay what it asks for, so any of it may fail.
void keep_armed(Client& client) try {
  const std::string state = client.state();
  if (state == "stopped" || state == "fault") client.acknowledge();
  if (state == "disarmed") client.arm();
  client.heartbeat();
} catch (const ClientError&) {
  try {
    client.acquire_lease();
  } catch (const ClientError&) {  // the next call tries again
  }
}

}  // namespace

std::vector<StopRequest> request_stops(const fs::path& socket, Abusers& abusers, int per_kind) {
  std::vector<StopRequest> requests;
  Client client(socket);
  for (std::size_t kind = 0; kind <= kAbuseNames.size(); ++kind) {
    kind < kAbuseNames.size() ? abusers.begin(kind) : abusers.begin();
    OtherUser user(kOtherUser,
                   [&](const OtherUser::Report& report) { stop_often(socket, per_kind, report); });
    for (bool ended = false; !ended;) {
      keep_armed(client);
      ended = user.has_ended();  // before its numbers are read, so that none is missed
      while (const auto sent_ns = user.next(10ms)) requests.push_back({kind, *sent_ns});
    }
    abusers.end();
  }
  return requests;
}

StopLatency stop_latency(const std::vector<StopRequest>& requests, std::size_t kind,
                         const std::vector<TickRecord>& ticks) {
  StopLatency result;
  std::vector<double> all_ms;
  for (const StopRequest& request : requests) {
    if (request.kind != kind) continue;
    ++result.stops;
    const auto tick = std::find_if(ticks.begin(), ticks.end(), [&](const TickRecord& one) {
      return one.now_ns >= request.sent_ns && one.state == static_cast<std::uint8_t>(State::stopped);
    });
    const double took_ms = tick == ticks.end() ? std::numeric_limits<double>::infinity()
                                               : 1e-6 * static_cast<double>(tick->now_ns - request.sent_ns);
    if (took_ms > std::chrono::duration<double, std::milli>(kMostWait).count())
      ++result.missed;
    else
      all_ms.push_back(took_ms);
  }
  std::sort(all_ms.begin(), all_ms.end());
  if (!all_ms.empty()) {
    result.p50_ms = all_ms[all_ms.size() / 2];
    result.max_ms = all_ms.back();
  }
  return result;
}

}  // namespace wrenchd::test
