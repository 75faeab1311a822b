// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>
#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>
#include <wrenchd/client.hpp>

#include "daemon/recording/recording_file.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_program_streams {

// The daemon with standard streams that are closed, that nobody reads any more, or that somebody has stopped
// reading.

namespace {

using namespace test;
using Catch::Contains;

const std::string kProgram = test::program_path("wrenchd");
constexpr const char* kReleased = "the hand is released: zero wrench, motors off";

std::string contents(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// Runs a command of the shell. Returns its exit code.
int shell(const std::string& command) {
  const int status = std::system(command.c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/// The write end of a pipe that is full and that nobody reads.
class StalledPipe {
 public:
  StalledPipe() {
    REQUIRE(::pipe2(ends_.data(), O_CLOEXEC) == 0);
    const int flags = ::fcntl(ends_[1], F_GETFL);
    ::fcntl(ends_[1], F_SETFL, flags | O_NONBLOCK);
    const std::array<char, 4096> bytes{};
    while (::write(ends_[1], bytes.data(), bytes.size()) > 0) {
    }
    REQUIRE(errno == EAGAIN);
    ::fcntl(ends_[1], F_SETFL, flags);
  }
  ~StalledPipe() {
    for (const int end : ends_) ::close(end);
  }
  StalledPipe(const StalledPipe&) = delete;
  StalledPipe& operator=(const StalledPipe&) = delete;
  int write_end() const { return ends_[1]; }

 private:
  std::array<int, 2> ends_{};
};

/// wrenchd with this descriptor as standard output and standard error.
class Daemon {
 public:
  Daemon(std::vector<std::string> arguments, int output) {
    arguments.insert(arguments.begin(), kProgram);
    std::vector<char*> words;
    for (std::string& argument : arguments) words.push_back(argument.data());
    words.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&actions, output, STDERR_FILENO);
    REQUIRE(posix_spawn(&pid_, kProgram.c_str(), &actions, nullptr, words.data(), environ) == 0);
    posix_spawn_file_actions_destroy(&actions);
  }
  ~Daemon() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  void signal(int number) const { ::kill(pid_, number); }
  /// Returns the exit code; -1 if the process did not end by itself in time.
  int wait() {
    for (const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
         std::chrono::steady_clock::now() < end; std::this_thread::sleep_for(std::chrono::milliseconds(5))) {
      int status = 0;
      if (::waitpid(pid_, &status, WNOHANG) == 0) continue;
      pid_ = -1;
      return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    }
    return -1;
  }

 private:
  pid_t pid_ = -1;
};

TEST_CASE("a log and a live line that nobody reads block neither clients nor the end of wrenchd",
          "[streams]") {
  const TemporaryDirectory files;
  const std::string socket = (files.path() / "control.sock").string();
  const StalledPipe pipe;
  Daemon daemon({"--realtime", "off", "--live", "--control", socket}, pipe.write_end());
  for (int i = 0; i < 6000 && !std::filesystem::exists(socket); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  REQUIRE(std::filesystem::exists(socket));
  {
    Client client(socket, std::chrono::seconds(20));
    for (int i = 0; i < 20; ++i) {  // each stop and each acknowledgement logs several lines
      CHECK_THAT(client.status(), Contains("\"state\""));
      CHECK_NOTHROW(client.stop());
      try {
        client.call("acknowledge");
      } catch (const ClientError&) {  // the loop has not taken the stop yet
      }
    }
  }
#ifndef __SANITIZE_THREAD__  // its _exit() flushes standard error, for which it waits
  daemon.signal(SIGTERM);
  const int code = daemon.wait();
  CHECK((code == 0 || code == 3));  // 3: the run ended stopped
#endif
}

TEST_CASE("a reader of the live line that leaves does not end wrenchd", "[streams]") {
  const TemporaryDirectory files;
  const std::string here = files.path().string();
  REQUIRE(shell("cd " + here + " && { " + kProgram +
                " --realtime off --arm --live --seconds 4 2> log; echo $? > code; } | head -1 > line") == 0);
  const std::string log = contents(files.path() / "log");
  INFO(log);
  const std::string code = contents(files.path() / "code");
  CHECK((code == "0\n" || code == "3\n"));  // 3: a busy machine has raised a fault
  CHECK_THAT(log, Contains(kReleased));
  CHECK_THAT(contents(files.path() / "line"), Contains(" contacts | "));
}

TEST_CASE("with its standard streams closed wrenchd writes nothing else into its recording", "[streams]") {
  const TemporaryDirectory files;
  const auto file = files.path() / "run.h5";
  CHECK(shell("exec " + kProgram + " --virtual-time --seconds 3 --arm --live --record " + file.string() +
              " 0<&- 1>&- 2>&-") == 0);
  CHECK(read_recording(file).ticks.size() >= 3000);
  CHECK(contents(file).find("contacts | F") == std::string::npos);
}

TEST_CASE("a recording that reaches the limit of the file size ends, the run goes on, and wrenchd ends well",
          "[streams]") {
  const TemporaryDirectory files;
  const std::string here = files.path().string();
  CHECK(shell("cd " + here + " && ulimit -f 20000 && exec " + kProgram +
              " --virtual-time --seconds 120 --arm --record run.h5 2> log") == 0);
  const std::string log = contents(files.path() / "log");
  CHECK_THAT(log, Contains("the recording has ended after ") && Contains(kReleased));
}

}  // namespace
}  // namespace wrenchd::test_program_streams
