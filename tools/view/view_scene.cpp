// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/view_scene.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <stdexcept>

#include "daemon/control/scene_geometry.hpp"
#include "tools/view/display_mesh.hpp"

namespace wrenchd {
namespace {

Vector3d vector_of(const Json& json) {
  return {json.at(0).get<double>(), json.at(1).get<double>(), json.at(2).get<double>()};
}

Pose pose_from_json(const Json& x) {
  const auto at = [&](std::size_t i) { return x.at(i).get<double>(); };
  return {Quaterniond(at(6), at(3), at(4), at(5)).normalized(), {at(0), at(1), at(2)}};
}

ObstacleMotion motion_of(const Json& json) {
  return {vector_of(json.at("linear_m_per_s")), vector_of(json.at("angular_rad_per_s")),
          json.at("reverse_after_s").get<double>(), json.at("start_s").get<double>(),
          json.at("duration_s").get<double>()};
}

std::optional<ScheduledMotion> later_of(const Json& json) {
  return ScheduledMotion{json.at("start_s").get<double>(), pose_from_json(json.at("X_WO")),
                         motion_of(json.at("motion"))};
}

template <class T>
std::vector<T> part(std::span<const std::byte> bytes, std::size_t offset, std::size_t count) {
  if (offset > bytes.size() || count > (bytes.size() - offset) / sizeof(T))
    throw std::runtime_error("the geometry of the scene exceeds its memory");
  std::vector<T> out(count);
  if (count > 0) std::memcpy(out.data(), bytes.data() + offset, count * sizeof(T));
  return out;
}

enum class Detail : std::uint32_t { fine = 1, coarse = 3 };

std::string message_of(Detail detail, std::uint32_t number, const DisplayMesh& mesh) {
  const auto count = [](std::size_t numbers) { return static_cast<std::uint32_t>(numbers / 3); };
  const std::array<std::uint32_t, 5> head = {static_cast<std::uint32_t>(detail), number,
                                             count(mesh.positions.size()), count(mesh.indices.size()),
                                             count(mesh.lines.size())};
  std::string out(reinterpret_cast<const char*>(head.data()), sizeof head);
  for (const std::vector<float>* part : {&mesh.positions, &mesh.normals})
    out.append(reinterpret_cast<const char*>(part->data()), part->size() * sizeof(float));
  out.append(reinterpret_cast<const char*>(mesh.indices.data()), mesh.indices.size() * sizeof(std::uint32_t));
  out.append(reinterpret_cast<const char*>(mesh.lines.data()), mesh.lines.size() * sizeof(float));
  return out;
}

}  // namespace

ViewScene::ViewScene(const Json& description, std::span<const std::byte> bytes, const ViewScene* known) try
    : shapes_(description.at("geometry_id").get<std::uint64_t>()),
      rendering_id_(description.at("rendering_id").get<std::uint32_t>()),
      start_ns_(description.at("scene_time_begins_ns").get<std::int64_t>()),
      X_WB_(pose_from_json(description.at("X_WB"))),
      X_HT_(pose_from_json(description.at("X_HT"))),
      about_handle_(description.at("wrench_about") == "handle") {
  const Json& meshes = description.at("meshes");
  std::size_t all = 0;
  for (const Json& mesh : meshes) source_triangles_.push_back(mesh.at("triangles").get<std::size_t>());
  for (const std::size_t one : source_triangles_) all += one;
  if (known != nullptr && known->shapes_ == shapes_) {
    meshes_ = known->meshes_;
  } else {
    const auto add_all = [&](Detail detail, std::size_t most) {
      std::uint32_t number = 0;
      for (const Json& mesh : meshes) {
        // Distributes the triangles in proportion to the meshes' sizes, with a minimum that keeps a mesh
        // recognizable.
        constexpr double kLeast = 2'000.0;
        const auto triangles = static_cast<double>(source_triangles_[number]);
        const double share = static_cast<double>(most) * triangles / static_cast<double>(std::max(all, most));
        const auto vertices = part<float>(bytes, mesh.at("vertices_offset").get<std::size_t>(),
                                          3 * mesh.at("vertices").get<std::size_t>());
        const auto corners = part<std::array<std::uint32_t, 3>>(
            bytes, mesh.at("triangles_offset").get<std::size_t>(), source_triangles_[number]);
        const DisplayMesh drawn =
            display_mesh(vertices, corners, static_cast<std::size_t>(std::max(share, kLeast)));
        meshes_.push_back(std::make_shared<const std::string>(message_of(detail, number, drawn)));
        ++number;
      }
    };
    add_all(Detail::fine, kMaxTriangles);
    if (all > kReducedTriangles) add_all(Detail::coarse, kReducedTriangles);
  }
  Json obstacles = Json::array();
  std::uint32_t number = 0;
  for (const Json& one : description.at("obstacles")) {
    names_.push_back(one.at("name").get<std::string>());
    Json shown = {{"name", names_.back()}};
    if (one.contains("half_space")) {
      shown["half_space"] = one["half_space"];
    } else {
      shown["mesh"] = one.at("mesh");
      shown["pose"] = one.at("X_WO");
      if (one.contains("motion") || one.contains("scheduled"))
        moving_obstacles_.push_back({number, pose_from_json(one.at("X_WO")),
                                     one.contains("motion") ? motion_of(one["motion"]) : ObstacleMotion{},
                                     one.contains("scheduled") ? later_of(one["scheduled"]) : std::nullopt});
      shown["moves"] = one.contains("motion") || one.contains("scheduled");
    }
    obstacles.push_back(std::move(shown));
    ++number;
  }
  first_body_ = number;
  for (const Json& one : description.value("bodies", Json::array())) {
    names_.push_back(one.at("name").get<std::string>());
    obstacles.push_back(
        {{"name", names_.back()}, {"mesh", one.at("mesh")}, {"pose", one.at("X_WB")}, {"moves", true}});
    ++body_count_;
  }
  Json sizes = Json::array();
  for (const std::size_t triangles : source_triangles_) sizes.push_back({{"triangles", triangles}});
  text_ = Json{{"type", "scene"},        {"shapes", shapes_},
               {"meshes", sizes},        {"tool", description.at("tool")},
               {"obstacles", obstacles}, {"view", description.value("view", Json())}}
              .dump(-1, ' ', false, Json::error_handler_t::replace);
} catch (const nlohmann::json::exception& error) {
  throw std::runtime_error(std::string("the scene has an unknown format: ") + error.what());
} catch (const std::invalid_argument& error) {
  throw std::runtime_error(std::string("the geometry of the scene: ") + error.what());
}

Json ViewScene::moved_poses(std::int64_t time_ns, std::span<const double> X_WB) const {
  const double t_s = 1e-9 * static_cast<double>(time_ns - start_ns_);
  Json out = Json::array();
  for (const MovingObstacle& one : moving_obstacles_) {
    const Pose X_WO = one.later && t_s >= one.later->start_s ? one.later->motion.pose_at(one.later->X_WO, t_s)
                                                             : one.motion.pose_at(one.X_WO, t_s);
    out.push_back({one.number, pose_json(X_WO)});
  }
  for (std::size_t i = 0; i < body_count_ && 7 * i + 7 <= X_WB.size(); ++i) {
    const std::span<const double> pose = X_WB.subspan(7 * i, 7);
    if (pose[6] == 0.0 && pose[3] == 0.0 && pose[4] == 0.0 && pose[5] == 0.0) continue;  // not recorded
    out.push_back({first_body_ + i, std::vector<double>(pose.begin(), pose.end())});
  }
  return out;
}

std::string ViewScene::obstacle_name(std::uint32_t number) const {
  return number < names_.size() ? names_[number] : "obstacle " + std::to_string(number);
}

}  // namespace wrenchd
