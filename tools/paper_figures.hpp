// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

namespace wrenchd {

/// Computes the paper, Figs. 11 to 15, and writes them to a directory, which it creates if necessary. Writes
/// the data as fig11.csv to fig15.csv, the script as figures.gp, and the figures as fig11.png to fig15.png by
/// gnuplot. Throws std::runtime_error that says what to do if a file cannot be written or gnuplot fails; the
/// data exists in the latter case. Not RT-safe: writes files and runs gnuplot.
void write_paper_figures(const std::filesystem::path& directory);

}  // namespace wrenchd
