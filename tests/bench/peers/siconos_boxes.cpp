// SPDX-License-Identifier: GPL-3.0-or-later
#include <memory>
#include <vector>

// Before all other headers of Siconos: it adds the classes of mechanics to those that its visitors know.
#include <MechanicsFwd.hpp>
#include <RigidBodyDS.hpp>
#include <SiconosBulletCollisionManager.hpp>
#include <SiconosContactor.hpp>
#include <SiconosKernel.hpp>
#include <SiconosShape.hpp>

#include "tests/bench/boxes_peer_interface.h"

// The scheme of Moreau and Jean with Newton's impact law and Coulomb's friction. Bullet finds the contacts.

namespace {

/// Bullet works in centimetres, as in bullet_boxes.cpp.
constexpr double kUnitsPerMetre = 100.0;
/// Bullet rounds convex shapes by a margin inside, and reports contacts within the margin outside [m].
constexpr double kInsideMargin_m = 5e-4, kOutsideMargin_m = 5e-4;
/// Without a weight on the end of the step, resting contacts oscillate.
constexpr double kTheta = 0.50001;
/// Half sides of the box below the plane. A body that slides falls through a SiconosPlane.
constexpr double kGround_m = 2.0;
constexpr double kForever_s = 1e6;

std::shared_ptr<SiconosVector> vector_of(std::initializer_list<double> values) {
  auto v = std::make_shared<SiconosVector>(static_cast<unsigned>(values.size()));
  unsigned i = 0;
  for (const double value : values) v->setValue(i++, value);
  return v;
}

struct World {
  std::vector<std::shared_ptr<RigidBodyDS>> bodies;
  std::shared_ptr<TimeStepping> simulation;
};

void set_margins(SiconosShape& shape) {
  shape.setInsideMargin(kInsideMargin_m);
  shape.setOutsideMargin(kOutsideMargin_m);
}

std::shared_ptr<SiconosContactorSet> contactors_of(const std::shared_ptr<SiconosShape>& shape) {
  set_margins(*shape);
  auto set = std::make_shared<SiconosContactorSet>();
  set->push_back(std::make_shared<SiconosContactor>(shape));
  return set;
}

}  // namespace

const char* peer_boxes_name() {
  return "Siconos";
}

void* peer_boxes_open(const PeerBoxScene* scene) {
  auto one = std::make_unique<World>();
  auto system = std::make_shared<NonSmoothDynamicalSystem>(0.0, kForever_s);
  for (std::size_t i = 0; i < scene->count; ++i) {
    const PeerBox& box = scene->boxes[i];
    const double* const h = box.half_sides;
    const double third = box.mass / 3.0;
    auto inertia = std::make_shared<SimpleMatrix>(3, 3);
    inertia->setValue(0, 0, third * (h[1] * h[1] + h[2] * h[2]));
    inertia->setValue(1, 1, third * (h[0] * h[0] + h[2] * h[2]));
    inertia->setValue(2, 2, third * (h[0] * h[0] + h[1] * h[1]));
    const double *const p = box.position, *const q = box.quaternion, *const v = box.velocity;
    auto body =
        std::make_shared<RigidBodyDS>(vector_of({p[0], p[1], p[2], q[3], q[0], q[1], q[2]}),
                                      vector_of({v[0], v[1], v[2], 0.0, 0.0, 0.0}), box.mass, inertia);
    body->setUseContactorInertia(false);
    body->setContactors(contactors_of(std::make_shared<SiconosBox>(2.0 * h[0], 2.0 * h[1], 2.0 * h[2])));
    const double* const g = scene->gravity;
    body->setFExtPtr(vector_of({box.mass * g[0], box.mass * g[1], box.mass * g[2]}));
    system->insertDynamicalSystem(body);
    one->bodies.push_back(body);
  }
  SiconosBulletOptions options;
  options.worldScale = kUnitsPerMetre;
  auto contacts = std::make_shared<SiconosBulletCollisionManager>(options);
  contacts->insertNonSmoothLaw(std::make_shared<NewtonImpactFrictionNSL>(0.0, 0.0, scene->friction, 3), 0, 0);
  contacts->insertStaticContactorSet(
      contactors_of(std::make_shared<SiconosBox>(2.0 * kGround_m, 2.0 * kGround_m, 2.0 * kGround_m)),
      vector_of({0.0, 0.0, -kGround_m, 1.0, 0.0, 0.0, 0.0}));
  auto problem = std::make_shared<FrictionContact>(3, SICONOS_FRICTION_3D_NSGS);
  problem->setNumericsVerboseMode(false);
  problem->setKeepLambdaAndYState(true);
  one->simulation =
      std::make_shared<TimeStepping>(system, std::make_shared<TimeDiscretisation>(0.0, scene->step_s),
                                     std::make_shared<MoreauJeanOSI>(kTheta), problem);
  one->simulation->insertInteractionManager(contacts);
  one->simulation->setNewtonOptions(SICONOS_TS_LINEAR);
  // The default prints a line into the table for every step in which the solver ends at its limit.
  one->simulation->setCheckSolverFunction([](int, Simulation*) {});
  one->simulation->initialize();
  return one.release();
}

void peer_boxes_close(void* world) {
  delete static_cast<World*>(world);
}

void peer_boxes_step(void* world) {
  TimeStepping& simulation = *static_cast<World*>(world)->simulation;
  simulation.computeOneStep();
  simulation.nextStep();
}

/// Siconos has the angular velocity in body axes.
void peer_boxes_state(void* world, size_t box, double pose[7], double velocity[6]) {
  const RigidBodyDS& body = *static_cast<World*>(world)->bodies[box];
  const SiconosVector &x = *body.q(), &v = *body.twist();
  for (unsigned k = 0; k < 3; ++k) {
    pose[k] = x(k);
    velocity[k] = v(k);
  }
  const double w = x(3), a[3] = {x(4), x(5), x(6)}, s[3] = {v(3), v(4), v(5)};
  for (int k = 0; k < 3; ++k) pose[3 + k] = a[k];
  pose[6] = w;
  // s + 2 w (a x s) + 2 a x (a x s)
  const double c[3] = {a[1] * s[2] - a[2] * s[1], a[2] * s[0] - a[0] * s[2], a[0] * s[1] - a[1] * s[0]};
  const double d[3] = {a[1] * c[2] - a[2] * c[1], a[2] * c[0] - a[0] * c[2], a[0] * c[1] - a[1] * c[0]};
  for (int k = 0; k < 3; ++k) velocity[3 + k] = s[k] + 2.0 * (w * c[k] + d[k]);
}
