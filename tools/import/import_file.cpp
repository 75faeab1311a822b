// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/import_file.hpp"

#include <algorithm>
#include <array>
#include <cctype>

#include <Eigen/Geometry>

#include "config/nearest_key.hpp"
#include "tools/import/cad_mesher.hpp"
#include "tools/import/cad_reader.hpp"
#include "tools/import/import_error.hpp"
#include "tools/import/length.hpp"
#include "tools/import/mesh_file_reader.hpp"
#include "tools/import/reading_child.hpp"

namespace wrenchd {
namespace {

/// The largest STEP files of whole machines have this size.
constexpr std::uint64_t kMaxFileBytes = std::uint64_t{512} << 20;

struct KnownFormat {
  const char* extension;
  SourceKind kind;
  CadFormat cad;
  MeshFormat mesh;
};

constexpr std::array kFormats = {
    KnownFormat{".step", SourceKind::cad, CadFormat::step, {}},
    KnownFormat{".stp", SourceKind::cad, CadFormat::step, {}},
    KnownFormat{".brep", SourceKind::cad, CadFormat::brep, {}},
    KnownFormat{".gltf", SourceKind::mesh, {}, MeshFormat::gltf},
    KnownFormat{".glb", SourceKind::mesh, {}, MeshFormat::glb},
    KnownFormat{".3mf", SourceKind::mesh, {}, MeshFormat::threemf},
    KnownFormat{".dae", SourceKind::mesh, {}, MeshFormat::collada},
    KnownFormat{".obj", SourceKind::mesh, {}, MeshFormat::obj},
    KnownFormat{".ply", SourceKind::mesh, {}, MeshFormat::ply},
    KnownFormat{".stl", SourceKind::mesh, {}, MeshFormat::stl},
    KnownFormat{".urdf", SourceKind::urdf, {}, {}},
};

const KnownFormat& format_of(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  std::vector<KnownKey> known;
  for (const KnownFormat& format : kFormats) {
    if (extension == format.extension) return format;
    known.push_back({format.extension, ""});
  }
  if (extension == ".iges" || extension == ".igs")
    throw ImportError("IGES is not read, because most IGES files contain surfaces only; export it as STEP");
  const NearestKey nearest = nearest_key(extension, known);
  std::string all;
  for (const KnownKey& key : known) all += (all.empty() ? "" : ", ") + key.name;
  throw ImportError("unknown format '" + printable_name(extension) + "'; " +
                    (nearest.name.empty() ? "there are " + all : nearest.advice));
}

CadModel read_selected(const std::string& bytes, const KnownFormat& format, const ImportJob& job) {
  CadModel model = read_cad(bytes, {format.cad, job.unit_mm});
  select_parts(model, job.parts, job.skip_surfaces);
  return model;
}

/// Reads the files that a glTF file refers to. They lie beneath its directory.
std::map<std::string, std::string> read_companions(const std::string& bytes, const ImportJob& job) {
  std::map<std::string, std::string> companions;
  const auto directory = job.file.has_parent_path() ? job.file.parent_path() : ".";
  const FileScope beneath = FileScope::beneath({directory});
  for (const std::string& name : gltf_companions(bytes)) {
    const std::string place = "buffer '" + printable_name(name) + "': ";
    std::filesystem::path at(name);
    if (at.is_absolute() || !beneath.contains(directory / at))
      throw ImportError(place + "lies outside of the directory of the file; export it as .glb");
    try {
      companions[name] = read_file(directory / at, kMaxFileBytes, beneath);
    } catch (const FileError& error) {
      throw ImportError(place + error.what() + ", or export it as .glb");
    }
  }
  return companions;
}

void select_mesh_parts(ImportedFile& file, const std::vector<std::string>& names) {
  if (names.empty()) return;
  const auto matches = [](const ImportedPart& part, const std::string& name) {
    return part.name == name || part.name.starts_with(name + "#");
  };
  for (const std::string& name : names)
    if (std::none_of(file.parts.begin(), file.parts.end(),
                     [&](const ImportedPart& part) { return matches(part, name); }))
      throw ImportError("has no part '" + name + "'; --list shows its parts");
  std::erase_if(file.parts, [&](const ImportedPart& part) {
    return std::none_of(names.begin(), names.end(),
                        [&](const std::string& name) { return matches(part, name); });
  });
}

ImportedFile read_mesh_in_child(const std::string& bytes, const KnownFormat& format, const ImportJob& job) {
  MeshReading reading{format.mesh, job.unit_mm, job.unit_is_default, job.max_triangles, {}};
  if (format.mesh == MeshFormat::gltf) reading.companions = read_companions(bytes, job);
  const std::string answer =
      read_in_child("assimp", {}, [&] { return packed(read_mesh_file(bytes, reading)); });
  ImportedFile file;
  if (!unpack(answer, file)) throw ImportError("is damaged: assimp crashes on it; export it again");
  return file;
}

}  // namespace

SourceKind source_kind(const std::filesystem::path& file) {
  return format_of(file).kind;
}

std::string read_source(const std::filesystem::path& file, const FileScope& scope) {
  try {
    OpenedFile opened(file, scope);
    if (opened.size_bytes() == 0) throw ImportError("is empty; export it again");
    return opened.read(kMaxFileBytes);
  } catch (const FileError& error) {
    if (error.problem() == FileProblem::too_large)
      throw ImportError("is larger than " + std::to_string(kMaxFileBytes >> 20) +
                        " MiB; export a part of the model");
    throw ImportError(error.what());
  }
}

ImportedFile import_file(const ImportJob& job, const FileScope& scope) {
  const KnownFormat& format = format_of(job.file);
  const std::string bytes = read_source(job.file, scope);
  ImportedFile file;
  if (format.kind == SourceKind::mesh) {
    file = read_mesh_in_child(bytes, format, job);
    select_mesh_parts(file, job.parts);
    return file;
  }
  const std::string answer = read_in_child("OpenCASCADE", {}, [&] {
    return packed(mesh_model(read_selected(bytes, format, job), {job.chord_mm, job.max_triangles}));
  });
  if (!unpack(answer, file)) throw ImportError("is damaged: OpenCASCADE crashes on it; export it again");
  file.format = format.cad == CadFormat::step ? "STEP" : "BREP";
  return file;
}

std::vector<PartSummary> list_parts(const ImportJob& job) {
  const KnownFormat& format = format_of(job.file);
  const std::string bytes = read_source(job.file);
  std::vector<PartSummary> parts;
  if (format.kind == SourceKind::mesh) {
    for (const ImportedPart& part : read_mesh_in_child(bytes, format, job).parts)
      parts.push_back({part.name, std::to_string(part.meshes.front().triangles.size()) + " triangles"});
    return parts;
  }
  const std::string answer = read_in_child("OpenCASCADE", {}, [&] {
    return packed(summarize(read_cad(bytes, {format.cad, job.unit_mm})));
  });
  if (!unpack(answer, parts)) throw ImportError("is damaged: OpenCASCADE crashes on it; export it again");
  return parts;
}

}  // namespace wrenchd
