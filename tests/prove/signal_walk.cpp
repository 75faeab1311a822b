// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/prove/signal_walk.hpp"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <memory>
#include <optional>
#include <thread>

#include <wrenchd/client.hpp>
#include <wrenchd/state_reader.hpp>

#include "tests/prove/abused_daemon.hpp"

namespace wrenchd::test {
namespace {

/// An armed daemon that gets a signal. The memory with its ticks outlives the daemon, so that the last tick
/// shows whether the hand was released.
class Signalled {
 public:
  Signalled(const std::string& program, const fs::path& config, const fs::path& directory, int signal)
      : signal_(signal),
        socket_(directory / ("signal-" + std::to_string(signal) + ".sock")),
        daemon_(program, {"--realtime", "off", "--arm", "--config", config, "--control", socket_},
                directory / ("signal-" + std::to_string(signal) + ".log")) {}

  /// Waits for force, and sends the signal. Returns false if the loop is not armed in time, or has latched a
  /// fault, as on a busy machine.
  bool send() try {
    const auto end = std::chrono::steady_clock::now() + 20s;
    while (!connected(socket_) && std::chrono::steady_clock::now() < end) std::this_thread::sleep_for(5ms);
    client_.emplace(socket_);
    reader_.emplace(client_->open_state());
    while (client_->state() != "active") {
      if (client_->state() == "fault" || std::chrono::steady_clock::now() > end) return false;
      std::this_thread::sleep_for(5ms);
    }
    daemon_.signal(signal_);
    return true;
  } catch (const ClientError&) {  // the daemon did not open its socket in time
    return false;
  }
  /// Waits until this time at most. Returns true if the daemon has ended.
  bool ends_before(std::chrono::steady_clock::time_point end) {
    return daemon_.ends_within(std::chrono::ceil<std::chrono::milliseconds>(
        std::max<std::chrono::nanoseconds>(end - std::chrono::steady_clock::now(), 2ms)));
  }
  /// Returns whether its last tick released the hand.
  bool released() {
    TickState newest;
    try {
      while (reader_->next(newest, 0ms)) {
      }
    } catch (const ClientError&) {  // the daemon has ended
    }
    return newest.state() == "shutdown" && newest.integer("released") == 1 &&
           newest.integer("motors_commanded") == 0;
  }
  int signal() const { return signal_; }

 private:
  int signal_;
  fs::path socket_;
  Daemon daemon_;
  std::optional<Client> client_;
  std::optional<StateReader> reader_;
};

}  // namespace

SignalWalk walk_signals(const std::string& program, const fs::path& config, const fs::path& directory) {
  constexpr std::size_t kAtOnce = 10;
  SignalWalk walk;
  std::vector<int> all;
  for (int signal = 1; signal <= SIGRTMAX; ++signal)
    if (signal != SIGKILL && signal != SIGSTOP && (signal <= SIGSYS || signal >= SIGRTMIN))
      all.push_back(signal);
  for (std::size_t begin = 0; begin < all.size(); begin += kAtOnce) {
    std::vector<std::unique_ptr<Signalled>> some;
    for (std::size_t i = begin; i < std::min(begin + kAtOnce, all.size()); ++i)
      some.push_back(std::make_unique<Signalled>(program, config, directory, all[i]));
    for (auto& one : some)
      if (!one->send()) one.reset(), ++walk.not_armed;
    const auto end = std::chrono::steady_clock::now() + 1s;
    for (auto& one : some) {
      if (!one) continue;
      ++walk.signals;
      if (!one->ends_before(end))
        ++walk.survived;
      else if (!one->released())
        walk.unreleased.push_back(one->signal());
    }
  }
  return walk;
}

}  // namespace wrenchd::test
