// SPDX-License-Identifier: GPL-3.0-or-later
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <thread>

#include <catch2/catch.hpp>
#include <sys/stat.h>

#include "tests/support/run_program.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tools/view/address_file.hpp"

namespace wrenchd::test_address_file {

namespace {

using namespace test;
namespace fs = std::filesystem;
using namespace std::chrono_literals;

std::string text_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Sets an environment variable as long as this object exists.
struct Variable {
  std::string name, previous;
  bool was_set;
  Variable(const char* variable, const std::string& value) : name(variable) {
    const char* const old = std::getenv(variable);
    was_set = old != nullptr;
    if (was_set) previous = old;
    ::setenv(variable, value.c_str(), 1);
  }
  ~Variable() {
    if (was_set)
      ::setenv(name.c_str(), previous.c_str(), 1);
    else
      ::unsetenv(name.c_str());
  }
};

TEST_CASE("the file with the address is readable by its owner alone, and is removed", "[address_file]") {
  const TemporaryDirectory runtime;
  fs::permissions(runtime.path(), fs::perms::owner_all);
  const Variable variable("XDG_RUNTIME_DIR", runtime.path());
  fs::path path;
  {
    AddressFile file("http://127.0.0.1:4000/secret/");
    path = file.path();
    CHECK(path.string().starts_with(runtime.path().string()));
    struct stat status {};
    REQUIRE(::stat(path.c_str(), &status) == 0);
    CHECK((status.st_mode & 0777) == 0600);
    REQUIRE(::stat(path.parent_path().c_str(), &status) == 0);
    CHECK((status.st_mode & 0777) == 0700);
    CHECK(text_of(path).find("url=http://127.0.0.1:4000/secret/\"") != std::string::npos);
  }
  CHECK_FALSE(fs::exists(path.parent_path()));
  // Others may write to this directory, so it is not used.
  fs::permissions(runtime.path(), fs::perms::all);
  CHECK_FALSE(
      AddressFile("http://127.0.0.1:4000/secret/").path().string().starts_with(runtime.path().string()));
}

TEST_CASE("wrenchctl view --open puts the token on no command line", "[address_file]") {
  const TemporaryDirectory dir;
  const fs::path program =
      dir.write("bin/xdg-open", "#!/bin/sh\nprintf '%s' \"$*\" > '" + (dir.path() / "words").string() +
                                    "'\ncp \"$1\" '" + (dir.path() / "page").string() + "'\ntouch '" +
                                    (dir.path() / "done").string() + "'\n");
  fs::permissions(program, fs::perms::owner_all);
  const Variable path("PATH", (dir.path() / "bin").string() + ":" + std::getenv("PATH"));
  RunningProgram view("wrenchctl", {"view", "--open", "--socket", (dir.path() / "nobody.sock").string()});
  for (int i = 0; i < 3000 && !fs::exists(dir.path() / "done"); ++i) std::this_thread::sleep_for(10ms);
  const std::string words = text_of(dir.path() / "words"), page = text_of(dir.path() / "page");
  const std::size_t url = page.find("url=http://127.0.0.1:");
  REQUIRE(url != std::string::npos);
  const std::size_t slash = page.find('/', url + 11);
  const std::string token = page.substr(slash + 1, 32);
  CHECK(token.find_first_not_of("0123456789abcdef") == std::string::npos);
  CHECK(words.find(token) == std::string::npos);
  CHECK(words.find("http") == std::string::npos);
  view.signal(SIGTERM);
  view.wait();
  CHECK_FALSE(fs::exists(words));  // its only word was the file
}

}  // namespace
}  // namespace wrenchd::test_address_file
