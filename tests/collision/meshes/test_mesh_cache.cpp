// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>
#include <sys/stat.h>
#include <unistd.h>

#include "collision/meshes/mesh_cache.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_mesh_cache {

namespace {

namespace fs = std::filesystem;
using namespace test;

struct Bench {
  TemporaryDirectory dir;
  fs::path directory = dir.path() / "a" / "b";
  MeshCache cache{directory};
  std::string key = MeshCache::key({"one", "two"});

  fs::path only_file() const {
    REQUIRE(std::distance(fs::directory_iterator(directory), fs::directory_iterator()) == 1);
    return fs::directory_iterator(directory)->path();
  }
  std::string contents() const {
    std::ifstream in(only_file(), std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void put(const std::string& bytes) const { dir.write(fs::relative(only_file(), dir.path()), bytes); }
};

TEST_CASE("a cache returns what was written under the same key only", "[mesh_cache]") {
  Bench bench;
  const std::string bytes("some\0bytes", 10);
  CHECK_FALSE(bench.cache.read(bench.key));
  REQUIRE(bench.cache.write(bench.key, bytes));
  CHECK(bench.cache.read(bench.key) == bytes);
  CHECK(MeshCache(bench.directory).read(bench.key) == bytes);
  CHECK_FALSE(bench.cache.read(MeshCache::key({"one", "three"})));
  CHECK_FALSE(bench.cache.read(MeshCache::key({"onetwo"})));
  CHECK_FALSE(bench.cache.read(MeshCache::key({"onet", "wo"})));
  REQUIRE(bench.cache.write(bench.key, "others"));
  CHECK(bench.cache.read(bench.key) == "others");
  REQUIRE(bench.cache.write(bench.key, ""));
  CHECK(bench.cache.read(bench.key) == "");
  bench.only_file();
}

TEST_CASE("a cache file with any modified, missing or additional byte counts as missing", "[mesh_cache]") {
  Bench bench;
  REQUIRE(bench.cache.write(bench.key, "some bytes"));
  const std::string good = bench.contents();
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 1);
    bench.put(bad);
    INFO(i);
    CHECK_FALSE(bench.cache.read(bench.key));
  }
  for (std::size_t size = 0; size < good.size(); ++size) {
    bench.put(good.substr(0, size));
    CHECK_FALSE(bench.cache.read(bench.key));
  }
  bench.put(good + "x");
  CHECK_FALSE(bench.cache.read(bench.key));
  bench.put("not a cache file at all, but long enough for one: " + std::string(1000, '.'));
  CHECK_FALSE(bench.cache.read(bench.key));
  bench.put(good);
  CHECK(bench.cache.read(bench.key));
  // The file can be overwritten.
  bench.put("no");
  REQUIRE(bench.cache.write(bench.key, "some bytes"));
  CHECK(bench.contents() == good);
}

TEST_CASE("a cache file with a wrong key, unsafe permissions or a wrong type is not trusted",
          "[mesh_cache]") {
  Bench bench;
  REQUIRE(bench.cache.write(bench.key, "some bytes"));
  const fs::path file = bench.only_file();
  const std::string other = MeshCache::key({"other"});
  REQUIRE(bench.cache.write(other, "other bytes"));
  for (const auto& entry : fs::directory_iterator(bench.directory))
    if (entry.path() != file) fs::rename(entry.path(), file);
  CHECK_FALSE(bench.cache.read(bench.key));
  REQUIRE(bench.cache.write(bench.key, "some bytes"));
  REQUIRE(::chmod(file.c_str(), 0666) == 0);
  CHECK_FALSE(bench.cache.read(bench.key));
  REQUIRE(bench.cache.write(bench.key, "some bytes"));
  CHECK(bench.cache.read(bench.key));
  fs::rename(file, bench.dir.path() / "elsewhere");
  fs::create_symlink(bench.dir.path() / "elsewhere", file);
  CHECK_FALSE(bench.cache.read(bench.key));
  fs::remove(file);
  fs::create_directory(file);
  CHECK_FALSE(bench.cache.read(bench.key));
  fs::remove(file);
  REQUIRE(::mkfifo(file.c_str(), 0600) == 0);
  CHECK_FALSE(bench.cache.read(bench.key));
}

TEST_CASE("a directory that is not writable is reported and causes no error", "[mesh_cache]") {
  const TemporaryDirectory dir;
  const fs::path file = dir.write("file", "");
  MeshCache cache(file / "cache");
  CHECK_FALSE(cache.write(MeshCache::key({"a"}), "bytes"));
  CHECK(cache.error().find((file / "cache").string() + ": cannot be made (") == 0);
  CHECK_FALSE(cache.read(MeshCache::key({"a"})));
  MeshCache off({});
  CHECK(off.disabled());
  CHECK_FALSE(off.write(MeshCache::key({"a"}), "bytes"));
}

TEST_CASE("the cache directory follows the system or the user", "[mesh_cache]") {
  struct Variable {
    explicit Variable(const char* name_) : name(name_), was(std::getenv(name_) ? std::getenv(name_) : "") {}
    ~Variable() { was.empty() ? ::unsetenv(name) : ::setenv(name, was.c_str(), 1); }
    void set(const char* value) const { ::setenv(name, value, 1); }
    const char* name;
    std::string was;
  } const service("CACHE_DIRECTORY"), base("XDG_CACHE_HOME"), home("HOME");
  home.set("/home/somebody");
  base.set("");
  service.set("");
  CHECK(cache_directory() == "/home/somebody/.cache/wrenchd");
  base.set("/somewhere");
  CHECK(cache_directory() == "/somewhere/wrenchd");
  base.set("not/absolute");
  CHECK(cache_directory() == "/home/somebody/.cache/wrenchd");
  service.set("/var/cache/wrenchd:/var/cache/other");
  CHECK(cache_directory() == "/var/cache/wrenchd");
  service.set("");
  base.set("");
  home.set("");
  CHECK(cache_directory().empty());
}

}  // namespace
}  // namespace wrenchd::test_mesh_cache
