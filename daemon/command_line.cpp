// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/command_line.hpp"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <iterator>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "config/near_file.hpp"
#include "config/nearest_key.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

bool is_option(const std::string& word) {
  return word.size() > 1 && word.front() == '-' && word != "--";
}

/// "--trangles" for "--trangles=10"
std::string name_of(const std::string& word) {
  return word.substr(0, word.find('='));
}

std::string without_dashes(const std::string& option) {
  return option.substr(std::min(option.find_first_not_of('-'), option.size()));
}

/// The subcommand that was parsed last, or the app itself.
const CLI::App& innermost(const CLI::App& app) {
  const std::vector<CLI::App*> parsed = app.get_subcommands();
  return parsed.empty() ? app : innermost(*parsed.back());
}

/// "wrenchctl scene add"
std::string full_name(const CLI::App& app) {
  return app.get_parent() == nullptr ? fs::path(app.get_name()).filename().string()
                                     : full_name(*app.get_parent()) + " " + app.get_name();
}

std::vector<std::string> long_options(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options({}))
    for (const std::string& name : option->get_lnames()) names.push_back(name);
  return names;
}

std::vector<std::string> visible_subcommands(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands({}))
    if (!command->get_group().empty()) names.push_back(command->get_name());
  return names;
}

/// Returns the command that has an option of this name, or the nearest one; "" is no name.
std::pair<const CLI::App*, std::string> command_with_option(const CLI::App& app, const std::string& typed) {
  std::pair<const CLI::App*, std::string> near;
  for (const CLI::App* other : app.get_subcommands({})) {
    if (other->get_group().empty()) continue;
    const std::vector<std::string> theirs = long_options(*other);
    if (std::find(theirs.begin(), theirs.end(), typed) != theirs.end()) return {other, typed};
    const std::string name = nearest_name(typed, theirs);
    if (near.second.empty() && !name.empty()) near = {other, name};
  }
  return near;
}

/// Returns advice about an option that no command on the line has in this place.
std::string option_advice(const CLI::App& app, const std::string& word) {
  const CLI::App& command = innermost(app);
  const std::string typed = without_dashes(name_of(word));
  const std::vector<std::string> known = long_options(command);
  if (std::find(known.begin(), known.end(), typed) != known.end())
    return word.starts_with("--") ? "; it belongs after '" + command.get_name() + "'"
                                  : "; did you mean '--" + typed + "'?";
  if (const std::string near = nearest_name(typed, known); !near.empty())
    return "; did you mean '--" + near + "'?";
  for (const CLI::Option* option : command.get_options({}))
    if (option->get_positional() && option->get_name() == typed)
      return "; give the " + typed + " without '" + name_of(word) + "'";
  if (const auto [other, name] = command_with_option(app, typed); other != nullptr)
    return "; '--" + name + "' is an option of commands such as '" + full_name(*other) + "'";
  return "; " + full_name(command) + " --help lists the options";
}

/// Returns whether a text has this word, in upper or lower case.
bool has_word(std::string text, std::string word) {
  for (char& c : text)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = ' ';
  std::istringstream words(CLI::detail::to_lower(text));
  return std::find(std::istream_iterator<std::string>(words), {}, CLI::detail::to_lower(word)) !=
         std::istream_iterator<std::string>();
}

/// Returns advice about a word in the place of a command: the nearest command, or those whose description has
/// the word.
std::string command_advice(const CLI::App& command, const std::string& word) {
  constexpr std::size_t kMostCommands = 3;
  if (const std::string near = nearest_name_advice(word, visible_subcommands(command)); !near.empty())
    return near;
  if (!nearest_name(word, {"help"}).empty()) return "; did you mean '--help'?";
  std::vector<std::string> about;
  for (const CLI::App* other : command.get_subcommands({}))
    if (!other->get_group().empty() && has_word(other->get_description(), word))
      about.push_back("'" + full_name(*other) + "'");
  const std::string help = "; " + full_name(command) + " --help lists the commands";
  if (about.empty() || about.size() > kMostCommands) return help;
  return help + "; about it: " + CLI::detail::join(about, ", ");
}

/// Returns advice about a word that is neither an option nor the value of one.
std::string word_advice(const CLI::App& app, const std::string& word) {
  const CLI::App& command = innermost(app);
  if (!visible_subcommands(command).empty()) return command_advice(command, word);
  return "; " + full_name(command) + " --help shows what it accepts";
}

}  // namespace

/// A word in the place of a subcommand comes before the options after it, which belong to that subcommand.
std::string mistake_text(const CLI::App& app, const CLI::Error& error) {
  std::string text = error.what();
  const std::vector<std::string> unexpected = app.remaining(true);
  const auto option = std::find_if(unexpected.begin(), unexpected.end(), is_option);
  const bool no_command = !visible_subcommands(innermost(app)).empty();
  const bool word_first = !unexpected.empty() && !is_option(unexpected.front());
  const std::string start = "The following argument was not expected: ";
  const bool only_words =
      option == unexpected.end() && error.get_exit_code() == static_cast<int>(CLI::ExitCodes::ExtrasError);
  if (word_first && (no_command || only_words))
    text = start + unexpected.front() + word_advice(app, unexpected.front());
  else if (option != unexpected.end())
    text = start + *option + option_advice(app, *option);
  return text + "\nRun with --help for more information.\n";
}

void advise_on_mistakes(CLI::App& app) {
  app.failure_message(
      [](const CLI::App* failed, const CLI::Error& error) { return mistake_text(*failed, error); });
}

std::string file_advice(const std::string& message, int argc, const char* const* argv) {
  if (message.find("did you mean") != std::string::npos) return {};
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    std::error_code ignored;
    if (word.empty() || is_option(word) || message.find(word) == std::string::npos ||
        fs::exists(word, ignored))
      continue;
    if (const fs::path near = near_file(word); !near.empty())
      return "; did you mean '" + near.string() + "'?";
  }
  return {};
}

}  // namespace wrenchd
