// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <cstdio>
#include <utility>

#include <wrenchd/collision/meshes/make_mesh.hpp>
#include <wrenchd/collision/pose_solver.hpp>
#include <wrenchd/collision/tool_body.hpp>

/// A cube of 20 mm and 0.2 kg, pressed 1 mm into a table: T = m d^2.
int main() {
  wrenchd::TriangleMesh cube;
  for (unsigned i = 0; i < 8; ++i)
    cube.vertices_m.emplace_back(i & 1u ? 0.01 : -0.01, i & 2u ? 0.01 : -0.01, i & 4u ? 0.01 : -0.01);
  cube.triangles = {{0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}};
  const wrenchd::Scene scene(wrenchd::tool_body(std::move(cube), 1.0, 0.2),
                             {{"table", {0.0, 0.0, 1.0}, 0.0}});
  wrenchd::PoseSolver solver(scene, {});
  const wrenchd::Pose pressed{wrenchd::Quaterniond::Identity(), {0.0, 0.0, 0.009}};
  const wrenchd::SolvedPose answer = solver.project(pressed);
  std::printf("energy %.9g kg m^2, %s\n", answer.penetration.projection.energy,
              wrenchd::status_name(answer.penetration.projection.status));
  return std::abs(answer.penetration.projection.energy - 0.2e-6) < 1e-15 && solver.overlaps(pressed) ? 0 : 1;
}
