// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <memory>
#include <vector>

#include <btBulletDynamicsCommon.h>

#include "tests/bench/boxes_peer_interface.h"

namespace {

/// Bullet works in centimetres here, as in bullet_mesh.cpp: its margins and tolerances assume bodies of about
/// 1 unit.
constexpr double kUnitsPerMetre = 100.0;

btVector3 scaled(const double* p, double factor = kUnitsPerMetre) {
  const auto at = [&](int i) { return static_cast<btScalar>(factor * p[i]); };
  return {at(0), at(1), at(2)};
}

struct World {
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btDiscreteDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
  btStaticPlaneShape plane{btVector3(0, 0, 1), 0};
  std::vector<std::unique_ptr<btCollisionShape>> shapes;
  std::vector<std::unique_ptr<btRigidBody>> bodies;
  btScalar step_s = 0;

  World() = default;
  World(const World&) = delete;
  World& operator=(const World&) = delete;
  ~World() {
    for (const auto& body : bodies) world.removeRigidBody(body.get());
  }

  /// Bullet multiplies the coefficients of both bodies.
  btRigidBody& add(btCollisionShape& shape, btScalar mass, const btTransform& pose, double friction) {
    btVector3 inertia(0, 0, 0);
    if (mass > 0) shape.calculateLocalInertia(mass, inertia);
    bodies.push_back(std::make_unique<btRigidBody>(mass, nullptr, &shape, inertia));
    bodies.back()->setWorldTransform(pose);
    bodies.back()->setFriction(static_cast<btScalar>(std::sqrt(friction)));
    bodies.back()->setActivationState(DISABLE_DEACTIVATION);
    world.addRigidBody(bodies.back().get());
    return *bodies.back();
  }
};

}  // namespace

const char* peer_boxes_name() {
  return "Bullet";
}

void* peer_boxes_open(const PeerBoxScene* scene) {
  auto one = std::make_unique<World>();
  one->step_s = static_cast<btScalar>(scene->step_s);
  one->world.setGravity(scaled(scene->gravity));
  one->add(one->plane, 0, btTransform::getIdentity(), scene->friction);
  for (std::size_t i = 0; i < scene->count; ++i) {
    const PeerBox& box = scene->boxes[i];
    one->shapes.push_back(std::make_unique<btBoxShape>(scaled(box.half_sides)));
    const auto q = [&](int k) { return static_cast<btScalar>(box.quaternion[k]); };
    const btTransform pose(btQuaternion(q(0), q(1), q(2), q(3)), scaled(box.position));
    one->add(*one->shapes.back(), static_cast<btScalar>(box.mass), pose, scene->friction)
        .setLinearVelocity(scaled(box.velocity));
  }
  return one.release();
}

void peer_boxes_close(void* world) {
  delete static_cast<World*>(world);
}

void peer_boxes_step(void* world) {
  World& one = *static_cast<World*>(world);
  one.world.stepSimulation(one.step_s, 1, one.step_s);
}

void peer_boxes_state(void* world, size_t box, double pose[7], double velocity[6]) {
  const btRigidBody& body = *static_cast<World*>(world)->bodies[box + 1];
  const btVector3 &p = body.getWorldTransform().getOrigin(), &v = body.getLinearVelocity();
  const btQuaternion q = body.getWorldTransform().getRotation();
  for (int k = 0; k < 3; ++k) {
    pose[k] = p[k] / kUnitsPerMetre;
    velocity[k] = v[k] / kUnitsPerMetre;
    velocity[3 + k] = body.getAngularVelocity()[k];
  }
  pose[3] = q.x();
  pose[4] = q.y();
  pose[5] = q.z();
  pose[6] = q.w();
}
