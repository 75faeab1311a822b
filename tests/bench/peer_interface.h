/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * What a peer's shared module exports. Plain C, so that nothing of the peer's own types, allocators or
 * versions crosses over. Lengths in metres. */
#pragma once

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A solid, its triangles outward-oriented; convex, for the modules that answer for convex bodies. */
struct PeerMesh {
  const double* vertices; /* x, y, z of each */
  size_t vertex_count;
  const uint32_t* triangles; /* three vertices of each */
  size_t triangle_count;
};

/* Pose of A in the frame of B. */
struct PeerPose {
  double rotation[9]; /* by rows */
  double translation[3];
};

/* The queries this module knows: what each is called, and null after the last. */
const char* peer_query_name(int query);

/* Null if the peer rejects the meshes. */
void* peer_open(const struct PeerMesh* A, const struct PeerMesh* B);
void peer_close(void* peer);

/* How many contacts they have, 0 where they do not overlap; and how deep, for convex bodies. */
int peer_ask(void* peer, int query, const struct PeerPose* X_BA, double* depth);

#ifdef __cplusplus
}
#endif
