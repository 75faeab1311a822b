// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include <ode/ode.h>

#include "tests/bench/peer_interface.h"

namespace {

/// ODE keeps pointers to these arrays, so they must live as long as the geometry.
struct Convex {
  std::vector<dReal> planes, points;
  std::vector<unsigned> polygons;
  dGeomID geometry = nullptr;

  explicit Convex(const PeerMesh& mesh) : points(mesh.vertices, mesh.vertices + 3 * mesh.vertex_count) {
    for (std::size_t i = 0; i < mesh.triangle_count; ++i) add_face(mesh.triangles + 3 * i);
    geometry = dCreateConvex(nullptr, planes.data(), static_cast<unsigned>(mesh.triangle_count),
                             points.data(), static_cast<unsigned>(mesh.vertex_count), polygons.data());
  }
  Convex(const Convex&) = delete;
  Convex& operator=(const Convex&) = delete;
  ~Convex() { dGeomDestroy(geometry); }

  void add_face(const std::uint32_t* corners) {
    const dReal* a = &points[3 * corners[0]];
    const dReal* b = &points[3 * corners[1]];
    const dReal* c = &points[3 * corners[2]];
    std::array<double, 3> n{};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t y = (k + 1) % 3;
      const std::size_t z = (k + 2) % 3;
      n[k] = (b[y] - a[y]) * (c[z] - a[z]) - (b[z] - a[z]) * (c[y] - a[y]);
    }
    const double length = std::hypot(n[0], n[1], n[2]);
    for (double& x : n) x /= length;
    planes.insert(planes.end(), {n[0], n[1], n[2], n[0] * a[0] + n[1] * a[1] + n[2] * a[2]});
    polygons.insert(polygons.end(), {3, corners[0], corners[1], corners[2]});
  }
};

struct Pair {
  Pair(const PeerMesh& a, const PeerMesh& b) : A(a), B(b) {}
  Convex A, B;
};

}  // namespace

const char* peer_query_name(int query) {
  return query == 0 ? "ODE dCollide" : nullptr;
}

void* peer_open(const PeerMesh* A, const PeerMesh* B) {
  dInitODE2(0);
  return new Pair(*A, *B);
}

void peer_close(void* peer) {
  delete static_cast<Pair*>(peer);
  dCloseODE();
}

int peer_ask(void* peer, int, const PeerPose* X_BA, double* depth) {
  auto& pair = *static_cast<Pair*>(peer);
  const double* R = X_BA->rotation;
  const dMatrix3 rotation = {R[0], R[1], R[2], 0, R[3], R[4], R[5], 0, R[6], R[7], R[8], 0};
  dGeomSetRotation(pair.A.geometry, rotation);
  dGeomSetPosition(pair.A.geometry, X_BA->translation[0], X_BA->translation[1], X_BA->translation[2]);
  std::array<dContactGeom, 64> contacts;
  const int found = dCollide(pair.A.geometry, pair.B.geometry, static_cast<int>(contacts.size()),
                             contacts.data(), sizeof(dContactGeom));
  *depth = 0.0;
  for (int i = 0; i < found; ++i) *depth = std::max(*depth, contacts[static_cast<std::size_t>(i)].depth);
  return found > 0 ? 1 : 0;
}
