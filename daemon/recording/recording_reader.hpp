// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>

#include "core/files/opened_file.hpp"
#include "daemon/recording/recording_file.hpp"
#include "daemon/recording/recording_stream.hpp"

namespace wrenchd {

/// Reads a recording that is open already, as read_recording() of its name does (recording_file.hpp). file:
/// for messages. Throws RecordingError. Not RT-safe: reads a file, starts a process.
Recording read_recording(const OpenedFile& opened, const std::filesystem::path& file);

/// Reads the HDF5 file behind a descriptor in this process and sends it. open_done: called when libhdf5 has
/// opened the file and needs no other file any more. For the child process of read_recording() only. Defined
/// beside the writer, which uses the same tables. Throws RecordingError: the reason, without the name of the
/// file. Not RT-safe: reads a file.
void send_hdf5(int descriptor, std::uint64_t file_bytes, const std::function<void()>& open_done,
               RecordingSender& sender);

}  // namespace wrenchd
