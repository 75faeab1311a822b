// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/page_lease.hpp"

#include <exception>
#include <utility>

namespace wrenchd {
namespace {

using namespace std::chrono_literals;

constexpr auto kBeatEvery = 25ms;    ///< the daemon waits for 100
constexpr auto kAnswerWithin = 2s;   ///< or the lease is lost anyway
constexpr int kFadeLooks = 20;       ///< of the time between two beats: a fade takes 100 ms
constexpr auto kUntilArmed = 500ms;  ///< until the ticks tell of it

const char* name(PageLease::Wish wish) {
  switch (wish) {
    case PageLease::Wish::arm:
      return "arm";
    case PageLease::Wish::disarm:
      return "disarm";
    case PageLease::Wish::stop:
      return "stop";
    case PageLease::Wish::acknowledge:
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

bool is_over(const std::string& state) {
  return !is_armed(state) && state != "releasing";
}

}  // namespace

PageLease::PageLease(std::string socket, std::function<void(const Told&)> tell)
    : socket_(std::move(socket)), tell_(std::move(tell)) {
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  stop_thread_ = std::jthread([this](const std::stop_token& stop) { run_stops(stop); });
}

PageLease::~PageLease() {
  stop_thread_.request_stop();
  thread_.request_stop();
  stop_thread_.join();
  thread_.join();
}

void PageLease::ask(std::uint64_t page, Wish wish) {
  {
    const std::scoped_lock lock(mutex_);
    if (wish == Wish::stop)
      stops_.push_back(page);
    else
      asked_.push_back({page, wish});
  }
  changed_.notify_all();
}

void PageLease::lives(std::uint64_t page) noexcept {
  if (holder_.load() == page) lived_at_ns_.store(now_ns());
}

void PageLease::gone(std::uint64_t page) {
  {
    const std::scoped_lock lock(mutex_);
    std::erase_if(asked_, [page](const Asked& one) { return one.page == page; });
    if (holder_.load() == page) holder_gone_ = true;
  }
  changed_.notify_all();
}

void PageLease::loop_is(const std::string& state) {
  disarmed_.store(!is_armed(state));
}

Client& PageLease::client() {
  if (!client_) client_.emplace(socket_, kAnswerWithin);
  return *client_;
}

void PageLease::arm(std::uint64_t page) {
  const std::uint64_t other = holder_.load();
  if (other == page) return;  // it was pressed twice
  if (other != 0)
    throw ClientError(ClientError::kTaken, "Another page of this view has armed; disarm there first.");
  client().call("lease.take");
  lived_at_ns_.store(now_ns());
  holder_.store(page);
  armed_at_ = std::chrono::steady_clock::now();
  disarmed_.store(false);
  try {
    client().call("arm");
  } catch (const ClientError&) {
    let_go("");
    throw;
  }
}

/// The force fades, and others may arm. why: told to the page that held it; empty: it knows.
void PageLease::let_go(const std::string& why) {
  const std::uint64_t page = holder_.exchange(0);
  if (page == 0) return;
  try {
    client().call("disarm");
    // The lease is kept until the force has faded: to the daemon, one that ends before is a client that died.
    for (int i = 0; i < kFadeLooks && !is_over(client().state()); ++i) {
      client().beat();
      std::this_thread::sleep_for(kBeatEvery);
    }
    client().call("lease.give");
  } catch (const ClientError&) {
    client_.reset();  // a connection that ends takes the lease with it
  }
  if (!why.empty()) tell_({page, "lease", false, why});
}

void PageLease::fulfil(const Asked& asked) {
  Told told{asked.page, name(asked.wish), true, {}};
  try {
    switch (asked.wish) {
      case Wish::arm:
        arm(asked.page);
        break;
      case Wish::disarm:
        if (holder_.load() == 0)
          client().call("disarm");
        else
          let_go(asked.page == holder_.load() ? "" : "another page of this view disarmed");
        break;
      case Wish::acknowledge:
        client().call("acknowledge");
        break;
      case Wish::stop:
        break;
    }
  } catch (const ClientError& error) {
    told.done = false;
    told.text = error.what();
    if (error.code() > 0) {  // the connection, not the daemon's answer
      client_.reset();
      holder_.store(0);
    }
  }
  tell_(told);
}

void PageLease::run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    std::optional<Asked> asked;
    bool gone = false;
    {
      std::unique_lock lock(mutex_);
      changed_.wait_for(lock, stop, kBeatEvery, [this] { return !asked_.empty() || holder_gone_; });
      gone = std::exchange(holder_gone_, false);
      if (!asked_.empty()) {
        asked = asked_.front();
        asked_.pop_front();
      }
    }
    if (gone) let_go("the page was closed");
    const std::int64_t silent_ns = now_ns() - lived_at_ns_.load();
    if (holder_.load() != 0 && silent_ns > std::chrono::nanoseconds(kSilentPage).count())
      let_go("Disarmed: nobody has seen this page for a second. It was hidden, or it hung.");
    if (holder_.load() != 0 && disarmed_.load() && std::chrono::steady_clock::now() > armed_at_ + kUntilArmed)
      let_go("The daemon has disarmed; its state says why.");
    if (holder_.load() != 0) {
      try {
        client().beat();
      } catch (const ClientError& error) {
        client_.reset();
        tell_({holder_.exchange(0), "lease", false, error.what()});
      }
    }
    if (asked) fulfil(*asked);
  }
  let_go("");
}

void PageLease::run_stops(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    std::uint64_t page = 0;
    {
      std::unique_lock lock(mutex_);
      if (!changed_.wait(lock, stop, [this] { return !stops_.empty(); })) return;
      page = stops_.front();
      stops_.pop_front();
    }
    Told told{page, name(Wish::stop), true, {}};
    try {
      Client(socket_, kAnswerWithin).stop();
    } catch (const ClientError& error) {
      told.done = false;
      told.text = error.what();
    }
    tell_(told);
  }
}

}  // namespace wrenchd
