// SPDX-License-Identifier: GPL-3.0-or-later
#include <memory>
#include <sstream>

#include <catch2/catch.hpp>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include "core/clock.hpp"
#include "daemon/device_wait.hpp"

namespace wrenchd::test_device_wait {

namespace {

/// Captures the log during its lifetime.
class LogCapture {
 public:
  LogCapture() : before_(spdlog::default_logger()) {
    const auto logger =
        std::make_shared<spdlog::logger>("log", std::make_shared<spdlog::sinks::ostream_sink_mt>(text_));
    logger->set_pattern("%v");
    spdlog::set_default_logger(logger);
  }
  ~LogCapture() { spdlog::set_default_logger(before_); }
  LogCapture(const LogCapture&) = delete;
  LogCapture& operator=(const LogCapture&) = delete;
  std::string text() const { return text_.str(); }

 private:
  std::ostringstream text_;
  std::shared_ptr<spdlog::logger> before_;
};

TEST_CASE("waiting tries at once, then repeatedly without an event, until an attempt succeeds",
          "[device_wait]") {
  DeviceWait wait;
  int attempts = 0;
  CHECK(wait.until([&] { return ++attempts == 3; }, [] { return false; }));
  CHECK(attempts == 3);
}

TEST_CASE("waiting ends on a stop request, without another attempt", "[device_wait]") {
  DeviceWait wait;
  int attempts = 0, stop_checks = 0;
  CHECK_FALSE(wait.until(
      [&] {
        ++attempts;
        return false;
      },
      [&] { return ++stop_checks > 3; }));
  CHECK(attempts == 1);
}

TEST_CASE("an exception of an attempt ends the waiting", "[device_wait]") {
  DeviceWait wait;
  CHECK_THROWS_WITH(wait.until([]() -> bool { throw std::runtime_error("no node"); }, [] { return false; }),
                    "no node");
}

TEST_CASE("each rejected device is logged once, and once more after it is connected again", "[device_wait]") {
  DeviceWait wait;
  const LogCapture log;
  wait.log_rejected({"a", "b"});
  wait.log_rejected({"a", "b"});
  CHECK(log.text() == "a\nb\n");
  wait.log_rejected({"b"});
  wait.log_rejected({"a", "b"});
  CHECK(log.text() == "a\nb\na\n");
  wait.log_rejected({"\x1b[2J\nmine"});
  CHECK(log.text() == "a\nb\na\n?[2J?mine\n");
}

}  // namespace
}  // namespace wrenchd::test_device_wait
