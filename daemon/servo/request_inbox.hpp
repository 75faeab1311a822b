// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <optional>

#include "core/command.hpp"
#include "core/latest_value.hpp"
#include "core/limits.hpp"
#include "daemon/servo/external_wrench.hpp"
#include "daemon/servo/local_models.hpp"
#include "daemon/servo/rendering_exchange.hpp"
#include "daemon/servo/workspace.hpp"

namespace wrenchd {

/// Everything that was requested of the servo loop since the previous tick.
struct Requests {
  CommandSet commands = kNoCommand;
  std::optional<WorkspaceRequest> workspace;
  std::optional<LocalModelSet> local_models;
  std::optional<LimitSettings> limits;
  std::optional<ExternalWrenchRequest> external_wrench;
};

/// Where other threads put requests, and where each tick takes them. No thread ever waits: commands
/// accumulate as bits, of everything else the newest value counts.
///
/// Commands may come from any thread. Each set_...() and renderings() belongs to one thread at a time. All
/// members are RT-safe.
class RequestInbox {
 public:
  /// Requests these commands for the next tick.
  void request(CommandSet commands) noexcept { commands_.fetch_or(commands, std::memory_order_relaxed); }
  /// Requests these commands for the next tick and for every later one: the process is about to end.
  void request_for_good(CommandSet commands) noexcept {
    held_.fetch_or(commands, std::memory_order_relaxed);
    request(commands);
  }
  /// If `permitted` is false, take() drops requests to arm until arming is permitted again.
  void permit_arming(bool permitted) noexcept {
    arming_permitted_.store(permitted, std::memory_order_relaxed);
  }
  /// Arms on behalf of the process itself: no heartbeat is needed.
  void arm() noexcept { request(kArm); }
  /// Arms on behalf of a client that calls heartbeat() at least every 100 ms from now on.
  void arm_with_lease() noexcept { request(kArm | kLease | kHeartbeat); }
  void heartbeat() noexcept { request(kHeartbeat); }
  /// The connection of the client that armed with a lease has ended: the force fades now. Without a lease it
  /// does nothing.
  void client_lost() noexcept { request(kClientLost); }
  void disarm() noexcept { request(kDisarm); }
  /// Emergency stop.
  void stop() noexcept { request(kStop); }
  /// Acknowledges a latched fault or an emergency stop.
  void acknowledge() noexcept { request(kAcknowledge); }
  /// Invalidates the proxy, after a change of tool or scene. The contact wrench is zero until a feasible pose
  /// near the hand is found; then the soft start runs again. Arming does the same by itself.
  void reinitialize_proxy() noexcept { request(kReinitialize); }
  /// The tool holds the free body that it touches, or the first one that it will touch.
  void grasp() noexcept { request(kGrasp); }
  /// The tool lets go of the body that it holds, and holds none that it touches from now on.
  void let_go() noexcept { request(kLetGo); }
  /// A fault has released the other hand, which held the same body: this hand is released as well. RT-safe.
  void release_with_other_hand() noexcept { request(kOtherHandReleased); }

  /// Changes scale, clutch or centre of the workspace (daemon/servo/workspace.hpp) without a jump of the
  /// wrench.
  void set_workspace(const WorkspaceRequest& workspace) noexcept { workspace_.write(workspace); }
  /// Changes the limits. Tighter values hold from the next tick on; looser ones are ignored while the loop is
  /// armed.
  void set_limits(const LimitSettings& limits) noexcept { limits_.write(limits); }
  /// Replaces the whole set of local models. Ignored by profiles whose wrench is not about the handle.
  void set_local_models(const LocalModelSet& models) noexcept { local_models_.write(models); }
  /// Replaces the external wrench. Of two requests in one tick the older one is lost, with its energy.
  void set_external_wrench(const ExternalWrenchRequest& request) noexcept { external_wrench_.write(request); }
  /// Where another rendering is offered; the loop cross-fades to it.
  RenderingExchange& renderings() noexcept { return renderings_; }

  /// By the servo thread: takes everything requested since the previous call.
  Requests take() noexcept;

 private:
  std::atomic<CommandSet> commands_{kNoCommand};
  std::atomic<bool> arming_permitted_{true};
  std::atomic<CommandSet> held_{kNoCommand};  ///< requested for every tick
  LatestValue<WorkspaceRequest> workspace_;
  LatestValue<LocalModelSet> local_models_;
  LatestValue<LimitSettings> limits_;
  LatestValue<ExternalWrenchRequest> external_wrench_;
  RenderingExchange renderings_;
};

}  // namespace wrenchd
