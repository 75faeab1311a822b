// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/peer.hpp"

#include <limits>
#include <stdexcept>

#include <dlfcn.h>

namespace wrenchd::bench {

PeerModule::PeerModule(const std::filesystem::path& file) : file_(file) {
  // The library stays loaded; some peers crash when they are unloaded.
  library_ = std::shared_ptr<void>(dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL), [](void*) {});
  if (library_ == nullptr) throw std::runtime_error(dlerror());
  find(query_name_, "peer_query_name");
  find(open_, "peer_open");
  find(close_, "peer_close");
  find(ask_, "peer_ask");
  for (int q = 0; query_name_(q) != nullptr; ++q) queries_.emplace_back(query_name_(q));
}

template <class Function>
void PeerModule::find(Function*& function, const char* name) {
  function = reinterpret_cast<Function*>(dlsym(library_.get(), name));
  if (function == nullptr) throw std::runtime_error(file_.string() + " exports no " + name);
}

PeerModule::Pair::Pair(const PeerModule& module, const TriangleMesh& A, const TriangleMesh& B)
    : module_(module) {
  static_assert(sizeof(Vector3d) == 3 * sizeof(double));  // an array of vectors is then an array of numbers
  const auto as_peer = [](const TriangleMesh& mesh) {
    return PeerMesh{mesh.vertices_m.front().data(), mesh.vertices_m.size(), mesh.triangles.front().data(),
                    mesh.triangles.size()};
  };
  const PeerMesh a = as_peer(A);
  const PeerMesh b = as_peer(B);
  peer_ = std::shared_ptr<void>(module.open_(&a, &b), module.close_);
  if (peer_ == nullptr) throw std::runtime_error(module.file_.string() + " rejects the bodies");
}

double PeerModule::Pair::depth_m(int q, const PeerPose& X_BA) const {
  double depth = 0.0;
  const bool overlap = module_.ask_(peer_.get(), q, &X_BA, &depth) != 0;
  return overlap ? depth : std::numeric_limits<double>::quiet_NaN();
}

PeerPose peer_pose(const Pose& X_BA) {
  PeerPose pose;
  using Rows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  Eigen::Map<Rows>(pose.rotation) = X_BA.rotation.toRotationMatrix();
  Eigen::Map<Vector3d>(pose.translation) = X_BA.translation_m;
  return pose;
}

int PeerModule::Pair::contacts(int q, const PeerPose& X_BA) const {
  double ignored = 0.0;
  return module_.ask_(peer_.get(), q, &X_BA, &ignored);
}

const std::vector<std::string>& convex_peers() {
  static const std::vector<std::string> names = {"fcl", "ccd", "ode", "bullet"};
  return names;
}

const std::vector<std::string>& mesh_peers() {
  static const std::vector<std::string> names = {"fcl_mesh", "ode_mesh", "bullet_mesh", "cgal_mesh"};
  return names;
}

const std::vector<std::string>& unpackaged_mesh_peers() {
  static const std::vector<std::string> names = {"PQP", "PhysX BV4"};
  return names;
}

std::vector<PeerModule> load_peers(const std::vector<std::string>& names, std::vector<std::string>& missing) {
  const auto directory = std::filesystem::read_symlink("/proc/self/exe").parent_path();
  std::vector<PeerModule> peers;
  for (const std::string& name : names) {
    const auto file = directory / ("bench_peer_" + name + ".so");
    if (std::filesystem::exists(file))
      peers.emplace_back(file);
    else
      missing.push_back(name);
  }
  return peers;
}

}  // namespace wrenchd::bench
