// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/conforming_mesh.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <ostream>
#include <string>

namespace wrenchd::test {
namespace {

using Polygon = std::vector<Vector3d>;

Polygon polygon(const ProfileRing& ring, std::uint32_t corners, std::uint32_t across) {
  const auto corner = [&](std::uint32_t i) {
    const double angle = kFullTurn_rad * (i % corners) / corners, r = ring.radius_m(angle);
    return Vector3d(r * std::cos(angle), r * std::sin(angle), ring.z_m);
  };
  Polygon points;
  for (std::uint32_t i = 0; i < corners; ++i)
    for (std::uint32_t k = 0; k < across; ++k) {
      const double s = static_cast<double>(k) / across;
      points.emplace_back((1.0 - s) * corner(i) + s * corner(i + 1));
    }
  return points;
}

/// Returns the polygons of the rings and the polygons that divide the facets between them. Facets have a
/// number of parts in proportion to their length along z.
std::vector<Polygon> divided(const std::vector<ProfileRing>& rings, std::uint32_t corners,
                             std::uint32_t across, std::uint32_t along) {
  double longest_m = 0.0;
  for (std::size_t k = 0; k + 1 < rings.size(); ++k)
    longest_m = std::max(longest_m, rings[k + 1].z_m - rings[k].z_m);
  std::vector<Polygon> out;
  for (std::size_t k = 0; k + 1 < rings.size(); ++k) {
    const Polygon low = polygon(rings[k], corners, across), high = polygon(rings[k + 1], corners, across);
    const auto parts = static_cast<std::uint32_t>(
        std::max(1.0, std::round(along * (rings[k + 1].z_m - rings[k].z_m) / longest_m)));
    for (std::uint32_t p = 0; p < parts; ++p) {
      const double s = static_cast<double>(p) / parts;
      Polygon& between = out.emplace_back();
      for (std::size_t i = 0; i < low.size(); ++i) between.emplace_back((1.0 - s) * low[i] + s * high[i]);
    }
  }
  out.push_back(polygon(rings.back(), corners, across));
  return out;
}

/// Builds a mesh of polygons with equal numbers of points.
class PrismBuilder {
 public:
  /// Returns the number of the polygon's first vertex.
  std::uint32_t add(const Polygon& points) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices_m.size());
    mesh.vertices_m.insert(mesh.vertices_m.end(), points.begin(), points.end());
    around_ = static_cast<std::uint32_t>(points.size());
    return first;
  }

  /// Adds the faces between two polygons, which point outward if `high` is above `low`.
  void strip(std::uint32_t low, std::uint32_t high) {
    for (std::uint32_t i = 0; i < around_; ++i) {
      const std::uint32_t j = (i + 1) % around_;
      mesh.triangles.push_back({low + i, low + j, high + j});
      mesh.triangles.push_back({low + i, high + j, high + i});
    }
  }

  /// Closes a polygon with a fan around a point on the axis.
  void close(std::uint32_t ring, bool above) {
    const auto middle = static_cast<std::uint32_t>(mesh.vertices_m.size());
    mesh.vertices_m.emplace_back(0.0, 0.0, mesh.vertices_m[ring].z());
    for (std::uint32_t i = 0; i < around_; ++i) {
      const std::uint32_t j = (i + 1) % around_;
      mesh.triangles.push_back({middle, ring + (above ? i : j), ring + (above ? j : i)});
    }
  }

  TriangleMesh mesh;

 private:
  std::uint32_t around_ = 0;
};

}  // namespace

TriangleMesh make_prism(const Prism& prism, const FacetParts& parts) {
  PrismBuilder builder;
  const auto add_all = [&](const std::vector<ProfileRing>& rings, std::uint32_t along) {
    std::vector<std::uint32_t> first;
    for (const Polygon& points : divided(rings, prism.corners, parts.across, along))
      first.push_back(builder.add(points));
    return first;
  };
  const std::vector<std::uint32_t> outer = add_all(prism.outside, parts.along);
  for (std::size_t k = 0; k + 1 < outer.size(); ++k) builder.strip(outer[k], outer[k + 1]);
  if (prism.bore.empty()) {
    builder.close(outer.front(), false);
    builder.close(outer.back(), true);
    return builder.mesh;
  }
  const std::vector<std::uint32_t> inner = add_all(prism.bore, parts.along_bore);
  for (std::size_t k = 0; k + 1 < inner.size(); ++k) builder.strip(inner[k + 1], inner[k]);
  builder.strip(outer.back(), inner.back());
  builder.strip(inner.front(), outer.front());
  return builder.mesh;
}

TriangleMesh rotated(TriangleMesh mesh, const Quaterniond& R) {
  const Matrix3d matrix = R.toRotationMatrix();
  for (Vector3d& p : mesh.vertices_m) p = matrix * p;
  return mesh;
}

void write_binary_stl(std::ostream& out, const TriangleMesh& mesh) {
  constexpr std::size_t kHeaderBytes = 80, kTriangleBytes = 50;
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  std::string bytes(kHeaderBytes + sizeof count + kTriangleBytes * mesh.triangles.size(), '\0');
  char* to = bytes.data() + kHeaderBytes;
  std::memcpy(to, &count, sizeof count);
  to += sizeof count;
  for (const auto& corners : mesh.triangles) {
    std::array<float, 12> numbers{};  // the normal may be zero; readers then derive it
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t d = 0; d < 3; ++d)
        numbers[3 + 3 * k + d] =
            static_cast<float>(1000.0 * mesh.vertices_m[corners[k]][static_cast<Eigen::Index>(d)]);
    std::memcpy(to, numbers.data(), sizeof numbers);
    to += kTriangleBytes;
  }
  out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

}  // namespace wrenchd::test
