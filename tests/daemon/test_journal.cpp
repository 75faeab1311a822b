// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdlib>

#include <catch2/catch.hpp>
#include <sys/stat.h>
#include <unistd.h>

#include "core/fault.hpp"
#include "core/state.hpp"
#include "daemon/event_journal.hpp"
#include "daemon/journal.hpp"

namespace wrenchd::test_journal {

namespace {

std::string field(const JournalFieldList& fields, const std::string& name) {
  for (const auto& [key, value] : fields)
    if (key == name) return value;
  return "(none)";
}

JournalFieldList one(const std::string& name, const std::string& value) {
  return {std::pair(name, value)};
}

TEST_CASE("standard error is the journal if JOURNAL_STREAM names its file", "[journal]") {
  struct stat status {};
  REQUIRE(::fstat(STDERR_FILENO, &status) == 0);
  const std::string here = std::to_string(status.st_dev) + ":" + std::to_string(status.st_ino);
  ::unsetenv("JOURNAL_STREAM");
  CHECK_FALSE(stderr_is_journal());
  ::setenv("JOURNAL_STREAM", here.c_str(), 1);
  CHECK(stderr_is_journal());
  ::setenv("JOURNAL_STREAM", (here + "1").c_str(), 1);  // inherited, but standard error is redirected
  CHECK_FALSE(stderr_is_journal());
  ::unsetenv("JOURNAL_STREAM");
}

TEST_CASE("journal fields apply during their lifetime; the innermost replace the outer", "[journal]") {
  CHECK(JournalFields::current().empty());
  {
    const JournalFields outer(one("A", "1"));
    CHECK(field(JournalFields::current(), "A") == "1");
    {
      const JournalFields inner(one("B", "2"));
      CHECK(field(JournalFields::current(), "A") == "(none)");
      CHECK(field(JournalFields::current(), "B") == "2");
    }
    CHECK(field(JournalFields::current(), "A") == "1");
  }
  CHECK(JournalFields::current().empty());
}

TEST_CASE("an event has journal fields for its state, its fault and its time", "[journal]") {
  Event event;
  event.at = TimePoint(std::chrono::nanoseconds(1234));
  event.data = Event::FaultRaised{Fault::overspeed, 0.0};
  JournalFieldList fields = journal_fields(event);
  CHECK(field(fields, "MESSAGE_ID") == kFaultMessageId);
  CHECK(field(fields, "WRENCHD_FAULT") == "overspeed");
  CHECK(field(fields, "WRENCHD_CURE") == std::string(fault_row(Fault::overspeed).cure));
  CHECK(field(fields, "WRENCHD_TIME_NS") == "1234");

  event.data = Event::StateChanged{State::active, Fault::none};
  fields = journal_fields(event);
  CHECK(field(fields, "MESSAGE_ID") == kStateMessageId);
  CHECK(field(fields, "WRENCHD_STATE") == "active");
  CHECK(field(fields, "WRENCHD_FAULT") == "(none)");

  event.data = Event::ProxyFound{};
  CHECK(field(journal_fields(event), "MESSAGE_ID") == kRenderingMessageId);
}

TEST_CASE("the three message ids have 128 bits and differ", "[journal]") {
  for (const std::string id : {kStateMessageId, kFaultMessageId, kRenderingMessageId}) {
    CHECK(id.size() == 32);
    CHECK(id.find_first_not_of("0123456789abcdef") == std::string::npos);
  }
  CHECK(std::string(kStateMessageId) != kFaultMessageId);
  CHECK(std::string(kStateMessageId) != kRenderingMessageId);
  CHECK(std::string(kFaultMessageId) != kRenderingMessageId);
}

}  // namespace
}  // namespace wrenchd::test_journal
