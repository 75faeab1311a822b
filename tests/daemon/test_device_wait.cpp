// SPDX-License-Identifier: GPL-3.0-or-later
#include <memory>
#include <sstream>

#include <catch2/catch.hpp>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include "core/clock.hpp"
#include "daemon/device_wait.hpp"

namespace wrenchd {
namespace {

/// What is logged while it lives.
class Heard {
 public:
  Heard() : before_(spdlog::default_logger()) {
    const auto logger =
        std::make_shared<spdlog::logger>("heard", std::make_shared<spdlog::sinks::ostream_sink_mt>(text_));
    logger->set_pattern("%v");
    spdlog::set_default_logger(logger);
  }
  ~Heard() { spdlog::set_default_logger(before_); }
  Heard(const Heard&) = delete;
  Heard& operator=(const Heard&) = delete;
  std::string text() const { return text_.str(); }

 private:
  std::ostringstream text_;
  std::shared_ptr<spdlog::logger> before_;
};

TEST_CASE("waiting tries at once, then again without news, until it succeeds", "[device_wait]") {
  DeviceWait wait;
  int attempts = 0;
  CHECK(wait.until([&] { return ++attempts == 3; }, [] { return false; }));
  CHECK(attempts == 3);
}

TEST_CASE("waiting ends when it is time to stop, and tries no more", "[device_wait]") {
  DeviceWait wait;
  int attempts = 0, asked = 0;
  CHECK_FALSE(wait.until(
      [&] {
        ++attempts;
        return false;
      },
      [&] { return ++asked > 3; }));
  CHECK(attempts == 1);
}

TEST_CASE("what an attempt throws ends the waiting", "[device_wait]") {
  DeviceWait wait;
  CHECK_THROWS_WITH(wait.until([]() -> bool { throw std::runtime_error("no node"); }, [] { return false; }),
                    "no node");
}

TEST_CASE("what is plugged in instead is told once, and again when it comes again", "[device_wait]") {
  DeviceWait wait;
  const Heard heard;
  wait.log_rejected({"a", "b"});
  wait.log_rejected({"a", "b"});
  CHECK(heard.text() == "a\nb\n");
  wait.log_rejected({"b"});
  wait.log_rejected({"a", "b"});
  CHECK(heard.text() == "a\nb\na\n");
  wait.log_rejected({"\x1b[2J\nmine"});
  CHECK(heard.text() == "a\nb\na\n?[2J?mine\n");
}

}  // namespace
}  // namespace wrenchd
