// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "core/clock.hpp"
#include "core/scene_settings.hpp"
#include "daemon/recording/recording_file.hpp"
#include "daemon/run_config.hpp"

namespace wrenchd {

// What goes into a recording besides its ticks, so that it can be shown and replayed without the files it ran
// with: they change, and the machine that replays may have others.

/// Meshes up to so many bytes together are inside, the tool's first; larger ones are named with their
/// SHA-256, so that a recording of seconds does not weigh as much as a scene of a million triangles.
inline constexpr std::size_t kMaxEmbeddedMesh_bytes = std::size_t{32} << 20;

/// Versions, and the texts of settings, scene, profile with its parents, and hand script. What cannot be read
/// any more is empty. Not RT safe.
RecordingHeader read_recorded_texts(const RunConfig& config);

/// The mesh files of the scene, as they are now. Meshes that are made stand in the scene's text.
void add_meshes(const SceneSettings& scene, RecordingHeader& header);

/// That the recording begins now: by that clock, and by UTC.
void set_start_time(const Clock& clock, RecordingHeader& header);

/// What a recording ran with, made of what is in it. Writes its files into the directory, which has to be
/// there for as long as the config is used. Throws RecordingError where it lacks something: a mesh that is too
/// large to be inside is taken from where it was, if it is still the same.
RunConfig unpack_run_config(const RecordingHeader& header, const std::filesystem::path& directory);

}  // namespace wrenchd
