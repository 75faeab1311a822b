// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/new_scene.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <system_error>

#include <Eigen/Geometry>
#include <spdlog/fmt/fmt.h>

#include "collision/feasible_pose_search.hpp"
#include "collision/meshes/mesh_source.hpp"
#include "collision/scene.hpp"
#include "config/scene_text.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

/// Tools with a larger side in file units are in millimetres: CAD programs export them so, and no hand holds
/// 2 m.
constexpr double kLargestTool_m = 2.0;
constexpr double kMillimetre_m = 1e-3;
constexpr double kToolMass_kg = 0.2;
/// Steps in which the tool is lowered onto a mesh to find where it touches.
constexpr int kLoweringSteps = 500;
constexpr int kBisections = 40;

constexpr const char* kHand =
    R"(# wrenchd hand script: lower the tool onto the obstacle, press, slide, and raise it again.
# The origin of the device base is where the tool first touches (base_in_world in wrenchd.toml), so z is the height over that.
repeats = true

[[waypoint]]
time_s = 0.0
position_m = [0.0, 0.0, 0.040]

[[waypoint]]
time_s = 1.5
position_m = [0.0, 0.0, 0.002]

# Press: the goal is 8 mm below the first contact. The force is that of the springs of hand and contact in series.
[[waypoint]]
time_s = 2.0
position_m = [0.0, 0.0, -0.008]

[[waypoint]]
time_s = 3.0
position_m = [0.0, 0.0, -0.008]

# Slide 20 mm forward and back, still pressing.
[[waypoint]]
time_s = 4.0
position_m = [0.020, 0.0, -0.008]

[[waypoint]]
time_s = 5.0
position_m = [0.0, 0.0, -0.008]

[[waypoint]]
time_s = 6.0
position_m = [0.0, 0.0, 0.040]
)";

std::string array(const Vector3d& v) {
  return fmt::format("[{:.9g}, {:.9g}, {:.9g}]", v.x(), v.y(), v.z());
}

Eigen::AlignedBox3d box_of(const TriangleMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : mesh.vertices_m) box.extend(p);
  return box;
}

/// A tool as a solid, or as a surface if the mesh is no solid.
ToolBody load_as_solid_or_surface(ToolSettings& settings, MeshLoader& loader, std::string& remarks) {
  try {
    return load_tool(settings, loader);
  } catch (const MeshError& not_solid) {
    settings.kind = BodyKind::surface;
    settings.inertia_source = InertiaSource::hull;
    try {
      ToolBody tool = load_tool(settings, loader);
      remarks += fmt::format("{} is no closed solid, so the scene uses it with kind = \"surface\": {}\n",
                             settings.mesh.filename().string(), not_solid.what());
      return tool;
    } catch (const MeshError&) {
      throw not_solid;
    }
  }
}

/// The scene, with its obstacle as a surface if its mesh is no solid.
Scene load_scene_as_solid_or_surface(SceneSettings& settings, MeshLoader& loader, std::string& remarks) {
  try {
    return Scene(settings, loader);
  } catch (const MeshError& not_solid) {
    settings.meshes.front().kind = BodyKind::surface;
    try {
      Scene scene(settings, loader);
      remarks += fmt::format("{} is no closed solid, so the scene uses it with kind = \"surface\": {}\n",
                             settings.meshes.front().mesh.filename().string(), not_solid.what());
      return scene;
    } catch (const MeshError&) {
      throw not_solid;
    }
  }
}

/// The scale that the user states, or that the size of the tool suggests.
double scale_of(const NewScene& request, const TriangleMesh& mesh, std::string& remarks) {
  if (request.scale) return *request.scale;
  const Vector3d sides = box_of(mesh).sizes();
  const double scale = sides.maxCoeff() > kLargestTool_m ? kMillimetre_m : 1.0;
  remarks += fmt::format(
      "the tool's sides are {:.4g} x {:.4g} x {:.4g}, taken as {}; --scale states metres per unit "
      "otherwise\n",
      sides.x(), sides.y(), sides.z(), scale == 1.0 ? "metres" : "millimetres");
  return scale;
}

/// Height of the centre of mass at which the tool touches when it is lowered along the vertical through x, y.
std::optional<double> touching_height(const Scene& scene, const Eigen::AlignedBox3d& obstacle, double x_m,
                                      double y_m) {
  FeasiblePoseSearch search(scene);
  const auto clear = [&](double z_m) {
    return search.admissible({Quaterniond::Identity(), {x_m, y_m, z_m}});
  };
  double above_m = obstacle.max().z() + 1.01 * scene.tool_radius_m();
  const double step_m = (above_m - obstacle.min().z()) / kLoweringSteps;
  if (!clear(above_m)) return {};
  for (int i = 1; i <= kLoweringSteps; ++i) {
    double below_m = above_m - step_m;
    if (clear(below_m)) {
      above_m = below_m;
      continue;
    }
    for (int k = 0; k < kBisections; ++k) {
      const double middle_m = 0.5 * (above_m + below_m);
      (clear(middle_m) ? above_m : below_m) = middle_m;
    }
    return above_m;
  }
  return {};
}

/// Where the centre of mass is when the lowered tool touches the obstacle: over its middle, or over its
/// highest point.
Vector3d touching_point(const Scene& scene, const MeshObstacle& obstacle, const fs::path& file) {
  const TriangleMesh mesh = obstacle.mesh->loaded_mesh();
  const Eigen::AlignedBox3d box = box_of(mesh);
  Vector3d highest_m = mesh.vertices_m.front();
  for (const Vector3d& p : mesh.vertices_m)
    if (p.z() > highest_m.z()) highest_m = p;
  for (const Vector3d& at_m : {Vector3d(box.center()), highest_m})
    if (const auto z_m = touching_height(scene, box, at_m.x(), at_m.y())) return {at_m.x(), at_m.y(), *z_m};
  throw std::runtime_error(
      file.string() +
      ": the tool, lowered over its middle and over its highest point, does not touch it; rotate the mesh "
      "so that its z axis points up, or write the scene by hand (config/README.md)");
}

/// A directory that appears under its name only when it is complete.
class NewDirectory {
 public:
  explicit NewDirectory(const fs::path& name) : name_(name.has_filename() ? name : name.parent_path()) {
    std::error_code error;
    if (fs::exists(name_) && !fs::is_empty(name_, error))
      throw std::runtime_error(name_.string() + ": exists already; choose another name, or remove it");
    std::string beside = name_.string() + ".XXXXXX";
    if (mkdtemp(beside.data()) == nullptr)
      throw std::runtime_error(name_.string() + ": cannot be made: " + std::strerror(errno) +
                               "; name a directory in one that exists and that you may write to");
    part_ = beside;
    fs::permissions(part_, fs::perms::owner_all | fs::perms::group_read | fs::perms::group_exec |
                               fs::perms::others_read | fs::perms::others_exec);
  }
  ~NewDirectory() {
    std::error_code ignored;
    if (!part_.empty()) fs::remove_all(part_, ignored);
  }
  NewDirectory(const NewDirectory&) = delete;
  NewDirectory& operator=(const NewDirectory&) = delete;

  void write(const char* file, const std::string& text) const {
    std::ofstream out(part_ / file, std::ios::binary);
    out << text;
    out.close();
    if (!out) throw std::runtime_error((name_ / file).string() + ": cannot be written; is the disk full?");
  }
  void finish() {
    fs::rename(part_, name_);
    part_.clear();
  }
  const fs::path& name() const noexcept { return name_; }

 private:
  fs::path name_;
  fs::path part_;
};

std::string config_text(const Vector3d& p_WT_m, const Vector3d& p_MT_m) {
  return fmt::format(
      R"(# wrenchd configuration. Everything that is not here has its default; the shipped wrenchd.toml lists all settings.
scene = "scene.toml"

[device]
# The device base is where the tool first touches, so that the hand script does not depend on the size of the tool.
base_in_world = {{ position_m = {} }}
# The hand holds the tool at its centre of mass.
tool_in_handle = {{ position_m = {} }}

[simulation]
hand_script = "hand.toml"
)",
      array(p_WT_m), array(-p_MT_m));
}

}  // namespace

std::string make_new_scene(const NewScene& request, MeshLoader& loader) {
  NewDirectory directory(request.directory);
  std::string remarks;
  SceneSettings settings;
  settings.tool.mesh = request.tool;
  settings.tool.mass_kg = kToolMass_kg;
  load_as_solid_or_surface(settings.tool, loader, remarks);
  const ToolBody unscaled = load_tool(settings.tool, loader);
  settings.tool.scale = scale_of(request, unscaled.mesh, remarks);

  Vector3d p_WT_m = Vector3d::Zero(), p_MT_m;
  if (request.obstacle.empty()) {
    settings.half_spaces.push_back({"table", Vector3d::UnitZ(), 0.0});
    const ToolBody tool = load_tool(settings.tool, loader);
    for (const Vector3d& p : tool.hull.vertices_T_m) p_WT_m.z() = std::max(p_WT_m.z(), -p.z());
    p_MT_m = tool.solid.p_MT_m;
  } else {
    MeshObstacleSettings obstacle;
    obstacle.name = request.obstacle.stem().string();
    obstacle.mesh = request.obstacle;
    obstacle.scale = settings.tool.scale;
    settings.meshes.push_back(obstacle);
    const Scene scene = load_scene_as_solid_or_surface(settings, loader, remarks);
    p_WT_m = touching_point(scene, scene.meshes().front(), request.obstacle);
    p_MT_m = scene.tool().solid.p_MT_m;
  }
  directory.write("scene.toml", scene_text(settings, 0.0));
  directory.write("wrenchd.toml", config_text(p_WT_m, p_MT_m));
  directory.write("hand.toml", kHand);
  directory.finish();

  const std::string config = (directory.name() / "wrenchd.toml").string();
  return fmt::format(
      "{}{}: scene.toml, wrenchd.toml and hand.toml\n"
      "run it:    wrenchd --config {} --arm --live --realtime best_effort\n"
      "in a clone of the sources: tools/run --config {}\n",
      remarks, directory.name().string(), config, config);
}

}  // namespace wrenchd
