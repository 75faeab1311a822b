// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "daemon/servo/request_inbox.hpp"

namespace wrenchd::test_request_inbox {

TEST_CASE("commands accumulate until a tick takes them", "[request_inbox]") {
  RequestInbox inbox;
  inbox.arm_with_lease();
  inbox.stop();
  CHECK(inbox.take().commands == (kArm | kLease | kHeartbeat | kStop));
  CHECK(inbox.take().commands == kNoCommand);
  inbox.request_for_good(kQuit);
  CHECK(inbox.take().commands == kQuit);
  CHECK(inbox.take().commands == kQuit);
}

TEST_CASE("while arming is forbidden no request to arm reaches the loop, and all others do",
          "[request_inbox]") {
  RequestInbox inbox;
  inbox.permit_arming(false);
  inbox.arm();
  inbox.stop();
  CHECK(inbox.take().commands == kStop);
  inbox.request_for_good(kArm);
  CHECK(inbox.take().commands == kNoCommand);
  inbox.permit_arming(true);
  CHECK(inbox.take().commands == kArm);
}

}  // namespace wrenchd::test_request_inbox
