// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/log_prefix.hpp"

#include <utility>

namespace wrenchd {
namespace {

thread_local std::string prefix;

}  // namespace

LogPrefix::LogPrefix(const std::string& hand)
    : previous_(std::exchange(prefix, hand.empty() ? std::string() : hand + ": ")) {}

LogPrefix::~LogPrefix() {
  prefix = std::move(previous_);
}

const std::string& LogPrefix::current() noexcept {
  return prefix;
}

}  // namespace wrenchd
