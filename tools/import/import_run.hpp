// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "tools/import/import_options.hpp"

namespace wrenchd {

/// Imports a file as the options say: writes the outputs and prints the report. Throws std::exception with
/// the name of the file, the place and the remedy; then no output exists. Not RT-safe: may take minutes.
void run_import(const ImportOptions& options);

}  // namespace wrenchd
