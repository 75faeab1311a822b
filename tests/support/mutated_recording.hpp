// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

#include "tests/support/random_values.hpp"

namespace wrenchd::test {

inline constexpr std::size_t kSampleTicks = 1500;

/// Writes a recording with ticks, contacts, configuration texts and a mesh.
void write_sample_recording(const std::filesystem::path& file);

std::string read_bytes(const std::filesystem::path& file);
void write_bytes(const std::filesystem::path& file, const std::string& bytes);

/// Returns the file with random damage: flipped bits, numbers replaced by extreme ones, parts overwritten,
/// moved or cut. Half of the damage hits the structures of HDF5 rather than the rows.
std::string mutate(const std::string& good, RandomValues& random);

}  // namespace wrenchd::test
