// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cstring>
#include <memory>
#include <sstream>
#include <string>

#include <mujoco/mujoco.h>

#include "tests/bench/boxes_peer_interface.h"

namespace {

struct World {
  std::unique_ptr<mjModel, decltype(&mj_deleteModel)> model{nullptr, mj_deleteModel};
  std::unique_ptr<mjData, decltype(&mj_deleteData)> data{nullptr, mj_deleteData};
};

/// MuJoCo's default solver and contact softness, with the elliptic cone.
std::string model_text(const PeerBoxScene& scene) {
  std::ostringstream text;
  text.precision(17);
  text << "<mujoco><option timestep='" << scene.step_s << "' cone='elliptic' gravity='" << scene.gravity[0]
       << ' ' << scene.gravity[1] << ' ' << scene.gravity[2]
       << "'/><size nconmax='1000' njmax='4000'/><default><geom friction='" << scene.friction
       << " 0 0'/></default><worldbody><geom type='plane' size='0 0 1'/>";
  for (std::size_t i = 0; i < scene.count; ++i) {
    const PeerBox& box = scene.boxes[i];
    const double *p = box.position, *q = box.quaternion, *h = box.half_sides;
    text << "<body pos='" << p[0] << ' ' << p[1] << ' ' << p[2] << "' quat='" << q[3] << ' ' << q[0] << ' '
         << q[1] << ' ' << q[2] << "'><freejoint/><geom type='box' mass='" << box.mass << "' size='" << h[0]
         << ' ' << h[1] << ' ' << h[2] << "'/></body>";
  }
  text << "</worldbody></mujoco>";
  return text.str();
}

}  // namespace

const char* peer_boxes_name() {
  return "MuJoCo";
}

void* peer_boxes_open(const PeerBoxScene* scene) {
  constexpr const char* kFile = "boxes.xml";
  const std::string text = model_text(*scene);
  const auto files = std::make_unique<mjVFS>();
  mj_defaultVFS(files.get());
  if (mj_makeEmptyFileVFS(files.get(), kFile, static_cast<int>(text.size())) != 0) return nullptr;
  std::memcpy(files->filedata[mj_findFileVFS(files.get(), kFile)], text.data(), text.size());
  std::array<char, 1000> error{};
  auto world = std::make_unique<World>();
  world->model.reset(mj_loadXML(kFile, files.get(), error.data(), static_cast<int>(error.size())));
  mj_deleteVFS(files.get());
  if (world->model == nullptr) return nullptr;
  world->data.reset(mj_makeData(world->model.get()));
  for (std::size_t i = 0; i < scene->count; ++i)
    for (std::size_t k = 0; k < 3; ++k) world->data->qvel[6 * i + k] = scene->boxes[i].velocity[k];
  return world.release();
}

void peer_boxes_close(void* world) {
  delete static_cast<World*>(world);
}

void peer_boxes_step(void* world) {
  auto* const one = static_cast<World*>(world);
  mj_step(one->model.get(), one->data.get());
}

/// MuJoCo's angular velocity of a free body is in its own axes.
void peer_boxes_state(void* world, size_t box, double pose[7], double velocity[6]) {
  const mjData& data = *static_cast<World*>(world)->data;
  const mjtNum *q = data.qpos + 7 * box, *v = data.qvel + 6 * box;
  for (int k = 0; k < 3; ++k) {
    pose[k] = q[k];
    pose[3 + k] = q[4 + k];
    velocity[k] = v[k];
  }
  pose[6] = q[3];
  mju_rotVecQuat(velocity + 3, v + 3, q + 3);
}
