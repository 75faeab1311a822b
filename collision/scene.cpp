// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/scene.hpp"

#include <algorithm>
#include <array>
#include <limits>

namespace wrenchd {
namespace {

/// The few smallest of a stream of gaps, smallest first.
template <std::size_t N>
class Deepest {
 public:
  /// Below this gap a vertex would be kept.
  double threshold() const noexcept {
    return count_ < N ? std::numeric_limits<double>::infinity() : gap_[N - 1];
  }
  void insert(double gap, std::uint32_t vertex) noexcept {
    std::size_t at = std::min(count_, N - 1);
    for (; at > 0 && gap < gap_[at - 1]; --at) {
      gap_[at] = gap_[at - 1];
      vertex_[at] = vertex_[at - 1];
    }
    gap_[at] = gap;
    vertex_[at] = vertex;
    count_ = std::min(count_ + 1, N);
  }
  std::size_t count() const noexcept { return count_; }
  std::uint32_t vertex(std::size_t i) const noexcept { return vertex_[i]; }

 private:
  std::array<double, N> gap_{};
  std::array<std::uint32_t, N> vertex_{};
  std::size_t count_ = 0;
};

}  // namespace

Scene::Scene(const SceneSettings& settings) : Scene(load_tool(settings.tool), settings.half_spaces) {}

Scene::Scene(ToolBody tool, std::vector<HalfSpaceSettings> half_spaces)
    : tool_(std::move(tool)), half_spaces_(std::move(half_spaces)) {}

//   gap = n . (R a + x) - o = (R' n) . a - (o - n . x): one dot product a vertex
std::size_t Scene::add_violated(const Pose& X_WT, double tolerance_m, ContactSet& contacts) const noexcept {
  const std::size_t before = contacts.size();
  const auto& vertices = tool_.hull.vertices_T_m;
  for (std::uint32_t k = 0; k < half_spaces_.size(); ++k) {
    const Vector3d& n_W = half_spaces_[k].normal_W;
    const double offset_m = half_spaces_[k].offset_m;
    const Vector3d n_T = X_WT.rotation.conjugate() * n_W;
    const double below = offset_m - n_W.dot(X_WT.translation_m);
    const auto contact_of = [&](std::uint32_t v) { return Contact{vertices[v], n_W, offset_m, v, k}; };

    Deepest<kPerObstacle> deepest;
    for (std::uint32_t v = 0; v < vertices.size(); ++v) {
      const double gap = n_T.dot(vertices[v]) - below;
      if (gap >= -tolerance_m || gap >= deepest.threshold()) continue;
      if (!contacts.contains(contact_of(v))) deepest.insert(gap, v);
    }
    for (std::size_t i = 0; i < deepest.count(); ++i) contacts.add(contact_of(deepest.vertex(i)));
  }
  return contacts.size() - before;
}

double Scene::least_gap_m(const Pose& X_WT) const noexcept {
  double least = std::numeric_limits<double>::infinity();
  for (const HalfSpaceSettings& half_space : half_spaces_)
    for (const Vector3d& a : tool_.hull.vertices_T_m)
      least = std::min(least, half_space.normal_W.dot(X_WT * a) - half_space.offset_m);
  return least;
}

}  // namespace wrenchd
