// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/rendering.hpp"

#include <algorithm>
#include <bit>
#include <chrono>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>

#include "collision/obstacle_work.hpp"
#include "core/energy_law.hpp"

namespace wrenchd {
namespace {

/// Delay between a failed search for a feasible pose and the next search. It bounds the processor load, and
/// the hand moves little in this time.
constexpr Duration kRetryDelay = std::chrono::milliseconds(100);
/// Time limit of a warm-up, and the number of ticks that it executes.
constexpr auto kWarmUpLimit = std::chrono::milliseconds(50);
constexpr int kWarmUpTicks = 30;

/// Returns the scene. Throws std::invalid_argument if it has bodies and the settings do not support them:
/// bodies feel the spring of the energy law, whose wrench is the gradient of what the projection minimizes.
std::shared_ptr<const Scene> with_support_for_bodies(std::shared_ptr<const Scene> given,
                                                     const Settings& settings) {
  const Scene& scene = *given;
  if (scene.bodies().empty()) return given;
  const bool two_hands = scene.bodies().back().of_hand;
  const std::string what = two_hands ? "two hands act in the scene" : "the scene has free bodies";
  const std::string cure = two_hands ? "remove the [[hand]] table" : "remove the [[body]] tables";
  if (settings.rendering.method != Method::exact)
    throw std::invalid_argument(
        what + ", and only [rendering] method \"exact\" supports that; choose it, or " + cure);
  if (settings.wrench.law != SpringLaw::energy)
    throw std::invalid_argument(what + ", and only [wrench] law \"energy\" supports that; choose it, or " +
                                cure);
  if (settings.rendering.contacts == ContactBackend::cgal)
    throw std::invalid_argument(
        what + ", and only [rendering] contacts \"native\" supports that; choose it, or " + cure);
  return given;
}

/// FNV-1a over 64-bit words.
class Checksum64 {
 public:
  void add(std::uint64_t word) noexcept { sum_ = (sum_ ^ word) * 0x100000001b3U; }
  void add(double x) noexcept { add(std::bit_cast<std::uint64_t>(x)); }
  void add(const Vector3d& v) noexcept { add(v.x()), add(v.y()), add(v.z()); }
  void add(const Pose& X) noexcept {
    add(X.translation_m), add(Vector3d(X.rotation.vec())), add(X.rotation.w());
  }
  void add(const Matrix6d& K) noexcept {
    for (Eigen::Index i = 0; i < K.size(); ++i) add(K.data()[i]);
  }
  std::uint64_t value() const noexcept { return sum_; }

 private:
  std::uint64_t sum_ = 0xcbf29ce484222325U;
};

/// In a scene with bodies, BodyProxy and this proxy take turns, so both have the clearance of BodyProxy. They
/// take turns only if the tool has no friction.
PenetrationDepth::Options proxy_options(const Scene& scene, const Settings& settings) {
  const RenderingSettings& rendering = settings.rendering;
  PenetrationDepth::Options options{rendering.method,   rendering.planes,   0.0,
                                    rendering.friction, Proxy::WorkLimit{}, rendering.contacts};
  if (scene.bodies().empty()) return options;
  options.clearance_m = BodyWorld::kClearance_m;
  options.friction = {};
  return options;
}

}  // namespace

Rendering::Rendering(std::uint32_t id, const Settings& settings, const DeviceProfile& profile,
                     std::shared_ptr<const Scene> scene, std::shared_ptr<ProxyInitializer> proxy_initializer,
                     const SharedTool& shared)
    : id_(id),
      scene_(with_support_for_bodies(std::move(scene), settings)),
      proxy_initializer_(std::move(proxy_initializer)),
      X_HT_(settings.device.tool_in_handle.pose() * scene_->tool().X_MT()),
      M_(scene_->tool().solid.inertia),
      spring_law_(settings.wrench.law),
      energy_stiffness_per_s2_(settings.wrench.energy_stiffness_per_s2),
      gains_(gains_for(settings.rendering.method, settings.wrench.gains)),
      stability_(settings, profile, M_, X_HT_),
      penetration_(*scene_, proxy_options(*scene_, settings)),
      law_(gains_) {
  if (shared.world)
    bodies_.emplace(shared.world, shared.tool, *scene_);
  else if (!scene_->bodies().empty())
    bodies_.emplace(*scene_, settings.rendering.friction.dynamic_coefficient, settings.rendering.grasp);
  invalidate_proxy();
}

void Rendering::warm_up(const Pose& X_WH, double scene_time_s) {
  std::stop_source stop;
  const std::jthread time_limit([&stop](const std::stop_token& done) {
    const auto end = std::chrono::steady_clock::now() + kWarmUpLimit;
    while (!done.stop_requested() && std::chrono::steady_clock::now() < end)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    stop.request_stop();
  });
  const Pose X_WP = X_WH * X_HT_;
  Pose X_WQ = penetration_.query(X_WP, stop.get_token(), scene_time_s).projection.X_WQ;
  penetration_.clear_history(scene_time_s);
  for (int tick = 0; tick < kWarmUpTicks && !stop.stop_requested(); ++tick) {
    const Penetration depth = penetration_.follow(X_WP, X_WQ, scene_time_s);
    X_WQ = depth.projection.X_WQ;
    law_.update(depth.spring_displacement, depth.contacts > 0, 1e-3);
  }
  if (bodies_) {
    for (int tick = 0; tick < kWarmUpTicks && !stop.stop_requested(); ++tick)
      bodies_->move_without_tool(scene_time_s + 1e-3 * tick);
    bodies_->restart(scene_time_s);
  }
  checksum();
  invalidate_proxy();
}

/// The work of moving obstacles is the mean of its values at the beginning and at the end of the tick,
/// METHOD (69).
bool Rendering::project(const Pose& X_WH, TimePoint now, double scene_time_s) noexcept {
  X_WP_ = X_WH * X_HT_;
  if (!proxy_valid()) {
    if (bodies_) bodies_->move_without_tool(scene_time_s);
    initialize_proxy(now, scene_time_s);
    return true;
  }
  if (bodies_) {
    depth_ = follow_among_bodies(scene_time_s);
    X_WQ_ = depth_.projection.X_WQ;
    proxy_initialization_ = ProxyInitialization::complete;
    return true;
  }
  const double since_s =
      proxy_initialization_ == ProxyInitialization::complete ? scene_time_s_ : scene_time_s;
  obstacle_work_kg_m2_ = 0.5 * obstacle_work(depth_.projection, *scene_, since_s, scene_time_s);
  depth_ = penetration_.follow(X_WP_, X_WQ_, scene_time_s);
  if (scene_->has_moving_obstacles() && depth_.projection.status == ProjectionStatus::infeasible)
    return false;
  X_WQ_ = depth_.projection.X_WQ;
  obstacle_work_kg_m2_ += 0.5 * obstacle_work(depth_.projection, *scene_, since_s, scene_time_s);
  scene_time_s_ = scene_time_s;
  proxy_initialization_ = ProxyInitialization::complete;
  return true;
}

/// The first answer of a proxy has no work: the contacts have no force before it.
Penetration Rendering::follow_among_bodies(double scene_time_s) noexcept {
  const bool first = proxy_initialization_ != ProxyInitialization::complete;
  constexpr double kLeastStiffness_per_s2 = 1.0;  // a spring that is scaled to nothing still leads the tool
  const double stiffness_per_s2 = std::max(spring_scale_ * energy_stiffness_per_s2_, kLeastStiffness_per_s2);
  scene_time_s_ = scene_time_s;
  if (!first && bodies_->bodies_are_out_of_reach(X_WP_)) {
    if (!bodies_->tool_was_moved()) penetration_.clear_history(scene_time_s);
    obstacle_work_kg_m2_ = 0.0;
    const Penetration depth = penetration_.follow(X_WP_, X_WQ_, scene_time_s);
    bodies_->move_tool(X_WP_, depth.projection.X_WQ, stiffness_per_s2, scene_time_s);
    return depth;
  }
  const Penetration depth = bodies_->follow(X_WP_, stiffness_per_s2, scene_time_s);
  obstacle_work_kg_m2_ = first ? 0.0 : bodies_->work_kg_m2();
  return depth;
}

/// Repeats the tick for another pose of the hand.
void Rendering::follow_among_bodies_again() noexcept {
  depth_ = bodies_->follow_again(X_WP_);
  obstacle_work_kg_m2_ = bodies_->work_kg_m2();
  X_WQ_ = depth_.projection.X_WQ;
}

void Rendering::adopt_bodies(const Rendering& other) noexcept {
  if (bodies_ && other.bodies_ && scene_->shares_bodies_with(*other.scene_)) bodies_->adopt(*other.bodies_);
}

bool Rendering::move(const Pose& X_WH) noexcept {
  X_WP_before_ = X_WP_;
  X_WQ_before_ = X_WQ_;
  depth_before_ = depth_;
  X_WP_ = X_WH * X_HT_;
  if (proxy_initialization_ != ProxyInitialization::complete) return true;
  if (bodies_) {
    follow_among_bodies_again();
    return true;
  }
  depth_ = penetration_.follow(X_WP_, X_WQ_, scene_time_s_);
  if (scene_->has_moving_obstacles() && depth_.projection.status == ProjectionStatus::infeasible)
    return false;
  X_WQ_ = depth_.projection.X_WQ;
  return true;
}

void Rendering::undo_move() noexcept {
  X_WP_ = X_WP_before_;
  X_WQ_ = X_WQ_before_;
  if (bodies_) return follow_among_bodies_again();
  depth_ = depth_before_;
  penetration_.discard_contacts();
}

Wrench Rendering::spring_F_T() const noexcept {
  if (!in_contact()) return {};
  if (spring_law_ == SpringLaw::energy)
    return energy_wrench(M_, spring_scale_ * energy_stiffness_per_s2_, X_WP_, X_WQ_);
  const Vector6d F = spring_scale_ * (gains_.stiffness * depth_.spring_displacement);
  return {F.head<3>(), F.tail<3>()};
}

double Rendering::spring_potential_J() const noexcept {
  if (!in_contact()) return 0.0;
  if (spring_law_ == SpringLaw::energy)
    return 0.5 * spring_scale_ * energy_stiffness_per_s2_ * depth_.projection.energy;
  const Vector6d& eps = depth_.spring_displacement;
  return 0.5 * spring_scale_ * eps.dot(gains_.stiffness * eps);
}

/// Sends a request, or takes its result in a later tick. The result is near the hand pose at the time of the
/// request. It becomes q of this tick, and the next tick follows from it. The proxy then also makes up for
/// the obstacle motion since the request.
void Rendering::initialize_proxy(TimePoint now, double scene_time_s) noexcept {
  if (!request_pending_) {
    if (proxy_initialization_ == ProxyInitialization::failed && now < retry_at_) return;
    proxy_initialization_ = ProxyInitialization::searching;
    proxy_initializer_->request(
        {++request_id_, has_initial_guess_ ? X_WT_guess_ : X_WP_, scene_time_s, X_WB()});
    request_pending_ = true;
    return;
  }
  ProxyInitializationResult result;
  if (!proxy_initializer_->take_result(result) || result.id != request_id_)
    return;  // drops a result whose request invalidate_proxy() cancelled
  request_pending_ = false;
  starts_in_contact_ = has_initial_guess_;
  has_initial_guess_ = false;
  if (result.found && bodies_) result.found = bodies_->enter(result.X_WQ, result.X_WB, result.scene_time_s);
  proxy_initialization_ = result.found ? ProxyInitialization::found : ProxyInitialization::failed;
  X_WQ_ = result.X_WQ;
  penetration_.clear_history(result.scene_time_s);
  retry_at_ = now + kRetryDelay;
}

/// A proxy that was initialised from a guess may begin deep in contact. One update with a very long time step
/// then sets the derivative to zero, so that the initial depth does not count as velocity.
void Rendering::compute_wrench(double dt_s) noexcept {
  constexpr double kLongTime_s = 1e9;
  if (proxy_initialization_ == ProxyInitialization::complete && std::exchange(starts_in_contact_, false))
    law_.update_damping({}, depth_.spring_displacement, in_contact(), kLongTime_s);
  F_T_ = spring_law_ == SpringLaw::pid
             ? law_.update(depth_.spring_displacement, in_contact(), dt_s)
             : law_.update_damping(energy_wrench(M_, spring_scale_ * energy_stiffness_per_s2_, X_WP_, X_WQ_),
                                   depth_.spring_displacement, in_contact(), dt_s);
  const double scale = lag_limiter_.scale(depth_.projection.energy,
                                          depth_.projection.status == ProjectionStatus::budget_spent);
  F_T_ = {scale * F_T_.force_N, scale * F_T_.torque_Nm};
}

void Rendering::invalidate_proxy() noexcept {
  proxy_initialization_ = ProxyInitialization::searching;
  request_pending_ = false;
  has_initial_guess_ = starts_in_contact_ = false;
  penetration_.clear_history();
  if (bodies_) bodies_->leave();
  depth_ = Penetration{};
  depth_.projection.status = ProjectionStatus::infeasible;
  F_T_ = Wrench{};
  law_.reset();
  lag_limiter_.reset();
}

void Rendering::initialize_near(const Pose& X_WT) noexcept {
  has_initial_guess_ = true;
  X_WT_guess_ = X_WT;
}

void Rendering::set_stiffness_scale(const StiffnessScale& scale) noexcept {
  law_.scale(scale.spring, scale.damper);
  spring_scale_ = scale.spring;
}

Touches Rendering::contacts() const noexcept {
  if (in_contact() && bodies_ && !bodies_->tool_was_moved()) return bodies_->touches();
  return in_contact() ? touches(depth_.projection, *scene_, penetration_.uses_mesh_features()) : Touches{};
}

/// Half of force times displacement plus half of torque times rotation, METHOD (68).
double Rendering::stored_energy_J() const noexcept {
  if (!in_contact()) return 0.0;
  return 0.5 * (F_T_.force_N.dot(depth_.spring_displacement.head<3>()) +
                F_T_.torque_Nm.dot(depth_.spring_displacement.tail<3>()));
}

/// The ratio of stored energy to T converts the change of T [kg m^2] to work [J].
double Rendering::obstacle_work_J() const noexcept {
  const double T = depth_.projection.energy;
  return proxy_initialization_ == ProxyInitialization::complete && T > 0.0
             ? stored_energy_J() / T * obstacle_work_kg_m2_
             : 0.0;
}

std::uint64_t Rendering::checksum() const noexcept {
  constexpr std::size_t kMaxObstacles = 16;  // of each kind; bounds the time in a tick
  Checksum64 sum;
  sum.add(std::uint64_t{id_});
  sum.add(X_HT_);
  sum.add(M_.mass_kg);
  sum.add(energy_stiffness_per_s2_);
  sum.add(gains_.stiffness);
  sum.add(gains_.damping);
  const auto& half_spaces = scene_->half_spaces();
  sum.add(std::uint64_t{half_spaces.size()});
  for (std::size_t i = 0; i < std::min(kMaxObstacles, half_spaces.size()); ++i) {
    sum.add(half_spaces[i].normal_W);
    sum.add(half_spaces[i].offset_m);
  }
  const auto& meshes = scene_->meshes();
  sum.add(std::uint64_t{meshes.size()});
  for (std::size_t i = 0; i < std::min(kMaxObstacles, meshes.size()); ++i) {
    sum.add(meshes[i].X_WO);
    sum.add(meshes[i].motion.linear_m_per_s);
    sum.add(meshes[i].radius_m);
    sum.add(std::uint64_t{meshes[i].mesh->surface.triangles().size()});
  }
  return sum.value();
}

}  // namespace wrenchd
