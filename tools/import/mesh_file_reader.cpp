// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/mesh_file_reader.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string_view>

#include <assimp/Importer.hpp>
#include <assimp/MemoryIOWrapper.h>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <nlohmann/json.hpp>
#include <zlib.h>

#include "collision/meshes/point_numbers.hpp"
#include "tools/import/import_error.hpp"
#include "tools/import/length.hpp"

namespace wrenchd {
namespace {

constexpr int kMaxNodeDepth = 200;  ///< deepest nesting of nodes that is accepted

struct FormatInfo {
  const char* name;
  const char* extension;  ///< selects assimp's reader
};

FormatInfo info_of(MeshFormat format) {
  switch (format) {
    case MeshFormat::gltf:
      return {"glTF", "gltf"};
    case MeshFormat::glb:
      return {"glTF", "glb"};
    case MeshFormat::threemf:
      return {"3MF", "3mf"};
    case MeshFormat::collada:
      return {"COLLADA", "dae"};
    case MeshFormat::obj:
      return {"OBJ", "obj"};
    case MeshFormat::ply:
      return {"PLY", "ply"};
    case MeshFormat::stl:
      break;
  }
  return {"STL", "stl"};
}

/// Gives assimp the files that are in memory, and no others.
class MemoryFiles : public Assimp::IOSystem {
 public:
  void add(std::string name, const std::string& bytes) { files_[std::move(name)] = &bytes; }
  bool Exists(const char* name) const override { return find(name) != nullptr; }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* name, const char*) override {
    const std::string* const bytes = find(name);
    return bytes == nullptr ? nullptr
                            : new Assimp::MemoryIOStream(reinterpret_cast<const std::uint8_t*>(bytes->data()),
                                                         bytes->size());
  }
  void Close(Assimp::IOStream* stream) override { delete stream; }

 private:
  const std::string* find(const char* name) const {
    std::string_view wanted(name);
    while (wanted.starts_with("./") || wanted.starts_with("/"))
      wanted.remove_prefix(wanted[0] == '/' ? 1 : 2);
    const auto found = files_.find(std::string(wanted));
    return found == files_.end() ? nullptr : found->second;
  }
  std::map<std::string, const std::string*> files_;
};

/// Returns an attribute of the first element with this name in an XML text; nothing if there is none.
std::optional<std::string> xml_attribute(std::string_view text, std::string_view element,
                                         std::string_view attribute) {
  const std::string opening = "<" + std::string(element);
  for (std::size_t at = text.find(opening); at != std::string::npos; at = text.find(opening, at + 1)) {
    const std::size_t end = text.find('>', at);
    std::string_view tag = text.substr(at, end == std::string::npos ? end : end - at);
    if (tag.size() > opening.size() && std::strchr(" \t\r\n/", tag[opening.size()]) == nullptr) continue;
    for (std::size_t k = tag.find(attribute); k != std::string::npos; k = tag.find(attribute, k + 1)) {
      if (std::strchr(" \t\r\n", tag[k - 1]) == nullptr) continue;
      std::size_t v = tag.find_first_not_of(" \t\r\n", k + attribute.size());
      if (v == std::string::npos || tag[v] != '=') continue;
      v = tag.find_first_not_of(" \t\r\n", v + 1);
      if (v == std::string::npos || (tag[v] != '"' && tag[v] != '\'')) continue;
      const std::size_t close = tag.find(tag[v], v + 1);
      if (close == std::string::npos) return {};
      return std::string(tag.substr(v + 1, close - v - 1));
    }
    return {};
  }
  return {};
}

/// Reads a little-endian number at an offset of a zip archive.
template <class T>
T zip_number(std::string_view bytes, std::size_t at) {
  T x = 0;
  if (at + sizeof x > bytes.size()) throw ImportError("is a damaged zip archive; export it again");
  std::memcpy(&x, bytes.data() + at, sizeof x);
  return x;
}

std::string inflate_entry(std::string_view packed, std::size_t size) {
  std::string out(size, '\0');
  z_stream stream{};
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
  stream.avail_in = static_cast<uInt>(packed.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(size);
  if (inflateInit2(&stream, -MAX_WBITS) != Z_OK) throw std::bad_alloc();
  const int result = inflate(&stream, Z_FINISH);
  inflateEnd(&stream);
  if (result != Z_STREAM_END) throw ImportError("is a damaged zip archive; export it again");
  return out;
}

/// Returns the model of a 3MF archive: the first entry whose name ends in ".model".
std::string model_of_3mf(std::string_view bytes) {
  const std::size_t end = bytes.rfind(std::string_view("PK\x05\x06", 4));
  if (end == std::string_view::npos) throw ImportError("is no 3MF archive, or truncated; export it again");
  std::size_t at = zip_number<std::uint32_t>(bytes, end + 16);
  for (std::uint16_t i = zip_number<std::uint16_t>(bytes, end + 10); i > 0; --i) {
    const auto method = zip_number<std::uint16_t>(bytes, at + 10);
    const auto packed_size = zip_number<std::uint32_t>(bytes, at + 20);
    const auto size = zip_number<std::uint32_t>(bytes, at + 24);
    const std::size_t name_size = zip_number<std::uint16_t>(bytes, at + 28);
    const std::size_t local = zip_number<std::uint32_t>(bytes, at + 42);
    if (bytes.size() < at + 46 + name_size) break;
    if (bytes.substr(at + 46, name_size).ends_with(".model")) {
      const std::size_t data = local + 30 + zip_number<std::uint16_t>(bytes, local + 26) +
                               zip_number<std::uint16_t>(bytes, local + 28);
      if (data > bytes.size() || packed_size > bytes.size() - data) break;
      const std::string_view packed = bytes.substr(data, packed_size);
      return method == 0 ? std::string(packed) : inflate_entry(packed, size);
    }
    at += 46 + name_size + zip_number<std::uint16_t>(bytes, at + 30) +
          zip_number<std::uint16_t>(bytes, at + 32);
  }
  throw ImportError("contains no model; export it again as 3MF");
}

/// Millimetres per number of the file after assimp has read it, and the name of the unit for reports.
struct FileUnit {
  double mm = 1.0;
  std::string name;
};

FileUnit unit_of(const std::string& bytes, const MeshReading& reading) {
  const auto stated = [&](double mm, const std::string& name) -> FileUnit {
    if (reading.unit_mm != 0.0 && !reading.unit_is_default)
      throw ImportError("states its unit (" + name + "); leave --unit out");
    return {mm, name};
  };
  switch (reading.format) {
    case MeshFormat::gltf:
    case MeshFormat::glb:
      return stated(1000.0, "m");
    case MeshFormat::threemf: {
      const std::string name = xml_attribute(model_of_3mf(bytes), "model", "unit").value_or("millimeter");
      const auto mm = unit_length_mm(name);
      if (!mm)
        throw ImportError("has the unknown unit '" + printable_name(name) +
                          "'; 3MF has micron, millimeter, centimeter, inch, foot and meter");
      return stated(*mm, name);
    }
    case MeshFormat::collada:
      if (const auto meter = xml_attribute(bytes, "unit", "meter")) {
        const double metres = std::strtod(meter->c_str(), nullptr);
        if (!(metres > 0.0) || !std::isfinite(metres))
          throw ImportError("states a unit of '" + printable_name(*meter) +
                            "' metres; correct <unit meter=...>, or export it again");
        return stated(1000.0,
                      short_number(metres) + " m");  // assimp applies the unit: its numbers are metres
      }
      break;
    default:
      break;
  }
  if (reading.unit_mm == 0.0)
    throw ImportError("states no unit of length; give it with --unit, for example --unit mm");
  return {reading.unit_mm, short_number(reading.unit_mm) + " mm, from --unit"};
}

/// Collects the triangles of all nodes.
class NodeCollector {
 public:
  NodeCollector(const aiScene& scene, double unit_mm, std::size_t max_triangles, ImportedFile& file)
      : scene_(scene), unit_mm_(unit_mm), max_triangles_(max_triangles), file_(file) {}

  void collect(const aiNode& node, const Eigen::Matrix4d& parent, int depth = 0) {
    if (depth > kMaxNodeDepth) throw ImportError("its nodes are nested too deeply; export it again");
    Eigen::Matrix4d local;
    for (unsigned r = 0; r < 4; ++r)
      for (unsigned c = 0; c < 4; ++c)
        local(static_cast<int>(r), static_cast<int>(c)) = static_cast<double>(node.mTransformation[r][c]);
    const Eigen::Matrix4d placed = parent * local;
    if (node.mNumMeshes > 0) add_part(node, placed);
    for (unsigned i = 0; i < node.mNumChildren; ++i) collect(*node.mChildren[i], placed, depth + 1);
  }

 private:
  void add_part(const aiNode& node, const Eigen::Matrix4d& placed) {
    TriangleMesh mesh;
    PointNumbers numbers(mesh.vertices_m);
    const bool mirrored = placed.topLeftCorner<3, 3>().determinant() < 0.0;
    for (unsigned i = 0; i < node.mNumMeshes; ++i) {
      const aiMesh& part = *scene_.mMeshes[node.mMeshes[i]];
      for (unsigned f = 0; f < part.mNumFaces; ++f) {
        const aiFace& face = part.mFaces[f];
        if (face.mNumIndices != 3) continue;  // points and lines
        if (++triangles_ > max_triangles_)
          throw ImportError("has more than " + std::to_string(max_triangles_) +
                            " triangles; simplify it, or raise --max-triangles");
        std::array<std::uint32_t, 3> t{};
        for (unsigned k = 0; k < 3; ++k) {
          const aiVector3D& v = part.mVertices[face.mIndices[k]];
          const Eigen::Vector4d p = placed * Eigen::Vector4d(v.x, v.y, v.z, 1.0);
          const Vector3d point = unit_mm_ * p.head<3>();
          if (!point.allFinite())
            throw ImportError("node '" + printable_name(node.mName.C_Str()) + "', face " + std::to_string(f) +
                              ": a corner is not a finite number; export it again");
          const std::size_t number = numbers.find_or_add(point, mesh.vertices_m.size());
          if (number == mesh.vertices_m.size()) mesh.vertices_m.push_back(point);
          t[mirrored ? 2 - k : k] = static_cast<std::uint32_t>(number);
        }
        mesh.triangles.push_back(t);
      }
    }
    if (mesh.triangles.empty()) return;
    std::string name = printable_name(node.mName.C_Str());
    if (name.empty()) name = "part";
    const std::size_t number = ++count_[name];
    ImportedPart& part = file_.parts.emplace_back();
    part.name = number == 1 ? name : name + "#" + std::to_string(number);
    part.meshes.push_back(std::move(mesh));
  }

  const aiScene& scene_;
  double unit_mm_;
  std::size_t max_triangles_;
  ImportedFile& file_;
  std::size_t triangles_ = 0;
  std::map<std::string, std::size_t> count_;
};

}  // namespace

ImportedFile read_mesh_file(const std::string& bytes, const MeshReading& reading) {
  const FormatInfo info = info_of(reading.format);
  ImportedFile file;
  file.format = info.name;
  const FileUnit unit = unit_of(bytes, reading);
  file.unit = unit.name;

  auto* const files = new MemoryFiles;  // the importer deletes it
  Assimp::Importer importer;
  importer.SetIOHandler(files);
  const std::string name = std::string("model.") + info.extension;
  files->add(name, bytes);
  for (const auto& [companion, content] : reading.companions) files->add(companion, content);
  importer.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
  const aiScene* const scene = importer.ReadFile(name, aiProcess_Triangulate);
  if (scene == nullptr || scene->mRootNode == nullptr) {
    std::string reason = printable_name(importer.GetErrorString());
    throw ImportError("is damaged or no " + file.format + " file (" + reason + "); export it again");
  }
  NodeCollector(*scene, unit.mm, reading.max_triangles, file)
      .collect(*scene->mRootNode, Eigen::Matrix4d::Identity());
  if (file.parts.empty()) throw ImportError("contains no triangles; export the mesh again");
  return file;
}

std::vector<std::string> gltf_companions(const std::string& bytes) {
  std::vector<std::string> names;
  const auto model = nlohmann::json::parse(bytes, nullptr, false);
  if (model.is_discarded() || !model.is_object())
    throw ImportError("is damaged or no glTF file: it is not JSON; export it again");
  const auto buffers = model.find("buffers");
  if (buffers == model.end() || !buffers->is_array()) return names;
  for (const auto& buffer : *buffers) {
    if (!buffer.is_object()) continue;
    const auto uri = buffer.find("uri");
    if (uri == buffer.end() || !uri->is_string()) continue;
    const auto text = uri->get<std::string>();
    if (!text.starts_with("data:")) names.push_back(text);
  }
  return names;
}

}  // namespace wrenchd
