// SPDX-License-Identifier: GPL-3.0-or-later
#include <memory>
#include <vector>

#include <fcl/fcl.h>

#include "tests/bench/peer_interface.h"

namespace {

using Model = fcl::BVHModel<fcl::OBBRSSd>;

std::shared_ptr<Model> model(const PeerMesh& mesh) {
  std::vector<fcl::Vector3d> vertices;
  for (std::size_t i = 0; i < mesh.vertex_count; ++i)
    vertices.emplace_back(mesh.vertices[3 * i], mesh.vertices[3 * i + 1], mesh.vertices[3 * i + 2]);
  std::vector<fcl::Triangle> triangles;
  for (std::size_t i = 0; i < mesh.triangle_count; ++i)
    triangles.emplace_back(mesh.triangles[3 * i], mesh.triangles[3 * i + 1], mesh.triangles[3 * i + 2]);
  auto out = std::make_shared<Model>();
  out->beginModel();
  out->addSubModel(vertices, triangles);
  out->endModel();
  return out;
}

struct Pair {
  std::shared_ptr<Model> A, B;
};

}  // namespace

const char* peer_query_name(int query) {
  return query == 0 ? "FCL all contacts" : nullptr;
}

void* peer_open(const PeerMesh* A, const PeerMesh* B) {
  return new Pair{model(*A), model(*B)};
}

void peer_close(void* peer) {
  delete static_cast<Pair*>(peer);
}

int peer_ask(void* peer, int, const PeerPose* X_BA, double*) {
  const auto& pair = *static_cast<Pair*>(peer);
  fcl::Transform3d X = fcl::Transform3d::Identity();
  X.linear() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(X_BA->rotation);
  X.translation() = Eigen::Map<const Eigen::Vector3d>(X_BA->translation);
  const fcl::CollisionRequestd request(100000, true);
  fcl::CollisionResultd result;
  fcl::collide(pair.A.get(), X, pair.B.get(), fcl::Transform3d::Identity(), request, result);
  return static_cast<int>(result.numContacts());
}
