// SPDX-License-Identifier: GPL-3.0-or-later
#include <atomic>
#include <filesystem>
#include <fstream>
#include <thread>

#include <catch2/catch.hpp>
#include <fcntl.h>
#include <sys/stat.h>

#include "files/opened_file.hpp"
#include "files/sha256.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;
using test::TemporaryDirectory;
using Reason = FileError::Reason;

constexpr std::uint64_t kMax_bytes = 1 << 20;

fs::path put(const fs::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
  return file;
}

Reason reason_of(const fs::path& file, const FileScope& scope = {}, std::uint64_t max_bytes = kMax_bytes) {
  try {
    const OpenedFile opened(file, max_bytes, scope);
  } catch (const FileError& error) {
    return error.reason();
  }
  FAIL(file << " was opened");
  return {};
}

TEST_CASE("a regular file is read whole, up to the limit", "[files]") {
  const TemporaryDirectory directory;
  const std::string text(3'000'000, 'x');
  const fs::path file = put(directory.path() / "a", text);
  CHECK(read_file(file, text.size()) == text);
  CHECK(OpenedFile(file, text.size()).size_bytes() == text.size());
  CHECK(reason_of(file, {}, text.size() - 1) == Reason::too_large);
  CHECK(read_file(put(directory.path() / "empty", ""), 10).empty());
  // A file that grows after it was opened does not exceed the limit.
  const fs::path growing = put(directory.path() / "b", "12345");
  const OpenedFile opened(growing, 8);
  put(growing, "123456789");
  CHECK_THROWS_AS(opened.read(), FileError);
  CHECK_FALSE(read_file("/proc/self/status", kMax_bytes).empty());  // its size is 0 for fstat()
}

TEST_CASE("FIFOs, devices, directories and missing files are rejected without waiting", "[files]") {
  const TemporaryDirectory directory;
  REQUIRE(::mkfifo((directory.path() / "fifo").c_str(), 0600) == 0);
  CHECK(reason_of(directory.path() / "fifo") == Reason::not_regular);
  CHECK(reason_of("/dev/zero") == Reason::not_regular);
  CHECK(reason_of(directory.path()) == Reason::directory);
  CHECK(reason_of(directory.path() / "none") == Reason::not_found);
}

TEST_CASE("a limited scope includes only files beneath its directories, by name", "[files]") {
  const FileScope scope = FileScope::beneath({"/etc/wrenchd/", "/usr/share/wrenchd"});
  CHECK(scope.includes("/etc/wrenchd/scenes/a.toml"));
  CHECK(scope.includes("/etc/wrenchd/scenes/../a.toml"));
  CHECK(scope.includes("/usr/share/wrenchd/a.toml"));
  for (const char* outside :
       {"/etc/shadow", "/etc/wrenchd/../shadow", "/etc/wrenchdx/a", "/etc/wrenchd", "/", ""})
    CHECK_FALSE(scope.includes(outside));
  CHECK_FALSE(scope.includes(std::string("/etc/wrenchd/a\0b", 16)));
  CHECK(FileScope().includes("/etc/shadow"));
  CHECK_FALSE(FileScope::beneath({"/"}).includes("/etc/shadow"));
  CHECK_FALSE(FileScope::beneath({}).includes("/etc/shadow"));
}

TEST_CASE("in a limited scope no symbolic link is followed, at the end of the name or before", "[files]") {
  const TemporaryDirectory directory;
  const fs::path allowed = directory.path() / "allowed", outside = directory.path() / "outside";
  fs::create_directories(allowed / "sub");
  fs::create_directory(outside);
  put(outside / "secret", "root:x:0");
  put(allowed / "sub" / "mesh.off", "OFF");
  fs::create_symlink(outside / "secret", allowed / "link.off");
  fs::create_directory_symlink(outside, allowed / "linked");
  fs::create_directory_symlink(allowed, directory.path() / "alias");
  const FileScope scope = FileScope::beneath({allowed});
  CHECK(read_file(allowed / "sub/mesh.off", kMax_bytes, scope) == "OFF");
  CHECK(read_file(allowed / "link.off", kMax_bytes) == "root:x:0");  // without a limit links are followed
  CHECK(reason_of(allowed / "link.off", scope) == Reason::link);
  CHECK(reason_of(allowed / "linked/secret", scope) == Reason::link);
  CHECK(reason_of(outside / "secret", scope) == Reason::outside);
  CHECK(reason_of(allowed / "../outside/secret", scope) == Reason::outside);
  // The administrator may reach an allowed directory through a link.
  CHECK(read_file(directory.path() / "alias/sub/mesh.off", kMax_bytes,
                  FileScope::beneath({directory.path() / "alias"})) == "OFF");
  for (const BeneathBy by : {BeneathBy::kernel, BeneathBy::steps}) {
    const auto opens = [&](const fs::path& name) {
      return static_cast<bool>(open_beneath(allowed, name, O_RDONLY | O_CLOEXEC | O_NONBLOCK, by));
    };
    CHECK(opens("sub/mesh.off"));
    for (const char* name : {"link.off", "linked/secret", "../outside/secret", "sub/../../outside/secret"}) {
      INFO(name << ", by " << static_cast<int>(by));
      CHECK_FALSE(opens(name));
    }
  }
}

TEST_CASE("a file that is swapped with a FIFO and a link while it is read never leaks or hangs", "[files]") {
  const TemporaryDirectory directory;
  const fs::path allowed = directory.path() / "allowed", victim = allowed / "mesh.off";
  fs::create_directory(allowed);
  const fs::path secret = put(directory.path() / "secret", "root:x:0");
  std::atomic<bool> done{false};
  std::thread swapper([&] {
    for (unsigned i = 0; !done; ++i) {
      const fs::path next = allowed / "next";
      if (i % 3 == 0) put(next, "OFF");
      if (i % 3 == 1) ::mkfifo(next.c_str(), 0600);
      if (i % 3 == 2) fs::create_symlink(secret, next);
      ::rename(next.c_str(), victim.c_str());
    }
  });
  const FileScope scope = FileScope::beneath({allowed});
  int good = 0, other = 0;
  for (int i = 0; i < 10'000; ++i) try {
      const std::string text = read_file(victim, kMax_bytes, scope);
      if (text == "OFF")
        ++good;
      else if (!text.empty())  // the swapper writes the file before it has its name
        FAIL("read " << text);
    } catch (const FileError&) {
      ++other;
    }
  done = true;
  swapper.join();
  CHECK(good + other > 0);
}

TEST_CASE("SHA-256 of a known text", "[files]") {
  CHECK(sha256_hex("abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

}  // namespace
}  // namespace wrenchd
