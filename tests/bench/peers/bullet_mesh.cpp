// SPDX-License-Identifier: GPL-3.0-or-later
#include <memory>

#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <BulletCollision/Gimpact/btGImpactCollisionAlgorithm.h>
#include <BulletCollision/Gimpact/btGImpactShape.h>
#include <btBulletCollisionCommon.h>

#include "tests/bench/peer_interface.h"

namespace {

/// Bullet works in centimetres here: its built-in margins and tolerances assume bodies of about 1 unit.
constexpr double kUnitsPerMetre = 100.0;

btVector3 scaled(const double* p) {
  const auto at = [&](int i) { return static_cast<btScalar>(kUnitsPerMetre * p[i]); };
  return {at(0), at(1), at(2)};
}

struct Surface {
  btTriangleMesh triangles{true, false};
  std::unique_ptr<btGImpactMeshShape> shape;
  btCollisionObject object;

  explicit Surface(const PeerMesh& mesh) {
    const auto vertex = [&](std::size_t i, std::size_t k) {
      return scaled(mesh.vertices + 3 * mesh.triangles[3 * i + k]);
    };
    for (std::size_t i = 0; i < mesh.triangle_count; ++i)
      triangles.addTriangle(vertex(i, 0), vertex(i, 1), vertex(i, 2), false);
    shape = std::make_unique<btGImpactMeshShape>(&triangles);
    shape->setMargin(0);
    shape->updateBound();
    object.setCollisionShape(shape.get());
    object.setWorldTransform(btTransform::getIdentity());
  }
};

/// Counts the contacts that the algorithm reports. A manifold would keep at most four.
struct Counter final : btManifoldResult {
  using btManifoldResult::btManifoldResult;
  int count = 0;
  void addContactPoint(const btVector3&, const btVector3&, btScalar) override { ++count; }
};

struct Pair {
  Pair(const PeerMesh& a, const PeerMesh& b) : A(a), B(b), dispatcher(&configuration) {
    btGImpactCollisionAlgorithm::registerAlgorithm(&dispatcher);
  }
  Surface A, B;
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher;
};

btTransform transform(const PeerPose& X) {
  const auto r = [&](int i) { return static_cast<btScalar>(X.rotation[i]); };
  return btTransform(btMatrix3x3(r(0), r(1), r(2), r(3), r(4), r(5), r(6), r(7), r(8)),
                     scaled(X.translation));
}

}  // namespace

const char* peer_query_name(int query) {
  return query == 0 ? "Bullet GImpact all contacts" : nullptr;
}

void* peer_open(const PeerMesh* A, const PeerMesh* B) {
  return new Pair(*A, *B);
}

void peer_close(void* peer) {
  delete static_cast<Pair*>(peer);
}

int peer_ask(void* peer, int, const PeerPose* X_BA, double*) {
  auto& pair = *static_cast<Pair*>(peer);
  pair.A.object.setWorldTransform(transform(*X_BA));
  const auto wrapped = [](const btCollisionObject& object) {
    return btCollisionObjectWrapper(nullptr, object.getCollisionShape(), &object, object.getWorldTransform(),
                                    -1, -1);
  };
  const btCollisionObjectWrapper a = wrapped(pair.A.object), b = wrapped(pair.B.object);
  btPersistentManifold* manifold = pair.dispatcher.getNewManifold(&pair.A.object, &pair.B.object);
  // Bullet's default closest-point algorithm ignores this kind of shape.
  btCollisionAlgorithm* algorithm =
      pair.dispatcher.findAlgorithm(&a, &b, manifold, BT_CONTACT_POINT_ALGORITHMS);
  Counter counter(&a, &b);
  counter.setPersistentManifold(manifold);
  const btDispatcherInfo info;
  algorithm->processCollision(&a, &b, info, &counter);
  algorithm->~btCollisionAlgorithm();
  pair.dispatcher.freeCollisionAlgorithm(algorithm);
  pair.dispatcher.releaseManifold(manifold);
  return counter.count;
}
