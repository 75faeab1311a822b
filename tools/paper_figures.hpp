// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

namespace wrenchd {

/// Writes Figs. 11 to 15 of the paper, as wrenchd computes them, into a directory, which is made where it
/// does not exist: fig11.csv to fig15.csv with what they show, figures.gp to draw them again in another
/// style, and fig11.png to fig15.png, drawn by gnuplot. Throws std::runtime_error that says what to do where
/// a file cannot be written or gnuplot cannot be run; the tables are there then.
void write_paper_figures(const std::filesystem::path& directory);

}  // namespace wrenchd
