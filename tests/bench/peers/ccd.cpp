// SPDX-License-Identifier: GPL-3.0-or-later
#include <vector>

#include <ccd/ccd.h>

#include "tests/bench/peer_interface.h"

namespace {

/// The support function that libccd requires: the vertex farthest along a direction. This one tests every
/// vertex.
struct Body {
  std::vector<double> vertices;
  PeerPose X;
};

void farthest(const void* object, const ccd_vec3_t* direction, ccd_vec3_t* out) {
  const Body& body = *static_cast<const Body*>(object);
  const double* R = body.X.rotation;
  const double* d = direction->v;
  const double local[3] = {R[0] * d[0] + R[3] * d[1] + R[6] * d[2], R[1] * d[0] + R[4] * d[1] + R[7] * d[2],
                           R[2] * d[0] + R[5] * d[1] + R[8] * d[2]};
  const auto height = [&](const double* p) { return local[0] * p[0] + local[1] * p[1] + local[2] * p[2]; };
  const double* best = body.vertices.data();
  double most = height(best);
  for (const double* p = best + 3; p != body.vertices.data() + body.vertices.size(); p += 3)
    if (const double h = height(p); h > most) {
      best = p;
      most = h;
    }
  for (int i = 0; i < 3; ++i)
    out->v[i] = R[3 * i] * best[0] + R[3 * i + 1] * best[1] + R[3 * i + 2] * best[2] + body.X.translation[i];
}

void centre(const void* object, ccd_vec3_t* out) {
  for (int i = 0; i < 3; ++i) out->v[i] = static_cast<const Body*>(object)->X.translation[i];
}

struct Pair {
  Body A, B;
  ccd_t settings;
};

Body body_of(const PeerMesh& mesh) {
  const PeerPose identity{{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}};
  return {{mesh.vertices, mesh.vertices + 3 * mesh.vertex_count}, identity};
}

}  // namespace

const char* peer_query_name(int query) {
  constexpr const char* kNames[] = {"libccd MPR", "libccd GJK and EPA", nullptr};
  return kNames[query];
}

void* peer_open(const PeerMesh* A, const PeerMesh* B) {
  auto* pair = new Pair{body_of(*A), body_of(*B), {}};
  CCD_INIT(&pair->settings);
  pair->settings.support1 = farthest;
  pair->settings.support2 = farthest;
  pair->settings.center1 = centre;
  pair->settings.center2 = centre;
  pair->settings.max_iterations = 500;
  // Metres; the default of 1e-4 is a fifth of the depths in this benchmark.
  pair->settings.epa_tolerance = 1e-9;
  pair->settings.mpr_tolerance = 1e-9;
  return pair;
}

void peer_close(void* peer) {
  delete static_cast<Pair*>(peer);
}

int peer_ask(void* peer, int query, const PeerPose* X_BA, double* depth) {
  auto& pair = *static_cast<Pair*>(peer);
  pair.A.X = *X_BA;
  ccd_vec3_t direction;
  ccd_vec3_t position;
  const auto ask = query == 0 ? ccdMPRPenetration : ccdGJKPenetration;
  return ask(&pair.A, &pair.B, &pair.settings, depth, &direction, &position) == 0 ? 1 : 0;
}
