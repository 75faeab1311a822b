// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/thread_guard.hpp"

#include <exception>

#include <spdlog/spdlog.h>

namespace wrenchd {
namespace {

/// A step that fails each time logs the same error once in this time.
constexpr auto kRepeatAfter = std::chrono::seconds(60);

std::string text_of_exception() {
  try {
    throw;
  } catch (const std::exception& error) {
    return error.what();
  } catch (...) {
    return "an exception of unknown type";
  }
}

}  // namespace

void ThreadGuard::log_exception() noexcept {
  try {
    const std::string error = text_of_exception();
    const auto now = std::chrono::steady_clock::now();
    if (error == last_error_ && now - logged_at_ < kRepeatAfter) return;
    spdlog::error("{}: {}; the daemon continues without this step", thread_, error);
    last_error_ = error;
    logged_at_ = now;
  } catch (...) {  // no memory for the text: the next error may be logged
  }
}

}  // namespace wrenchd
