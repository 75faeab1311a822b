// SPDX-License-Identifier: GPL-3.0-or-later
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "collision/meshes/mesh_loader.hpp"
#include "config/load_scene.hpp"
#include "config/pose_table.hpp"
#include "core/contact_backend.hpp"
#include "core/files/opened_file.hpp"
#include "core/friction.hpp"
#include "daemon/option_checks.hpp"
#include "tools/commands/subcommand.hpp"
#include "tools/output_file.hpp"
#include "tools/solve_table.hpp"

namespace wrenchd {
namespace {

const std::map<std::string, Method> kMethods = {{"exact", Method::exact},
                                                {"planar", Method::planar},
                                                {"descent", Method::descent},
                                                {"translational", Method::translational}};

/// Parses "0.5,0.3": static and dynamic friction coefficient; a single number sets both.
std::optional<FrictionSettings> parse_friction(const std::string& text) {
  FrictionSettings friction;
  const char* const end = text.data() + text.size();
  const auto parse = [end](const char* from, double& x) {
    const auto [stop, error] = std::from_chars(from, end, x);
    return error == std::errc() && x >= 0.0 && x <= FrictionSettings::kMaxCoefficient ? stop : nullptr;
  };
  const char* stop = parse(text.data(), friction.static_coefficient);
  friction.dynamic_coefficient = friction.static_coefficient;
  if (stop != nullptr && stop != end)
    stop = *stop == ',' ? parse(stop + 1, friction.dynamic_coefficient) : nullptr;
  if (stop != end || friction.dynamic_coefficient > friction.static_coefficient) return {};
  return friction;
}

CLI::Validator friction_pair() {
  return {[](std::string& text) -> std::string {
            return parse_friction(text) ? ""
                                        : "expected two numbers from 0 to 5, the second no more than the "
                                          "first, as in 0.5,0.3; found '" +
                                              text + "'";
          },
          ""};
}

std::vector<Pose> read_poses_from(const std::string& name) {
  if (name == "-") return read_poses(std::cin, "standard input");
  try {
    std::istringstream table(read_file(name));
    return read_poses(table, name);
  } catch (const FileError& error) {
    throw PoseTableError(name + ": cannot be read; name a CSV file, or - for standard input (" +
                         error.what() + ")");
  }
}

class SolveCommand final : public Subcommand {
 public:
  void add_to(CLI::App& app) override {
    CLI::App* solve =
        app.add_subcommand("solve", "Compute the closest admissible configuration of each pose in a table");
    solve->add_option("scene", scene_, "scene file (TOML)")->required()->check(not_empty());
    solve
        ->add_option("--poses", poses_,
                     "CSV with the header px,py,pz,qx,qy,qz,qw: poses of the mesh frame in the\n"
                     "world [m]; - reads standard input")
        ->required()
        ->check(not_empty());
    solve->add_option("--method", method_, "projection method")
        ->check(one_of({"exact", "planar", "descent", "translational"}))
        ->capture_default_str();
    solve->add_option("--planes", settings_.depth.planes, "N_delta of Eq. (40), for method planar")
        ->check(CLI::Range(1, 1000))
        ->capture_default_str();
    solve
        ->add_option("--contacts", contacts_,
                     "contact detection between meshes, for method exact: wrenchd's kernels, or CGAL's AABB\n"
                     "trees with exact predicates: the same contacts, much slower")
        ->check(one_of({"native", "cgal"}))
        ->capture_default_str();
    solve->add_option("--law", law_, "wrench law: Eq. (16), or the gradient of (k/2) T")
        ->check(one_of({"pid", "energy"}))
        ->capture_default_str();
    solve->add_option("--energy-stiffness", settings_.energy_stiffness_per_s2, "k of law energy [1/s2]")
        ->check(number_in_range(0.0, 1e9))
        ->capture_default_str();
    solve->add_option("--k-p", settings_.k_P, "k_P of Eq. (16), without integral and derivative")
        ->check(number_in_range(0.0, 1e9))
        ->capture_default_str();
    add_proxy_options(*solve);
    solve->add_option("-o,--output", output_, "CSV file to write; - writes standard output")
        ->check(not_empty())
        ->capture_default_str();
    solve->footer(
        "The output has one row per pose: contacts (number of tool vertices in contact at the projection; 0\n"
        "if the pose is admissible), energy T [kg m^2] of Eq. (8), the projected pose of the mesh frame, "
        "eps\n"
        "of Eq. (15) in the body frame at the centre of mass, the wrench in that frame and about the world\n"
        "origin, and the duration of the solve [ns]. The last column is the KKT residual: the part of the\n"
        "pull towards the commanded pose that no contact balances. Each pose is solved without history;\n"
        "method exact then searches for the global optimum. With --proxy, each row also has status (free,\n"
        "converged, iteration_limit, infeasible) and iterations. Method exact is converged only if the\n"
        "residual is at most 1e-6. The first pose is at scene time 0. Without --proxy, all poses are at\n"
        "scene time 0, with moving obstacles at their start.");
    solve->callback([this] { exit_code_ = run(); });
  }

 private:
  void add_proxy_options(CLI::App& solve) {
    auto* proxy = solve.add_flag("--proxy", proxy_,
                                 "follow the poses as a trajectory, as the daemon does: each answer starts\n"
                                 "from the previous one and never enters or crosses an obstacle");
    solve.add_option("--rate", rate_Hz_, "rate of the trajectory [Hz], which sets the motion of obstacles")
        ->check(number_in_range(0.001, 1e6))
        ->needs(proxy)
        ->capture_default_str();
    solve
        .add_option("--friction", friction_,
                    "STATIC,DYNAMIC: Coulomb friction coefficients of the proxy, for method exact")
        ->check(friction_pair())
        ->needs(proxy)
        ->capture_default_str();
  }

  int run() {
    MeshLoader meshes = make_mesh_loader();
    const Scene scene(load_scene(scene_), meshes);
    for (const std::string& change : meshes.changes()) print_note(change);
    const std::vector<Pose> poses = read_poses_from(poses_);
    SolveSettings settings = settings_;
    if (scene.has_moving_obstacles() && !proxy_)
      print_note("the obstacles move, but every pose is solved at scene time 0; use --proxy to move them");
    settings.depth.method = kMethods.at(method_);
    settings.depth.friction = parse_friction(friction_).value();
    settings.depth.contacts = contacts_ == "cgal" ? ContactBackend::cgal : ContactBackend::native;
    settings.law = law_ == "energy" ? SpringLaw::energy : SpringLaw::pid;
    PoseSolver solver(scene, settings);
    std::vector<SolvedPose> rows;
    if (proxy_)
      rows = solver.follow(poses, rate_Hz_);
    else
      for (const Pose& X_WM : poses) rows.push_back(solver.project(X_WM));
    std::ostringstream text;
    write_csv(text, rows, proxy_);
    write_output(output_, text.str());
    return report_infeasible(rows);
  }

  int report_infeasible(const std::vector<SolvedPose>& rows) const {
    int exit_code = kExitDone;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (rows[i].penetration.projection.status != ProjectionStatus::infeasible) continue;
      print_note("pose " + std::to_string(i + 1) + " of " + poses_ +
                 ": no admissible pose found near it, so its energy is nan; check that the obstacles leave "
                 "enough space for the tool");
      exit_code = kExitInfeasible;
    }
    return exit_code;
  }

  std::filesystem::path scene_;
  std::string poses_;
  std::string output_ = "-";
  std::string method_ = "exact";
  std::string law_ = "pid";
  std::string contacts_ = "native";
  std::string friction_ = "0,0";
  SolveSettings settings_;
  bool proxy_ = false;  ///< follow the poses as a trajectory
  double rate_Hz_ = 1000.0;
};

}  // namespace

std::unique_ptr<Subcommand> make_solve_command() {
  return std::make_unique<SolveCommand>();
}

}  // namespace wrenchd
