// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/page_calls.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

namespace wrenchd {
namespace {

using namespace std::chrono_literals;

constexpr auto kResponseTimeout = 5s;
constexpr auto kLoadTimeout =
    60s;  ///< response timeout of scene.load; a mesh of a million triangles takes long

constexpr std::array<std::string_view, 11> kMethods{
    "rendering.get", "rendering.set", "workspace.get", "workspace.set", "scene.get", "scene.load",
    "record.status", "record.start",  "record.stop",   "record.mark",   "status"};

}  // namespace

bool PageCalls::permits(std::string_view method) noexcept {
  return std::find(kMethods.begin(), kMethods.end(), method) != kMethods.end();
}

PageCalls::PageCalls(std::string socket, std::function<void(const Reply&)> on_reply)
    : socket_(std::move(socket)), on_reply_(std::move(on_reply)) {
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

void PageCalls::submit(Call call) {
  const std::uint64_t page = call.page, id = call.id;
  if (!permits(call.method))
    return on_reply_(
        {page,
         id,
         {},
         "The page may not call '" + call.method + "'; connect a client to the control socket."});
  {
    const std::scoped_lock lock(mutex_);
    if (pending_.size() < kMaxPending) {
      pending_.push_back(std::move(call));
      changed_.notify_all();
      return;
    }
  }
  on_reply_({page, id, {}, "The daemon has not replied to earlier requests yet; try again later."});
}

void PageCalls::run(const std::stop_token& stop) {
  while (true) {
    Call call;
    {
      std::unique_lock lock(mutex_);
      if (!changed_.wait(lock, stop, [this] { return !pending_.empty(); }) || stop.stop_requested()) return;
      call = std::move(pending_.front());
      pending_.pop_front();
    }
    on_reply_(execute(call));
  }
}

/// Returns the result as JSON text. scene.load has a connection of its own, because a connection has one
/// timeout.
std::string PageCalls::send(const Call& call) {
  if (call.method == "scene.load") return Client(socket_, kLoadTimeout).call(call.method, call.params.dump());
  if (!client_) client_.emplace(socket_, kResponseTimeout);
  return client_->call(call.method, call.params.dump());
}

PageCalls::Reply PageCalls::execute(const Call& call) {
  Reply reply{call.page, call.id, {}, {}};
  try {
    reply.result = Json::parse(send(call));
  } catch (const ClientError& error) {
    if (error.code() > 0) client_.reset();  // an error of the connection, not a response of the daemon
    reply.error = error.what();
  }
  return reply;
}

}  // namespace wrenchd
