// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/gnuplot.hpp"

#include <array>
#include <cstring>
#include <stdexcept>

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace wrenchd {

void run_gnuplot(const std::filesystem::path& directory, const std::string& script, const std::string& left) {
  std::string program = "gnuplot";
  std::string name = script;
  std::array<char*, 3> arguments = {program.data(), name.data(), nullptr};
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, directory.c_str());
  pid_t child = 0;
  const int error = posix_spawnp(&child, program.c_str(), &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0)
    throw std::runtime_error("gnuplot: cannot be run (" + std::string(std::strerror(error)) +
                             "); install the package gnuplot-nox" + left);
  int status = 0;
  waitpid(child, &status, 0);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
    throw std::runtime_error("gnuplot: failed on " + script + "; see its message above" + left);
}

}  // namespace wrenchd
