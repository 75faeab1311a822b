// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdarg>
#include <cstdint>
#include <vector>

#include <ode/ode.h>

#include "tests/bench/peer_interface.h"

namespace {

constexpr int kMostContacts = 8192;

/// ODE keeps pointers to these arrays, so they must live as long as the geometry.
struct Surface {
  std::vector<double> vertices;
  std::vector<dTriIndex> triangles;
  dTriMeshDataID data;
  dGeomID geometry;

  explicit Surface(const PeerMesh& mesh)
      : vertices(mesh.vertices, mesh.vertices + 3 * mesh.vertex_count),
        triangles(mesh.triangles, mesh.triangles + 3 * mesh.triangle_count),
        data(dGeomTriMeshDataCreate()) {
    dGeomTriMeshDataBuildDouble(data, vertices.data(), 3 * sizeof(double),
                                static_cast<int>(mesh.vertex_count), triangles.data(),
                                static_cast<int>(triangles.size()), 3 * sizeof(dTriIndex));
    geometry = dCreateTriMesh(nullptr, data, nullptr, nullptr, nullptr);
  }
  Surface(const Surface&) = delete;
  Surface& operator=(const Surface&) = delete;
  ~Surface() {
    dGeomDestroy(geometry);
    dGeomTriMeshDataDestroy(data);
  }
};

struct Pair {
  Pair(const PeerMesh& a, const PeerMesh& b) : A(a), B(b), contacts(kMostContacts) {}
  Surface A, B;
  std::vector<dContactGeom> contacts;
};

/// Suppresses ODE's message about a full contact table.
void be_quiet(int, const char*, va_list) {}

}  // namespace

const char* peer_query_name(int query) {
  return query == 0 ? "ODE all contacts" : nullptr;
}

void* peer_open(const PeerMesh* A, const PeerMesh* B) {
  dInitODE2(0);
  dSetMessageHandler(be_quiet);
  return new Pair(*A, *B);
}

void peer_close(void* peer) {
  delete static_cast<Pair*>(peer);
  dCloseODE();
}

int peer_ask(void* peer, int, const PeerPose* X_BA, double*) {
  auto& pair = *static_cast<Pair*>(peer);
  const double* R = X_BA->rotation;
  const dMatrix3 rotation = {R[0], R[1], R[2], 0, R[3], R[4], R[5], 0, R[6], R[7], R[8], 0};
  dGeomSetRotation(pair.A.geometry, rotation);
  dGeomSetPosition(pair.A.geometry, X_BA->translation[0], X_BA->translation[1], X_BA->translation[2]);
  return dCollide(pair.A.geometry, pair.B.geometry, kMostContacts, pair.contacts.data(),
                  sizeof(dContactGeom));
}
