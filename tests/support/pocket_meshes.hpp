// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <utility>

#include "core/triangle_mesh.hpp"

namespace wrenchd::test {

/// A tray: a box of 0.14 m x 0.14 m x 0.04 m with its rim in z = 0 and a recess of 0.1 m x 0.1 m x 0.03 m.
inline TriangleMesh tray() {
  TriangleMesh mesh;
  const auto square = [&](double half_m, double z_m) {
    for (const auto& [x, y] : {std::pair(-1, -1), {1, -1}, {1, 1}, {-1, 1}})
      mesh.vertices_m.emplace_back(half_m * x, half_m * y, z_m);
  };
  square(0.07, -0.04), square(0.07, 0.0), square(0.05, 0.0), square(0.05, -0.03);
  mesh.triangles = {{0, 2, 1}, {0, 3, 2}, {12, 13, 14}, {12, 14, 15}};
  for (std::uint32_t ring = 0; ring < 3; ++ring)
    for (std::uint32_t i = 0; i < 4; ++i) {
      const std::uint32_t a = 4 * ring + i, b = 4 * ring + (i + 1) % 4;
      mesh.triangles.push_back({a, b, b + 4});
      mesh.triangles.push_back({a, b + 4, a + 4});
    }
  return mesh;
}

/// A block of 0.14 m x 0.14 m x 0.04 m with its top in z = 0, and n x n square pockets in it, 0.01 m deep.
inline TriangleMesh block_with_pockets(std::uint32_t n) {
  const std::uint32_t cells = 2 * n + 1, points = cells + 1;
  constexpr double kSize_m = 0.14;
  TriangleMesh mesh;
  for (const double z_m : {0.0, -0.04})
    for (std::uint32_t i = 0; i < points; ++i)
      for (std::uint32_t j = 0; j < points; ++j)
        mesh.vertices_m.emplace_back(kSize_m * (i / static_cast<double>(cells) - 0.5),
                                     kSize_m * (j / static_cast<double>(cells) - 0.5), z_m);
  const auto top = [&](std::uint32_t i, std::uint32_t j) { return i * points + j; };
  const auto bottom = [&](std::uint32_t i, std::uint32_t j) { return points * points + top(i, j); };
  using Quad = std::array<std::uint32_t, 4>;
  const auto add = [&](const Quad& q) {
    mesh.triangles.push_back({q[0], q[1], q[2]});
    mesh.triangles.push_back({q[0], q[2], q[3]});
  };
  for (std::uint32_t i = 0; i < cells; ++i)
    for (std::uint32_t j = 0; j < cells; ++j) {
      add({bottom(i, j), bottom(i, j + 1), bottom(i + 1, j + 1), bottom(i + 1, j)});
      const Quad rim = {top(i, j), top(i + 1, j), top(i + 1, j + 1), top(i, j + 1)};
      if (i % 2 == 0 || j % 2 == 0) {
        add(rim);
        continue;
      }
      const auto first = static_cast<std::uint32_t>(mesh.vertices_m.size());
      const Quad floor = {first, first + 1, first + 2, first + 3};
      for (const std::uint32_t v : rim) mesh.vertices_m.push_back(mesh.vertices_m[v] - Vector3d(0, 0, 0.01));
      add(floor);
      for (std::size_t k = 0; k < 4; ++k) add({rim[k], rim[(k + 1) % 4], floor[(k + 1) % 4], floor[k]});
    }
  for (std::uint32_t i = 0; i < cells; ++i) {
    add({bottom(i, 0), bottom(i + 1, 0), top(i + 1, 0), top(i, 0)});
    add({bottom(i + 1, cells), bottom(i, cells), top(i, cells), top(i + 1, cells)});
    add({bottom(0, i + 1), bottom(0, i), top(0, i), top(0, i + 1)});
    add({bottom(cells, i), bottom(cells, i + 1), top(cells, i + 1), top(cells, i)});
  }
  return mesh;
}

}  // namespace wrenchd::test
