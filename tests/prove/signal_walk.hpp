// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace wrenchd::test {

/// What armed daemons did when a signal came.
struct SignalWalk {
  long signals = 0;    ///< signals sent to armed daemons
  long survived = 0;   ///< daemons that ran on
  long not_armed = 0;  ///< daemons that were not armed in time, or had latched a fault
  /// Signals that ended a daemon which had not released the hand.
  std::vector<int> unreleased;
};

/// Sends every signal that can be handled to an armed daemon, a few daemons at a time. program: path of
/// wrenchd. config: its configuration, with which an armed loop is soon active. directory: for its files.
/// Throws std::system_error.
SignalWalk walk_signals(const std::string& program, const std::filesystem::path& config,
                        const std::filesystem::path& directory);

}  // namespace wrenchd::test
