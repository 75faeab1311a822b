// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/realtime.hpp"

#include <array>
#include <cerrno>
#include <cstring>

#include <malloc.h>
#include <pthread.h>
#include <sched.h>
#include <spdlog/spdlog.h>
#include <sys/mman.h>

namespace wrenchd {
namespace {

/// A tick uses less stack than this. Its deepest frames hold a few kilobytes of fixed-size matrices.
constexpr std::size_t kStackBytes = std::size_t{256} * 1024;

RealtimeGrant grant_of(std::string request, int error, const std::string& cure) {
  RealtimeGrant grant{std::move(request), error == 0, {}};
  if (error != 0) grant.cure = std::string(std::strerror(error)) + "; " + cure;
  return grant;
}

/// Returns the grants. Throws RealtimeError if `mode` is required and one of them is denied.
std::vector<RealtimeGrant> check_required(Realtime mode, std::vector<RealtimeGrant> grants) {
  if (mode != Realtime::required) return grants;
  std::string denied;
  for (const RealtimeGrant& grant : grants)
    if (!grant.granted) denied += "\n  " + grant.request + ": " + grant.cure;
  if (!denied.empty())
    throw RealtimeError("the kernel denied what realtime = \"required\" needs:" + denied +
                        "\n  or set realtime = \"best_effort\" under [servo] to run without it");
  return grants;
}

/// Writes to every page of the stack that a tick may use, so that no tick causes a page fault.
[[gnu::noinline]] void prefault_stack() {
  std::array<volatile unsigned char, kStackBytes> pages;
  for (std::size_t i = 0; i < pages.size(); i += 1024) pages[i] = 0;
}

}  // namespace

std::vector<RealtimeGrant> lock_memory(Realtime mode) {
  if (mode == Realtime::off) return {};
  mallopt(M_TRIM_THRESHOLD, -1);
  mallopt(M_MMAP_MAX, 0);
  const int error = mlockall(MCL_CURRENT | MCL_FUTURE) == 0 ? 0 : errno;
  return check_required(
      mode, {grant_of("memory locked", error, "raise the memlock limit (LimitMEMLOCK=, ulimit -l)")});
}

std::vector<RealtimeGrant> prepare_servo_thread(const ServoSettings& settings) {
  prefault_stack();
  pthread_setname_np(pthread_self(), "wrenchd-servo");
  if (settings.realtime == Realtime::off) return {};
  std::vector<RealtimeGrant> grants;
  sched_param priority{};
  priority.sched_priority = settings.priority;
  grants.push_back(grant_of("SCHED_FIFO priority " + std::to_string(settings.priority),
                            pthread_setschedparam(pthread_self(), SCHED_FIFO, &priority),
                            "raise the rtprio limit (LimitRTPRIO=, /etc/security/limits.d)"));
  if (settings.cpu >= 0) {
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    CPU_SET(static_cast<std::size_t>(settings.cpu), &cpus);
    grants.push_back(grant_of("servo thread on cpu " + std::to_string(settings.cpu),
                              pthread_setaffinity_np(pthread_self(), sizeof(cpus), &cpus),
                              "choose a cpu that this machine has"));
  }
  return check_required(settings.realtime, std::move(grants));
}

void log_grants(const std::vector<RealtimeGrant>& grants) {
  for (const RealtimeGrant& grant : grants) {
    if (grant.granted)
      spdlog::info("granted: {}", grant.request);
    else
      spdlog::warn("denied: {}: {}", grant.request, grant.cure);
  }
}

}  // namespace wrenchd
