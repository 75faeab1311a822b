// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <csignal>
#include <fstream>
#include <iterator>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/support/paths.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test {

struct ProgramResult {
  int exit_code = -1;  ///< -1 if a signal ended the program, or if it did not end in time
  std::string out;
  std::string err;
};

/// A built program that runs beside the test. Its streams are files, so that the program never waits for the
/// test.
class RunningProgram {
 public:
  RunningProgram(const std::string& name, const std::vector<std::string>& arguments,
                 const std::string& in = {}) {
    const std::string program = program_path(name);
    std::vector<std::string> words = arguments;
    words.insert(words.begin(), program);
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);

    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    const std::string in_file = files_.write("in", in).string();
    const std::string out_file = files_.write("out", "").string();
    const std::string err_file = files_.write("err", "").string();
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, in_file.c_str(), O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, out_file.c_str(), O_WRONLY, 0);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, err_file.c_str(), O_WRONLY, 0);
    const int error = posix_spawn(&pid_, program.c_str(), &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) throw std::system_error(error, std::generic_category(), program);
  }
  ~RunningProgram() {
    if (pid_ > 0) {
      signal(SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
  }
  RunningProgram(const RunningProgram&) = delete;
  RunningProgram& operator=(const RunningProgram&) = delete;

  pid_t pid() const { return pid_; }
  void signal(int number) const { kill(pid_, number); }

  std::string out() const { return text_of("out"); }
  std::string err() const { return text_of("err"); }

  /// Waits until standard error contains the text. Returns false after `limit`.
  bool wait_for_output(const std::string& text, std::chrono::seconds limit = std::chrono::seconds(30)) const {
    for (const auto end = std::chrono::steady_clock::now() + limit; std::chrono::steady_clock::now() < end;) {
      if (err().find(text) != std::string::npos) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
  }

  ProgramResult wait(std::chrono::seconds limit = std::chrono::seconds(120)) {
    int status = 0;
    const auto end = std::chrono::steady_clock::now() + limit;
    while (waitpid(pid_, &status, WNOHANG) == 0) {
      if (std::chrono::steady_clock::now() >= end) return {-1, out(), err() + "\n[did not end in time]"};
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    pid_ = -1;
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, out(), err()};
  }

 private:
  std::string text_of(const char* name) const {
    std::ifstream stream(files_.path() / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }

  TemporaryDirectory files_;
  pid_t pid_ = -1;
};

/// Runs a built program to its end.
inline ProgramResult run_program(const std::string& name, const std::vector<std::string>& arguments,
                                 const std::string& in = {}) {
  return RunningProgram(name, arguments, in).wait();
}

}  // namespace wrenchd::test
