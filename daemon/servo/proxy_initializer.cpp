// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/proxy_initializer.hpp"

#include <chrono>

#include "collision/bodies/body_placement.hpp"

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

ProxySearch::ProxySearch(const Scene& scene, ContactBackend contacts)
    : scene_(scene), contacts_(contacts), penetration_(scene, search_options(contacts)) {}

/// The bodies stand still in the search, so they are obstacles.
ProxyInitializationResult ProxySearch::find(const ProxyInitializationRequest& request,
                                            const std::stop_token& stop) {
  const auto query = [&](PenetrationDepth& penetration) {
    const Projection q = penetration.query(request.X_WP, stop, request.scene_time_s).projection;
    return ProxyInitializationResult{request.id, q.status != ProjectionStatus::infeasible, q.X_WQ,
                                     request.scene_time_s, request.X_WB};
  };
  if (request.X_WB.empty()) return query(penetration_);
  const Scene obstacles = with_bodies_as_obstacles(scene_, {request.X_WB.begin(), request.X_WB.size()});
  PenetrationDepth among_bodies(obstacles, search_options(contacts_));
  return query(among_bodies);
}

BackgroundProxyInitializer::BackgroundProxyInitializer(const Scene& scene, ContactBackend contacts)
    : search_(scene, contacts), thread_([this](const std::stop_token& stop) { run(stop); }) {}

void BackgroundProxyInitializer::run(const std::stop_token& stop) noexcept {
  ProxyInitializationRequest request;
  while (!stop.stop_requested()) {
    if (request_.read(request))
      result_.write(search_.find(request, stop));
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
    : search_(scene, contacts) {}

void InTickProxyInitializer::request(const ProxyInitializationRequest& request) noexcept {
  request_ = request;
  request_pending_ = true;
}

bool InTickProxyInitializer::take_result(ProxyInitializationResult& result) noexcept {
  if (!request_pending_) return false;
  request_pending_ = false;
  result = search_.find(request_, {});
  return true;
}

}  // namespace wrenchd
