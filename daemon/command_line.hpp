// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

namespace CLI {
class App;
class Error;
}  // namespace CLI

namespace wrenchd {

/// Makes the app answer an invalid command line with mistake_text().
void advise_on_mistakes(CLI::App& app);

/// Returns what is wrong with the parsed command line, with the name that was probably meant: of a subcommand
/// or an option. An unknown option comes first, because its value may cause the other errors. Not RT-safe:
/// allocates.
std::string mistake_text(const CLI::App& app, const CLI::Error& error);

/// Completes the message about a rejected file. If the command line names a file that does not exist, and the
/// message has no advice yet, returns "; did you mean 'FILE'?" for a file of a similar name; else "". Not
/// RT-safe: reads directories.
std::string file_advice(const std::string& message, int argc, const char* const* argv);

}  // namespace wrenchd
