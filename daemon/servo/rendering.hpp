// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "collision/bodies/body_proxy.hpp"
#include "collision/penetration.hpp"
#include "collision/scene.hpp"
#include "collision/touch.hpp"
#include "config/settings.hpp"
#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/lag_limiter.hpp"
#include "core/wrench_law.hpp"
#include "daemon/servo/proxy_initializer.hpp"
#include "daemon/servo/stability_analysis.hpp"

namespace wrenchd {

/// One haptic rendering: a scene, the proxy that follows the hand in it, and the wrench law between hand and
/// proxy. Implements lines 2 to 7 of the paper, Algorithm 1. daemon/servo/README.md, section "Renderings".
///
/// Any thread builds a rendering. RenderingExchange then passes it to the servo thread and back. Frames:
/// core/README.md, section "Conventions".
class Rendering {
 public:
  /// id: number of the rendering in records; 0 is the rendering of the start. Throws std::invalid_argument if
  /// method or law do not support the scene or if the gains give no valid spring. shared: the tool's place in
  /// the world of two hands. Not RT-safe: allocates.
  Rendering(std::uint32_t id, const Settings& settings, const DeviceProfile& profile,
            std::shared_ptr<const Scene> scene, std::shared_ptr<ProxyInitializer> proxy_initializer,
            const SharedTool& shared = {});

  /// Executes all code of a tick near handle pose X_WH, which loads memory and caches, then invalidates the
  /// proxy. Not RT-safe: takes up to 50 ms and starts a thread.
  void warm_up(const Pose& X_WH, double scene_time_s);

  /// Computes p from the handle pose, then moves the proxy q from its last pose towards p. If no valid q
  /// exists, requests or takes a proxy initialization instead. Returns false if moving obstacles trap the
  /// proxy; the caller must then call invalidate_proxy(). RT-safe.
  bool project(const Pose& X_WH, TimePoint now, double scene_time_s) noexcept;
  /// Moves p of this tick to another handle pose, and q after it; the obstacles stay as in the last
  /// project(). Returns false if no admissible pose is left. Does nothing without a valid proxy. RT-safe.
  bool move(const Pose& X_WH) noexcept;
  /// Puts p and q back to where they were before the last move(). RT-safe.
  void undo_move() noexcept;
  /// Computes the body wrench for the poses of the last project(). dt_s: device time since the last call.
  /// RT-safe.
  void compute_wrench(double dt_s) noexcept;

  /// Discards q, sets the wrench to zero and starts a proxy initialization in the next tick. RT-safe.
  void invalidate_proxy() noexcept;
  /// In a world of two hands: the hand is gone, and its tool is in nobody's way. RT-safe.
  void leave_shared_world() noexcept {
    if (bodies_ && bodies_->shares_world()) invalidate_proxy();
  }
  /// Resets integral and derivative of the wrench law, for use after a gap of unknown length. RT-safe.
  void reset_law() noexcept { law_.reset(); }
  /// Starts the next proxy initialization near tool pose X_WT instead of p. Use it to keep the tool on that
  /// side of a wall on which another rendering has it. RT-safe.
  void initialize_near(const Pose& X_WT) noexcept;
  /// Returns true if X_WQ() holds a feasible pose. RT-safe.
  bool proxy_valid() const noexcept {
    return proxy_initialization_ == ProxyInitialization::complete ||
           proxy_initialization_ == ProxyInitialization::found;
  }
  ProxyInitialization proxy_initialization() const noexcept { return proxy_initialization_; }  ///< RT-safe.

  /// Sets the factors on the configured spring and damper. RT-safe.
  void set_stiffness_scale(const StiffnessScale& scale) noexcept;

  const Pose& X_WP() const noexcept { return X_WP_; }  ///< Commanded pose p of the tool body. RT-safe.
  /// Returns the proxy pose q of the tool body. Precondition: proxy_valid(). RT-safe.
  const Pose& X_WQ() const noexcept { return X_WQ_; }
  const Penetration& depth() const noexcept { return depth_; }      ///< Result of project(). RT-safe.
  bool in_contact() const noexcept { return depth_.contacts > 0; }  ///< RT-safe.
  /// Returns the poses of the free bodies of the scene. RT-safe.
  BodyPoses X_WB() const noexcept { return bodies_ ? bodies_->poses() : BodyPoses{}; }
  /// Takes over the motions of the bodies from another rendering of the same bodies. RT-safe.
  void adopt_bodies(const Rendering& other) noexcept;
  /// BodyProxy::set_grasp(); without effect in a scene without bodies. RT-safe.
  void set_grasp(bool wanted) noexcept {
    if (bodies_) bodies_->set_grasp(wanted);
  }
  /// Number of the body that the tool holds, from 1 in the order of the scene; 0: none. RT-safe.
  std::size_t held_body() const noexcept { return bodies_ ? bodies_->held_body() : 0; }
  /// True if the load of a held body was larger than the strength of the grasp in this tick. RT-safe.
  bool grasp_broke() const noexcept { return bodies_ && bodies_->grasp_broke(); }
  /// Returns the contacts that hold the proxy, at most kMaxTouches. RT-safe.
  Touches contacts() const noexcept;
  const Wrench& F_T() const noexcept { return F_T_; }  ///< Body wrench in axes of T at its origin. RT-safe.
  /// Returns the wrench of the spring alone at the poses of the last project() or move(), in axes of T at its
  /// origin, and its potential, METHOD (63): for the PID law 1/2 eps' K eps. RT-safe.
  Wrench spring_F_T() const noexcept;
  double spring_potential_J() const noexcept;
  /// Returns the energy stored in the spring [J], METHOD (68). RT-safe.
  double stored_energy_J() const noexcept;
  /// Returns the work of moving obstacles on the spring in this tick [J], METHOD (69). It is negative if the
  /// obstacles unload the spring. RT-safe.
  double obstacle_work_J() const noexcept;

  std::uint32_t id() const noexcept { return id_; }                           ///< RT-safe.
  const Scene& scene() const noexcept { return *scene_; }                     ///< RT-safe.
  const Pose& X_HT() const noexcept { return X_HT_; }                         ///< RT-safe.
  const StabilityAnalysis& stability() const noexcept { return stability_; }  ///< RT-safe.

  /// Returns a checksum of the constant inputs: id, tool, gains and the first obstacles of the scene. A tick
  /// that computes from other memory contents shows a different value. RT-safe.
  std::uint64_t checksum() const noexcept;

 private:
  void initialize_proxy(TimePoint now, double scene_time_s) noexcept;
  Penetration follow_among_bodies(double scene_time_s) noexcept;
  void follow_among_bodies_again() noexcept;

  // Constant after construction
  std::uint32_t id_;
  std::shared_ptr<const Scene> scene_;
  std::shared_ptr<ProxyInitializer> proxy_initializer_;
  Pose X_HT_;
  Inertia M_;
  SpringLaw spring_law_;
  double energy_stiffness_per_s2_;
  WrenchGains gains_;
  StabilityAnalysis stability_;

  PenetrationDepth penetration_;
  /// Follows the hand in a scene with bodies, unless they sleep out of reach; penetration_ does otherwise.
  std::optional<BodyProxy> bodies_;
  WrenchLaw law_;
  LagLimiter lag_limiter_;
  double spring_scale_ = 1.0;  ///< Factor on the configured stiffness.

  ProxyInitialization proxy_initialization_ = ProxyInitialization::searching;
  Pose X_WQ_;
  Pose X_WP_;
  Penetration depth_;
  Pose X_WP_before_, X_WQ_before_;  ///< Before the last move().
  Penetration depth_before_;
  Wrench F_T_;
  double scene_time_s_ = 0.0;         ///< Scene time at which depth_ was computed.
  double obstacle_work_kg_m2_ = 0.0;  ///< Change of T by moving obstacles in the last tick [kg m^2].
  bool has_initial_guess_ = false;    ///< True while X_WT_guess_ replaces p in the next request.
  Pose X_WT_guess_;                   ///< Tool pose near which the next search starts.
  bool starts_in_contact_ = false;    ///< True until the first wrench of a proxy that begins in contact.
  std::uint32_t request_id_ = 0;      ///< Number of the last request to proxy_initializer_.
  bool request_pending_ = false;      ///< True while the last request has no result.
  TimePoint retry_at_{};              ///< Earliest time of the next request after a failed search.
};

}  // namespace wrenchd
