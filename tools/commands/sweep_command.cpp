// SPDX-License-Identifier: GPL-3.0-or-later
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <unistd.h>

#include "daemon/option_checks.hpp"
#include "tools/commands/subcommand.hpp"

namespace wrenchd {
namespace {

/// Puts a directory in front of the entries of a list of paths in the environment.
void prepend(const char* variable, const std::filesystem::path& directory) {
  const char* const before = std::getenv(variable);
  const std::string rest = before != nullptr && *before != '\0' ? std::string(":") + before : std::string();
  ::setenv(variable, (directory.string() + rest).c_str(), 1);
}

/// sweep: the Python package does the work, because it also runs functions of Python programs.
class SweepCommand final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    CLI::App* sweep =
        app.add_subcommand("sweep",
                           "Run wrenchd in virtual time for every point of a grid of settings, and\n"
                           "write one table; an interrupted sweep continues where it was");
    sweep->add_option("file", file_, "TOML file: out, engine, [run] with config and seconds, [grid]")
        ->required()
        ->check(not_empty());
    sweep
        ->add_option(
            "--engine", engine_,
            "replaces the engine of the file: serial, a number of processes, dask (a cluster on this\n"
            "machine), or the address of a Dask scheduler, as tcp://host:8786")
        ->check(not_empty());
    sweep
        ->add_option(
            "--part", part_,
            "K/N: run only every N-th point from point K on, as in an array of Slurm jobs; the command\n"
            "without it then writes the table")
        ->check(not_empty());
    sweep->callback([this] { run(); });
  }

 private:
  /// Replaces this process by Python. Returns only if there is no Python, by an exception.
  void run() const {
    std::error_code error;
    const auto bin = std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
    if (!error) {
      prepend("PATH", bin);  // the sweep runs the wrenchd beside this program
      if (const auto built = bin.parent_path() / "python"; std::filesystem::exists(built / "wrenchd"))
        prepend("PYTHONPATH", built);
    }
    // Debian's Python has the packages that a sweep needs, whatever else is first in PATH.
    std::vector<std::string> words = {"/usr/bin/python3", "-m", "wrenchd.sweeps", file_};
    for (const auto& [option, value] : {std::pair{"--engine", engine_}, std::pair{"--part", part_}})
      if (!value.empty()) words.insert(words.end(), {option, value});
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    ::execv(arguments[0], arguments.data());
    throw std::runtime_error("sweep: Python cannot be started (" + std::string(std::strerror(errno)) +
                             "); install python3-wrenchd");
  }

  std::string file_, engine_, part_;
};

}  // namespace

std::unique_ptr<Subcommand> make_sweep_command() {
  return std::make_unique<SweepCommand>();
}

}  // namespace wrenchd
