// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/paper_figures.hpp"

#include <array>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "tools/csv_row.hpp"
#include "tools/gnuplot.hpp"
#include "tools/output_file.hpp"
#include "tools/paper_examples.hpp"
#include "tools/paper_script.hpp"

namespace wrenchd {
namespace {

using Steps = std::vector<PaperStep>;

/// Writes the outline of the cube in the plane of motion, and its centre of mass.
std::string trajectory_csv(const Steps& steps) {
  constexpr double kHalf = 25.0;
  std::ostringstream csv;
  csv << "t,x,y,a_x,a_y,b_x,b_y,c_x,c_y,d_x,d_y\n";
  for (const PaperStep& step : steps) {
    CsvRow row(csv);
    row << step.time_s << step.X_WP.translation_m.x() << step.X_WP.translation_m.y();
    for (const auto& [x, y] : {std::array{-1.0, -1.0}, {1.0, -1.0}, {1.0, 1.0}, {-1.0, 1.0}}) {
      const Vector3d corner_W = step.X_WP * Vector3d(kHalf * x, kHalf * y, 0.0);
      row << corner_W.x() << corner_W.y();
    }
  }
  return csv.str();
}

/// Returns the value at a step where contact begins, or at the first step without contact.
double starts_or_ends(const Steps& steps, std::size_t i) {
  const bool before = i > 0 && steps[i - 1].in_contact;
  return before != steps[i].in_contact ? 1.0 : 0.0;
}

std::string centres_csv(const Steps& ours, const Steps& traditional) {
  std::ostringstream csv;
  csv << "t,x,y,starts_or_ends,x_traditional,y_traditional,starts_or_ends_traditional\n";
  for (std::size_t i = 0; i < ours.size(); ++i) {
    CsvRow row(csv);
    row << ours[i].time_s;
    for (const Steps* steps : {&ours, &traditional})
      row << (*steps)[i].X_WP.translation_m.x() << (*steps)[i].X_WP.translation_m.y()
          << starts_or_ends(*steps, i);
  }
  return csv.str();
}

template <class Number>
std::string over_time_csv(const std::string& name, const Steps& ours, const Steps& traditional,
                          const Number& number) {
  std::ostringstream csv;
  csv << "t," << name << ',' << name << "_traditional\n";
  for (std::size_t i = 0; i < ours.size(); ++i)
    CsvRow(csv) << ours[i].time_s << number(ours[i]) << number(traditional[i]);
  return csv.str();
}

}  // namespace

void write_paper_figures(const std::filesystem::path& directory) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (!std::filesystem::is_directory(directory))
    throw std::runtime_error(directory.string() +
                             ": is not a directory and cannot be created; name another directory");
  const auto write = [&](const char* name, const std::string& text) {
    write_output((directory / name).string(), text);
  };
  const Steps ours = simulate_example_4_2(Method::planar);  // the paper's own method
  const Steps traditional = simulate_example_4_2(Method::translational);
  write("fig11.csv", trajectory_csv(ours));
  write("fig12.csv", trajectory_csv(traditional));
  write("fig13.csv", centres_csv(ours, traditional));
  write("fig14.csv",
        over_time_csv("f_y", ours, traditional, [](const PaperStep& step) { return step.F_W.force_N.y(); }));
  write("fig15.csv", over_time_csv("tau_z", ours, traditional,
                                   [](const PaperStep& step) { return step.F_W.torque_Nm.z(); }));
  write("figures.gp", kPaperScript);
  run_gnuplot(directory, "figures.gp", "; the data of the figures is in " + directory.string());
}

}  // namespace wrenchd
