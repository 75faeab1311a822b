// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <atomic>
#include <cstring>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>
#include <fcntl.h>
#include <nlohmann/json.hpp>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>
#include <wrenchd/state_reader.hpp>

#include "daemon/control/state_layout.hpp"
#include "daemon/servo/record_fields.hpp"
#include "daemon/servo/shared_state.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/random_values.hpp"
#include "tests/support/shipped_config.hpp"

namespace wrenchd::test_shared_state {

using namespace wrenchd::test;

namespace {

const Reconfigurator::ObstacleNames kTable{3, {"table"}};

StateReader reader_of(const SharedState& state, const Reconfigurator::ObstacleNames& obstacles = kTable) {
  std::string layout;
  int descriptor = -1;
  open_state(state, obstacles, [&](const nlohmann::json& result, int sent_descriptor) {
    layout = result.at("layout").dump();
    descriptor = fcntl(sent_descriptor, F_DUPFD_CLOEXEC, 0);
  });
  return StateReader(layout, descriptor);
}

/// Returns a record in which every field depends on `number`, so that a mixture of two records is detected.
TickRecord record_of(std::uint64_t number) {
  TickRecord r;
  auto* const bytes = reinterpret_cast<std::byte*>(&r);
  for (const RecordField& field : tick_fields())
    for (std::size_t i = 0; i < field.count; ++i) {
      const double x = static_cast<double>(number) + static_cast<double>(i);
      if (field.type == FieldType::f64)
        std::memcpy(bytes + field.offset + i * 8, &x, 8);
      else
        std::memcpy(bytes + field.offset + i * size_of(field.type), &number, size_of(field.type));
    }
  return r;
}

Touches contacts_of(std::uint64_t number) {
  Touches contacts;
  for (std::uint64_t i = 0; i < number % (kMaxTouches + 1); ++i) {
    Touch touch;
    touch.point_W_m.fill(static_cast<double>(number));
    touch.load_fraction = static_cast<double>(i);
    contacts.add(touch);
  }
  return contacts;
}

/// Returns true if every field equals that of record_of() and contacts_of() for the number of the tick.
bool complete(const TickState& state) {
  const std::uint64_t number = state.tick();
  const TickRecord reference = record_of(number);
  const auto* const bytes = reinterpret_cast<const std::byte*>(&reference);
  for (const RecordField& field : tick_fields())
    for (std::size_t i = 0; i < field.count; ++i) {
      if (field.type == FieldType::f64) {
        if (state.number(field.name, i) != static_cast<double>(number) + static_cast<double>(i)) return false;
        continue;
      }
      std::int64_t expected = 0;
      std::memcpy(&expected, bytes + field.offset + i * size_of(field.type), size_of(field.type));
      if (state.integer(field.name, i) != expected) return false;
    }
  const std::vector<ProxyContact> contacts = state.contacts();
  if (contacts.size() != number % (kMaxTouches + 1)) return false;
  for (std::size_t i = 0; i < contacts.size(); ++i)
    if (contacts[i].point_W_m[2] != static_cast<double>(number) ||
        contacts[i].load_fraction != static_cast<double>(i))
      return false;
  return true;
}

}  // namespace

TEST_CASE("a reader gets every field of every record, in order, once", "[shared_state]") {
  SharedState state(100.0);
  REQUIRE(state.slots() == 256);
  state.write(record_of(999), {});
  StateReader reader = reader_of(state);
  TickState tick;
  CHECK_FALSE(reader.next(tick, std::chrono::milliseconds(1)));  // next() starts after the records that exist
  REQUIRE(reader.latest(tick));
  CHECK(tick.tick() == 999);
  for (std::uint64_t i = 1000; i < 3000; ++i) {
    state.write(record_of(i), contacts_of(i));
    REQUIRE(reader.next(tick));
    REQUIRE(tick.tick() == i);
    REQUIRE(complete(tick));
    CHECK(reader.unread() == 0);
  }
  CHECK_FALSE(reader.next(tick, std::chrono::milliseconds(1)));
  CHECK(reader.missed() == 0);
}

TEST_CASE("a reader that pauses for 2 s misses nothing; a longer pause is counted", "[shared_state]") {
  SharedState state(4000.0);
  REQUIRE(state.slots() >= 8000);
  StateReader reader = reader_of(state);
  TickState tick;
  std::uint64_t written = 0;
  for (; written < 8000; ++written) state.write(record_of(written), {});
  REQUIRE(reader.next(tick));
  CHECK(tick.tick() == 0);
  for (; written < 30'000; ++written) state.write(record_of(written), {});
  std::uint64_t taken = 1;
  std::uint64_t last = 0;
  while (reader.next(tick, std::chrono::milliseconds(1))) {
    CHECK(tick.tick() > last);
    last = tick.tick();
    ++taken;
  }
  CHECK(last == 29'999);
  CHECK(reader.missed() > 30'000 - 8192);
  CHECK(taken + reader.missed() == written);
}

TEST_CASE("readers beside a writer at full speed never get a torn record", "[shared_state]") {
  SharedState state(4.0);  // 8 records, overwritten all the time
  std::atomic<bool> stop{false};
  std::array<std::uint64_t, 2> read{}, torn{}, backward{}, missed{};
  std::vector<std::thread> readers;
  for (std::size_t r = 0; r < 2; ++r)
    readers.emplace_back([&, r] {
      StateReader reader = reader_of(state);
      TickState tick;
      std::uint64_t last = 0;
      while (!stop.load()) {
        if (r == 0 ? !reader.next(tick, std::chrono::milliseconds(1)) : !reader.latest(tick)) continue;
        ++read[r];
        if (!complete(tick)) ++torn[r];
        if (tick.tick() < last) ++backward[r];
        last = tick.tick();
      }
      missed[r] = reader.missed();
    });
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(2);
  for (std::uint64_t i = 0; std::chrono::steady_clock::now() < end; ++i)
    state.write(record_of(i), contacts_of(i));
  stop.store(true);
  for (std::thread& reader : readers) reader.join();
  for (std::size_t r = 0; r < 2; ++r) {
    CHECK(read[r] > 100);
    CHECK(torn[r] == 0);
    CHECK(backward[r] == 0);
  }
  CHECK(missed[0] > 100);
}

TEST_CASE("the descriptor allows reading only", "[shared_state]") {
  SharedState state(100.0);
  const int fd = state.descriptor();
  const auto size = static_cast<off_t>(state.bytes());
  void* const readable = mmap(nullptr, state.bytes(), PROT_READ, MAP_SHARED, fd, 0);
  REQUIRE(readable != MAP_FAILED);
  CHECK(mprotect(readable, state.bytes(), PROT_READ | PROT_WRITE) != 0);
  munmap(readable, state.bytes());
  CHECK(mmap(nullptr, state.bytes(), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0) == MAP_FAILED);
  CHECK(pwrite(fd, "x", 1, 0) < 0);
  CHECK(ftruncate(fd, size / 2) != 0);
  CHECK(ftruncate(fd, size * 2) != 0);
  CHECK(fallocate(fd, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, 0, size) != 0);
  CHECK(fcntl(fd, F_ADD_SEALS, F_SEAL_WRITE) != 0);
  state.write(record_of(1), {});
  CHECK(state.written() == 1);
}

TEST_CASE("writing neither allocates nor locks, and causes no page fault", "[shared_state][realtime]") {
  SharedState state(1000.0);
  const TickRecord record = record_of(5);
  const Touches contacts = contacts_of(16);
  state.write(record, contacts);
  rusage before{}, after{};
  getrusage(RUSAGE_THREAD, &before);
  const RealtimeGuard guard;
  for (std::uint64_t i = 0; i < 2 * state.slots(); ++i) state.write(record, contacts);
  const std::uint64_t allocations = guard.allocations();
  const std::uint64_t locks = guard.locks();
  getrusage(RUSAGE_THREAD, &after);
  CHECK(allocations == 0);
  CHECK(locks == 0);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  CHECK(after.ru_minflt - before.ru_minflt + after.ru_majflt - before.ru_majflt <= 2);
#endif
}

TEST_CASE("every tick of the loop is published with its contacts", "[shared_state][servo]") {
  VirtualRuntime s;
  StateReader reader =
      reader_of(s.runtime.enable_shared_state(), s.runtime.reconfigurator().obstacle_names());
  s.runtime.loop().requests().arm();
  TickState tick;
  for (int i = 0; i < 2400; ++i) {
    REQUIRE(s.tick() == Fault::none);
    REQUIRE(reader.next(tick));
    REQUIRE(tick.tick() == s.last.tick);
    REQUIRE(tick.integer("contacts") == s.last.contacts);
    REQUIRE(tick.wrench() == s.last.F_out);
  }
  CHECK(tick.state() == "active");
  CHECK(tick.text("projection_status") == "converged");
  CHECK(tick.text("faults").empty());
  const std::vector<ProxyContact> contacts = tick.contacts();
  REQUIRE(contacts.size() == 4);
  double load = 0.0;
  for (const ProxyContact& touch : contacts) {
    CHECK(touch.obstacle == "table");
    CHECK(touch.obstacle_feature == "plane");
    CHECK(touch.tool_feature.starts_with("hull vertex "));
    CHECK(touch.normal_W == std::array<double, 3>{0.0, 0.0, 1.0});
    CHECK(std::abs(touch.point_W_m[2]) < 1e-8);
    CHECK(std::abs(std::abs(touch.point_W_m[0] - tick.proxy_pose()[0]) - 0.025) < 1e-6);
    load += touch.load_fraction;
  }
  CHECK(load == Approx(1.0));
  s.runtime.loop().release(s.clock.now());
  REQUIRE(reader.next(tick));
  CHECK(tick.integer("released") == 1);
  CHECK(tick.text("commands") == "release");
}

TEST_CASE("the layout describes every field, within a line of the protocol", "[shared_state]") {
  SharedState state(8000.0);
  CHECK(state.slots() >= 16'000);
  const nlohmann::json layout = state_layout(state, kTable);
  CHECK(layout.dump().size() < 32 * 1024);
  for (const nlohmann::json& list : {layout["fields"], layout["contacts"]["fields"]})
    for (const nlohmann::json& field : list) {
      INFO(field);
      CHECK_FALSE(field["unit"].get<std::string>().empty());
      CHECK_FALSE(field["doc"].get<std::string>().empty());
      if (field["unit"] == "enum") CHECK(field["values"].size() > 1);
      for (const std::string names : {"values", "bits"})
        if (field.contains(names))
          for (const std::string name : field[names]) CHECK((!name.empty() && name != "unknown"));
    }
  CHECK(layout["obstacles"] == nlohmann::json({"table"}));
  CHECK(layout["rendering_id"] == 3);
}

TEST_CASE("contacts have the obstacle names of their rendering, requested from the daemon once per rendering",
          "[shared_state]") {
  SharedState state(4.0);
  int requests = 0;
  std::string response = R"({"rendering_id": 4, "obstacles": ["bolt"]})";
  StateReader reader(state_layout(state, kTable).dump(), fcntl(state.descriptor(), F_DUPFD_CLOEXEC, 0), {},
                     [&] {
                       ++requests;
                       if (response.empty()) throw ClientError(ClientError::kDisconnected, "gone");
                       return response;
                     });
  const auto obstacle_in = [&](std::uint32_t rendering) {
    TickRecord record;
    record.rendering_id = rendering;
    Touches contacts;
    contacts.add(Touch{});
    state.write(record, contacts);
    TickState tick;
    REQUIRE(reader.latest(tick));
    return tick.contacts().at(0).obstacle;
  };
  CHECK(obstacle_in(3) == "table");
  CHECK(requests == 0);
  CHECK(obstacle_in(4) == "bolt");
  CHECK(obstacle_in(4) == "bolt");
  CHECK(obstacle_in(3) == "table");  // a late read of an earlier rendering
  CHECK(requests == 1);
  CHECK(obstacle_in(5) == "obstacle 0");  // unknown
  response = R"({"rendering_id": 7, "obstacles": ["nut"]})";
  CHECK(obstacle_in(6) == "obstacle 0");  // not known any more
  CHECK(obstacle_in(7) == "nut");
  for (const char* bad : {"", "no JSON", "{}", R"({"rendering_id": 8, "obstacles": 1})"}) {
    response = bad;
    CHECK(obstacle_in(8) == "obstacle 0");
  }
}

TEST_CASE("a layout that does not fit its memory is rejected", "[shared_state]") {
  SharedState state(4.0);
  const nlohmann::json good = state_layout(state, kTable);
  const auto open = [&](const nlohmann::json& layout) {
    return StateReader(layout.dump(), fcntl(state.descriptor(), F_DUPFD_CLOEXEC, 0));
  };
  CHECK_NOTHROW(open(good));
  const auto rejected = [&](const char* where, const nlohmann::json& value) {
    nlohmann::json layout = good;
    layout[nlohmann::json::json_pointer(where)] = value;
    INFO(where << " = " << value);
    CHECK_THROWS_AS(open(layout), ClientError);
  };
  rejected("/version", SharedState::kVersion + 1);
  rejected("/bytes", state.bytes() + 1);
  rejected("/slots", state.slots() + 1);
  rejected("/slots", 0);
  rejected("/slot_bytes", SharedState::kSlotBytes + 8);
  rejected("/record_bytes", SharedState::kSlotBytes);
  rejected("/written_offset", 4096);
  rejected("/byte_order", "big");
  rejected("/fields/3/offset", sizeof(StateRecord));
  rejected("/fields/3/count", 1'000'000);
  rejected("/fields/3/type", "f16");
  rejected("/contacts/max_count", 1000);
  rejected("/contacts/fields/0/offset", 87);
  rejected("/fields", nullptr);
  const int unsealed = memfd_create("unsealed", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  REQUIRE(ftruncate(unsealed, static_cast<off_t>(state.bytes())) == 0);
  CHECK_THROWS_WITH(StateReader(good.dump(), unsealed), Catch::Contains("not sealed"));
  CHECK_THROWS_AS(StateReader("no JSON", fcntl(state.descriptor(), F_DUPFD_CLOEXEC, 0)), ClientError);
}

}  // namespace wrenchd::test_shared_state
