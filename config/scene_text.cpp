// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/scene_text.hpp"

#include <array>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <vector>

#include "config/toml_file.hpp"
#include "core/files/absolute_name.hpp"

namespace wrenchd {
namespace {

/// Returns a basic string of TOML.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (byte < 0x20 || byte == 0x7f) {
      std::array<char, 8> escaped{};
      std::snprintf(escaped.data(), escaped.size(), "\\u%04x", byte);
      out += escaped.data();
    } else {
      out += c;
    }
  }
  return out + '"';
}

std::string array(const Vector3d& v) {
  return "[" + to_text(v.x()) + ", " + to_text(v.y()) + ", " + to_text(v.z()) + "]";
}

std::string quoted_file(const std::filesystem::path& file) {
  return quoted(absolute_name(file).string());
}

std::string parts_line(const std::vector<std::filesystem::path>& parts) {
  std::string text;
  for (const std::filesystem::path& part : parts) text += (text.empty() ? "" : ", ") + quoted_file(part);
  return "meshes = [" + text + "]\n";
}

/// The shape of the tool or of an obstacle: a file, the files of its parts, or a generated mesh.
template <class Body>
std::string mesh_line(const Body& body) {
  const std::optional<GeneratedMesh>& generated = body.generated;
  if (!body.parts.empty()) return parts_line(body.parts);
  if (!generated) return "mesh = " + quoted_file(body.mesh) + "\n";
  std::string text =
      "mesh = { make = " + quoted(generated->kind) + ", triangles = " + std::to_string(generated->triangles);
  if (generated->kind == "bumpy" || generated->kind == "boulder")
    text += ", seed = " + std::to_string(generated->seed);
  if (generated->kind == "box") text += ", size_m = " + array(generated->size_m);
  return text + " }\n";
}

std::string mesh_obstacle(const MeshObstacleSettings& obstacle, double now_s) {
  Pose X_WM = obstacle.motion.pose_at(obstacle.X_WM, now_s);
  ObstacleMotion motion = obstacle.motion;
  if (obstacle.scheduled && now_s >= obstacle.scheduled->start_s) {
    motion = obstacle.scheduled->motion;
    X_WM = motion.pose_at(obstacle.scheduled->X_WO, now_s);
  }
  std::string text = "\n[[obstacle]]\nname = " + quoted(obstacle.name) + "\n" + mesh_line(obstacle) +
                     "scale = " + to_text(obstacle.scale) + "\nposition_m = " + array(X_WM.translation_m) +
                     "\nrotation_vector_rad = " + array(rotation_vector(X_WM.rotation)) + "\n";
  if (obstacle.kind == BodyKind::surface) text += "kind = \"surface\"\n";
  if (!motion.moves() || motion.duration_s > 0.0) return text;
  text += "velocity_m_per_s = " + array(motion.linear_m_per_s) +
          "\nangular_velocity_rad_per_s = " + array(motion.angular_rad_per_s) + "\n";
  if (motion.reverse_after_s > 0.0) text += "reverse_after_s = " + to_text(motion.reverse_after_s) + "\n";
  return text;
}

/// What gives the inertia, unless it is the default of the kind.
std::string inertia_lines(const ToolSettings& tool) {
  const Matrix3d& I = tool.inertia_kg_m2;
  switch (tool.inertia_source) {
    case InertiaSource::solid:
      return {};
    case InertiaSource::hull:
      return "inertia = \"hull\"\n";
    case InertiaSource::shell:
      return "inertia = \"shell\"\nshell_thickness_m = " + to_text(tool.shell_thickness_m) + "\n";
    case InertiaSource::given:
      return "centre_of_mass_m = " + array(tool.centre_of_mass_m) + "\ninertia_kg_m2 = [" + to_text(I(0, 0)) +
             ", " + to_text(I(1, 1)) + ", " + to_text(I(2, 2)) + ", " + to_text(I(0, 1)) + ", " +
             to_text(I(0, 2)) + ", " + to_text(I(1, 2)) + "]\n";
  }
  return {};
}

std::string tool_lines(const ToolSettings& tool) {
  return mesh_line(tool) + "scale = " + to_text(tool.scale) + "\nmass = " + to_text(tool.mass_kg) + "\n" +
         (tool.kind == BodyKind::surface ? "kind = \"surface\"\n" : "") + inertia_lines(tool);
}

/// A body at its start.
std::string free_body(const BodySettings& body) {
  const auto with_default = [](const char* key, double value) {
    return value == 0.0 ? std::string() : key + (" = " + to_text(value)) + "\n";
  };
  const ToolSettings& shape = body.shape;
  std::string text = "\n[[body]]\nname = " + quoted(body.name) + "\n" + mesh_line(shape) +
                     "scale = " + to_text(shape.scale) + "\n" +
                     (body.density_kg_per_m3 ? "density_kg_per_m3 = " + to_text(*body.density_kg_per_m3)
                                             : "mass = " + to_text(shape.mass_kg)) +
                     "\n" + (shape.kind == BodyKind::surface ? "kind = \"surface\"\n" : "") +
                     inertia_lines(shape) + "position_m = " + array(body.X_WM.translation_m) +
                     "\nrotation_vector_rad = " + array(rotation_vector(body.X_WM.rotation)) +
                     "\nfriction = " + to_text(body.friction) + "\n";
  if (!body.velocity_m_per_s.isZero(0.0)) text += "velocity_m_per_s = " + array(body.velocity_m_per_s) + "\n";
  if (!body.spin_rad_per_s.isZero(0.0))
    text += "angular_velocity_rad_per_s = " + array(body.spin_rad_per_s) + "\n";
  return text + with_default("restitution", body.restitution) +
         with_default("linear_damping_per_s", body.linear_damping_per_s) +
         with_default("angular_damping_per_s", body.angular_damping_per_s);
}

}  // namespace

std::string scene_text(const SceneSettings& scene, double now_s) {
  std::string text =
      "# The scene as wrenchd renders it, at scene time " + to_text(now_s) +
      " s.\nsurface_tolerance_m = " + to_text(scene.surface_tolerance_m) + "\n" +
      (scene.bodies.empty() ? "" : "gravity_m_per_s2 = " + array(scene.gravity_W_m_per_s2) + "\n") +
      "\n[tool]\n" + tool_lines(scene.tool);
  for (const HalfSpaceSettings& obstacle : scene.half_spaces)
    text += "\n[[obstacle]]\nname = " + quoted(obstacle.name) +
            "\nhalf_space = { normal = " + array(obstacle.normal_W) +
            ", offset = " + to_text(obstacle.offset_m) + " }\n";
  for (const MeshObstacleSettings& obstacle : scene.meshes) text += mesh_obstacle(obstacle, now_s);
  for (const BodySettings& body : scene.bodies) text += free_body(body);
  return text;
}

}  // namespace wrenchd
