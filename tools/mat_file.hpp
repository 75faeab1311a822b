// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "daemon/servo/record_fields.hpp"

namespace wrenchd {

// Elements of a MAT-file of version 5, which MATLAB, Octave and scipy.io.loadmat read. Each function returns
// the bytes of one element miMATRIX. Names are those of variables, at most 31 letters; members of structures
// and cells have an empty name. Not RT-safe: allocates.

/// Returns the first 128 bytes of a file.
std::string mat_header();
/// A matrix of rows x columns; bytes: its numbers column by column. Throws std::runtime_error if it is larger
/// than the 2 GB that the format permits.
std::string mat_matrix(const std::string& name, FieldType type, std::size_t rows, std::size_t columns,
                       const std::string& bytes);
/// A row of characters.
std::string mat_text(const std::string& name, const std::string& text);
/// A column of texts, as a cell array.
std::string mat_texts(const std::string& name, std::span<const std::string> texts);
/// A structure. members: names, and elements with an empty name.
std::string mat_struct(const std::string& name, std::span<const std::pair<std::string, std::string>> members);

}  // namespace wrenchd
