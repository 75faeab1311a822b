// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <memory>
#include <vector>

#include <ode/ode.h>

#include "tests/bench/boxes_peer_interface.h"

namespace {

struct World {
  dWorldID world = dWorldCreate();
  dSpaceID space = dHashSpaceCreate(nullptr);
  dJointGroupID contacts = dJointGroupCreate(0);
  std::vector<dBodyID> bodies;
  double step_s = 0.0, friction = 0.0;

  World() = default;
  World(const World&) = delete;
  World& operator=(const World&) = delete;
  ~World() {
    dJointGroupDestroy(contacts);
    dSpaceDestroy(space);
    dWorldDestroy(world);
  }
};

void add_contacts(void* data, dGeomID a, dGeomID b) {
  constexpr int kMost = 16;
  World& one = *static_cast<World*>(data);
  std::array<dContact, kMost> found{};
  const int count = dCollide(a, b, kMost, &found[0].geom, sizeof(dContact));
  for (int k = 0; k < count; ++k) {
    dContact& contact = found[static_cast<std::size_t>(k)];
    contact.surface.mode = dContactApprox1;
    contact.surface.mu = one.friction;
    dJointAttach(dJointCreateContact(one.world, one.contacts, &contact), dGeomGetBody(a), dGeomGetBody(b));
  }
}

}  // namespace

const char* peer_boxes_name() {
  return "ODE (dWorldStep)";
}

void* peer_boxes_open(const PeerBoxScene* scene) {
  dInitODE2(0);
  dAllocateODEDataForThread(dAllocateMaskAll);
  auto one = std::make_unique<World>();
  one->step_s = scene->step_s;
  one->friction = scene->friction;
  dWorldSetGravity(one->world, scene->gravity[0], scene->gravity[1], scene->gravity[2]);
  dCreatePlane(one->space, 0.0, 0.0, 1.0, 0.0);
  for (std::size_t i = 0; i < scene->count; ++i) {
    const PeerBox& box = scene->boxes[i];
    const double* h = box.half_sides;
    const dBodyID body = dBodyCreate(one->world);
    dMass mass;
    dMassSetBoxTotal(&mass, box.mass, 2.0 * h[0], 2.0 * h[1], 2.0 * h[2]);
    dBodySetMass(body, &mass);
    dBodySetPosition(body, box.position[0], box.position[1], box.position[2]);
    const dQuaternion q = {box.quaternion[3], box.quaternion[0], box.quaternion[1], box.quaternion[2]};
    dBodySetQuaternion(body, q);
    dBodySetLinearVel(body, box.velocity[0], box.velocity[1], box.velocity[2]);
    dGeomSetBody(dCreateBox(one->space, 2.0 * h[0], 2.0 * h[1], 2.0 * h[2]), body);
    one->bodies.push_back(body);
  }
  return one.release();
}

void peer_boxes_close(void* world) {
  delete static_cast<World*>(world);
}

void peer_boxes_step(void* world) {
  World& one = *static_cast<World*>(world);
  dSpaceCollide(one.space, &one, add_contacts);
  dWorldStep(one.world, one.step_s);
  dJointGroupEmpty(one.contacts);
}

void peer_boxes_state(void* world, size_t box, double pose[7], double velocity[6]) {
  const dBodyID body = static_cast<World*>(world)->bodies[box];
  const dReal *p = dBodyGetPosition(body), *q = dBodyGetQuaternion(body);
  const dReal *v = dBodyGetLinearVel(body), *w = dBodyGetAngularVel(body);
  for (int k = 0; k < 3; ++k) {
    pose[k] = p[k];
    pose[3 + k] = q[1 + k];
    velocity[k] = v[k];
    velocity[3 + k] = w[k];
  }
  pose[6] = q[0];
}
