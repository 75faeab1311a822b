// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/log_prefix.hpp"

#include <utility>

namespace wrenchd {
namespace {

thread_local std::string thread_prefix;

}  // namespace

LogPrefix::LogPrefix(const std::string& hand)
    : previous_(std::exchange(thread_prefix, hand.empty() ? std::string() : hand + ": ")) {}

LogPrefix::~LogPrefix() {
  thread_prefix = std::move(previous_);
}

const std::string& LogPrefix::current() noexcept {
  return thread_prefix;
}

}  // namespace wrenchd
