// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/robot_import.hpp"

#include <algorithm>
#include <map>
#include <optional>

#include "collision/meshes/mesh_source.hpp"
#include "tools/import/cad_mesher.hpp"
#include "tools/import/cad_primitive.hpp"
#include "tools/import/import_error.hpp"
#include "tools/import/length.hpp"
#include "tools/import/reading_child.hpp"
#include "tools/import/urdf_reader.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

constexpr double kMillimetres = 1000.0;  // URDF is in metres

/// Splits "NAME=REST". Throws ImportError.
std::pair<std::string, std::string> split(const std::string& text, const char* option, const char* form) {
  const auto at = text.find('=');
  if (at == std::string::npos || at == 0 || at + 1 == text.size())
    throw ImportError(std::string(option) + " " + printable_name(text) + ": write it as " + form);
  return {text.substr(0, at), text.substr(at + 1)};
}

std::map<std::string, double> positions(const std::vector<std::string>& joints) {
  std::map<std::string, double> all;
  for (const std::string& text : joints) {
    const auto [name, value] = split(text, "--joint", "NAME=VALUE, in rad or m");
    const auto x = parse_number(value);
    if (!x)
      throw ImportError("--joint " + printable_name(text) + ": '" + printable_name(value) +
                        "' is no finite number; write it as NAME=VALUE, in rad or m");
    all[name] = *x;
  }
  return all;
}

/// Finds the mesh files of a robot.
class MeshFinder {
 public:
  MeshFinder(const fs::path& urdf, const std::vector<std::string>& packages)
      : directory_(fs::absolute(urdf).lexically_normal().parent_path()) {
    for (const std::string& text : packages) {
      const auto [name, directory] = split(text, "--package", "NAME=DIR");
      std::error_code error;
      if (!fs::is_directory(directory, error))
        throw ImportError("--package " + printable_name(text) + ": there is no such directory; check it");
      packages_[name] = fs::absolute(directory).lexically_normal();
    }
  }

  /// Returns the file of a name such as "package://arm/meshes/link.stl".
  fs::path find(std::string name, const std::string& place) {
    constexpr std::string_view kPackage = "package://", kFile = "file://";
    if (name.starts_with(kPackage)) {
      name.erase(0, kPackage.size());
      const std::string package = name.substr(0, name.find('/'));
      const auto rest = name.substr(std::min(name.size(), package.size() + 1));
      return package_directory(package, place) / rest;
    }
    if (name.starts_with(kFile)) name.erase(0, kFile.size());
    if (name.find("://") != std::string::npos)
      throw ImportError(place + ": '" + printable_name(name) +
                        "' is no name of a file; use package://, file:// or a relative name");
    return (directory_ / name).lexically_normal();
  }

  /// Returns the directories in which meshes may be.
  FileScope scope() const {
    std::vector<fs::path> directories = {directory_};
    for (const auto& [name, directory] : packages_) directories.push_back(directory);
    return FileScope::beneath(directories);
  }

 private:
  /// A package that no option names is a directory above the file with this name.
  const fs::path& package_directory(const std::string& package, const std::string& place) {
    if (const auto known = packages_.find(package); known != packages_.end()) return known->second;
    for (fs::path at = directory_; !package.empty() && at.has_relative_path(); at = at.parent_path())
      if (at.filename() == package) return packages_[package] = at;
    throw ImportError(place + ": the directory of the package '" + printable_name(package) +
                      "' is unknown; name it with --package " + printable_name(package) + "=DIR");
  }

  fs::path directory_;
  std::map<std::string, fs::path> packages_;
};

UrdfRobot read_robot(const RobotJob& job) {
  const std::string bytes = read_source(job.job.file);
  const auto joints = positions(job.joints);
  const std::string answer =
      read_in_child("the XML parser", {}, [&] { return packed(read_urdf(bytes, joints)); });
  UrdfRobot robot;
  if (!unpack(answer, robot)) throw ImportError("is damaged: the XML parser crashes on it; export it again");
  const auto& links = job.job.parts;
  for (const std::string& link : links)
    if (std::none_of(robot.shapes.begin(), robot.shapes.end(),
                     [&](const UrdfShape& shape) { return shape.link == link; }))
      throw ImportError("has no link '" + printable_name(link) +
                        "' with a collision element; --list shows the links");
  if (!links.empty())
    std::erase_if(robot.shapes, [&](const UrdfShape& shape) {
      return std::find(links.begin(), links.end(), shape.link) == links.end();
    });
  return robot;
}

/// Scales the meshes of a file. A mirrored mesh is turned inside out, so that it faces outwards.
void scale_meshes(ImportedFile& file, const Vector3d& scale) {
  const bool mirrored = scale.prod() < 0.0;
  for (ImportedPart& part : file.parts)
    for (TriangleMesh& mesh : part.meshes) {
      for (Vector3d& p : mesh.vertices_m) p = p.cwiseProduct(scale);
      if (mirrored)
        for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
    }
}

std::string place_of(const UrdfShape& shape) {
  return "link '" + shape.link + "', collision '" + shape.name + "'";
}

/// Returns the mesh file of each shape; an empty path for other shapes. Throws ImportError if a file is
/// missing, is no mesh, or lies outside of the scope of the finder.
std::vector<fs::path> find_meshes(const std::vector<UrdfShape>& shapes, MeshFinder& finder) {
  std::vector<fs::path> files;
  for (const UrdfShape& shape : shapes) {
    fs::path& file = files.emplace_back();
    if (shape.kind != UrdfShape::Kind::mesh) continue;
    const std::string place = place_of(shape);
    file = finder.find(shape.mesh, place);
    const FileScope scope = finder.scope();
    if (!scope.contains(file))
      throw ImportError(place + ": " + file.string() + " lies outside of the directories for meshes (" +
                        scope.directories_text() + "); add its directory with --package NAME=DIR");
    try {
      if (source_kind(file) != SourceKind::mesh)
        throw ImportError("is no mesh; name a .dae, .stl, .obj or .ply file");
      OpenedFile(file, scope);
    } catch (const std::runtime_error& error) {
      throw ImportError(place + ": " + file.string() + ": " + error.what());
    }
  }
  return files;
}

ImportedFile import_mesh(const UrdfShape& shape, const fs::path& mesh, const ImportJob& robot,
                         const FileScope& scope) {
  ImportJob job;
  job.file = mesh;
  job.max_triangles = robot.max_triangles;
  job.unit_mm = kMillimetres;
  job.unit_is_default = true;
  ImportedFile file;
  try {
    file = import_file(job, scope);
  } catch (const ImportError& error) {
    throw ImportError(job.file.string() + ": " + error.what());
  }
  scale_meshes(file, shape.scale);
  return file;
}

ImportedFile make_primitive(const UrdfShape& shape, const ImportJob& robot) {
  const Primitive kind = shape.kind == UrdfShape::Kind::box        ? Primitive::box
                         : shape.kind == UrdfShape::Kind::cylinder ? Primitive::cylinder
                                                                   : Primitive::sphere;
  const std::string answer = read_in_child("OpenCASCADE", {}, [&] {
    return packed(mesh_model(primitive_model(kind, kMillimetres * shape.size_m, shape.name),
                             {robot.chord_mm, robot.max_triangles}));
  });
  ImportedFile file;
  if (!unpack(answer, file)) throw ImportError("OpenCASCADE crashes on it; correct its size");
  return file;
}

const char* kind_name(UrdfShape::Kind kind) {
  switch (kind) {
    case UrdfShape::Kind::mesh:
      return "mesh ";
    case UrdfShape::Kind::box:
      return "box";
    case UrdfShape::Kind::cylinder:
      return "cylinder";
    case UrdfShape::Kind::sphere:
      break;
  }
  return "sphere";
}

}  // namespace

std::vector<PlacedBody> import_robot(const RobotJob& job, std::vector<std::string>& remarks) {
  const UrdfRobot robot = read_robot(job);
  remarks.insert(remarks.end(), robot.remarks.begin(), robot.remarks.end());
  MeshFinder finder(job.job.file, job.packages);
  // A wrong name is rejected before the first mesh takes its time.
  const std::vector<fs::path> meshes = find_meshes(robot.shapes, finder);
  std::vector<PlacedBody> bodies;
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    const UrdfShape& shape = robot.shapes[i];
    try {
      ImportedFile file = shape.kind == UrdfShape::Kind::mesh
                              ? import_mesh(shape, meshes[i], job.job, finder.scope())
                              : make_primitive(shape, job.job);
      bodies.push_back({shape.name, join_parts(std::move(file), job.joining), shape.X_WS});
    } catch (const ImportError& error) {
      throw ImportError(place_of(shape) + ": " + error.what());
    }
  }
  return bodies;
}

std::vector<PartSummary> list_links(const RobotJob& job) {
  std::vector<PartSummary> all;
  for (const UrdfShape& shape : read_robot(job).shapes) {
    const Vector3d& p = shape.X_WS.translation_m;
    all.push_back({shape.link, kind_name(shape.kind) + printable_name(shape.mesh) + " at " +
                                   place_text(1e3 * p.x(), 1e3 * p.y(), 1e3 * p.z())});
  }
  return all;
}

}  // namespace wrenchd
