// SPDX-License-Identifier: GPL-3.0-or-later
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <stdexcept>
#include <string>

#include <CLI/CLI.hpp>
#include <sys/signalfd.h>
#include <unistd.h>

#include "daemon/command_line.hpp"
#include "daemon/option_checks.hpp"
#include "daemon/standard_streams.hpp"
#include "daemon/version.hpp"
#include "tools/spacenav/spacenav_bridge.hpp"

namespace {

using namespace wrenchd;

/// Returns the path that libspnav uses: that of SPNAV_SOCKET, or /run/spnav.sock, which only root can create.
std::string default_path() {
  const char* const named = std::getenv("SPNAV_SOCKET");
  if (named != nullptr && *named != '\0') return named;
  if (::geteuid() == 0) return "/run/spnav.sock";
  const char* const run = std::getenv("XDG_RUNTIME_DIR");
  if (run == nullptr || *run == '\0')
    throw std::runtime_error(
        "no directory for the socket: XDG_RUNTIME_DIR is not set; name a path with --serve");
  return std::string(run) + "/spnav.sock";
}

/// Blocks SIGINT and SIGTERM, and returns a descriptor that can be read when one of them arrives.
OwnedFd end_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return OwnedFd(::signalfd(-1, &signals, SFD_CLOEXEC));
}

void serve(std::string path, bool all_users, const SpacenavOptions& options) {
  if (path.empty()) path = default_path();
  const OwnedFd end = end_signals();
  SpacenavServer server(path, all_users);
  std::printf("serving %s\n", path.c_str());
  if (path != "/run/spnav.sock") std::printf("for your programs: export SPNAV_SOCKET=%s\n", path.c_str());
  std::fflush(stdout);
  SpacenavBridge(server, options).run(end.get());
}

}  // namespace

int main(int argc, char** argv) {
  if (!open_standard_streams()) return 1;  // else a file that is opened gets the number of a closed stream
  CLI::App app(
      "wrenchd-spnav: steers programs of libspnav, such as Blender and FreeCAD, with the device of wrenchd.\n"
      "It serves the socket of spacenavd with the motion of the hand and the buttons of the device.");
  app.set_version_flag("--version", std::string("wrenchd-spnav ") + kVersion);
  app.footer(
      "Exit codes: 0 ended by SIGINT or SIGTERM; 1 rejected (standard error names the remedy);\n"
      "over 100: invalid command line.");
  std::string path;
  bool all_users = false;
  SpacenavOptions options;
  int period_ms = 16;
  std::string pose = "hand";
  app.add_option("--serve", path,
                 "path of the socket for programs; without it $SPNAV_SOCKET, or\n"
                 "/run/spnav.sock for root, which libspnav finds by itself, or\n"
                 "$XDG_RUNTIME_DIR/spnav.sock")
      ->check(not_empty());
  app.add_flag("--all-users", all_users, "programs of all users may connect and see the motion");
  app.add_option("--socket", options.daemon_socket, "socket of wrenchd; without it the same as for wrenchctl")
      ->check(not_empty());
  app.add_option("--pose", pose,
                 "hand: programs follow the hand; tool: they follow the tool, which obstacles stop")
      ->check(one_of({"hand", "tool"}))
      ->capture_default_str();
  app.add_option("--full-speed", options.full.speed_m_per_s,
                 "speed [m/s] that counts as full deflection of a SpaceMouse; a lower\n"
                 "one makes programs faster")
      ->check(number_in_range(1e-3, 100.0))
      ->capture_default_str();
  app.add_option("--full-turn", options.full.speed_rad_per_s,
                 "rotational speed [rad/s] that counts as full deflection")
      ->check(number_in_range(1e-3, 1000.0))
      ->capture_default_str();
  app.add_option("--period", period_ms, "time between two events of motion [ms]")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  advise_on_mistakes(app);
  try {
    app.parse(argc, argv);
    if (pose == "tool") options.pose = SteeringPose::tool;
    options.period = std::chrono::milliseconds(period_ms);
    serve(path, all_users, options);
    return 0;
  } catch (const CLI::ParseError& error) {
    return app.exit(error);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "wrenchd-spnav: %s\n", error.what());
    return 1;
  }
}
