// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/page_lease.hpp"

#include <exception>
#include <utility>

namespace wrenchd {
namespace {

using namespace std::chrono_literals;

constexpr auto kHeartbeatInterval = 25ms;  ///< heartbeat interval; the daemon's timeout is 100 ms
constexpr auto kLeaseTimeout = 2s;         ///< response timeout; after it the lease is lost anyway
constexpr int kFadeChecks = 20;            ///< in heartbeat intervals; a fade takes 100 ms
constexpr auto kArmedDelay = 500ms;        ///< time until the ticks show the new state

const char* name(PageLease::Request request) {
  switch (request) {
    case PageLease::Request::arm:
      return "arm";
    case PageLease::Request::disarm:
      return "disarm";
    case PageLease::Request::stop:
      return "stop";
    case PageLease::Request::acknowledge:
      return "acknowledge";
  }
  return "";
}

std::int64_t now_ns() {
  return std::chrono::steady_clock::now().time_since_epoch().count();
}

bool is_armed(const std::string& state) {
  return state == "waiting" || state == "ramping" || state == "active" || state == "degraded";
}

bool is_released(const std::string& state) {
  return !is_armed(state) && state != "releasing";
}

}  // namespace

PageLease::PageLease(std::string socket, std::function<void(const Reply&)> on_reply)
    : socket_(std::move(socket)), on_reply_(std::move(on_reply)) {
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  stop_thread_ = std::jthread([this](const std::stop_token& stop) { run_stops(stop); });
}

PageLease::~PageLease() {
  stop_thread_.request_stop();
  thread_.request_stop();
  stop_thread_.join();
  thread_.join();
}

void PageLease::submit(std::uint64_t page, Request request) {
  {
    const std::scoped_lock lock(mutex_);
    if (request == Request::stop)
      pending_stops_.push_back(page);
    else
      pending_.push_back({page, request});
  }
  changed_.notify_all();
}

void PageLease::heartbeat(std::uint64_t page) noexcept {
  if (holder_.load() == page) last_heartbeat_ns_.store(now_ns());
}

void PageLease::page_closed(std::uint64_t page) {
  {
    const std::scoped_lock lock(mutex_);
    std::erase_if(pending_, [page](const PendingRequest& one) { return one.page == page; });
    if (holder_.load() == page) holder_closed_ = true;
  }
  changed_.notify_all();
}

void PageLease::set_loop_state(const std::string& state) {
  disarmed_by_daemon_.store(!is_armed(state));
}

Client& PageLease::client() {
  if (!client_) client_.emplace(socket_, kLeaseTimeout);
  return *client_;
}

void PageLease::arm(std::uint64_t page) {
  const std::uint64_t other = holder_.load();
  if (other == page) return;  // the user pressed the button twice
  if (other != 0)
    throw ClientError(ClientError::kLeaseHeld,
                      "Another page of this view holds the lease; disarm on that page first.");
  client().call("lease.acquire");
  last_heartbeat_ns_.store(now_ns());
  holder_.store(page);
  armed_at_ = std::chrono::steady_clock::now();
  disarmed_by_daemon_.store(false);
  try {
    client().call("arm");
  } catch (const ClientError&) {
    release("");
    throw;
  }
}

/// Disarms and releases the lease. why: message to the page that held it; empty: no message.
void PageLease::release(const std::string& why) {
  const std::uint64_t page = holder_.exchange(0);
  if (page == 0) return;
  try {
    client().call("disarm");
    // Keeps the lease until the force is zero. The daemon treats a lease that ends before as a lost client.
    for (int i = 0; i < kFadeChecks && !is_released(client().state()); ++i) {
      client().heartbeat();
      std::this_thread::sleep_for(kHeartbeatInterval);
    }
    client().call("lease.release");
  } catch (const ClientError&) {
    client_.reset();  // the end of the connection also ends the lease
  }
  if (!why.empty()) on_reply_({page, "lease", false, why});
}

void PageLease::execute(const PendingRequest& request) {
  Reply reply{request.page, name(request.request), true, {}};
  try {
    switch (request.request) {
      case Request::arm:
        arm(request.page);
        break;
      case Request::disarm:
        if (holder_.load() == 0)
          client().call("disarm");
        else
          release(request.page == holder_.load() ? "" : "Another page of this view has disarmed.");
        break;
      case Request::acknowledge:
        client().call("acknowledge");
        break;
      case Request::stop:
        break;
    }
  } catch (const ClientError& error) {
    reply.accepted = false;
    reply.error = error.what();
    if (error.code() > 0) {  // an error of the connection, not a response of the daemon
      client_.reset();
      holder_.store(0);
    }
  }
  on_reply_(reply);
}

void PageLease::run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    std::optional<PendingRequest> request;
    bool closed = false;
    {
      std::unique_lock lock(mutex_);
      changed_.wait_for(lock, stop, kHeartbeatInterval,
                        [this] { return !pending_.empty() || holder_closed_; });
      closed = std::exchange(holder_closed_, false);
      if (!pending_.empty()) {
        request = pending_.front();
        pending_.pop_front();
      }
    }
    if (closed) release("The page was closed.");
    const std::int64_t silent_ns = now_ns() - last_heartbeat_ns_.load();
    if (holder_.load() != 0 && silent_ns > std::chrono::nanoseconds(kPageTimeout).count())
      release("Disarmed: this page was hidden or unresponsive for one second. Arm again if necessary.");
    if (holder_.load() != 0 && disarmed_by_daemon_.load() &&
        std::chrono::steady_clock::now() > armed_at_ + kArmedDelay)
      release("The daemon has disarmed; the state shows the cause.");
    if (holder_.load() != 0) {
      try {
        client().heartbeat();
      } catch (const ClientError& error) {
        client_.reset();
        on_reply_({holder_.exchange(0), "lease", false, error.what()});
      }
    }
    if (request) execute(*request);
  }
  release("");
}

void PageLease::run_stops(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    std::uint64_t page = 0;
    {
      std::unique_lock lock(mutex_);
      if (!changed_.wait(lock, stop, [this] { return !pending_stops_.empty(); })) return;
      page = pending_stops_.front();
      pending_stops_.pop_front();
    }
    Reply reply{page, name(Request::stop), true, {}};
    try {
      Client(socket_, kLeaseTimeout).stop();
    } catch (const ClientError& error) {
      reply.accepted = false;
      reply.error = error.what();
    }
    on_reply_(reply);
  }
}

}  // namespace wrenchd
