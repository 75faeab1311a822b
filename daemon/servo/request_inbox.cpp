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
  return {commands_.exchange(held_.load(std::memory_order_relaxed), std::memory_order_relaxed),
          newest(workspace_), newest(local_models_), newest(limits_), newest(external_wrench_)};
}

}  // namespace wrenchd
