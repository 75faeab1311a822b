// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/proxy_initializer.hpp"

#include <chrono>

namespace wrenchd {
namespace {

/// Polling interval of the search thread. Polling avoids a system call in the servo thread. The delay is
/// small against the 100 ms of calm that precede any force.
constexpr auto kPollInterval = std::chrono::milliseconds(5);

/// The search always uses the exact method, whatever the method of the rendering. The clearance keeps the
/// result strictly feasible, so that a proxy can follow from it.
PenetrationDepth::Options search_options(ContactBackend contacts) {
  PenetrationDepth::Options options;
  options.method = Method::exact;
  options.clearance_m = Proxy::kClearance_m;
  options.contacts = contacts;
  return options;
}

ProxyInitializationResult find_feasible_pose(PenetrationDepth& penetration,
                                             const ProxyInitializationRequest& request,
                                             const std::stop_token& stop) noexcept {
  const Projection q = penetration.query(request.X_WP, stop, request.scene_time_s).projection;
  return {request.id, q.status != ProjectionStatus::infeasible, q.X_WQ, request.scene_time_s};
}

}  // namespace

const char* name(ProxyInitialization progress) noexcept {
  switch (progress) {
    case ProxyInitialization::complete:
      return "complete";
    case ProxyInitialization::searching:
      return "searching";
    case ProxyInitialization::found:
      return "found";
    case ProxyInitialization::failed:
      return "failed";
  }
  return "unknown";
}

BackgroundProxyInitializer::BackgroundProxyInitializer(const Scene& scene, ContactBackend contacts)
    : penetration_(scene, search_options(contacts)),
      thread_([this](const std::stop_token& stop) { run(stop); }) {}

void BackgroundProxyInitializer::run(const std::stop_token& stop) noexcept {
  ProxyInitializationRequest request;
  while (!stop.stop_requested()) {
    if (request_.read(request))
      result_.write(find_feasible_pose(penetration_, request, stop));
    else
      std::this_thread::sleep_for(kPollInterval);
  }
}

std::shared_ptr<ProxyInitializer> make_proxy_initializer(std::shared_ptr<const Scene> scene,
                                                         ProxySearchMode mode, ContactBackend contacts) {
  const Scene& borrowed = *scene;
  // The deleter owns the scene, so that the scene outlives the initializer that refers to it.
  const auto with_scene = [&scene](auto initializer) {
    return std::shared_ptr<ProxyInitializer>(initializer.release(),
                                             [scene = std::move(scene)](ProxyInitializer* p) { delete p; });
  };
  if (mode == ProxySearchMode::in_tick)
    return with_scene(std::make_unique<InTickProxyInitializer>(borrowed, contacts));
  return with_scene(std::make_unique<BackgroundProxyInitializer>(borrowed, contacts));
}

InTickProxyInitializer::InTickProxyInitializer(const Scene& scene, ContactBackend contacts)
    : penetration_(scene, search_options(contacts)) {}

void InTickProxyInitializer::request(const ProxyInitializationRequest& request) noexcept {
  request_ = request;
  request_pending_ = true;
}

bool InTickProxyInitializer::take_result(ProxyInitializationResult& result) noexcept {
  if (!request_pending_) return false;
  request_pending_ = false;
  result = find_feasible_pose(penetration_, request_, {});
  return true;
}

}  // namespace wrenchd
