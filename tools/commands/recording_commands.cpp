// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <optional>
#include <stdexcept>
#include <string>

#include <CLI/CLI.hpp>

#include "daemon/option_checks.hpp"
#include "daemon/recording/recording_file.hpp"
#include "tools/commands/subcommand.hpp"
#include "tools/export_mat.hpp"
#include "tools/export_mcap.hpp"
#include "tools/export_recording.hpp"
#include "tools/output_file.hpp"
#include "tools/plot_recording.hpp"
#include "tools/replay_recording.hpp"

namespace wrenchd {
namespace {

/// replay, export and plot.
class RecordingCommands final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    add_replay(app);
    add_export(app);
    add_plot(app);
  }

 private:
  void add_replay(CLI::App& app) {
    CLI::App* replay = app.add_subcommand("replay",
                                          "Run a recording through the servo loop again, and name the first\n"
                                          "tick that differs");
    replay->add_option("recording", recording_, "HDF5 file of wrenchd --record")
        ->required()
        ->check(not_empty());
    const std::array file_options = {
        replay->add_option("-c,--config", files_.config,
                           "configuration for the replay; without any of these three options, the\n"
                           "configuration in the recording"),
        replay->add_option("--scene", files_.scene, "scene that replaces the configuration's scene"),
        replay->add_option("--profile", files_.profile, "profile that replaces the configuration's profile")};
    for (CLI::Option* option : file_options) option->check(not_empty());
    replay->callback([this, file_options] {
      const bool from_files =
          std::any_of(file_options.begin(), file_options.end(), [](auto* o) { return o->count() > 0; });
      const bool same =
          replay_recording(recording_, from_files ? std::optional<RunConfigFiles>(files_) : std::nullopt);
      exit_code_ = same ? kExitDone : kExitDiffers;
    });
  }

  void add_export(CLI::App& app) {
    CLI::App* command = app.add_subcommand(
        "export", "Export a recording as CSV with units in the headings, as MAT-file or as MCAP");
    command->add_option("recording", recording_, "HDF5 file")->required()->check(not_empty());
    command
        ->add_option(
            "-o,--output", output_,
            "file to write: .csv, .mat for MATLAB and scipy, or .mcap for Foxglove; without it, CSV to\n"
            "standard output")
        ->check(not_empty());
    command
        ->add_option("--columns", selection_.columns,
                     "names separated by commas, as in F_out,state; without it, all columns")
        ->delimiter(',');
    command->add_option("--every", selection_.every, "export every n-th tick")
        ->check(CLI::Range(std::size_t{1}, std::size_t{1'000'000'000}))
        ->capture_default_str();
    command->add_option("--from", selection_.from_s, "first time to export [s since the first tick]")
        ->check(number_in_range(0.0, 1e9));
    command->add_option("--to", selection_.to_s, "last time to export [s since the first tick]")
        ->check(number_in_range(0.0, 1e9));
    command->callback([this] { run_export(); });
  }

  void add_plot(CLI::App& app) {
    CLI::App* plot =
        app.add_subcommand("plot",
                           "Plot a recording: force, torque, penetration and energy over time, the\n"
                           "distribution of tick times, and the path of the tool");
    plot->add_option("recording", recording_, "HDF5 file")->required()->check(not_empty());
    plot->add_option("-o,--output", output_,
                     "file that ends in .svg, .pdf or .png, for one picture; otherwise a directory, for one\n"
                     "SVG per figure, the data and the script. Default: the recording's name without .h5")
        ->check(not_empty());
    plot->callback([this] {
      const auto output = output_.empty() ? std::filesystem::path(recording_).replace_extension()
                                          : std::filesystem::path(output_);
      for (const auto& picture : plot_recording(read_recording(recording_), output))
        std::printf("%s\n", picture.c_str());
    });
  }

  void run_export() const {
    if (output_.empty()) return write_csv(std::cout, read_recording(recording_), selection_);
    const std::string kind = std::filesystem::path(output_).extension().string();
    const bool is_csv = kind.empty() || kind == ".csv" || kind == ".txt";
    if (!is_csv && kind != ".mat" && kind != ".mcap")
      throw std::runtime_error(output_ + ": wrenchctl writes no files of kind '" + kind +
                               "'; use .csv, .mat or .mcap");
    const auto write = kind == ".mat" ? write_mat : kind == ".mcap" ? write_mcap : write_csv;
    const Recording recording = read_recording(recording_);
    write_output(output_, [&](std::ostream& out) { write(out, recording, selection_); });
  }

  std::filesystem::path recording_;
  RunConfigFiles files_;
  std::string output_;
  ExportSettings selection_;
};

}  // namespace

std::unique_ptr<Subcommand> make_recording_commands() {
  return std::make_unique<RecordingCommands>();
}

}  // namespace wrenchd
