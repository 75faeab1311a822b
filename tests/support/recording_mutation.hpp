// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace wrenchd::test {

/// Writes a small recording with contacts, texts and a mesh.
void write_sample_recording(const std::filesystem::path& file);

/// The kinds of damage, in the order of mutate_recording().
enum class Damage : std::uint8_t {
  bytes,    ///< a few bytes have other values
  number,   ///< a number that looks like a size or an address has another value
  cut,      ///< the end is missing, or there are more bytes
  block,    ///< a block is copied to another place
  storage,  ///< a data set has external storage or virtual storage
  link,     ///< a name is an external link, a soft link, or a hard link that makes a loop
  size,     ///< a data set claims more rows
};
inline constexpr int kDamages = 7;
const char* name(Damage damage) noexcept;

/// Damages a copy of a sample recording. `number` and `seed` select kind and place. secret: a file to which
/// external storage and links lead. Returns the kind.
Damage mutate_recording(const std::filesystem::path& sample, const std::filesystem::path& file,
                        const std::filesystem::path& secret, std::uint64_t seed, std::uint64_t number);

}  // namespace wrenchd::test
