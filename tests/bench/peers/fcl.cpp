// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <memory>
#include <vector>

#include <fcl/fcl.h>

#include "tests/bench/peer_interface.h"

namespace {

std::shared_ptr<fcl::Convexd> convex(const PeerMesh& mesh) {
  const auto vertices = std::make_shared<std::vector<fcl::Vector3d>>();
  for (std::size_t i = 0; i < mesh.vertex_count; ++i)
    vertices->emplace_back(mesh.vertices[3 * i], mesh.vertices[3 * i + 1], mesh.vertices[3 * i + 2]);
  // For each face: the number of vertices, then their indices.
  const auto faces = std::make_shared<std::vector<int>>();
  for (std::size_t i = 0; i < mesh.triangle_count; ++i) {
    faces->push_back(3);
    for (std::size_t k = 0; k < 3; ++k) faces->push_back(static_cast<int>(mesh.triangles[3 * i + k]));
  }
  return std::make_shared<fcl::Convexd>(vertices, static_cast<int>(mesh.triangle_count), faces);
}

struct Pair {
  std::shared_ptr<fcl::Convexd> A, B;
};

}  // namespace

const char* peer_query_name(int query) {
  return query == 0 ? "FCL collide, libccd" : nullptr;
}

void* peer_open(const PeerMesh* A, const PeerMesh* B) {
  return new Pair{convex(*A), convex(*B)};
}

void peer_close(void* peer) {
  delete static_cast<Pair*>(peer);
}

int peer_ask(void* peer, int, const PeerPose* X_BA, double* depth) {
  const auto& pair = *static_cast<Pair*>(peer);
  fcl::Transform3d X = fcl::Transform3d::Identity();
  X.linear() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(X_BA->rotation);
  X.translation() = Eigen::Map<const Eigen::Vector3d>(X_BA->translation);
  fcl::CollisionRequestd request(1, true);
  request.gjk_solver_type = fcl::GST_LIBCCD;  // the other solver returns wrong depths and is slower
  fcl::CollisionResultd result;
  fcl::collide(pair.A.get(), X, pair.B.get(), fcl::Transform3d::Identity(), request, result);
  if (!result.isCollision()) return 0;
  *depth = result.getContact(0).penetration_depth;
  return 1;
}
