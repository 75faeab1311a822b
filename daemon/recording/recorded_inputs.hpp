// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "collision/meshes/mesh_loader.hpp"
#include "core/clock.hpp"
#include "core/scene_settings.hpp"
#include "daemon/recording/recording_file.hpp"
#include "daemon/run_config.hpp"

namespace wrenchd {

// The input files of a run, which a recording contains beside its ticks. With them it can be shown and
// replayed after the files have changed, and on another machine. Not RT-safe: reads and writes files.

/// Returns a header with the versions and the texts of settings, scene, profile with its parents, and hand
/// script, as they were read at the start. A text that does not come from a file is empty.
RecordingHeader read_recorded_texts(const RunConfig& config);

/// Adds the mesh files of the scene as `loaded` has read them: present files may have other contents. Files
/// whose bytes the loader has not kept (MeshLoader::kMaxKeptBytes) are named with their SHA-256 only, so that
/// a short recording stays small. Generated meshes need no file: the text of the scene defines them.
void add_meshes(const SceneSettings& scene, const MeshLoader& loaded, RecordingHeader& header);

/// Sets the start time to now, by `clock` and by UTC.
void set_start_time(const Clock& clock, RecordingHeader& header);

/// Returns the run configuration that a recording contains. Writes its files into `directory`, which must
/// exist as long as the configuration is used. Reads a mesh that is not in the recording from its original
/// path. Throws RecordingError if a file is missing or has another SHA-256.
RunConfig unpack_run_config(const RecordingHeader& header, const std::filesystem::path& directory);

/// True if the recording is of one of two hands that have the same tool.
bool hands_have_same_tool(const RecordingHeader& header);

}  // namespace wrenchd
