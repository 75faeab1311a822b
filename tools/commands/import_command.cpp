// SPDX-License-Identifier: GPL-3.0-or-later
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <unistd.h>

#include "tools/commands/subcommand.hpp"
#include "tools/import/import_options.hpp"

namespace wrenchd {
namespace {

/// import: wrenchd-import does the work, because wrenchctl must not depend on the libraries that read CAD
/// files. Both have the same options.
class ImportCommand final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    CLI::App* command = app.add_subcommand("import", kImportDescription);
    add_import_options(*command, options_);
    command->callback([command] { run(*command); });
  }

 private:
  /// Returns the words of the command line that the command was given, in the order of the options.
  static std::vector<std::string> words_of(const CLI::App& command) {
    std::vector<std::string> words;
    for (const CLI::Option* option : command.get_options()) {
      if (option->count() == 0) continue;
      if (option->get_positional()) {
        words.insert(words.begin(), option->results().begin(), option->results().end());
      } else if (option->get_expected_max() == 0) {
        words.push_back("--" + option->get_lnames().front());
      } else {
        for (const std::string& value : option->results())
          words.push_back("--" + option->get_lnames().front() + "=" + value);
      }
    }
    return words;
  }

  /// Replaces this process by wrenchd-import: the one beside this program, otherwise the one in PATH. Returns
  /// only if there is none, by an exception.
  static void run(const CLI::App& command) {
    std::vector<std::string> words = words_of(command);
    words.insert(words.begin(), "wrenchd-import");
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    std::error_code error;
    const auto program = std::filesystem::read_symlink("/proc/self/exe", error);
    if (!error) ::execv((program.parent_path() / words.front()).c_str(), arguments.data());
    ::execvp(arguments[0], arguments.data());
    if (errno == ENOENT)
      throw std::runtime_error(
          "import: there is no program wrenchd-import; install its package wrenchd-import, or build it in "
          "the source "
          "tree: tools/setup release wrenchd-import");
    throw std::runtime_error("import: wrenchd-import cannot be started (" +
                             std::string(std::strerror(errno)) +
                             "); install the package wrenchd-import again");
  }

  ImportOptions options_;
};

}  // namespace

std::unique_ptr<Subcommand> make_import_command() {
  return std::make_unique<ImportCommand>();
}

}  // namespace wrenchd
