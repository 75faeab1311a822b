// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/prove/hoarding.hpp"

#include <algorithm>
#include <atomic>
#include <fstream>
#include <iterator>
#include <optional>
#include <stdexcept>

#include <poll.h>
#include <sys/stat.h>
#include <wrenchd/client.hpp>

#include "daemon/control/control_socket.hpp"
#include "daemon/control/json_rpc.hpp"
#include "tests/prove/abused_daemon.hpp"
#include "tests/prove/other_user.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/recording_mutation.hpp"

namespace wrenchd::test {
namespace {

constexpr const char* kSecret = "root:$6$sEcReT:19000:0:99999:7:::";
constexpr double kMostEnd_ms = 2000.0;
/// Descriptors of a daemon that nobody exhausts, with room.
constexpr long kMostFds = 100 + static_cast<long>(kMaxClients + kMaxDescriptors);

double since_ms(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
}

std::string call_line(const std::string& method, const Json& params) {
  return Json{{"jsonrpc", "2.0"}, {"id", 1}, {"method", method}, {"params", params}}.dump() + "\n";
}

/// Sends a line and returns the reply; nothing if none comes in 10 s.
std::optional<Json> reply_to(int fd, const std::string& line) {
  if (::send(fd, line.data(), line.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(line.size())) return {};
  std::string text;
  const auto begin = std::chrono::steady_clock::now();
  while (text.find('\n') == std::string::npos) {
    pollfd readable{fd, POLLIN, 0};
    const int left_ms = 10'000 - static_cast<int>(since_ms(begin));
    if (left_ms <= 0 || ::poll(&readable, 1, left_ms) <= 0) return {};
    std::array<char, 65536> bytes;
    const ssize_t got = ::recv(fd, bytes.data(), bytes.size(), 0);
    if (got <= 0) return {};
    text.append(bytes.data(), static_cast<std::size_t>(got));
  }
  return Json::parse(text.substr(0, text.find('\n')));
}

long descriptors_of(pid_t pid) {
  std::error_code error;
  const fs::directory_iterator list("/proc/" + std::to_string(pid) + "/fd", error);
  return error ? -1 : static_cast<long>(std::distance(begin(list), end(list)));
}

/// 31 clients of one user request descriptors and read no reply.
void exhaust_descriptors(const fs::path& socket, const Daemon& daemon, Client& owner, Hoarding& result) {
  OtherUser hoarder(kNobody, [&](const OtherUser::Report& report) {
    std::vector<OwnedFd> clients;
    for (int i = 0; i < 31; ++i) clients.push_back(connected(socket));
    for (int round = 0; round < 100; ++round)
      for (const OwnedFd& one : clients)
        if (one)
          send_bytes(one.get(), call_line("record.open", {{"name", "sample.h5"}}) + request("state.open"));
    report(1);
    std::this_thread::sleep_for(1h);
  });
  const auto begin = std::chrono::steady_clock::now();
  for (bool stopped = false; since_ms(begin) < 2500.0; std::this_thread::sleep_for(10ms)) {
    result.most_fds = std::max(result.most_fds, descriptors_of(daemon.pid()));
    if (stopped || since_ms(begin) < 1500.0) continue;
    const auto asked = std::chrono::steady_clock::now();
    owner.stop();
    result.stop_ms = since_ms(asked);
    stopped = true;
  }
  if (result.most_fds > kMostFds)
    result.violations.push_back("clients that do not read hold " + std::to_string(result.most_fds) +
                                " descriptors");
  try {
    owner.call("acknowledge");
    static_cast<void>(owner.open_state());
  } catch (const ClientError& error) {
    result.violations.push_back(std::string("the owner receives no descriptor meanwhile: ") + error.what());
  }
}

/// One user fills the queue of slow requests; another one requests a scene now and then.
void starve_queue(const fs::path& socket, Hoarding& result) {
  if (geteuid() != 0) return;
  OtherUser greedy(kNobody, [&](const OtherUser::Report& report) {
    std::vector<OwnedFd> clients;
    for (int i = 0; i < 24; ++i) clients.push_back(connected(socket));
    report(1);
    for (;;) {
      for (const OwnedFd& one : clients)
        if (one) send_bytes(one.get(), call_line("scene.get", Json::object()));
      for (const OwnedFd& one : clients)
        if (one) drain(one.get());
    }
  });
  greedy.next();
  OtherUser victim(kOtherUser, [&](const OtherUser::Report& report) {
    const OwnedFd fd = connected(socket);
    for (int i = 0; i < 95; ++i) {
      const auto reply = fd ? reply_to(fd.get(), call_line("scene.get", Json::object())) : std::nullopt;
      report(reply && reply->contains("result") ? 1 : 0);
      std::this_thread::sleep_for(10ms);
    }
  });
  while (const auto answered = victim.next()) {
    ++result.asked;
    result.refused += *answered == 0;
  }
  if (result.asked < 95 || result.refused > 0)
    result.violations.push_back("a user who fills the queue keeps another one out of it");
}

/// An operator loads a mesh while its name changes between a FIFO, a symbolic link and a file.
void race_names(const fs::path& socket, const fs::path& directory, Hoarding& result) {
  const fs::path name = directory / "conf/raced.off", next = directory / "conf/next.off";
  std::atomic<bool> done{false};
  std::thread swaps([&] {
    for (result.swaps = 0; result.swaps < 10'000; ++result.swaps) {
      ::unlink(next.c_str());
      if (result.swaps % 3 == 0) [[maybe_unused]]
        const int made = ::mkfifo(next.c_str(), 0666);
      if (result.swaps % 3 == 1) [[maybe_unused]]
        const int made = ::symlink("../secret", next.c_str());
      if (result.swaps % 3 == 2) [[maybe_unused]]
        const int made = ::link((directory / "conf/cube.off").c_str(), next.c_str());
      ::rename(next.c_str(), name.c_str());
      std::this_thread::sleep_for(300us);
    }
    done = true;
  });
  // nobody is an operator: its group is that of the operators.
  OtherUser racer(kNobody, [&](const OtherUser::Report& report) {
    const OwnedFd fd = connected(socket);
    const Json obstacle = {
        {"name", "raced"}, {"mesh", name.string()}, {"scale", 0.001}, {"position_m", {0.3, 0, 0}}};
    while (fd) {
      const auto added = reply_to(fd.get(), call_line("scene.add", {{"obstacle", obstacle}}));
      if (!added) return report(-1);  // the slow work hangs
      report(geteuid() != 0 && added->dump().find("sEcReT") != std::string::npos ? 1 : 0);
      if (added->contains("result")) reply_to(fd.get(), call_line("scene.remove", {{"name", "raced"}}));
    }
  });
  while (!done) {
    const auto one = racer.next();
    if (!one || *one < 0) {
      result.violations.push_back("a name that becomes a FIFO stops the slow work");
      break;
    }
    ++result.adds;
    result.leaks += *one;
  }
  swaps.join();
  if (result.leaks > 0) result.violations.push_back("an operator reads a file through a symbolic link");
}

/// Makes a mesh of 10 million triangles, and ends the daemon meanwhile.
void end_during_mesh(Daemon& daemon, const fs::path& config, Hoarding& result) {
  std::ofstream(config.parent_path() / "big.toml")
      << "[tool]\nmesh = { make = \"bumpy\", triangles = 10000000 }\nmass = 0.2\n";
  std::string text;
  {
    std::ifstream in(config);
    text.assign(std::istreambuf_iterator<char>(in), {});
  }
  text.replace(text.find("scene.toml"), 10, "big.toml");
  std::ofstream(config) << text;
  daemon.signal(SIGHUP);
  std::this_thread::sleep_for(1500ms);
  const auto begin = std::chrono::steady_clock::now();
  daemon.signal(SIGTERM);
  const bool ended = daemon.ends_within(10s);
  result.end_ms = since_ms(begin);
  if (!ended || result.end_ms > kMostEnd_ms)
    result.violations.push_back("a large mesh delays the end of the daemon by " +
                                std::to_string(static_cast<long>(result.end_ms)) + " ms");
}

}  // namespace

Hoarding hoard(const std::string& program, const fs::path& directory) {
  Hoarding result;
  const fs::path socket = directory / "hoarded.sock", config = directory / "conf/wrenchd.toml";
  const std::string shipped = test::source_path("config/");
  fs::create_directories(directory / "conf");
  fs::create_directories(directory / "recordings");
  fs::copy_file(shipped + "meshes/cube.off", directory / "conf/cube.off");
  std::ofstream(directory / "secret") << kSecret << "\n";
  std::ofstream(directory / "conf/scene.toml")
      << "[tool]\nmesh = \"cube.off\"\nscale = 0.001\nmass = 0.2\n[[obstacle]]\nname = \"table\"\n"
         "half_space = { normal = [0.0, 0.0, 1.0], offset = 0.0 }\n";
  std::ofstream(config) << "scene = \"scene.toml\"\n[control]\nobservers = \"*\"\noperators = \"nogroup\"\n"
                           "[recording]\ndirectory = \""
                        << (directory / "recordings").string() << "\"\nkeep_free_MB = 0.0\n";
  write_sample_recording(directory / "recordings/sample.h5");
  Daemon daemon(program, {"--realtime", "off", "--config", config, "--control", socket},
                directory / "hoarded.log");
  for (int i = 0; i < 3000 && !connected(socket); ++i) std::this_thread::sleep_for(10ms);
  Client owner(socket);
  for (int i = 0; i < 1000 && owner.state() != "disarmed"; ++i) std::this_thread::sleep_for(10ms);
  exhaust_descriptors(socket, daemon, owner, result);
  starve_queue(socket, result);
  race_names(socket, directory, result);
  if (!daemon.lives()) throw std::runtime_error("the daemon that clients exhaust has ended");
  end_during_mesh(daemon, config, result);
  return result;
}

}  // namespace wrenchd::test
