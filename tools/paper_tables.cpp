// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/paper_tables.hpp"

#include <cmath>
#include <initializer_list>
#include <string_view>
#include <vector>

#include <spdlog/fmt/fmt.h>

#include "tools/paper_examples.hpp"

namespace wrenchd {
namespace {

constexpr const char* kHeading = "{:<22} {:>10}  {:>16}  {:>16}  {:>16}\n";

/// Formats a number that the paper prints with four decimals, and the result of each method. A star marks
/// results that differ by more than half of the last printed digit.
std::string row(std::string_view name, double printed, const std::vector<double>& computed) {
  constexpr double kHalfDigit = 0.5e-4 * (1.0 + 1e-9);
  std::string text = fmt::format("{:<22} {:>10.4f}", name, printed);
  for (const double x : computed)
    text += fmt::format("  {:>15.9f}{}", x, std::abs(x - printed) > kHalfDigit ? '*' : ' ');
  return text + '\n';
}

std::vector<Penetration> projections(double scale) {
  const Scene scene = paper_scene(scale);
  std::vector<Penetration> answers;
  for (const Method method : {Method::exact, Method::planar, Method::descent})
    answers.push_back(PenetrationDepth(scene, {method}).query(pose_of_example_4_1(scale)));
  return answers;
}

/// Formats one row with one number per answer.
template <class Number>
std::string row_of(std::string_view name, double printed, const std::vector<Penetration>& answers,
                   const Number& number) {
  std::vector<double> computed;
  for (const Penetration& answer : answers) computed.push_back(number(answer));
  return row(name, printed, computed);
}

/// Formats the nonzero exponential coordinates [v; w] of the planar motion.
template <class Coordinates>
std::string rows_of(std::string_view name, std::initializer_list<double> printed,
                    const std::vector<Penetration>& answers, const Coordinates& coordinates) {
  const char* const labels[] = {"v_x", "v_y", "w_z"};
  constexpr Eigen::Index kRows[] = {0, 1, 5};
  std::string text;
  for (std::size_t i = 0; i < 3; ++i)
    text += row_of(fmt::format("{} {}", name, labels[i]), printed.begin()[i], answers,
                   [&](const Penetration& answer) { return coordinates(answer)[kRows[i]]; });
  return text;
}

std::string rows_of_matrix(std::string_view name, double cosine, double sine, double height,
                           const std::vector<Penetration>& answers) {
  const auto R = [](const Penetration& answer) -> Matrix3d {
    return answer.projection.X_WQ.rotation.toRotationMatrix();
  };
  return row_of(fmt::format("{} R_11, R_22", name), cosine, answers,
                [&](const Penetration& answer) { return R(answer)(0, 0); }) +
         row_of(fmt::format("{} R_12 = -R_21", name), sine, answers,
                [&](const Penetration& answer) { return R(answer)(0, 1); }) +
         row_of(fmt::format("{} height", name), height, answers,
                [](const Penetration& answer) { return answer.projection.X_WQ.translation_m.y(); });
}

/// Returns eps of p and q from the matrices as printed in the paper.
Vector6d eps_of_printed_matrices() {
  const Pose p{rotation_from({0.0, 0.0, std::atan2(-0.1987, 0.9801)}), {0.0, 25.0, 0.0}};
  const Pose q{rotation_from({0.0, 0.0, std::atan2(-0.0866, 0.9962)}), {0.0, 27.0712, 0.0}};
  return log(inverse(p) * q);
}

std::string example_4_1() {
  const std::vector<Penetration> answers = projections(1.0);
  const Vector6d xi_p = log(pose_of_example_4_1(1.0));
  const Vector6d printed = eps_of_printed_matrices();
  std::string text = "Example 4.1: closest admissible configuration of a rotated cube in a plane\n\n";
  text += fmt::format(kHeading, "p, given", "paper", "here", "", "");
  text += row("(44) xi_p v_x", -2.5, {xi_p[0]}) + row("(44) xi_p v_y", 24.9166, {xi_p[1]}) +
          row("(44) xi_p w_z", -0.2, {xi_p[5]}) + '\n';
  text += fmt::format(kHeading, "q and eps", "paper", "exact", "planar (47)", "descent");
  text += rows_of("(45) xi_q", {-1.1737, 27.0543, -0.0867}, answers,
                  [](const Penetration& answer) { return log(answer.projection.X_WQ); });
  text += rows_of_matrix("(46) q", 0.9962, 0.0866, 27.0712, answers);
  text += row_of("T_min", 9.6315, answers, [](const Penetration& a) { return a.projection.energy; });
  text += rows_of("(47) eps", {-0.2959, 2.0510, 0.1133}, answers,
                  [](const Penetration& answer) { return answer.eps; });
  text += fmt::format(
      "\n* differs from the paper by more than half of its last digit. From the paper's own p and q, Eqs. "
      "(43) and "
      "(46) as\n"
      "  printed, eps is ({:.4f}, {:.4f}, {:.4f}).\n",
      printed[0], printed[1], printed[5]);
  const double depth = std::sqrt(PenetrationDepth(paper_scene(1.0), {Method::translational})
                                     .query(pose_of_example_4_1(1.0))
                                     .projection.energy);
  return text +
         fmt::format("  The depth of p along y is {:.4f} units of length; the paper states 4.5 mm.\n", depth);
}

std::string example_4_1_larger() {
  const std::vector<Penetration> answers = projections(10.0);
  std::string text = "\nExample 4.1 with all lengths 10 times as large\n\n";
  text += fmt::format(kHeading, "q", "paper", "exact", "planar (47)", "descent");
  return text + rows_of_matrix("(51) q", 0.9962, 0.0866, 270.7122, answers);
}

std::string example_4_2() {
  std::vector<std::vector<PaperStep>> runs;
  for (const Method method : {Method::exact, Method::planar, Method::translational})
    runs.push_back(simulate_example_4_2(method));
  const std::vector<PaperSummary> found = {summary_of(runs[0]), summary_of(runs[1]), summary_of(runs[2])};
  std::string text =
      fmt::format("\nExample 4.2: the cube thrown against the plane, {} steps\n\n", runs[0].size());
  text += fmt::format(kHeading, "", "paper", "exact", "planar (47)", "traditional");
  const auto line = [&](std::string_view name, std::string_view shown, int digits, const auto& number) {
    std::string cells;
    for (const PaperSummary& one : found) cells += fmt::format("  {:>15.{}f} ", number(one), digits);
    return fmt::format("{:<22} {:>10}{}\n", name, shown, cells);
  };
  text += line("steps in contact", "-", 0, [](const PaperSummary& s) { return double(s.steps_in_contact); });
  text += line("largest f_y", "Fig. 14", 4, [](const PaperSummary& s) { return s.max_force_y; });
  text += line("largest |tau_z|", "Fig. 15", 4, [](const PaperSummary& s) { return s.max_torque_z; });
  return text +
         fmt::format(
             "\nThe paper shows this example only in figures: similar forces, and a much larger torque "
             "of the\n"
             "traditional method. Here its force is {:.2f} times and its torque {:.0f} times that of "
             "exact.\n",
             found[2].max_force_y / found[0].max_force_y, found[2].max_torque_z / found[0].max_torque_z);
}

}  // namespace

std::string paper_tables() {
  return example_4_1() + example_4_1_larger() + example_4_2();
}

}  // namespace wrenchd
