// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/request_inbox.hpp"

namespace wrenchd {
namespace {

template <class T>
std::optional<T> newest(LatestValue<T>& value) noexcept {
  std::optional<T> taken(std::in_place);
  if (!value.read(*taken)) taken.reset();
  return taken;
}

}  // namespace

Requests RequestInbox::take() noexcept {
  CommandSet commands = commands_.exchange(held_.load(std::memory_order_relaxed), std::memory_order_relaxed);
  if (!arming_permitted_.load(std::memory_order_relaxed)) commands &= ~CommandSet{kArm};
  return {commands, newest(workspace_), newest(local_models_), newest(limits_), newest(external_wrench_)};
}

}  // namespace wrenchd
