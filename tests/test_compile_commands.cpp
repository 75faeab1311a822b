// SPDX-License-Identifier: GPL-3.0-or-later
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "tests/support/paths.hpp"

namespace wrenchd::test_compile_commands {

namespace {

/// The commands by which all of this was built, one a source, words apart. CMake writes one entry a line
/// pair, so no more of JSON is needed than to find the "command" and undo its escapes.
std::vector<std::vector<std::string>> commands() {
  std::ifstream file(wrenchd::test::program_path("../compile_commands.json"));
  std::vector<std::vector<std::string>> all;
  for (std::string line; std::getline(file, line);) {
    const std::string key = "\"command\": \"";
    const std::size_t at = line.find(key);
    if (at == std::string::npos) continue;
    std::string plain;
    for (std::size_t i = at + key.size(); i < line.size() && line[i] != '"'; ++i)
      plain += line[i] == '\\' ? line[++i] : line[i];
    std::istringstream words(plain);
    std::vector<std::string>& command = all.emplace_back();
    for (std::string word; words >> word;) command.push_back(word);
  }
  return all;
}

/// The last of the words that begin so, as the compiler takes it; empty: none.
std::string last(const std::vector<std::string>& command, const std::string& begin) {
  std::string found;
  for (const std::string& word : command)
    if (word.starts_with(begin)) found = word;
  return found;
}

}  // namespace

TEST_CASE("no file is compiled with -ffast-math or other flags that ignore NaN", "[compile_commands]") {
  const auto all = commands();
  REQUIRE(all.size() > 50);
  for (const auto& command : all) {
    INFO(command.back());
    for (const std::string& word : command)
      for (const char* unsafe : {"-ffast-math", "-Ofast", "-ffinite-math-only", "-funsafe-math-optimizations",
                                 "-fassociative-math", "-freciprocal-math", "-fno-signed-zeros"})
        CHECK(word != unsafe);
  }
}

TEST_CASE("the files that limit the wrench have explicit flags for strict IEEE arithmetic",
          "[compile_commands]") {
  int found = 0;
  for (const auto& command : commands()) {
    if (!command.back().ends_with("/core/limits.cpp") && !command.back().ends_with("/core/thermal.cpp"))
      continue;
    INFO(command.back());
    ++found;
    CHECK(last(command, "-ffp-contract") == "-ffp-contract=off");
    // The last word is the file's own, behind whatever a build or a packager adds.
    int said = 0;
    for (const std::string& word : command) said += word == "-fno-fast-math" ? 1 : 0;
    CHECK(said == 2);
  }
  CHECK(found == 2);
}

}  // namespace wrenchd::test_compile_commands
