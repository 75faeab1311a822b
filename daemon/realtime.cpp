// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/realtime.hpp"

#include <array>
#include <cerrno>
#include <cstring>

#include <malloc.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>

namespace wrenchd {
namespace {

/// More stack than a tick uses: its deepest frames are a few kilobytes of fixed-size matrices.
constexpr std::size_t kStackBytes = std::size_t{256} * 1024;

RealtimeGrant outcome(std::string what, int error, const std::string& cure) {
  RealtimeGrant grant{std::move(what), error == 0, {}};
  if (error != 0) grant.cure = std::string(std::strerror(error)) + "; " + cure;
  return grant;
}

std::vector<RealtimeGrant> required_or_told(Realtime mode, std::vector<RealtimeGrant> grants) {
  if (mode != Realtime::required) return grants;
  std::string refused;
  for (const RealtimeGrant& grant : grants)
    if (!grant.granted) refused += "\n  " + grant.request + ": " + grant.cure;
  if (!refused.empty())
    throw RealtimeError("the kernel refused what realtime = \"required\" asks for:" + refused +
                        "\n  or set realtime = \"best_effort\" under [servo] to run without");
  return grants;
}

/// Writes to every page of the stack that a tick may use, so that none is faulted in later.
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
  return required_or_told(
      mode, {outcome("memory locked", error, "raise the memlock limit (LimitMEMLOCK=, ulimit -l)")});
}

std::vector<RealtimeGrant> prepare_servo_thread(const ServoSettings& settings) {
  prefault_stack();
  pthread_setname_np(pthread_self(), "wrenchd-servo");
  if (settings.realtime == Realtime::off) return {};
  std::vector<RealtimeGrant> grants;
  sched_param priority{};
  priority.sched_priority = settings.priority;
  grants.push_back(outcome("SCHED_FIFO priority " + std::to_string(settings.priority),
                           pthread_setschedparam(pthread_self(), SCHED_FIFO, &priority),
                           "raise the rtprio limit (LimitRTPRIO=, /etc/security/limits.d)"));
  if (settings.cpu >= 0) {
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    CPU_SET(static_cast<std::size_t>(settings.cpu), &cpus);
    grants.push_back(outcome("servo thread on cpu " + std::to_string(settings.cpu),
                             pthread_setaffinity_np(pthread_self(), sizeof(cpus), &cpus),
                             "choose a cpu that this machine has"));
  }
  return required_or_told(settings.realtime, std::move(grants));
}

}  // namespace wrenchd
