// SPDX-License-Identifier: GPL-3.0-or-later
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include <catch2/catch.hpp>
#include <fcntl.h>
#include <hdf5.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include "daemon/recording/limited_child.hpp"
#include "daemon/recording/recording_file.hpp"
#include "daemon/recording/recording_stream.hpp"
#include "tests/support/mutated_recording.hpp"
#include "tests/support/random_values.hpp"
#include "tests/support/temporary_directory.hpp"

// Recordings of strangers. Libhdf5 follows links, reads external files, and crashes or loops on damaged
// files.

namespace wrenchd {
namespace {

namespace fs = std::filesystem;
using namespace test;

/// Opens a good recording for changes with libhdf5.
class Changed {
 public:
  explicit Changed(const fs::path& directory) : file_(directory / "changed.h5") {
    write_sample_recording(file_);
    id_ = H5Fopen(file_.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    REQUIRE(id_ >= 0);
  }
  hid_t id() const { return id_; }
  /// Closes the file and returns why it is rejected.
  std::string rejection() {
    H5Fclose(id_);
    try {
      read_recording(file_);
    } catch (const RecordingError& error) {
      return error.what();
    }
    return "accepted";
  }

 private:
  fs::path file_;
  hid_t id_ = -1;
};

void put_text(hid_t group, const char* name, const std::string& text, hid_t layout = H5P_DEFAULT) {
  const hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, text.size());
  const hsize_t one = 1;
  const hid_t space = H5Screate_simple(1, &one, nullptr);
  const hid_t set = H5Dcreate2(group, name, type, space, H5P_DEFAULT, layout, H5P_DEFAULT);
  REQUIRE(set >= 0);
  if (layout == H5P_DEFAULT) H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, text.data());
  H5Dclose(set), H5Sclose(space), H5Tclose(type);
}

TEST_CASE("a recording that refers to other files is rejected, and quotes none of them",
          "[recording][hostile]") {
  const TemporaryDirectory directory;
  const fs::path secret = directory.write("secret", "root:x:0:0 top secret");
  Changed changed(directory.path());
  SECTION("external storage") {
    H5Ldelete(changed.id(), "/config/settings", H5P_DEFAULT);
    const hid_t layout = H5Pcreate(H5P_DATASET_CREATE);
    REQUIRE(H5Pset_external(layout, secret.c_str(), 0, 21) >= 0);
    put_text(changed.id(), "/config/settings", std::string(21, ' '), layout);
    H5Pclose(layout);
    const std::string why = changed.rejection();
    CHECK_THAT(why, Catch::Contains("external storage"));
    CHECK_THAT(why, !Catch::Contains("root:x"));
  }
  SECTION("an external link to another recording") {
    write_sample_recording(directory.path() / "other.h5");
    H5Ldelete(changed.id(), "/config/scene", H5P_DEFAULT);
    REQUIRE(H5Lcreate_external("other.h5", "/config/scene", changed.id(), "/config/scene", H5P_DEFAULT,
                               H5P_DEFAULT) >= 0);
    CHECK_THAT(changed.rejection(), Catch::Contains("'scene' is a link to another object or file"));
  }
  SECTION("a soft link in place of a table") {
    H5Ldelete(changed.id(), "/contacts", H5P_DEFAULT);
    H5Lcreate_soft("/ticks", changed.id(), "/contacts", H5P_DEFAULT, H5P_DEFAULT);
    CHECK_THAT(changed.rejection(), Catch::Contains("'contacts' is a link"));
  }
  SECTION("a virtual data set") {
    H5Ldelete(changed.id(), "/meshes/tool", H5P_DEFAULT);
    const hsize_t count = 4;
    const hid_t space = H5Screate_simple(1, &count, nullptr), layout = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_virtual(layout, space, "other.h5", "/meshes/tool", space);
    const hid_t set =
        H5Dcreate2(changed.id(), "/meshes/tool", H5T_NATIVE_UINT8, space, H5P_DEFAULT, layout, H5P_DEFAULT);
    REQUIRE(set >= 0);
    H5Dclose(set), H5Pclose(layout), H5Sclose(space);
    CHECK_THAT(changed.rejection(), Catch::Contains("'tool' is not stored in this file"));
  }
}

TEST_CASE("a recording with other types than the writer makes is rejected before it is read",
          "[recording][hostile]") {
  const TemporaryDirectory directory;
  Changed changed(directory.path());
  const hsize_t one = 1;
  const hid_t space = H5Screate_simple(1, &one, nullptr);
  SECTION("a mesh of texts of variable length") {
    H5Ldelete(changed.id(), "/meshes/tool", H5P_DEFAULT);
    const hid_t type = H5Tcopy(H5T_C_S1);
    H5Tset_size(type, H5T_VARIABLE);
    const hid_t set =
        H5Dcreate2(changed.id(), "/meshes/tool", type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    const std::uint8_t embedded = 1;
    const hid_t scalar = H5Screate(H5S_SCALAR);
    const hid_t attribute = H5Acreate2(set, "embedded", H5T_NATIVE_UINT8, scalar, H5P_DEFAULT, H5P_DEFAULT);
    H5Awrite(attribute, H5T_NATIVE_UINT8, &embedded);
    H5Aclose(attribute), H5Sclose(scalar), H5Dclose(set), H5Tclose(type);
    CHECK_THAT(changed.rejection(), Catch::Contains("the mesh 'tool' does not consist of bytes"));
  }
  SECTION("a column of references") {
    const hid_t old = H5Dopen2(changed.id(), "/contacts", H5P_DEFAULT), old_type = H5Dget_type(old);
    const hid_t type = H5Tcreate(H5T_COMPOUND, H5Tget_size(old_type) + 64);
    for (int i = 0; i < H5Tget_nmembers(old_type); ++i) {
      const auto member = static_cast<unsigned>(i);
      char* const name = H5Tget_member_name(old_type, member);
      const hid_t column = i == 1 ? H5Tcopy(H5T_STD_REF_OBJ) : H5Tget_member_type(old_type, member);
      H5Tinsert(type, name, H5Tget_member_offset(old_type, member), column);
      H5free_memory(name), H5Tclose(column);
    }
    H5Dclose(old), H5Tclose(old_type);
    H5Ldelete(changed.id(), "/contacts", H5P_DEFAULT);
    H5Dclose(H5Dcreate2(changed.id(), "/contacts", type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
    H5Tclose(type);
    CHECK_THAT(changed.rejection(), Catch::Contains("has another type than recordings have"));
  }
  H5Sclose(space);
}

TEST_CASE("a recording that somebody has locked is not called damaged", "[recording]") {
  const TemporaryDirectory directory;
  const fs::path file = directory.path() / "run.h5";
  write_sample_recording(file);
  const OwnedFd held(::open(file.c_str(), O_RDWR | O_CLOEXEC));
  REQUIRE(::flock(held.get(), LOCK_EX | LOCK_NB) == 0);
  CHECK_THROWS_WITH(read_recording(file), Catch::Contains("still being written"));
  REQUIRE(::flock(held.get(), LOCK_UN) == 0);
  CHECK(read_recording(file).ticks.size() == kSampleTicks);
}

TEST_CASE("a FIFO in place of a recording is rejected without waiting", "[recording]") {
  const TemporaryDirectory directory;
  const fs::path fifo = directory.path() / "run.h5";
  REQUIRE(::mkfifo(fifo.c_str(), 0600) == 0);
  CHECK_THROWS_WITH(read_recording(fifo), Catch::Contains("is not a regular file"));
}

TEST_CASE("mutated recordings are read or rejected, and never crash or hang the reader",
          "[recording][hostile]") {
  const TemporaryDirectory directory;
  const fs::path file = directory.path() / "run.h5", mutant = directory.path() / "mutant.h5";
  write_sample_recording(file);
  const std::string good = read_bytes(file);
  RandomValues random(24);
  int accepted = 0, rejected = 0;
  for (int i = 0; i < 150; ++i) {
    write_bytes(mutant, mutate(good, random));
    try {
      const Recording recording = read_recording(mutant);
      for (std::size_t row = 0; row < recording.ticks.size(); ++row)
        accepted += recording.contacts_of(row).size() <= recording.contacts.size() ? 0 : 1000;
      ++accepted;
    } catch (const RecordingError& error) {
      CHECK_THAT(error.what(), Catch::Contains(mutant.string()));
      ++rejected;
    }
  }
  CHECK(accepted + rejected == 150);
}

TEST_CASE("the stream of a child that a hostile file has taken over is checked", "[recording][hostile]") {
  const auto frame = [](int kind, const std::string& content) {
    std::string bytes(1, static_cast<char>(kind));
    const auto length = static_cast<std::uint32_t>(content.size());
    bytes.append(reinterpret_cast<const char*>(&length), sizeof length);
    return bytes + content;
  };
  const auto kind = [](FrameKind k) { return static_cast<int>(k); };
  const std::string end = frame(kind(FrameKind::end), "");
  const auto decode = [](const std::string& stream) {
    RecordingDecoder decoder("run.h5", 1 << 20);
    for (const char c : stream)  // in the smallest pieces
      if (!decoder.feed({&c, 1})) break;
    return decoder.take();
  };
  CHECK(decode(end).ticks.empty());
  CHECK_THROWS_AS(decode(""), RecordingError);                   // no end
  CHECK_THROWS_AS(decode(frame(77, "") + end), RecordingError);  // no such kind
  CHECK_THROWS_AS(decode(frame(kind(FrameKind::ticks), "half a row") + end), RecordingError);
  CHECK_THROWS_AS(decode(frame(kind(FrameKind::file_role), "tool") + end), RecordingError);  // no file yet
  CHECK_THROWS_AS(decode(std::string("\x01\xff\xff\xff\xff", 5)), RecordingError);           // 4 GiB
  CHECK_THROWS_AS(
      decode(frame(kind(FrameKind::new_file), "") + frame(kind(FrameKind::file_role), "../../evil") + end),
      RecordingError);
  RecordingDecoder small("run.h5", 10);
  CHECK_THROWS_AS(small.feed(frame(kind(FrameKind::settings), "eleven bytes")), RecordingError);
  CHECK_THROWS_WITH(decode(frame(kind(FrameKind::error), "is \x1b[31mbad")), Catch::Contains("is ?[31mbad"));
  // Contacts that do not exist are not referred to.
  TickRow row;
  row.first_contact = 5, row.contact_count = 4'000'000'000;
  const Recording recording =
      decode(frame(kind(FrameKind::ticks), {reinterpret_cast<const char*>(&row), sizeof row}) + end);
  REQUIRE(recording.contact_ranges.size() == 1);
  CHECK(recording.contacts_of(0).empty());
}

TEST_CASE("a child that crashes, loops, opens files or fills the memory does no harm",
          "[recording][hostile]") {
  using Write = std::function<void(std::string_view)>;
  std::string got;
  const auto run = [&got](const std::function<void(const Write&)>& work) {
    got.clear();
    ChildLimits limits;
    limits.cpu_s = 0.2;
    limits.memory_bytes = std::uint64_t{64} << 20;
    return run_limited_child(limits, work, [&got](std::string_view part) {
      got += part;
      return true;
    });
  };
  CHECK_FALSE(run([](const Write& write) { write("all well"); }).out_of_time);
  CHECK(got == "all well");
  const ChildEnd aborted = run([](const Write&) { std::abort(); });
  CHECK(aborted.signal == SIGABRT);
  CHECK_FALSE(run([](const Write&) { throw std::runtime_error("x"); }).out_of_time);
  const ChildEnd looped = run([](const Write&) {
    for (std::atomic<unsigned> i{0};; ++i) {
    }
  });
  CHECK(looped.out_of_time);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  run([](const Write& write) {
    const bool opened = ::open("/etc/passwd", O_RDONLY) >= 0;
    const bool connected = ::socket(AF_UNIX, SOCK_STREAM, 0) >= 0;
    write(opened || connected ? "escaped" : "held");
  });
  CHECK(got == "held");
  run([](const Write& write) {
    try {
      const std::vector<char> much(std::size_t{1} << 30, 'x');
      write(std::string_view(much.data(), 1));
    } catch (const std::bad_alloc&) {
      write("no memory");
    }
  });
  CHECK(got == "no memory");
#endif
}

}  // namespace
}  // namespace wrenchd
