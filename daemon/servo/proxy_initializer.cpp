// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/proxy_initializer.hpp"

#include <chrono>

namespace wrenchd {
namespace {

/// How often the thread looks for a question. To wake it the servo thread would have to call the kernel; and
/// beside the tenth of a second of calm that goes before any force, nobody feels this.
constexpr auto kPause = std::chrono::milliseconds(5);

/// Whatever the method of rendering is, the way back is the exact one; and it is clear of what it touches, so
/// that a proxy can follow from it.
constexpr PenetrationDepth::Options kNearest = {Method::exact, 47, Proxy::kClearance_m};

ProxyInitializationResult sought(PenetrationDepth& penetration, const ProxyInitializationRequest& question,
                                 const std::stop_token& stop) noexcept {
  const Projection q = penetration.query(question.X_WP, stop, question.scene_time_s).projection;
  return {question.id, q.status != ProjectionStatus::infeasible, q.X_WQ, question.scene_time_s};
}

}  // namespace

const char* name(ProxyInitialization placing) noexcept {
  switch (placing) {
    case ProxyInitialization::complete:
      return "following";
    case ProxyInitialization::searching:
      return "placing";
    case ProxyInitialization::found:
      return "placed";
    case ProxyInitialization::failed:
      return "no place";
  }
  return "unknown";
}

BackgroundProxyInitializer::BackgroundProxyInitializer(const Scene& scene)
    : penetration_(scene, kNearest), thread_([this](const std::stop_token& stop) { run(stop); }) {}

void BackgroundProxyInitializer::run(const std::stop_token& stop) noexcept {
  ProxyInitializationRequest question;
  while (!stop.stop_requested()) {
    if (request_.read(question))
      result_.write(sought(penetration_, question, stop));
    else
      std::this_thread::sleep_for(kPause);
  }
}

std::shared_ptr<ProxyInitializer> make_proxy_initializer(std::shared_ptr<const Scene> scene,
                                                         ProxySearchMode place_in) {
  const Scene& its = *scene;
  const auto with_scene = [&scene](auto placer) {
    // The scene goes after the placer that uses it.
    return std::shared_ptr<ProxyInitializer>(placer.release(),
                                             [scene = std::move(scene)](ProxyInitializer* p) { delete p; });
  };
  if (place_in == ProxySearchMode::in_tick) return with_scene(std::make_unique<InTickProxyInitializer>(its));
  return with_scene(std::make_unique<BackgroundProxyInitializer>(its));
}

InTickProxyInitializer::InTickProxyInitializer(const Scene& scene) : penetration_(scene, kNearest) {}

void InTickProxyInitializer::request(const ProxyInitializationRequest& question) noexcept {
  request_ = question;
  request_pending_ = true;
}

bool InTickProxyInitializer::take_result(ProxyInitializationResult& answer) noexcept {
  if (!request_pending_) return false;
  request_pending_ = false;
  answer = sought(penetration_, request_, {});
  return true;
}

}  // namespace wrenchd
