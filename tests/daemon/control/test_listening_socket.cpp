// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdlib>
#include <thread>

#include <catch2/catch.hpp>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include "daemon/control/listening_socket.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_listening_socket {

namespace {

namespace fs = std::filesystem;
using test::TemporaryDirectory;

const RoleRules kOwnerOnly{geteuid(), false, {}, {}, {}};

mode_t mode_of(const fs::path& path) {
  struct stat status {};
  REQUIRE(::lstat(path.c_str(), &status) == 0);
  return status.st_mode & 07777U;
}

bool connects(const fs::path& path) {
  const OwnedFd fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.native().copy(address.sun_path, sizeof address.sun_path - 1);
  return ::connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
}

/// Leaves a socket file without a listener, as a killed program does.
void leave_socket(const fs::path& path) {
  const OwnedFd fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.native().copy(address.sun_path, sizeof address.sun_path - 1);
  REQUIRE(::bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
}

std::string rejection_text(const fs::path& path) {
  try {
    const ListeningSocket socket(path, kOwnerOnly);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

bool has(const std::string& text, const std::string& part) {
  INFO(text);
  CHECK(text.find(part) != std::string::npos);
  return text.find(part) != std::string::npos;
}

TEST_CASE("a socket is created with its directory, with the mode of the roles, and removed with its daemon",
          "[listening_socket]") {
  const TemporaryDirectory dir;
  const fs::path path = dir.path() / "made" / "control.sock";
  {
    const ListeningSocket socket(path, kOwnerOnly);
    CHECK(connects(path));
    CHECK(mode_of(path) == 0600);
  }
  CHECK_FALSE(fs::exists(path));
  {
    const ListeningSocket socket(path, {geteuid(), false, getegid(), {}, {}});
    CHECK(mode_of(path) == 0660);
  }
  {
    const ListeningSocket socket(path, {geteuid(), false, {}, getegid(), {}});
    CHECK(mode_of(path) == 0660);
  }
  const ListeningSocket socket(path, {geteuid(), true, {}, getegid(), {}});
  CHECK(mode_of(path) == 0666);
}

TEST_CASE("the mode of a socket does not depend on the umask", "[listening_socket]") {
  const TemporaryDirectory dir;
  const mode_t before = ::umask(0);
  {
    const ListeningSocket socket(dir.path() / "control.sock", kOwnerOnly);
    CHECK(mode_of(dir.path() / "control.sock") == 0600);
  }
  ::umask(0777);
  {
    const ListeningSocket socket(dir.path() / "control.sock", {geteuid(), true, {}, {}, {}});
    CHECK(mode_of(dir.path() / "control.sock") == 0666);
  }
  ::umask(before);
}

TEST_CASE("the socket of a dead daemon is replaced, that of a live daemon is not", "[listening_socket]") {
  const TemporaryDirectory dir;
  const fs::path path = dir.path() / "control.sock";
  leave_socket(path);
  CHECK_FALSE(connects(path));
  {
    const ListeningSocket first(path, kOwnerOnly);
    CHECK(connects(path));
    CHECK(has(rejection_text(path),
              "control.sock: another wrenchd listens there; stop it, or name another path"));
    CHECK(connects(path));
  }
  const ListeningSocket again(path, kOwnerOnly);
  CHECK(connects(path));
}

TEST_CASE("another program's socket, and a file that is not a socket, stay unchanged", "[listening_socket]") {
  const TemporaryDirectory dir;
  const fs::path path = dir.path() / "control.sock";
  {
    const OwnedFd other(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.native().copy(address.sun_path, sizeof address.sun_path - 1);
    REQUIRE(::bind(other.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
    REQUIRE(::listen(other.get(), 1) == 0);
    CHECK(has(rejection_text(path), "another program listens there"));
    CHECK(connects(path));
  }
  fs::remove(path);
  dir.write("control.sock", "mine");
  CHECK(has(rejection_text(path), "exists and is not a socket; move it away"));
  CHECK(fs::file_size(path) == 4);
  fs::remove(path);
  fs::create_symlink(dir.path() / "elsewhere", path);
  CHECK(has(rejection_text(path), "exists and is not a socket"));
  CHECK_FALSE(fs::exists(dir.path() / "elsewhere"));
}

TEST_CASE("a directory in which other users could replace the socket is rejected", "[listening_socket]") {
  const TemporaryDirectory dir;
  fs::create_directory(dir.path() / "open");
  fs::permissions(dir.path() / "open", fs::perms::all);
  CHECK(has(rejection_text(dir.path() / "open/control.sock"), "other users can write there"));
  ::chmod((dir.path() / "open").c_str(), 01777);  // as /tmp: no user can replace another user's file
  CHECK(rejection_text(dir.path() / "open/control.sock") == "");
  CHECK(has(rejection_text(dir.path() / "gone/on/control.sock"),
            "gone/on: cannot be created: No such file or directory"));
  dir.write("file", "");
  CHECK(has(rejection_text(dir.path() / "file/control.sock"), "file: is not a directory"));
  CHECK(has(rejection_text(dir.path() / std::string(120, 'x')), "is longer than the 107 bytes"));
  if (geteuid() != 0) return;
  fs::create_directory(dir.path() / "others");
  REQUIRE(::chown((dir.path() / "others").c_str(), 65534, 65534) == 0);
  CHECK(has(rejection_text(dir.path() / "others/control.sock"), "belongs to uid 65534"));
}

TEST_CASE("a lock file that is a symbolic link is not followed", "[listening_socket]") {
  const TemporaryDirectory dir;
  const fs::path victim = dir.write("victim", "kept");
  fs::create_symlink(victim, dir.path() / "control.sock.lock");
  CHECK(has(rejection_text(dir.path() / "control.sock"), "control.sock.lock: cannot be created"));
  CHECK(fs::file_size(victim) == 4);
}

TEST_CASE("of several daemons that start at once exactly one listens", "[listening_socket]") {
  const TemporaryDirectory dir;
  const fs::path path = dir.path() / "control.sock";
  for (int round = 0; round < 20; ++round) {
    if (round % 2 == 0) leave_socket(path);
    std::vector<pid_t> children;
    std::array<int, 2> go{};
    REQUIRE(::pipe(go.data()) == 0);
    for (int i = 0; i < 6; ++i) {
      const pid_t child = ::fork();
      if (child == 0) {
        ::close(go[1]);
        char byte = 0;
        [[maybe_unused]] const ssize_t started = ::read(go[0], &byte, 1);
        int code = 1;
        try {
          const ListeningSocket socket(path, kOwnerOnly);
          ::usleep(100'000);  // until all have tried
          code = 0;
        } catch (...) {
        }
        ::_exit(code);
      }
      children.push_back(child);
    }
    ::close(go[0]);
    ::close(go[1]);
    int listening = 0;
    for (const pid_t child : children) {
      int status = 0;
      ::waitpid(child, &status, 0);
      listening += WIFEXITED(status) && WEXITSTATUS(status) == 0 ? 1 : 0;
    }
    CHECK(listening == 1);
    fs::remove(path);
  }
}

TEST_CASE("a socket passed by systemd is used, and its file stays", "[listening_socket]") {
  const TemporaryDirectory dir;
  const fs::path path = dir.path() / "control.sock";
  // In a child: descriptor 3 may be in use here.
  const auto passed = [&](bool listens) {
    const pid_t child = ::fork();
    if (child == 0) {
      const int fd = ::socket(AF_UNIX, SOCK_STREAM, 0);
      sockaddr_un address{};
      address.sun_family = AF_UNIX;
      path.native().copy(address.sun_path, sizeof address.sun_path - 1);
      int code = 1;
      if (::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 &&
          (!listens || ::listen(fd, 5) == 0) && (fd == 3 || ::dup2(fd, 3) == 3)) {
        ::setenv("LISTEN_PID", std::to_string(::getpid()).c_str(), 1);
        ::setenv("LISTEN_FDS", "1", 1);
        try {
          const ListeningSocket socket("/no/such/directory/control.sock", kOwnerOnly);
          code = socket.fd() == 3 && connects(path) ? 0 : 2;
        } catch (const std::runtime_error& error) {
          code = std::string(error.what()).find("ListenStream=") != std::string::npos ? 3 : 4;
        }
      }
      ::_exit(code);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  };
  CHECK(passed(true) == 0);
  CHECK(fs::exists(path));
  fs::remove(path);
  CHECK(passed(false) == 3);
}

TEST_CASE("the socket path is taken from command line, environment, configuration, system, in this order",
          "[listening_socket]") {
  struct Environment {
    std::string socket = std::getenv("WRENCHD_SOCKET") ? std::getenv("WRENCHD_SOCKET") : "";
    ~Environment() {
      ::setenv("WRENCHD_SOCKET", socket.c_str(), 1);
      ::unsetenv("RUNTIME_DIRECTORY");
    }
  } const kept;
  ControlSettings settings;
  ::unsetenv("WRENCHD_SOCKET");
  CHECK_FALSE(choose_socket_path("", settings).explicitly_named);
  CHECK(choose_socket_path("", settings).path.filename() == "control.sock");
  ::setenv("RUNTIME_DIRECTORY", "/run/a:/run/b", 1);
  CHECK(choose_socket_path("", settings).path == "/run/a/control.sock");
  CHECK(choose_socket_path("", settings).explicitly_named);
  settings.socket = "/run/c.sock";
  CHECK(choose_socket_path("", settings).path == "/run/c.sock");
  ::setenv("WRENCHD_SOCKET", "/run/d.sock", 1);
  CHECK(choose_socket_path("", settings).path == "/run/d.sock");
  CHECK(choose_socket_path("/run/e.sock", settings).path == "/run/e.sock");
  CHECK(choose_socket_path("none", settings).path.empty());
  CHECK_THROWS_WITH(choose_socket_path("e.sock", settings),
                    "--control: expected an absolute path, or \"none\", found \"e.sock\"");
}

}  // namespace
}  // namespace wrenchd::test_listening_socket
