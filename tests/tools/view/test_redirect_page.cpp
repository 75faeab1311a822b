// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>

#include <catch2/catch.hpp>
#include <sys/stat.h>

#include "tests/support/temporary_directory.hpp"
#include "tools/view/redirect_page.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

/// Sets XDG_RUNTIME_DIR for one test.
class RuntimeDirectory {
 public:
  explicit RuntimeDirectory(const char* value) {
    if (const char* const before = std::getenv("XDG_RUNTIME_DIR")) before_ = before;
    ::setenv("XDG_RUNTIME_DIR", value, 1);
  }
  ~RuntimeDirectory() {
    if (before_.empty())
      ::unsetenv("XDG_RUNTIME_DIR");
    else
      ::setenv("XDG_RUNTIME_DIR", before_.c_str(), 1);
  }
  RuntimeDirectory(const RuntimeDirectory&) = delete;
  RuntimeDirectory& operator=(const RuntimeDirectory&) = delete;

 private:
  std::string before_;
};

unsigned mode_of(const fs::path& file) {
  struct stat status {};
  REQUIRE(::stat(file.c_str(), &status) == 0);
  return status.st_mode & 0777U;
}

TEST_CASE("the address of the view reaches the browser in a file that only its owner reads", "[view]") {
  const std::string url = "http://127.0.0.1:8017/0123456789abcdef/";
  const test::TemporaryDirectory directory;
  fs::permissions(directory.path(), fs::perms::owner_all);
  fs::path file;
  SECTION("in the runtime directory") {
    const RuntimeDirectory runtime(directory.path().c_str());
    const RedirectPage page(url);
    file = page.file();
    CHECK(file.parent_path() == directory.path());
    CHECK(mode_of(file) == 0600U);
    std::ifstream in(file);
    const std::string text{std::istreambuf_iterator<char>(in), {}};
    CHECK_THAT(text, Catch::Contains("0;url=" + url));
    CHECK_THAT(file.string(), !Catch::Contains("0123456789abcdef"));
  }
  SECTION("in a directory of its own if others can write to the runtime directory") {
    fs::permissions(directory.path(), fs::perms::all);
    const RuntimeDirectory runtime(directory.path().c_str());
    const RedirectPage page(url);
    file = page.file();
    CHECK(file.parent_path() != directory.path());
    CHECK(mode_of(file) == 0600U);
    CHECK(mode_of(file.parent_path()) == 0700U);
  }
  CHECK_FALSE(fs::exists(file));
}

}  // namespace
}  // namespace wrenchd
