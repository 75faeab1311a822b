// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <memory>

#include <BulletCollision/NarrowPhaseCollision/btGjkEpa2.h>
#include <btBulletCollisionCommon.h>

#include "tests/bench/peer_interface.h"

namespace {

/// Bullet works in centimetres here: its built-in margins and tolerances assume bodies of about 1 unit.
constexpr double kUnitsPerMetre = 100.0;

/// The build has only one precision: single and double builds share inline objects across modules.
constexpr const char* kNames[] = {"Bullet GJK and EPA", "Bullet contact pair", nullptr};

btVector3 scaled(const double* p) {
  const auto at = [&](int i) { return static_cast<btScalar>(kUnitsPerMetre * p[i]); };
  return {at(0), at(1), at(2)};
}

std::unique_ptr<btConvexHullShape> hull(const PeerMesh& mesh) {
  auto shape = std::make_unique<btConvexHullShape>();
  for (std::size_t i = 0; i < mesh.vertex_count; ++i) shape->addPoint(scaled(mesh.vertices + 3 * i), false);
  shape->recalcLocalAabb();
  shape->setMargin(0);
  return shape;
}

struct Deepest final : btCollisionWorld::ContactResultCallback {
  bool found = false;
  double depth = 0.0;
  btScalar addSingleResult(btManifoldPoint& point, const btCollisionObjectWrapper*, int, int,
                           const btCollisionObjectWrapper*, int, int) override {
    found = true;
    depth = std::max(depth, -static_cast<double>(point.getDistance()));
    return 0;
  }
};

struct Pair {
  Pair(const PeerMesh& a, const PeerMesh& b)
      : shape_A(hull(a)),
        shape_B(hull(b)),
        dispatcher(&configuration),
        world(&dispatcher, &broadphase, &configuration) {
    A.setCollisionShape(shape_A.get());
    B.setCollisionShape(shape_B.get());
    B.setWorldTransform(btTransform::getIdentity());
  }

  std::unique_ptr<btConvexHullShape> shape_A, shape_B;
  btCollisionObject A, B;
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher;
  btDbvtBroadphase broadphase;
  btCollisionWorld world;
};

btTransform transform(const PeerPose& X) {
  const auto r = [&](int i) { return static_cast<btScalar>(X.rotation[i]); };
  return btTransform(btMatrix3x3(r(0), r(1), r(2), r(3), r(4), r(5), r(6), r(7), r(8)),
                     scaled(X.translation));
}

}  // namespace

const char* peer_query_name(int query) {
  return kNames[query];
}

void* peer_open(const PeerMesh* A, const PeerMesh* B) {
  return new Pair(*A, *B);
}

void peer_close(void* peer) {
  delete static_cast<Pair*>(peer);
}

int peer_ask(void* peer, int query, const PeerPose* X_BA, double* depth) {
  auto& pair = *static_cast<Pair*>(peer);
  const btTransform X = transform(*X_BA);
  if (query == 0) {
    btGjkEpaSolver2::sResults result;
    if (!btGjkEpaSolver2::Penetration(pair.shape_A.get(), X, pair.shape_B.get(), btTransform::getIdentity(),
                                      X.getOrigin(), result, false))
      return 0;
    *depth = -static_cast<double>(result.distance) / kUnitsPerMetre;
    return 1;
  }
  pair.A.setWorldTransform(X);
  Deepest deepest;
  pair.world.contactPairTest(&pair.A, &pair.B, deepest);
  *depth = deepest.depth / kUnitsPerMetre;
  return deepest.found ? 1 : 0;
}
