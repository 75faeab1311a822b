// SPDX-License-Identifier: GPL-3.0-or-later
#include <atomic>
#include <filesystem>
#include <string>
#include <thread>

#include <catch2/catch.hpp>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "core/files/opened_file.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_opened_file {

namespace {

using namespace test;
namespace fs = std::filesystem;

/// Returns the problem and the reason of the error that opening this file gives.
std::pair<FileProblem, std::string> rejection(const fs::path& file, const FileScope& scope = {}) {
  try {
    read_file(file, 1 << 20, scope);
  } catch (const FileError& error) {
    return {error.problem(), error.what()};
  }
  FAIL(file << " was read");
  return {};
}

/// Selects the fall-back for kernels without openat2 as long as this object exists.
struct Fallback {
  explicit Fallback(bool wanted) { OpenedFile::use_fallback(wanted); }
  ~Fallback() { OpenedFile::use_fallback(false); }
};

TEST_CASE("a regular file is read whole, and only as far as permitted", "[opened_file]") {
  const TemporaryDirectory dir;
  const std::string content(100'000, 'x');
  const fs::path file = dir.write("a", content);
  CHECK(read_file(file) == content);
  CHECK(read_file(dir.write("empty", "")).empty());
  OpenedFile opened(file);
  CHECK(opened.size_bytes() == content.size());
  CHECK(opened.peek(3) == "xxx");
  CHECK(opened.read() == content);
  CHECK(read_file(file, content.size()) == content);
  CHECK_THROWS_AS(read_file(file, content.size() - 1), FileError);
  CHECK(!read_file("/proc/self/status").empty());  // its stated size is 0
  fs::create_symlink(file, dir.path() / "link");
  CHECK(read_file(dir.path() / "link") == content);
}

TEST_CASE("what is no regular file is named as what it is, and opening it does not wait", "[opened_file]") {
  const TemporaryDirectory dir;
  const fs::path fifo = dir.path() / "fifo", socket = dir.path() / "socket";
  REQUIRE(::mkfifo(fifo.c_str(), 0600) == 0);
  const int listening = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  socket.native().copy(address.sun_path, sizeof address.sun_path - 1);
  REQUIRE(::bind(listening, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
  for (const FileScope& scope : {FileScope(), FileScope::beneath({dir.path()})}) {
    CHECK(rejection(fifo, scope).second == "is a FIFO; name a regular file");
    CHECK(rejection(socket, scope).first == FileProblem::not_regular);
    CHECK(rejection(dir.path() / "none", scope).first == FileProblem::missing);
    fs::create_directory(dir.path() / "folder");
    CHECK(rejection(dir.path() / "folder", scope).second == "is a directory; name a file in it");
  }
  ::close(listening);
  CHECK(rejection("/dev/null").second == "is a character device; name a regular file");
}

TEST_CASE("a scope permits files beneath its directories that are reached without a link", "[opened_file]") {
  for (const bool without_openat2 : {false, true}) {
    const Fallback fallback(without_openat2);
    const TemporaryDirectory dir;
    const fs::path inside = dir.path() / "inside";
    dir.write("inside/a", "good");
    dir.write("inside/b/c", "good");
    dir.write("outside", "secret");
    fs::create_symlink(dir.path() / "outside", inside / "link");
    fs::create_symlink("a", inside / "link_inside");
    fs::create_symlink(dir.path(), inside / "up");
    const FileScope scope = FileScope::beneath({inside, dir.path() / "none"});
    CHECK(read_file(inside / "a", 100, scope) == "good");
    CHECK(read_file(inside / "b/c", 100, scope) == "good");
    CHECK(read_file(inside / "b/../a", 100, scope) == "good");
    CHECK(rejection(inside / "link", scope).first == FileProblem::linked);
    CHECK(rejection(inside / "link_inside", scope).first == FileProblem::linked);
    CHECK(rejection(inside / "up/outside", scope).first == FileProblem::linked);
    CHECK(rejection(inside / "b/none", scope).first == FileProblem::missing);
    CHECK(rejection(inside / "a/none", scope).first == FileProblem::missing);
    // Outside, the answer does not depend on the file.
    for (const fs::path& file :
         {dir.path() / "outside", dir.path() / "missing", inside / "../outside", fs::path("/etc/shadow")}) {
      CHECK(rejection(file, scope).first == FileProblem::outside);
      CHECK_FALSE(scope.contains(file));
    }
  }
  CHECK_FALSE(FileScope::beneath({"/"}).contains("/etc/passwd"));
}

TEST_CASE("a name that changes between a FIFO, a link and a file gives the file or an error",
          "[opened_file]") {
  for (const bool without_openat2 : {false, true}) {
    const Fallback fallback(without_openat2);
    const TemporaryDirectory dir;
    const fs::path inside = dir.path() / "inside", name = inside / "name";
    dir.write("secret", "secret");
    dir.write("inside/file", "good");
    const FileScope scope = FileScope::beneath({inside});
    constexpr int kSwaps = 10'000;
    std::atomic<bool> done{false};
    std::thread swaps([&] {
      for (int i = 0; i < kSwaps; ++i) {
        const fs::path next = inside / "next";
        ::unlink(next.c_str());
        if (i % 3 == 0) [[maybe_unused]]
          const int made = ::mkfifo(next.c_str(), 0600);
        if (i % 3 == 1) [[maybe_unused]]
          const int made = ::symlink("../secret", next.c_str());
        if (i % 3 == 2) [[maybe_unused]]
          const int made = ::link((inside / "file").c_str(), next.c_str());
        ::rename(next.c_str(), name.c_str());
      }
      done = true;
    });
    long read = 0, rejected = 0, other = 0;
    while (!done) try {
        (read_file(name, 100, scope) == "good" ? read : other) += 1;
      } catch (const FileError&) {
        ++rejected;
      }
    swaps.join();
    CHECK(other == 0);
    CHECK(read + rejected > 100);
  }
}

}  // namespace
}  // namespace wrenchd::test_opened_file
