// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "core/device_profile.hpp"
#include "daemon/live_line.hpp"

namespace wrenchd {

class ServoLoop;

/// Prints the state of the servo loop: on a terminal one line that it overwrites, elsewhere a line for every
/// fifth sample. Not RT-safe: prints. One thread.
class LiveView {
 public:
  using Print = std::function<void(std::string text)>;

  /// print: null prints nothing. terminal: the text goes to a terminal. hand: name of the second hand, before
  /// its lines; empty: the first hand.
  LiveView(Print print, bool terminal, const DeviceProfile& profile, const std::string& hand = {});

  /// Prints the newest tick record. Does nothing before the first tick, and for the second hand on a
  /// terminal: the one line there is that of the first hand.
  void sample(ServoLoop& loop);
  /// Prints the summary of the run. seconds: duration of the run.
  void close(const ServoLoop& loop, double seconds);

 private:
  Print print_;
  bool terminal_;
  ShownWrench shown_;
  std::string prefix_;  ///< "left: "
  std::uint64_t samples_ = 0;
};

}  // namespace wrenchd
