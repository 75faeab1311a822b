// SPDX-License-Identifier: GPL-3.0-or-later
#include <vector>

#include <CGAL/Rigid_triangle_mesh_collision_detection.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>

#include "tests/bench/peer_interface.h"

namespace {

using Kernel = CGAL::Simple_cartesian<double>;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;

Mesh surface(const PeerMesh& mesh) {
  Mesh out;
  std::vector<Mesh::Vertex_index> vertices;
  for (std::size_t i = 0; i < mesh.vertex_count; ++i)
    vertices.push_back(out.add_vertex(
        Kernel::Point_3(mesh.vertices[3 * i], mesh.vertices[3 * i + 1], mesh.vertices[3 * i + 2])));
  for (std::size_t i = 0; i < mesh.triangle_count; ++i)
    out.add_face(vertices[mesh.triangles[3 * i]], vertices[mesh.triangles[3 * i + 1]],
                 vertices[mesh.triangles[3 * i + 2]]);
  return out;
}

struct Pair {
  Pair(const PeerMesh& a, const PeerMesh& b) : A(surface(a)), B(surface(b)), a_number(detection.add_mesh(A)) {
    detection.add_mesh(B);
  }
  Mesh A, B;
  CGAL::Rigid_triangle_mesh_collision_detection<Mesh> detection;
  std::size_t a_number;
};

}  // namespace

const char* peer_query_name(int query) {
  return query == 0 ? "CGAL do intersect" : nullptr;
}

void* peer_open(const PeerMesh* A, const PeerMesh* B) {
  return new Pair(*A, *B);
}

void peer_close(void* peer) {
  delete static_cast<Pair*>(peer);
}

int peer_ask(void* peer, int, const PeerPose* X_BA, double*) {
  auto& pair = *static_cast<Pair*>(peer);
  const double* R = X_BA->rotation;
  const double* t = X_BA->translation;
  pair.detection.set_transformation(
      pair.a_number,
      Kernel::Aff_transformation_3(R[0], R[1], R[2], t[0], R[3], R[4], R[5], t[1], R[6], R[7], R[8], t[2]));
  return static_cast<int>(pair.detection.get_all_intersections(pair.a_number).size());
}
