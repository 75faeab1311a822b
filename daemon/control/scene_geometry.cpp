// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/scene_geometry.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <string>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "collision/touch.hpp"

namespace wrenchd {
namespace {

[[noreturn]] void reject_with_errno(const char* what) {
  throw std::system_error(errno, std::generic_category(),
                          std::string("the shared memory of the scene geometry: ") + what);
}

void write(const TriangleMesh& mesh, std::byte* vertices, std::byte* triangles) {
  for (const Vector3d& p : mesh.vertices_m)
    for (int i = 0; i < 3; ++i) {
      const auto x = static_cast<float>(p[i]);
      std::memcpy(vertices, &x, sizeof x);
      vertices += sizeof x;
    }
  static_assert(sizeof(mesh.triangles[0]) == 12);
  if (!mesh.triangles.empty()) std::memcpy(triangles, mesh.triangles.data(), 12 * mesh.triangles.size());
}

Json motion_json(const ObstacleMotion& motion) {
  return {{"linear_m_per_s", json_of(motion.linear_m_per_s)},
          {"angular_rad_per_s", json_of(motion.angular_rad_per_s)},
          {"reverse_after_s", motion.reverse_after_s},
          {"start_s", motion.start_s},
          {"duration_s", motion.duration_s}};
}

bool same(const TriangleMesh& a, const TriangleMesh& b) {
  return a.triangles == b.triangles && a.vertices_m == b.vertices_m;
}

}  // namespace

Json json_of(const Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}

Json view_json(const ViewSettings& view) {
  if (view.eye_m == view.target_m) return nullptr;
  return {{"eye_m", {view.eye_m.x(), view.eye_m.y(), view.eye_m.z()}},
          {"target_m", {view.target_m.x(), view.target_m.y(), view.target_m.z()}}};
}

Json pose_json(const Pose& X) {
  const Vector3d& p = X.translation_m;
  const Quaterniond& q = X.rotation;
  return {p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()};
}

SceneGeometry::SceneGeometry(std::shared_ptr<const Scene> scene) : scene_(std::move(scene)) {
  std::vector<const TriangleMesh*> all = {&scene_->tool().mesh};
  for (const MeshObstacle& obstacle : scene_->meshes()) {
    if (std::find(meshes_.begin(), meshes_.end(), obstacle.mesh.get()) != meshes_.end()) continue;
    meshes_.push_back(obstacle.mesh.get());
    all.push_back(&obstacle.mesh->loaded_mesh());
  }
  for (const FreeBody& body : scene_->bodies()) {
    meshes_.push_back(body.mesh.get());
    all.push_back(&body.body.mesh);
  }
  for (const TriangleMesh* mesh : all) {
    const std::size_t vertices = mesh->vertices_m.size(), triangles = mesh->triangles.size();
    layouts_.push_back({vertices, bytes_, triangles, bytes_ + 12 * vertices});
    bytes_ += 12 * (vertices + triangles);
  }
  descriptor_ = memfd_create("wrenchd-shapes", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  if (descriptor_ < 0) reject_with_errno("memfd_create");
  const auto give_up = [this](const char* what) {
    const int error = errno;
    close(descriptor_);
    errno = error;
    reject_with_errno(what);
  };
  if (ftruncate(descriptor_, static_cast<off_t>(bytes_)) != 0) give_up("ftruncate");
  void* const memory = mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor_, 0);
  if (memory == MAP_FAILED) give_up("mmap");
  memory_ = static_cast<std::byte*>(memory);
  for (std::size_t i = 0; i < all.size(); ++i)
    write(*all[i], memory_ + layouts_[i].vertices_offset, memory_ + layouts_[i].triangles_offset);
  // A writable mapping would prevent the write seal.
  munmap(memory_, bytes_);
  if (fcntl(descriptor_, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE | F_SEAL_SEAL) != 0)
    give_up("seals");
  void* const readable = mmap(nullptr, bytes_, PROT_READ, MAP_SHARED, descriptor_, 0);
  if (readable == MAP_FAILED) give_up("mmap");
  memory_ = static_cast<std::byte*>(readable);
}

SceneGeometry::~SceneGeometry() {
  munmap(memory_, bytes_);
  close(descriptor_);
}

bool SceneGeometry::matches(const Scene& scene) const {
  if (&scene == scene_.get()) return true;
  return std::all_of(scene.meshes().begin(), scene.meshes().end(),
                     [this](const MeshObstacle& one) { return mesh_number(one.mesh.get()) != 0; }) &&
         std::all_of(scene.bodies().begin(), scene.bodies().end(),
                     [this](const FreeBody& one) { return mesh_number(one.mesh.get()) != 0; }) &&
         same(scene.tool().mesh, scene_->tool().mesh);
}

/// Returns the number of an obstacle mesh, starting at 1; 0: unknown mesh. Mesh 0 is the tool.
std::size_t SceneGeometry::mesh_number(const MeshBvh* mesh) const {
  const auto found = std::find(meshes_.begin(), meshes_.end(), mesh);
  return found == meshes_.end() ? 0 : static_cast<std::size_t>(found - meshes_.begin()) + 1;
}

Json SceneGeometry::description(const Scene& scene) const {
  Json meshes = Json::array();
  for (const MeshLayout& place : layouts_)
    meshes.push_back({{"vertices", place.vertices},
                      {"vertices_offset", place.vertices_offset},
                      {"triangles", place.triangles},
                      {"triangles_offset", place.triangles_offset}});
  Json obstacles = Json::array();
  std::uint32_t number = 0;
  for (const HalfSpaceSettings& one : scene.half_spaces())
    obstacles.push_back({{"name", obstacle_name(scene, number++)},
                         {"half_space", {{"normal", json_of(one.normal_W)}, {"offset_m", one.offset_m}}}});
  number = scene.first_mesh();
  for (const MeshObstacle& one : scene.meshes()) {
    Json obstacle = {{"name", obstacle_name(scene, number++)},
                     {"mesh", mesh_number(one.mesh.get())},
                     {"X_WO", pose_json(one.X_WO)}};
    if (one.motion.moves()) obstacle["motion"] = motion_json(one.motion);
    if (one.scheduled)
      obstacle["scheduled"] = {{"start_s", one.scheduled->start_s},
                               {"X_WO", pose_json(one.scheduled->X_WO)},
                               {"motion", motion_json(one.scheduled->motion)}};
    obstacles.push_back(std::move(obstacle));
  }
  Json bodies = Json::array();
  for (const FreeBody& one : scene.bodies())
    bodies.push_back(
        {{"name", one.name}, {"mesh", mesh_number(one.mesh.get())}, {"X_WB", pose_json(one.motion.X_WB)}});
  return {{"bytes", bytes_},
          {"meshes", meshes},
          {"tool", {{"mesh", 0}}},
          {"obstacles", obstacles},
          {"bodies", bodies}};
}

}  // namespace wrenchd
