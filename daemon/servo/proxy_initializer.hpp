// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <thread>

#include "collision/penetration.hpp"
#include "collision/scene.hpp"
#include "core/latest_value.hpp"
#include "core/pose.hpp"

namespace wrenchd {

/// Where the proxy stands, as the servo loop knows it. While it is not following there is no contact force.
enum class ProxyInitialization : std::uint8_t {
  complete,   ///< q is this tick's, and follows the hand
  searching,  ///< there is no q: the admissible pose nearest to p is being looked for
  found,      ///< it was found and is q; the next fresh sample is followed from there
  failed,     ///< there is no q, and none was found: asked for again in a moment
};

/// "following", "placing", "placed", "no place".
const char* name(ProxyInitialization placing) noexcept;

/// Which admissible pose is nearest to p, with the obstacles where they stand at that scene time?
struct ProxyInitializationRequest {
  std::uint32_t id = 0;  ///< comes back with the answer
  Pose X_WP;
  double scene_time_s = 0.0;  ///< comes back as well: obstacles that move have gone on meanwhile
};

struct ProxyInitializationResult {
  std::uint32_t id = 0;
  bool found = false;         ///< false: no admissible pose was found, and X_WQ is not set
  Pose X_WQ;                  ///< admissible
  double scene_time_s = 0.0;  ///< at this scene time: the question's
};

/// Looks for the admissible pose from which the proxy may follow the hand, where there is no last one: at the
/// start, after arming, after the tool or the scene was changed. One question at a time; a new one takes the
/// place of the last.
class ProxyInitializer {
 public:
  virtual ~ProxyInitializer() = default;

  /// Hands the question over. RT safe: never waits.
  virtual void request(const ProxyInitializationRequest& question) noexcept = 0;
  /// Takes the newest answer, if there is one that was not taken yet. RT safe: never waits.
  virtual bool take_result(ProxyInitializationResult& answer) noexcept = 0;
};

/// Where the proxy's place is looked for when it is not known.
enum class ProxySearchMode : std::uint8_t {
  background,  ///< beside the servo loop
  in_tick,     ///< in the tick: virtual time, every run the same
};

/// Looks on a thread of its own, with the priority of the thread that makes it. For a search of any length.
class BackgroundProxyInitializer final : public ProxyInitializer {
 public:
  /// Starts at once. The scene is kept by reference and must outlive this.
  explicit BackgroundProxyInitializer(const Scene& scene);
  /// Ends a search that is under way, which takes a few milliseconds (Placement::nearest()), and joins.
  ~BackgroundProxyInitializer() override = default;

  void request(const ProxyInitializationRequest& question) noexcept override { request_.write(question); }
  bool take_result(ProxyInitializationResult& answer) noexcept override { return result_.read(answer); }

 private:
  void run(const std::stop_token& stop) noexcept;

  PenetrationDepth penetration_;  ///< belongs to the thread
  LatestValue<ProxyInitializationRequest> request_;
  LatestValue<ProxyInitializationResult> result_;
  std::jthread thread_;  ///< the last: it uses all of the above
};

/// Looks when the answer is asked for: in virtual time, where a search takes none and every run is to be the
/// same. Neither allocates nor locks, but takes its time.
class InTickProxyInitializer final : public ProxyInitializer {
 public:
  /// The scene is kept by reference and must outlive this.
  explicit InTickProxyInitializer(const Scene& scene);

  void request(const ProxyInitializationRequest& question) noexcept override;
  bool take_result(ProxyInitializationResult& answer) noexcept override;

 private:
  PenetrationDepth penetration_;
  ProxyInitializationRequest request_;
  bool request_pending_ = false;
};

/// One that keeps its scene.
std::shared_ptr<ProxyInitializer> make_proxy_initializer(std::shared_ptr<const Scene> scene,
                                                         ProxySearchMode place_in);

}  // namespace wrenchd
