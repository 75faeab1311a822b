// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstring>
#include <fstream>
#include <optional>

#include <catch2/catch.hpp>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include "tests/support/random_values.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tools/spacenav/spacenav_server.hpp"

namespace wrenchd::test_spacenav_server {

using namespace wrenchd::test;
using namespace std::chrono_literals;
using Catch::Matchers::Contains;

namespace {

using Words = std::array<std::int32_t, 8>;

const SpacenavDevice kDevice = {"wrenchd: a device with a long name, longer than 24 bytes", "/run/w.sock",
                                true};

/// A program that speaks the protocol word for word.
class Program {
 public:
  explicit Program(const std::filesystem::path& path)
      : socket_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(static_cast<char*>(address.sun_path), path.c_str(), path.string().size());
    REQUIRE(::connect(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
  }
  void send(const void* data, std::size_t size) const {
    REQUIRE(::send(socket_.get(), data, size, MSG_NOSIGNAL) == static_cast<ssize_t>(size));
  }
  void send(const Words& words) const { send(words.data(), sizeof words); }
  void send(std::uint32_t word) const { send(&word, sizeof word); }
  void send_sensitivity(float value) const { send(&value, sizeof value); }

  template <class T>
  std::optional<T> receive() const {
    T out{};
    if (::recv(socket_.get(), &out, sizeof out, MSG_DONTWAIT) != sizeof out) return {};
    return out;
  }
  bool ended() const {
    char byte = 0;
    return ::recv(socket_.get(), &byte, 1, MSG_DONTWAIT | MSG_PEEK) == 0;
  }
  void receive_little() const {
    const int bytes = 1;
    ::setsockopt(socket_.get(), SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
  }

 private:
  OwnedFd socket_;
};

struct Rig {
  TemporaryDirectory files;
  std::filesystem::path path = files.path() / "n.sock";
  SpacenavServer server{path, false};
  OwnedFd never{::eventfd(0, EFD_CLOEXEC)};

  void serve() { server.serve(kDevice, 20ms, never.get()); }
  Program connect() {
    Program program(path);
    serve();
    return program;
  }
  Program connect_version_1() {
    Program program = connect();
    program.send(0x7faa5501U);
    serve();
    CHECK(program.receive<std::uint32_t>() == 0x7faa5501U);
    return program;
  }
};

}  // namespace

TEST_CASE("a program of version 0 receives motion, and scales it", "[spacenav]") {
  Rig rig;
  const Program program = rig.connect();
  rig.server.send_motion({100, 0, -50, 0, 7, 0}, 0.016);
  CHECK(program.receive<Words>() == Words{0, 100, 0, -50, 0, 7, 0, 16});
  program.send_sensitivity(2.0F);
  rig.serve();
  rig.server.send_motion({100, 0, -50, 0, 7, 0}, 0.016);
  CHECK(program.receive<Words>() == Words{0, 200, 0, -100, 0, 14, 0, 16});
  rig.server.send_device_change(true);
  CHECK_FALSE(program.receive<Words>());  // version 0 has no such event
}

TEST_CASE("a hand at rest sends one event of zeros, and then none", "[spacenav]") {
  Rig rig;
  const Program program = rig.connect();
  rig.server.send_motion({}, 0.016);
  CHECK_FALSE(program.receive<Words>());
  rig.server.send_motion({5, 0, 0, 0, 0, 0}, 0.016);
  CHECK(program.receive<Words>() == Words{0, 5, 0, 0, 0, 0, 0, 16});
  rig.server.send_motion({}, 0.016);
  CHECK(program.receive<Words>() == Words{0, 0, 0, 0, 0, 0, 0, 16});
  rig.server.send_motion({}, 0.016);
  CHECK_FALSE(program.receive<Words>());
}

TEST_CASE("slow motion is not lost by rounding", "[spacenav]") {
  Rig rig;
  const Program program = rig.connect();
  int sum = 0;
  for (int i = 0; i < 1000; ++i) {
    rig.server.send_motion({0.1, -0.3, 0, 0, 0, 0}, 0.016);
    if (const auto event = program.receive<Words>()) sum += (*event)[1] - (*event)[2];
  }
  CHECK(std::abs(sum - 400) <= 1);
}

TEST_CASE("a program that does not read gets its motion later", "[spacenav]") {
  Rig rig;
  const Program program = rig.connect();
  program.receive_little();
  long sum = 0;
  for (int i = 0; i < 20000; ++i) rig.server.send_motion({1, 0, 0, 0, 0, 0}, 0.016);
  for (int i = 0; i < 10; ++i) {
    while (const auto event = program.receive<Words>()) sum += (*event)[1];
    rig.server.send_motion({0, 0, 0, 0, 0, 0}, 0.016);
  }
  CHECK(sum == 20000);
  CHECK(rig.server.clients() == 1);
}

TEST_CASE("a program of version 1 asks for the device and for events", "[spacenav]") {
  Rig rig;
  const Program program = rig.connect_version_1();
  program.send(Words{0x7faa2000});
  rig.serve();
  std::string name;
  for (int left = static_cast<int>(kDevice.name.size()), part = 0; left > 0; left -= 24, ++part) {
    const auto answer = program.receive<Words>();
    REQUIRE(answer);
    CHECK((*answer)[0] == 0x7faa2000);
    CHECK((*answer)[7] == (left | (part > 0 ? 0x10000 : 0)));
    name.append(reinterpret_cast<const char*>(&(*answer)[1]), static_cast<std::size_t>(std::min(left, 24)));
  }
  CHECK(name == kDevice.name);
  program.send(Words{0x7faa2002});
  program.send(Words{0x7faa3000});     // a setting of spacenavd
  program.send(Words{0x7faa1003, 2});  // buttons only
  rig.serve();
  CHECK(program.receive<Words>() == Words{0x7faa2002, 6});
  CHECK((*program.receive<Words>())[7] == -1);
  CHECK(program.receive<Words>() == Words{0x7faa1003, 2});
  rig.server.send_motion({9, 0, 0, 0, 0, 0}, 0.016);
  rig.server.send_button(3, true);
  rig.server.send_button(3, false);
  CHECK(program.receive<Words>() == Words{1, 3, 1});
  CHECK(program.receive<Words>() == Words{2, 3, 0});
}

TEST_CASE("without a device, questions about it fail, and it is announced", "[spacenav]") {
  Rig rig;
  const Program program = rig.connect_version_1();
  program.send(Words{0x7faa2000});
  rig.server.serve({}, 20ms, rig.never.get());
  CHECK((*program.receive<Words>())[7] == -1);
  rig.server.send_device_change(true);
  rig.server.send_device_change(false);
  CHECK(program.receive<Words>() == Words{3, 0});
  CHECK(program.receive<Words>() == Words{3, 1});
}

TEST_CASE("random bytes harm neither the server nor other programs", "[spacenav]") {
  Rig rig;
  const Program good = rig.connect_version_1();
  RandomValues random(26);
  for (int run = 0; run < 2000; ++run) {
    const Program bad = rig.connect();
    if (random.chance(0.7)) bad.send(0x7faa5500U | static_cast<std::uint32_t>(random.integer(0, 255)));
    std::vector<std::uint64_t> bytes(static_cast<std::size_t>(random.integer(1, 40)));
    for (std::uint64_t& word : bytes) word = random.bits();
    if (random.chance(0.5))
      for (std::size_t i = 0; i < bytes.size(); i += 4) bytes[i] = 0x7faa1000U + random.bits() % 0x3000;
    bad.send(bytes.data(), 8 * bytes.size() - static_cast<std::size_t>(random.integer(0, 7)));
    rig.server.serve(kDevice, 0ms, rig.never.get());
    rig.server.send_motion({1, 2, 3, 4, 5, 6}, 0.016);
  }
  rig.serve();
  CHECK(rig.server.clients() == 1);
  int events = 0;
  while (good.receive<Words>()) ++events;
  CHECK(events > 0);
}

TEST_CASE("a program beyond the limit waits until another one leaves", "[spacenav]") {
  Rig rig;
  std::vector<Program> programs;
  for (std::size_t i = 0; i < SpacenavServer::kMostClients; ++i) programs.push_back(rig.connect());
  const Program waiting = rig.connect();
  CHECK(rig.server.clients() == SpacenavServer::kMostClients);
  rig.server.send_button(0, true);
  CHECK_FALSE(waiting.receive<Words>());
  programs.pop_back();
  rig.serve();
  rig.serve();
  CHECK(rig.server.clients() == SpacenavServer::kMostClients);
  rig.server.send_button(0, false);
  CHECK(waiting.receive<Words>() == Words{2, 0, 0});
}

TEST_CASE("the socket is private, and only the socket of a dead server is replaced", "[spacenav]") {
  const TemporaryDirectory files;
  const auto path = files.path() / "n.sock";
  struct stat status {};
  {
    const SpacenavServer server(path, false);
    REQUIRE(::stat(path.c_str(), &status) == 0);
    CHECK((status.st_mode & 0777U) == 0600);
    CHECK_THROWS_WITH(SpacenavServer(path, false), Contains("n.sock: another program serves this socket"));
    CHECK(std::filesystem::exists(path));
  }
  CHECK_FALSE(std::filesystem::exists(path));
  {
    const SpacenavServer server(path, true);
    REQUIRE(::stat(path.c_str(), &status) == 0);
    CHECK((status.st_mode & 0777U) == 0666);
    std::filesystem::create_hard_link(path, files.path() / "dead");
  }
  std::filesystem::rename(files.path() / "dead", path);
  { const SpacenavServer server(path, false); }
  files.write("text", "not a socket");
  CHECK_THROWS_WITH(SpacenavServer(files.path() / "text", false), Contains("is no socket"));
  CHECK(std::filesystem::exists(files.path() / "text"));
  CHECK_THROWS_WITH(SpacenavServer(files.path() / std::string(120, 'x'), false), Contains("too long"));
  CHECK_THROWS_WITH(SpacenavServer("/nowhere/n.sock", false), Contains("cannot be created"));
}

}  // namespace wrenchd::test_spacenav_server
