// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <optional>
#include <span>
#include <sstream>

#include <catch2/catch.hpp>
#include <fcntl.h>
#include <sys/wait.h>

#include "tests/support/control_rig.hpp"
#include "tests/support/rate_check.hpp"
#include "tests/support/soon.hpp"

namespace wrenchd::test_control_socket {

namespace {

/// A sanitizer keeps freed memory, and makes the socket's thread too slow for heartbeats.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

using namespace test;
using namespace std::chrono_literals;

int code_of(RpcCode code) {
  return static_cast<int>(code);
}

std::string request(const std::string& method, const std::string& params = "{}",
                    const std::string& id = "1") {
  return R"({"jsonrpc":"2.0","id":)" + id + R"(,"method":")" + method + R"(","params":)" + params + "}\n";
}

/// Returns the error code in the next line; 0 if the line has no error, -1 if no line came.
int next_code(RigClient& client) {
  const auto line = client.read_line();
  if (!line) return -1;
  const Json reply = Json::parse(*line, nullptr, false);
  return reply.is_object() && reply.contains("error") ? reply["error"]["code"].get<int>() : 0;
}

bool disconnects(RigClient& client) {
  while (client.read_line(2000ms)) {
  }
  return client.closed_by_peer();
}

std::size_t open_descriptors() {
  std::size_t count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) ++count;
  return count;
}

double resident_MB() {
  std::ifstream statm("/proc/self/statm");
  double size = 0.0, resident = 0.0;
  statm >> size >> resident;
  return resident * static_cast<double>(getpagesize()) / 1e6;
}

/// Sends a request with ancillary data of this type attached.
void send_with_control(const RigClient& client, const std::string& method, int type,
                       std::span<const std::byte> data) {
  std::vector<char> control(CMSG_SPACE(data.size()));
  std::string bytes = request(method);
  iovec part{bytes.data(), bytes.size()};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  cmsghdr* header = CMSG_FIRSTHDR(&message);
  header->cmsg_level = SOL_SOCKET;
  header->cmsg_type = type;
  header->cmsg_len = CMSG_LEN(data.size());
  std::memcpy(CMSG_DATA(header), data.data(), data.size());
  ::sendmsg(client.fd(), &message, MSG_NOSIGNAL | MSG_DONTWAIT);
}

/// Sends a request with open files attached.
void send_files(const RigClient& client, int count) {
  const OwnedFd file(::open("/dev/null", O_RDONLY | O_CLOEXEC));
  const std::vector<int> files(static_cast<std::size_t>(count), file.get());
  send_with_control(client, "status", SCM_RIGHTS, std::as_bytes(std::span(files)));
}

/// Sends a request with the credentials of root attached.
void claim_root(const RigClient& client) {
  const std::array<ucred, 1> root{{{getpid(), geteuid(), getegid()}}};
  send_with_control(client, "lease.acquire", SCM_CREDENTIALS, std::as_bytes(std::span(root)));
}

/// An attempt to misuse the socket, which must have no effect on others.
struct Abuse {
  std::string name;
  std::function<void(ControlRig&)> run;
};

/// Sends one line and checks the error code of its response.
Abuse line_of(const std::string& name, const std::string& line, RpcCode code,
              TestUser who = TestUser::observer) {
  return {name, [=](ControlRig& rig) {
            RigClient client = rig.connect(who);
            client.send(line);
            CHECK(next_code(client) == code_of(code));
            CHECK(client.error_code("status") == 0);  // the connection stays open
          }};
}

Abuse forbidden(const std::string& method) {
  return line_of("observer requests " + method, request(method), RpcCode::permission_denied);
}

void flood(RigClient& client, const std::string& line, int lines) {
  for (int i = 0; i < lines && client.send(line); ++i) {
  }
}

std::vector<Abuse> abuses() {
  const std::string nested(30000, '[');
  std::vector<Abuse> table = {
      forbidden("arm"),
      forbidden("disarm"),
      forbidden("lease.acquire"),
      forbidden("lease.release"),
      forbidden("lease.heartbeat"),
      forbidden("acknowledge"),
      forbidden("reinitialize_proxy"),
      forbidden("grasp"),
      forbidden("let_go"),
      line_of("no such method", request("sudo"), RpcCode::method_not_found),
      line_of("a method with a path in it", request("../../stop"), RpcCode::method_not_found),
      line_of("a method of 60 kB", request(std::string(60000, 'm')), RpcCode::method_not_found),
      line_of("a role in the parameters", request("arm", R"({"role":"administrator"})"),
              RpcCode::permission_denied),
      line_of("a uid in the request",
              R"({"jsonrpc":"2.0","id":1,"method":"arm","uid":0})"
              "\n",
              RpcCode::invalid_request),
      line_of("operator arms without the lease", request("arm"), RpcCode::invalid_state, TestUser::operator_),
      line_of("operator sends a heartbeat without the lease", request("lease.heartbeat"),
              RpcCode::invalid_state, TestUser::operator_),
      line_of("operator releases a lease that it does not hold", request("lease.release"),
              RpcCode::invalid_state, TestUser::operator_),
      line_of("operator preempts the lease", request("lease.acquire", R"({"preempt":true})"),
              RpcCode::permission_denied, TestUser::operator_),
      line_of("a batch with stop in it", "[" + request("stop").substr(0, request("stop").size() - 1) + "]\n",
              RpcCode::invalid_request),
      line_of("another version",
              R"({"jsonrpc":"1.0","id":1,"method":"stop"})"
              "\n",
              RpcCode::invalid_request),
      line_of("no version",
              R"({"id":1,"method":"stop"})"
              "\n",
              RpcCode::invalid_request),
      line_of("two methods",
              R"({"jsonrpc":"2.0","id":1,"method":"status","method":"stop"})"
              "\n",
              RpcCode::parse_error),
      line_of("a zero byte", std::string("{\"jsonrpc\":\"2.0\",\0\"id\":1,\"method\":\"stop\"}\n", 42),
              RpcCode::parse_error),
      line_of("a zero byte behind the request", request("stop").insert(request("stop").size() - 1, 1, '\0'),
              RpcCode::parse_error),
      line_of("bytes that are not UTF-8", request("stop", "{\"a\":\"\xff\xfe\"}"), RpcCode::parse_error),
      line_of("surrogates", request("stop", R"({"a":"\ud800"})"), RpcCode::parse_error),
      line_of("30,000 nested arrays", request("stop", "{\"a\":" + nested), RpcCode::parse_error),
      line_of("a huge id", request("stop", "{}", "99999999999999999999999"), RpcCode::invalid_request),
      line_of("an id of 60 kB", request("stop", "{}", '"' + std::string(60000, 'i') + '"'),
              RpcCode::invalid_request),
      line_of("an id that is an object", request("stop", "{}", "{}"), RpcCode::invalid_request),
      line_of("a number outside the range of double", request("stop", R"({"a":1e999})"),
              RpcCode::parse_error),
      line_of("parameters without names", request("stop", "[1]"), RpcCode::invalid_params),
      line_of("parameters that stop does not have", request("stop", R"({"softly":true})"),
              RpcCode::invalid_params),
      line_of("an empty line", "\n", RpcCode::parse_error),
      line_of("60 kB of blanks", std::string(60000, ' ') + "\n", RpcCode::parse_error),
      line_of("another protocol", "GET / HTTP/1.1\r\n", RpcCode::parse_error),
      line_of("an unknown event name", request("subscribe", R"({"events":["everything"]})"),
              RpcCode::invalid_params),
      {"half a line, then disconnects",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::operator_);
         client.send(request("lease.acquire").substr(0, 40));
         client.disconnect();
       }},
      {"a request without its end, then disconnects",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::observer);
         std::string stop = request("stop");
         stop.pop_back();
         client.send(stop);
         client.disconnect();
         std::this_thread::sleep_for(50ms);
       }},
      {"a byte at a time",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::observer);
         for (const char byte : request("status")) {
           client.send(std::string_view(&byte, 1));
           std::this_thread::sleep_for(1ms);
         }
         CHECK(next_code(client) == 0);
       }},
      {"a line without end",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::observer);
         client.send(std::string(kMaxLineBytes + 4096, 'x'));
         CHECK(next_code(client) == code_of(RpcCode::parse_error));
         CHECK(disconnects(client));
       }},
      {"a line of 100 MB",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::observer);
         const std::string piece(std::size_t{1} << 16, '{');
         const double before_MB = resident_MB();
         int pieces = 0;
         while (pieces < 1600 && client.send(piece)) ++pieces;
         CHECK(pieces < 100);
         if (!kSanitized) CHECK(resident_MB() - before_MB < 20.0);
       }},
      {"a forbidden request before an endless line",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::observer);
         client.send(request("arm") + std::string(200000, 'y'));
         CHECK(next_code(client) == code_of(RpcCode::permission_denied));
       }},
      {"strangers",
       [](ControlRig& rig) {
         for (int i = 0; i < 100; ++i) {
           RigClient client = rig.connect(TestUser::stranger);
           client.send(request("stop"));
           if (i > 0) continue;
           CHECK(next_code(client) == code_of(RpcCode::permission_denied));
           CHECK(disconnects(client));
         }
       }},
      {"a thousand connections",
       [](ControlRig& rig) {
         for (int i = 0; i < 1000; ++i) rig.connect(TestUser::observer);
       }},
      {"more open connections of one user than the limit",
       [](ControlRig& rig) {
         RigClient same(rig.path(), 7000U), other = rig.connect(TestUser::observer);
         CHECK(same.error_code("status") == 0);
         std::vector<RigClient> kept;
         for (int i = 0; i < 100; ++i) kept.emplace_back(rig.path(), 7000U);
         CHECK(kept.back().error_code("status") == 0);
         CHECK(same.error_code("status") == 0);   // a connection in use is kept
         CHECK(other.error_code("status") == 0);  // so is every connection of another user
         CHECK(rig.connect(TestUser::operator_).error_code("status") == 0);
       }},
      {"a flood of requests whose responses are not read",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::observer);
         flood(client, request("describe"), 3000);
         CHECK(rig.connect(TestUser::observer).error_code("status") == 0);
       }},
      {"a flood of invalid lines",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::observer);
         flood(client, "\x01\x02}{][\"\\\n", 20000);
       }},
      {"a flood of notifications that are not allowed",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::observer);
         flood(client, "{\"jsonrpc\":\"2.0\",\"method\":\"arm\"}\n", 5000);
         flood(client, "{\"jsonrpc\":\"2.0\",\"method\":\"lease.acquire\"}\n", 100);
       }},
      {"a subscriber that never reads",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::observer);
         client.send(request("subscribe"));
         const double before_MB = resident_MB();
         for (int i = 0; i < 20000; ++i)
           rig.feed().emit("log", EventLevel::info, "noise " + std::string(200, 'n'));
         if (!kSanitized) CHECK(resident_MB() - before_MB < 20.0);
       }},
      {"subscribes and unsubscribes repeatedly",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::observer);
         flood(client, request("subscribe") + request("unsubscribe"), 300);
       }},
      {"20,000 names to subscribe to",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::observer);
         std::string names = "\"state\"";
         while (names.size() < 60000) names += ",\"state\"";
         client.send(request("subscribe", "{\"events\":[" + names + "]}"));
         CHECK(next_code(client) == 0);
       }},
      {"open files attached to the request",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::observer);
         for (int i = 0; i < 20; ++i) send_files(client, 100);
         for (int i = 0; i < 20; ++i) CHECK(next_code(client) == 0);
       }},
      {"credentials attached to the request",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::observer);
         claim_root(client);
         CHECK(next_code(client) == code_of(RpcCode::permission_denied));
       }},
      {"bytes out of band",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::observer);
         for (int i = 0; i < 10; ++i) {
           ::send(client.fd(), "!", 1, MSG_OOB | MSG_NOSIGNAL | MSG_DONTWAIT);
           client.send(request("status"));
         }
       }},
      {"shuts down its reading side, and sends more requests",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::observer);
         ::shutdown(client.fd(), SHUT_RD);
         flood(client, request("describe"), 200);
       }},
      {"shuts down both sides at once",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::observer);
         ::shutdown(client.fd(), SHUT_RDWR);
         std::this_thread::sleep_for(20ms);
       }},
      {"hangs up over answers that it has not read",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::observer);
         flood(client, request("status"), 50);
         std::this_thread::sleep_for(20ms);
       }},
      {"asks for much that takes long",
       [](ControlRig& rig) {
         std::vector<RigClient> clients;
         for (int i = 0; i < 15; ++i) {
           clients.push_back(rig.connect(TestUser::observer));
           clients.back().send(request("devices") + request("devices") + request("devices"));
         }
         CHECK(rig.connect(TestUser::observer).error_code("status") == 0);
       }},
      {"acquires and releases the lease repeatedly",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::operator_);
         flood(client, request("lease.acquire") + request("lease.release"), 200);
       }},
      {"two clients request the lease",
       [](ControlRig& rig) {
         RigClient first = rig.connect(TestUser::operator_), second = rig.connect(TestUser::operator_);
         for (const char* method : {"lease.acquire", "arm", "lease.heartbeat", "lease.release"}) {
           CHECK(first.error_code("lease.acquire") == 0);  // counts as a heartbeat
           int code = second.error_code(method);
           // On a busy machine the lease may end between two requests; then this attempt shows nothing.
           while (first.error_code("lease.heartbeat") != 0) {
             second.error_code("lease.release");
             CHECK(first.error_code("lease.acquire") == 0);
             code = second.error_code(method);
           }
           CHECK(code == code_of(RpcCode::lease_held));
         }
         CHECK(second.error_code("lease.acquire", {{"preempt", true}}) ==
               code_of(RpcCode::permission_denied));
       }},
      {"another process keeps the holder's connection open",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::operator_);
         CHECK(client.error_code("lease.acquire") == 0);
         CHECK(client.error_code("arm") == 0);
         const pid_t child = ::fork();
         if (child == 0) {
           ::pause();
           ::_exit(0);
         }
         client.disconnect();  // the child process still has it open
         CHECK(rig.wait_for_state(State::disarmed, 2000ms));
         ::kill(child, SIGKILL);
         ::waitpid(child, nullptr, 0);
       }},
      {"the holder disconnects in the middle of a line",
       [](ControlRig& rig) {
         RigClient client = rig.connect(TestUser::operator_);
         client.send(request("lease.acquire") + request("arm"));
         CHECK(next_code(client) == 0);
         CHECK(next_code(client) == 0);
         CHECK(rig.wait_for_state(State::waiting, 500ms));
         client.send("{\"jsonrpc\":\"2.0\",\"meth");
         client.disconnect();
       }},
  };
  return table;
}

/// Checks that the loop is disarmed, no client has the lease, the loop ticks, and status responds within 2 s.
void check_unaffected(ControlRig& rig) {
  CHECK(rig.wait_for_state(State::disarmed, 2000ms));
  RigClient client = rig.connect(TestUser::observer);
  const auto requested_at = std::chrono::steady_clock::now();
  const Json before = client.result("status");
  CHECK(std::chrono::steady_clock::now() - requested_at < 2s);
  const auto end = requested_at + 3s;
  Json status = before;
  while ((status["tick"] == before["tick"] || !status["lease"].is_null()) &&
         std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(10ms);
    status = client.result("status");
  }
  CHECK(status["tick"] > before["tick"]);
  CHECK(status["lease"].is_null());
  CHECK(status["armed_by"].is_null());
  // A busy machine may cause a fault; no client can.
  const std::string state = status["state"];
  INFO(state);
  CHECK((state == "disarmed" || state == "fault" || state == "self-test"));
}

TEST_CASE("no misuse of the socket stops the daemon or gains a permission", "[control_socket]") {
  ControlRig rig;
  check_unaffected(rig);
  const std::size_t descriptors = open_descriptors();
  const auto table = abuses();
  CHECK(table.size() >= 60);
  for (const Abuse& abuse : table) {
    INFO(abuse.name);
    abuse.run(rig);
    check_unaffected(rig);
  }
  // The daemon has closed all descriptors of these clients.
  for (int i = 0; i < 1000 && open_descriptors() > descriptors; ++i) std::this_thread::sleep_for(10ms);
  CHECK(open_descriptors() <= descriptors);
}

TEST_CASE("every client that may connect can stop, and only operators can acknowledge", "[control_socket]") {
  ControlRig rig;
  RigClient observer = rig.connect(TestUser::observer), operating = rig.connect(TestUser::operator_);
  CHECK(operating.error_code("acknowledge") == code_of(RpcCode::invalid_state));
  CHECK(observer.result("stop")["requested"] == "stop");
  CHECK(rig.wait_for_state(State::stopped));
  CHECK(observer.error_code("acknowledge") == code_of(RpcCode::permission_denied));
  CHECK(operating.error_code("lease.acquire") == 0);
  CHECK(operating.error_code("arm") == code_of(RpcCode::invalid_state));
  CHECK(rig.state() == State::stopped);
  CHECK(operating.error_code("acknowledge") == 0);
  CHECK(rig.wait_for_state(State::disarmed));
}

TEST_CASE("stop and the holder's heartbeats get through while other clients flood the socket",
          "[control_socket]") {
  ControlRig rig;
  RigClient holder = rig.connect(TestUser::operator_);
  std::atomic<bool> over{false};
  std::vector<std::thread> floods;
  for (int i = 0; i < 12; ++i)
    floods.emplace_back([&rig, &over, i] {
      while (!over) {
        RigClient client(rig.path(), 8000U + static_cast<uid_t>(i % 3));
        for (int k = 0; k < 200 && !over; ++k)
          if (!client.send(i % 2 == 0 ? request("describe") : std::string(3000, '{') + '\n')) break;
      }
    });
  // On a busy machine twelve flooding threads may keep the socket's thread from running, so the test tries
  // again.
  bool held = false;
  for (int attempt = 0; attempt < 5 && !held; ++attempt) {
    REQUIRE(holder.error_code("lease.acquire") == 0);
    for (int heartbeats = 0; heartbeats < 40; ++heartbeats) {
      holder.heartbeat();
      std::this_thread::sleep_for(20ms);
    }
    held = holder.error_code("lease.heartbeat") == 0;
  }
  RigClient observer = rig.connect(TestUser::observer);
  const auto requested_at = std::chrono::steady_clock::now();
  observer.send(request("stop"));
  const bool stopped = rig.wait_for_state(State::stopped, 2000ms);
  const bool in_time = std::chrono::steady_clock::now() - requested_at < 1s;
  over = true;
  for (std::thread& flood : floods) flood.join();
  const MachineLoad load;  // measured without the floods: only the load of other programs permits a skip
  REQUIRE_RATE(load, stopped);
  if (kSanitized) return;
  REQUIRE_RATE(load, held);
  REQUIRE_RATE(load, in_time);
}

TEST_CASE("a client with the lease arms, stays armed by heartbeats, and releases the hand by disconnecting",
          "[control_socket]") {
  ControlRig rig;
  RigClient watcher = rig.connect(TestUser::observer);
  const Json first = watcher.result("subscribe");
  CHECK(first["state"] == "disarmed");
  auto holder = std::make_optional(rig.connect(TestUser::operator_));
  std::jthread heart([&](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      holder->heartbeat();
      std::this_thread::sleep_for(10ms);
    }
  });
  // If the machine delays a heartbeat for too long, the test tries again.
  for (int attempt = 0; attempt < 5 && rig.state() != State::active; ++attempt) {
    CHECK(holder->result("lease.acquire")["heartbeat_timeout_s"] == 0.1);
    CHECK(holder->error_code("arm") == 0);
    rig.wait_for_state(State::active, 2000ms);
  }
  REQUIRE(rig.state() == State::active);
  CHECK(watcher.result("status")["armed_by"].get<std::string>().find("uid 60003") != std::string::npos);
  heart.request_stop();
  heart.join();
  holder.reset();
  CHECK(rig.wait_for_state(State::disarmed, 1000ms));
  rig.feed().drain();
  std::uint64_t next = first["sequence"].get<std::uint64_t>() + 1;
  std::vector<std::string> states;
  for (Json event; rig.state() != State::disarmed || next <= rig.feed().snapshot().sequence;) {
    event = watcher.events.empty() ? Json(nullptr) : watcher.events.front();
    if (event.is_null()) {
      const auto line = watcher.read_line();
      REQUIRE(line);
      event = Json::parse(*line)["params"];
    } else {
      watcher.events.pop_front();
    }
    CHECK(event["sequence"] == next++);  // no event is missing
    if (event["name"] == "state") states.push_back(event["state"]);
  }
  CHECK(std::ranges::count(states, "waiting") >= 1);
  // A late tick on a busy machine may add `degraded` before these four.
  REQUIRE(states.size() >= 5);
  states.erase(states.begin(), states.end() - 4);
  CHECK(states == std::vector<std::string>{"ramping", "active", "releasing", "disarmed"});
}

TEST_CASE("an administrator preempts the lease, and the previous holder gets an event", "[control_socket]") {
  ControlRig rig;
  RigClient holder = rig.connect(TestUser::operator_), administrator = rig.connect(TestUser::administrator);
  holder.result("subscribe", {{"events", {"lease"}}});
  CHECK(holder.error_code("lease.acquire") == 0);
  CHECK(administrator.error_code("lease.acquire") == code_of(RpcCode::lease_held));
  CHECK(administrator.result("lease.acquire", {{"preempt", true}})["heartbeat_timeout_s"] == 0.1);
  const Json taken = holder.next_event("lease");
  CHECK(taken["holder"].get<std::string>().find("uid 60003") != std::string::npos);
  CHECK(holder.next_event("lease")["holder"].is_null());
  CHECK(holder.next_event("lease")["holder"].get<std::string>().find("uid 60004") != std::string::npos);
}

TEST_CASE("events arrive in order, and the events that a slow reader loses are counted", "[control_socket]") {
  ControlRig rig;
  RigClient slow = rig.connect(TestUser::observer), chosen = rig.connect(TestUser::observer);
  const auto from = slow.result("subscribe")["sequence"].get<std::uint64_t>();
  chosen.result("subscribe", {{"events", {"lease"}}});
  constexpr int kEvents = 20000;
  for (int i = 0; i < kEvents; ++i)
    rig.feed().emit("log", EventLevel::info, "event " + std::string(100, '.'), {{"i", i}});
  rig.feed().emit("lease", EventLevel::info, "the last", {{"holder", nullptr}});
  std::uint64_t got = 0, lost = 0, last = from;
  while (last < from + kEvents + 1) {
    const auto line = slow.read_line();
    REQUIRE(line);
    const Json event = Json::parse(*line)["params"];
    const auto sequence = event["sequence"].get<std::uint64_t>();
    if (event["name"] == "events_lost") {
      lost += event["count"].get<std::uint64_t>();
      CHECK(sequence == last + event["count"].get<std::uint64_t>());
    } else {
      CHECK(sequence == last + 1);
      ++got;
    }
    last = sequence;
  }
  CHECK(lost > 0);
  CHECK(got + lost == kEvents + 1);
  CHECK(chosen.next_event("lease")["text"] == "the last");
  CHECK(slow.error_code("unsubscribe") == 0);
  slow.events.clear();
  rig.feed().emit("log", EventLevel::info, "no subscriber");
  CHECK(slow.next_event("log", 100ms).is_null());
}

TEST_CASE("a client that has shut down its sending side still gets its responses", "[control_socket]") {
  ControlRig rig;
  RigClient client = rig.connect(TestUser::observer);
  client.send(request("status") + request("devices", "{}", "2") + request("status", "{}", "3"));
  ::shutdown(client.fd(), SHUT_WR);
  std::set<int> ids;
  while (const auto line = client.read_line()) ids.insert(Json::parse(*line)["id"].get<int>());
  CHECK(ids == std::set<int>{1, 2, 3});
  CHECK(client.closed_by_peer());
}

TEST_CASE("a slow method blocks no other client, and its response follows when it ends", "[control_socket]") {
  std::atomic<bool> go{false};
  const MethodRow slow{"test.wait",
                       Role::observer,
                       {},
                       "Waits until the test ends it.",
                       [&go](const Json&, const Caller& caller) {
                         while (!go) std::this_thread::sleep_for(1ms);
                         return MethodResult(Json{{"client", caller.client}});
                       },
                       true};
  ControlRig rig(resting_config(), {slow});
  RigClient patient = rig.connect(TestUser::observer);
  patient.send(request("test.wait", "{}", "\"w\""));
  CHECK(patient.error_code("status") == 0);
  CHECK(patient.error_code("test.wait") == code_of(RpcCode::invalid_state));
  std::vector<RigClient> others;
  for (std::size_t i = 0; i < WorkerQueue::kMaxQueuedPerUser + 2; ++i) {
    others.push_back(rig.connect(TestUser::observer));
    others.back().send(request("test.wait", "{}", "\"w\""));
    if (i >= WorkerQueue::kMaxQueuedPerUser)
      CHECK(next_code(others.back()) == code_of(RpcCode::invalid_state));
    CHECK(others.back().error_code("status") == 0);
  }
  RigClient another = rig.connect(TestUser::operator_);  // another user finds a place
  another.send(request("test.wait", "{}", "\"w\""));
  others.front().disconnect();
  go = true;
  const auto line = patient.read_line();
  REQUIRE(line);
  CHECK(Json::parse(*line)["result"].contains("client"));
  CHECK(next_code(others[1]) == 0);
  CHECK(next_code(another) == 0);
}

TEST_CASE("a request waits for one of the clients whose requests take long, not for all of them",
          "[control_socket]") {
  std::atomic<int> done{0};
  const MethodRow work{"test.work", Role::observer, {}, "Takes 5 ms.", [&done](const Json&, const Caller&) {
                         std::this_thread::sleep_for(5ms);
                         return MethodResult(Json{{"done", ++done}});
                       }};
  ControlRig rig(resting_config(), {work});
  std::vector<std::unique_ptr<RigClient>> busy;
  constexpr int kClients = 12, kRequests = 60;
  for (int i = 0; i < kClients; ++i) {
    busy.push_back(std::make_unique<RigClient>(rig.path(), 8000U + static_cast<uid_t>(i)));
    for (int k = 0; k < kRequests; ++k) busy.back()->send(request("test.work"));
  }
  RigClient client = rig.connect(TestUser::observer);
  CHECK(client.error_code("status") == 0);
  const int before = done;
  CHECK(client.error_code("status") == 0);
  CHECK(done - before <= 2 * kLinesPerRound);
  CHECK(done < kClients * kRequests);  // the clients were still busy
}

TEST_CASE("a descriptor is sent with its response", "[control_socket]") {
  std::array<int, 2> ends{};
  REQUIRE(::pipe2(ends.data(), O_CLOEXEC) == 0);
  const OwnedFd read_end(ends[0]);
  OwnedFd write_end(ends[1]);
  const MethodRow open{
      "test.open", Role::observer, {}, "Hands over the end of a pipe.", [&](const Json&, const Caller&) {
        return MethodResult(Json{{"open", true}}, write_end.get());
      }};
  ControlRig rig(resting_config(), {open});
  RigClient client = rig.connect(TestUser::observer);
  client.send(request("status") + request("test.open", "{}", "2"));
  std::string text;
  OwnedFd got;
  while (text.find("\"open\":true") == std::string::npos) {
    std::array<char, 4096> bytes;
    std::array<char, CMSG_SPACE(sizeof(int))> control{};
    iovec part{bytes.data(), bytes.size()};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const ssize_t received = ::recvmsg(client.fd(), &message, MSG_CMSG_CLOEXEC);
    REQUIRE(received > 0);
    text.append(bytes.data(), static_cast<std::size_t>(received));
    if (cmsghdr* header = CMSG_FIRSTHDR(&message); header && header->cmsg_type == SCM_RIGHTS) {
      CHECK(text.find("\"id\":2") != std::string::npos);  // with its response, not before
      int fd = -1;
      std::memcpy(&fd, CMSG_DATA(header), sizeof fd);
      got = OwnedFd(fd);
    }
  }
  REQUIRE(got);
  CHECK(::write(got.get(), "x", 1) == 1);
  char byte = 0;
  CHECK(::read(read_end.get(), &byte, 1) == 1);
  CHECK(byte == 'x');
}

TEST_CASE("replies with descriptors that nobody reads are bounded, and the excess is an error",
          "[control_socket]") {
  std::atomic<int> calls = 0;
  const MethodRow open{
      "test.open", Role::observer, {}, "Opens a file.", [&](const Json&, const Caller&) {
        ++calls;
        return MethodResult(Json{{"open", true}}, OwnedFd(::open("/dev/null", O_RDONLY | O_CLOEXEC)));
      }};
  ControlRig rig(resting_config(), {open});
  const auto open_fds = [] {
    return std::distance(std::filesystem::directory_iterator("/proc/self/fd"),
                         std::filesystem::directory_iterator());
  };
  std::vector<RigClient> hoarders;
  for (int i = 0; i < 20; ++i) {
    hoarders.push_back(rig.connect(TestUser::observer));
    REQUIRE(hoarders.back().error_code("status") == 0);  // its answer shows that the connection is accepted
  }
  const auto before = open_fds();
  for (int round = 0; round < 40; ++round)
    for (RigClient& one : hoarders) one.send(request("test.open", "{}", "1"));
  REQUIRE(soon([&] { return calls == 800; }, 60s));
  CHECK(soon([&] { return open_fds() - before <= static_cast<long>(kMaxUserDescriptors); }));
  // Another user receives one, and a reader of the first user too as soon as it has read.
  RigClient other = rig.connect(TestUser::operator_);
  CHECK(other.error_code("test.open") == 0);
  long with = 0, without = 0;
  for (RigClient& one : hoarders)
    for (int reply = 0; reply < 40; ++reply) {
      const auto line = one.read_line(10s);
      REQUIRE(line);
      (Json::parse(*line).contains("error") ? without : with) += 1;
    }
  CHECK(with <= static_cast<long>(kMaxUserDescriptors));
  CHECK(with + without == 800);
  CHECK(hoarders.front().error_code("test.open") == 0);
}

TEST_CASE("a reply whose descriptor cannot be made is an error", "[control_socket]") {
  const MethodRow open{
      "test.open", Role::observer, {}, "Has a descriptor that is closed.", [](const Json&, const Caller&) {
        return MethodResult(Json{{"open", true}}, 9999);
      }};
  MethodRow slow = open;
  slow.name = "test.slow";
  slow.slow = true;
  ControlRig rig(resting_config(), {open, slow});
  RigClient client = rig.connect(TestUser::observer);
  CHECK(client.error_code("test.open") == code_of(RpcCode::invalid_state));
  CHECK(client.error_code("test.slow") == code_of(RpcCode::invalid_state));
  CHECK(client.error_code("status") == 0);
}

TEST_CASE("an observer's connections leave places for other users", "[control_socket]") {
  ControlRig rig;
  std::vector<RigClient> many;
  for (std::size_t i = 0; i < kMaxObserverClients; ++i) {
    many.push_back(rig.connect(TestUser::observer));
    CHECK(many.back().error_code("status") == 0);
  }
  RigClient other = rig.connect(TestUser::operator_);
  CHECK(other.error_code("status") == 0);
  RigClient more = rig.connect(TestUser::observer);
  CHECK(more.error_code("status") == 0);
  CHECK_FALSE(many.front().read_line(1s)->empty());  // why its connection ends
  CHECK(other.error_code("status") == 0);
}

TEST_CASE("a daemon that ends sends an event to its subscribers, and disconnects", "[control_socket]") {
  auto rig = std::make_optional<ControlRig>();
  RigClient client = rig->connect(TestUser::operator_);
  CHECK(client.error_code("lease.acquire") == 0);
  client.result("subscribe");
  rig.reset();
  std::vector<std::string> names;
  while (const auto line = client.read_line()) names.push_back(Json::parse(*line)["params"]["name"]);
  CHECK(client.closed_by_peer());
  CHECK(std::find(names.begin(), names.end(), "lease") != names.end());
}

TEST_CASE("the thread of an idle socket sleeps", "[control_socket]") {
  ControlRig rig;
  RigClient client = rig.connect(TestUser::observer);
  const auto events_before = client.result("status")["sequence"].get<std::uint64_t>();
  // Counts how often the thread, found by its name, slept voluntarily; preemption does not count.
  const auto sleeps = []() -> std::optional<std::uint64_t> {
    for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
      std::string line;
      std::getline(std::ifstream(task.path() / "comm"), line);
      if (line != "control") continue;
      const std::string wanted = "voluntary_ctxt_switches:";
      for (std::ifstream status(task.path() / "status"); std::getline(status, line);)
        if (line.starts_with(wanted)) return std::stoull(line.substr(wanted.size()));
    }
    return std::nullopt;
  };
  const auto before = sleeps();
  std::this_thread::sleep_for(300ms);
  REQUIRE(before);
  // Each event of the loop wakes the thread once.
  const auto events = client.result("status")["sequence"].get<std::uint64_t>() - events_before;
  CHECK(sleeps().value() - *before <= 4 + events);
}

}  // namespace
}  // namespace wrenchd::test_control_socket
