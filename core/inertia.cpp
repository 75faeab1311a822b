// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/inertia.hpp"

namespace wrenchd {

// METHOD (16). The solid is the signed sum of the tetrahedra (r, a, b, c) over all triangles, with a
// reference point r. With d = det[a b c] (six times the volume) and s = a + b + c, relative to r:
//
//   V       = sum d / 6
//   int x   = sum d s / 24
//   int xx' = sum d (a a' + b b' + c c' + s s') / 120
//
// and H = m (tr(C) I - C), C = int (x - c)(x - c)' / V. r is the mean of the vertices, so a body far from the
// mesh origin loses no digits.
SolidProperties solid_properties(const TriangleMesh& mesh, double mass_kg) {
  Vector3d r = Vector3d::Zero();
  for (const Vector3d& p : mesh.vertices_m) r += p;
  if (!mesh.vertices_m.empty()) r /= static_cast<double>(mesh.vertices_m.size());

  double six_volume = 0.0;
  Vector3d first = Vector3d::Zero();
  Matrix3d second = Matrix3d::Zero();
  for (const auto& [i, j, k] : mesh.triangles) {
    const Vector3d a = mesh.vertices_m[i] - r;
    const Vector3d b = mesh.vertices_m[j] - r;
    const Vector3d c = mesh.vertices_m[k] - r;
    const Vector3d s = a + b + c;
    const double d = a.dot(b.cross(c));
    six_volume += d;
    first += d * s;
    second += d * (a * a.transpose() + b * b.transpose() + c * c.transpose() + s * s.transpose());
  }

  SolidProperties solid;
  solid.volume_m3 = six_volume / 6.0;
  if (!(solid.volume_m3 > 0.0)) return solid;
  const Vector3d centre = first / (24.0 * solid.volume_m3);
  const Matrix3d C = second / (120.0 * solid.volume_m3) - centre * centre.transpose();
  solid.p_MT_m = r + centre;
  solid.inertia.mass_kg = mass_kg;
  solid.inertia.H_kg_m2 = mass_kg * (C.trace() * Matrix3d::Identity() - C);
  return solid;
}

// Each triangle (a, b, c) of area A and unit normal n contributes, relative to r and with s = a + b + c:
//
//   int x   = A s / 3
//   int xx' = A (a a' + b b' + c c' + s s') / 12 + A t^2 n n' / 12
//
// where t is the thickness. H follows from these as in METHOD (16).
SolidProperties shell_properties(const TriangleMesh& mesh, double mass_kg, double thickness_m) {
  Vector3d r = Vector3d::Zero();
  for (const Vector3d& p : mesh.vertices_m) r += p;
  if (!mesh.vertices_m.empty()) r /= static_cast<double>(mesh.vertices_m.size());

  double area = 0.0;
  Vector3d first = Vector3d::Zero();
  Matrix3d second = Matrix3d::Zero();
  for (const auto& [i, j, k] : mesh.triangles) {
    const Vector3d a = mesh.vertices_m[i] - r;
    const Vector3d b = mesh.vertices_m[j] - r;
    const Vector3d c = mesh.vertices_m[k] - r;
    const Vector3d s = a + b + c, twice = (b - a).cross(c - a);
    const double A = 0.5 * twice.norm();
    if (!(A > 0.0)) continue;
    const Vector3d n = twice.normalized();
    area += A;
    first += A / 3.0 * s;
    second += A / 12.0 *
              (a * a.transpose() + b * b.transpose() + c * c.transpose() + s * s.transpose() +
               thickness_m * thickness_m * n * n.transpose());
  }

  SolidProperties shell;
  shell.volume_m3 = area * thickness_m;
  if (!(area > 0.0)) return shell;
  const Vector3d centre = first / area;
  const Matrix3d C = second / area - centre * centre.transpose();
  shell.p_MT_m = r + centre;
  shell.inertia.mass_kg = mass_kg;
  shell.inertia.H_kg_m2 = mass_kg * (C.trace() * Matrix3d::Identity() - C);
  return shell;
}

}  // namespace wrenchd
