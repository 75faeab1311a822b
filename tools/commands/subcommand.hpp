// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace wrenchd {

class MeshLoader;

/// Exit codes of wrenchctl.
enum ExitCode : int {
  kExitDone = 0,
  kExitRejected = 1,    ///< an input was rejected, or a file cannot be written
  kExitDefects = 2,     ///< mesh: the mesh is not a solid
  kExitInfeasible = 3,  ///< solve: no admissible pose was found near a pose
  kExitDiffers = 4,     ///< replay: a tick differs
  kExitUnfit = 5,       ///< doctor, conform: a check failed
};

/// One or several related subcommands of wrenchctl with their options. Not RT-safe: commands read and write
/// files, and wait for devices and the daemon.
class Subcommand {
 public:
  Subcommand() = default;
  virtual ~Subcommand() = default;
  Subcommand(const Subcommand&) = delete;
  Subcommand& operator=(const Subcommand&) = delete;

  /// Adds the subcommands, their options and their callbacks to the app. This object must outlive the app's
  /// parse(), which runs the selected subcommand. Callbacks throw std::exception.
  virtual void add_to(CLI::App& app) = 0;

  /// Returns the exit code of the subcommand that ran; kExitDone if none of this object's ran.
  int exit_code() const noexcept { return exit_code_; }

 protected:
  int exit_code_ = kExitDone;
};

/// Heading of the subcommands for a running daemon in the help.
inline constexpr const char* kDaemonGroup = "A running daemon";

std::unique_ptr<Subcommand> make_solve_command();
std::unique_ptr<Subcommand> make_check_command();
std::unique_ptr<Subcommand> make_report_commands();  ///< decode, encode
std::unique_ptr<Subcommand> make_device_commands();  ///< devices, udev-rules, calibrate, conform, profile
std::unique_ptr<Subcommand> make_doctor_command();
std::unique_ptr<Subcommand> make_daemon_commands();  ///< status, watch, arm, record and others
std::unique_ptr<Subcommand> make_set_command();
std::unique_ptr<Subcommand> make_scene_command();
std::unique_ptr<Subcommand> make_workspace_command();
std::unique_ptr<Subcommand> make_view_command();
std::unique_ptr<Subcommand> make_fault_command();
std::unique_ptr<Subcommand> make_mesh_command();
std::unique_ptr<Subcommand> make_import_command();
std::unique_ptr<Subcommand> make_gallery_command();
std::unique_ptr<Subcommand> make_new_command();
std::unique_ptr<Subcommand> make_paper_command();
std::unique_ptr<Subcommand> make_recording_commands();  ///< replay, export, plot
std::unique_ptr<Subcommand> make_sweep_command();
std::unique_ptr<Subcommand> make_names_command();  ///< for the shell completion; the help does not show it

/// Prints a line about progress or a change to standard error, after the program's name.
void print_note(const std::string& text);

/// Returns a mesh loader that uses the cache and reports its progress with print_note().
MeshLoader make_mesh_loader();

}  // namespace wrenchd
