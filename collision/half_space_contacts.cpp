// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/half_space_contacts.hpp"

#include <algorithm>
#include <array>
#include <limits>

namespace wrenchd {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The N smallest gaps of a sequence, smallest first.
template <std::size_t N>
class Deepest {
 public:
  /// Gaps below this value are kept.
  double threshold() const noexcept { return count_ < N ? kInfinity : gap_[N - 1]; }
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

//   gap = n . (R a + x) - o = (R' n) . a - (o - n . x): one dot product a vertex
HalfSpaceContacts::HalfSpaceInTool HalfSpaceContacts::half_space_in_tool(std::uint32_t k,
                                                                         const Frame& X_WT) const noexcept {
  const HalfSpaceSettings& half_space = scene_.half_spaces()[k];
  return {X_WT.R.transpose() * half_space.normal_W, half_space.offset_m - half_space.normal_W.dot(X_WT.x_m)};
}

Contact HalfSpaceContacts::make_contact(std::uint32_t k, std::uint32_t vertex) const noexcept {
  Contact contact;
  contact.n_W = scene_.half_spaces()[k].normal_W;
  contact.offset_m = scene_.half_spaces()[k].offset_m;
  contact.p_WCb_m = contact.offset_m * contact.n_W;
  contact.obstacle = k;
  contact.p_TCa_m = scene_.tool().hull.vertices_T_m[vertex];
  contact.tool_feature = vertex;
  return contact;
}

void HalfSpaceContacts::add_violated(const Frame& X_WT, double tolerance_m,
                                     ContactSet& contacts) const noexcept {
  for (std::uint32_t k = 0; k < scene_.half_spaces().size(); ++k) {
    const HalfSpaceInTool plane = half_space_in_tool(k, X_WT);
    Deepest<kMaxPerObstacle> deepest;
    scene_.tool().hull.visit_above(
        -plane.n_T, [&] { return -plane.offset_m - std::min(-tolerance_m, deepest.threshold()); },
        [&](std::uint32_t v, double depth) {
          const double gap = -depth - plane.offset_m;
          if (gap >= -tolerance_m || gap >= deepest.threshold()) return;
          if (!contacts.contains(make_contact(k, v))) deepest.insert(gap, v);
        });
    for (std::size_t i = 0; i < deepest.count(); ++i) contacts.add(make_contact(k, deepest.vertex(i)));
  }
}

void HalfSpaceContacts::add_touching(const Frame& X_WT, double within_m,
                                     ContactSet& contacts) const noexcept {
  for (std::uint32_t k = 0; k < scene_.half_spaces().size(); ++k) {
    const HalfSpaceInTool plane = half_space_in_tool(k, X_WT);
    const std::size_t known = contacts.size();
    const auto is_known = [&](std::uint32_t v) {
      return std::any_of(contacts.begin(), contacts.begin() + known,
                         [&](const Contact& c) { return c.obstacle == k && c.tool_feature == v; });
    };
    scene_.tool().hull.visit_above(
        -plane.n_T, [&] { return -plane.offset_m - within_m; },
        [&](std::uint32_t v, double depth) {
          if (-depth - plane.offset_m < within_m && !is_known(v)) contacts.add(make_contact(k, v));
        });
  }
}

bool HalfSpaceContacts::admits(const Frame& X_WT, double tolerance_m) const noexcept {
  const ConvexBody& tool = scene_.tool().hull;
  for (std::uint32_t k = 0; k < scene_.half_spaces().size(); ++k) {
    const HalfSpaceInTool plane = half_space_in_tool(k, X_WT);
    if (plane.n_T.dot(tool.vertices_T_m[tool.support(-plane.n_T)]) - plane.offset_m < -tolerance_m)
      return false;
  }
  return true;
}

}  // namespace wrenchd
