// SPDX-License-Identifier: GPL-3.0-or-later
#include <thread>

#include <catch2/catch.hpp>

#include "daemon/log_prefix.hpp"

namespace wrenchd::test_log_prefix {

TEST_CASE("log lines of a thread begin with the name of the hand as long as the prefix lives",
          "[log_prefix]") {
  CHECK(LogPrefix::current().empty());
  {
    const LogPrefix left("left");
    CHECK(LogPrefix::current() == "left: ");
    std::string elsewhere = "unset";
    std::thread([&elsewhere] { elsewhere = LogPrefix::current(); }).join();
    CHECK(elsewhere.empty());
    {
      const LogPrefix first("");  // the first hand has no name
      CHECK(LogPrefix::current().empty());
    }
    CHECK(LogPrefix::current() == "left: ");
  }
  CHECK(LogPrefix::current().empty());
}

}  // namespace wrenchd::test_log_prefix
