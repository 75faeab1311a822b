// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <ctime>
#include <filesystem>
#include <string>
#include <vector>

#include "config/settings.hpp"
#include "daemon/control/owned_fd.hpp"
#include "daemon/recording/recording_file.hpp"

namespace wrenchd {

// The directory of recordings. Not RT-safe: accesses files.

/// Returns the configured directory; else recordings/ in $STATE_DIRECTORY, which systemd sets for a service;
/// else wrenchd/recordings in $XDG_STATE_HOME or ~/.local/state. Returns an empty path if none of these is
/// set.
std::filesystem::path recordings_directory(const RecordingSettings& settings);

/// Creates the directory if it is missing, accessible by owner and group only. Throws RecordingError with the
/// cure.
void make_recordings_directory(const std::filesystem::path& directory);

/// Returns a time as "20261122T141501Z". The texts sort by time.
std::string utc_stamp(std::time_t utc);

/// Returns the path for a requested name: in the directory, with .h5 at its end. If `anywhere` is set, an
/// absolute path is permitted too. Throws RecordingError, which says what a name may be.
std::filesystem::path recording_path(const std::string& asked, const std::filesystem::path& directory,
                                     bool anywhere);

/// Returns the free space on the disk [MB]. Throws RecordingError if the system does not report it.
double free_MB(const std::filesystem::path& directory);
/// Throws RecordingError if there is less free space than keep_free_MB.
void check_free_space(const std::filesystem::path& directory, const RecordingSettings& settings);

/// A recording on disk.
struct StoredRecording {
  std::string name;  ///< "run.h5"
  std::uint64_t bytes;
  std::time_t modified_at;  ///< time of the last write
};
/// Returns the recordings in a directory, the oldest first. Returns none if the directory does not exist.
std::vector<StoredRecording> stored_recordings(const std::filesystem::path& directory);
/// Opens a recording for reading. Throws RecordingError.
OwnedFd open_recording(const std::filesystem::path& directory, const std::string& name);

// The files of the flight recorder. hand: name of the second hand, which ends the names of its files; empty:
// the first hand.

/// Returns an unused path for a file of the flight recorder: "flight-20261122T141501Z-overspeed.h5".
std::filesystem::path flight_path(const std::filesystem::path& directory, std::time_t utc,
                                  std::string_view fault, const std::string& hand = {});
/// Returns true if a file name has the form that flight_path() gives: "flight-20261122T141501Z-overspeed.h5",
/// with the name of a fault, and a number if several have the same time and fault.
bool is_flight_name(const std::string& name, const std::string& hand = {});
/// Removes the oldest files of this hand's flight recorder until at most `most` are left. Keeps all other
/// files, also those whose name only begins with "flight-".
void prune_flights(const std::filesystem::path& directory, std::size_t most, const std::string& hand = {});

}  // namespace wrenchd
