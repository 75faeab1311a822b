/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * What the module of a peer exports that moves rigid boxes above the plane z = 0. Plain C, as in
 * peer_interface.h. Lengths in metres, masses in kilograms, angles in radians. */
#pragma once

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

struct PeerBox {
  double half_sides[3];
  double mass;
  double position[3];
  double quaternion[4]; /* x, y, z, w */
  double velocity[3];
};

struct PeerBoxScene {
  const struct PeerBox* boxes;
  size_t count;
  double friction; /* of all contacts */
  double gravity[3];
  double step_s;
};

const char* peer_boxes_name(void);
void* peer_boxes_open(const struct PeerBoxScene* scene);
void peer_boxes_close(void* world);
void peer_boxes_step(void* world);
/* pose: position, then x, y, z, w. velocity: of the centre, then the angular velocity in world axes. */
void peer_boxes_state(void* world, size_t box, double pose[7], double velocity[6]);

#ifdef __cplusplus
}
#endif
