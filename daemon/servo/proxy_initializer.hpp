// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <thread>

#include "collision/bodies/body_proxy.hpp"
#include "collision/penetration.hpp"
#include "collision/scene.hpp"
#include "core/contact_backend.hpp"
#include "core/latest_value.hpp"
#include "core/pose.hpp"

namespace wrenchd {

/// Progress of the proxy's initialization (core/METHOD.md, section 14.7). The contact force is zero unless
/// the value is `complete`.
enum class ProxyInitialization : std::uint8_t {
  complete,   ///< The proxy pose q follows the hand.
  searching,  ///< q is not valid. A search for the feasible pose nearest to p is under way.
  found,   ///< The search returned a feasible pose, which is q. Tracking starts with the next fresh sample.
  failed,  ///< q is not valid. The search found no feasible pose; the rendering retries after 100 ms.
};

/// Returns "complete", "searching", "found" or "failed". RT-safe.
const char* name(ProxyInitialization progress) noexcept;

/// Request for the feasible pose nearest to p.
struct ProxyInitializationRequest {
  std::uint32_t id = 0;       ///< Number of the request; the result repeats it.
  Pose X_WP;                  ///< Commanded pose p of the tool body.
  double scene_time_s = 0.0;  ///< Scene time at which the search places the obstacles.
  BodyPoses X_WB = {};        ///< Poses at which the search places the bodies of the scene.
};

/// Result of one request.
struct ProxyInitializationResult {
  std::uint32_t id = 0;       ///< Number of the request that this result answers.
  bool found = false;         ///< False if no feasible pose was found; X_WQ is then not set.
  Pose X_WQ;                  ///< Feasible pose of the tool body.
  double scene_time_s = 0.0;  ///< Scene time at which X_WQ is feasible; equals that of the request.
  BodyPoses X_WB = {};        ///< Poses of the bodies with which X_WQ is feasible; those of the request.
};

/// Searches the feasible pose nearest to a commanded pose.
class ProxySearch {
 public:
  /// Keeps a reference to `scene`, which must outlive this object. Not RT-safe: allocates.
  ProxySearch(const Scene& scene, ContactBackend contacts);

  /// Not RT-safe: takes milliseconds, and seconds inside a fine mesh. In a scene with bodies it allocates. A
  /// stop request ends it within a few milliseconds.
  ProxyInitializationResult find(const ProxyInitializationRequest& request, const std::stop_token& stop);

 private:
  const Scene& scene_;
  ContactBackend contacts_;
  PenetrationDepth penetration_;
};

/// Searches for a feasible pose from which the proxy can follow the hand. The rendering uses it after start,
/// after arming and after a change of tool or scene. Handles one request at a time; a new request replaces
/// the previous one.
class ProxyInitializer {
 public:
  virtual ~ProxyInitializer() = default;

  /// Submits a request and returns at once. RT-safe.
  virtual void request(const ProxyInitializationRequest& request) noexcept = 0;
  /// Copies the newest result to `result` and returns true, if a result arrived since the last call. RT-safe
  /// unless a derived class states otherwise.
  virtual bool take_result(ProxyInitializationResult& result) noexcept = 0;
};

/// Where the search for a feasible pose runs.
enum class ProxySearchMode : std::uint8_t {
  background,  ///< In a thread beside the servo loop.
  in_tick,     ///< In the tick that takes the result: for virtual time, so that every run is equal.
};

/// Runs the search in its own thread, which inherits the priority of the constructing thread.
class BackgroundProxyInitializer final : public ProxyInitializer {
 public:
  /// Starts the thread. Keeps a reference to `scene`, which must outlive this object. Not RT-safe: allocates.
  explicit BackgroundProxyInitializer(const Scene& scene, ContactBackend contacts = ContactBackend::native);
  /// Stops a running search and joins the thread. Not RT-safe: takes a few milliseconds.
  ~BackgroundProxyInitializer() override = default;

  /// RT-safe.
  void request(const ProxyInitializationRequest& request) noexcept override { request_.write(request); }
  /// RT-safe.
  bool take_result(ProxyInitializationResult& result) noexcept override { return result_.read(result); }

 private:
  void run(const std::stop_token& stop) noexcept;

  ProxySearch search_;  ///< Used by the search thread only.
  LatestValue<ProxyInitializationRequest> request_;
  LatestValue<ProxyInitializationResult> result_;
  std::jthread thread_;  ///< Declared last, because the thread uses all other members.
};

/// Runs the search inside take_result(). For virtual time, where the duration of a search does not count.
class InTickProxyInitializer final : public ProxyInitializer {
 public:
  /// Keeps a reference to `scene`, which must outlive this object. Not RT-safe: allocates.
  explicit InTickProxyInitializer(const Scene& scene, ContactBackend contacts = ContactBackend::native);

  /// RT-safe.
  void request(const ProxyInitializationRequest& request) noexcept override;
  /// Neither allocates nor locks, unless CGAL detects the contacts or the scene has bodies. Not RT-safe:
  /// takes milliseconds, and seconds inside a fine mesh.
  bool take_result(ProxyInitializationResult& result) noexcept override;

 private:
  ProxySearch search_;
  ProxyInitializationRequest request_;
  bool request_pending_ = false;
};

/// Returns an initializer for `mode` that shares ownership of `scene`. Not RT-safe: allocates.
std::shared_ptr<ProxyInitializer> make_proxy_initializer(std::shared_ptr<const Scene> scene,
                                                         ProxySearchMode mode,
                                                         ContactBackend contacts = ContactBackend::native);

}  // namespace wrenchd
