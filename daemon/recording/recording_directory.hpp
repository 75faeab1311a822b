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

// Where recordings go. Not RT safe.

/// The settings' directory; else recordings/ in $STATE_DIRECTORY, which systemd gives a service; else
/// wrenchd/recordings in $XDG_STATE_HOME, or in ~/.local/state. Empty where there is none of these.
std::filesystem::path recordings_directory(const RecordingSettings& settings);

/// Makes it where it is missing, for its owner and group alone. Throws RecordingError, with the cure.
void make_recordings_directory(const std::filesystem::path& directory);

/// "20261122T141501Z", which sorts by time
std::string utc_stamp(std::time_t utc);

/// The file that somebody asks for: a plain name in the directory, with .h5 at its end; or, where `anywhere`
/// is set, an absolute path. Throws RecordingError, which says what a name may be.
std::filesystem::path recording_path(const std::string& asked, const std::filesystem::path& directory,
                                     bool anywhere);

/// Room that is left on the disk [MB]. Throws RecordingError where it cannot be told.
double free_MB(const std::filesystem::path& directory);
/// Throws RecordingError where there is less room than the settings keep free.
void check_free_space(const std::filesystem::path& directory, const RecordingSettings& settings);

/// A recording that is there.
struct StoredRecording {
  std::string name;  ///< "run.h5"
  std::uint64_t bytes;
  std::time_t modified_at;  ///< when it was last written to
};
/// Those of a directory, the oldest first. None where there is no such directory.
std::vector<StoredRecording> stored_recordings(const std::filesystem::path& directory);
/// One of them, to be read. Throws RecordingError.
OwnedFd open_recording(const std::filesystem::path& directory, const std::string& name);

/// A name for the flight recorder's file, "flight-20261122T141501Z-overspeed.h5", that is not taken.
std::filesystem::path flight_path(const std::filesystem::path& directory, std::time_t utc,
                                  std::string_view fault);
/// Removes the oldest files of the flight recorder until no more than so many are left. Other files stay.
void prune_flights(const std::filesystem::path& directory, std::size_t most);

}  // namespace wrenchd
