// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "daemon/recording/recording_file.hpp"
#include "daemon/servo/record_fields.hpp"

namespace wrenchd {

/// Selects the columns and rows of an export.
struct ExportSettings {
  std::vector<std::string> columns;                       ///< Names of fields; empty exports all fields.
  std::size_t every = 1;                                  ///< Exports one tick out of this number.
  double from_s = 0.0;                                    ///< First time to export, since the first tick.
  double to_s = std::numeric_limits<double>::infinity();  ///< Last time to export, since the first tick.
};

/// Returns the fields of these names, in this order; all fields if the list is empty. Throws
/// std::invalid_argument if a column does not exist. Not RT-safe: allocates.
std::vector<RecordField> selected_fields(const ExportSettings& settings);
/// Returns the rows of the selected ticks in order. Not RT-safe: allocates.
std::vector<std::size_t> selected_rows(const Recording& recording, const ExportSettings& settings);
/// Returns the time of a row since the first tick [s]. RT-safe.
double time_s(const Recording& recording, std::size_t row) noexcept;

/// Returns the name of a component: ".fx" of a wrench, ".0" of an array without names, "" of a number. Not
/// RT-safe: allocates.
std::string component_suffix(const RecordField& field, std::size_t component);
/// Returns the unit of a component. RT-safe.
const char* component_unit(const RecordField& field, std::size_t component) noexcept;

/// Appends the shortest text that reads back to the same number. Not RT-safe: allocates.
void append_number(std::string& to, double number);
/// Appends component number `component` of this field of a record as text. The record is a TickRecord or a
/// Touch. Not RT-safe: allocates.
void append_component(std::string& to, const RecordField& field, const void* record, std::size_t component);
/// Returns the component of a field of type f64. RT-safe.
double real_component(const RecordField& field, const void* record, std::size_t component) noexcept;

}  // namespace wrenchd
