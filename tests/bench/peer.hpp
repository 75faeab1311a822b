// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/pose.hpp"
#include "core/triangle_mesh.hpp"
#include "tests/bench/peer_interface.h"

namespace wrenchd::bench {

/// The shared module of a peer library. Its symbols are local to the module.
class PeerModule {
 public:
  /// Throws std::runtime_error with the reason if the module cannot be loaded.
  explicit PeerModule(const std::filesystem::path& file);

  const std::vector<std::string>& queries() const { return queries_; }

  /// Two bodies in the peer's own representation. Must not outlive the module.
  class Pair {
   public:
    /// Returns the depth of query q at a pose [m]; NaN if the peer detects no overlap.
    double depth_m(int q, const PeerPose& X_BA) const;
    /// Returns the number of contacts that query q lists.
    int contacts(int q, const PeerPose& X_BA) const;

   private:
    friend class PeerModule;
    Pair(const PeerModule& module, const TriangleMesh& A, const TriangleMesh& B);

    const PeerModule& module_;
    std::shared_ptr<void> peer_;
  };
  Pair open(const TriangleMesh& A, const TriangleMesh& B) const { return {*this, A, B}; }

 private:
  template <class Function>
  void find(Function*& function, const char* name);

  std::filesystem::path file_;
  std::shared_ptr<void> library_;
  decltype(&peer_query_name) query_name_ = nullptr;
  decltype(&peer_open) open_ = nullptr;
  decltype(&peer_close) close_ = nullptr;
  decltype(&peer_ask) ask_ = nullptr;
  std::vector<std::string> queries_;
};

PeerPose peer_pose(const Pose& X_BA);

/// Loads the peers with these names from the directory of the running program. missing: receives the names of
/// the peers that were not built.
std::vector<PeerModule> load_peers(const std::vector<std::string>& names, std::vector<std::string>& missing);
/// Names of the peers for convex bodies, and of those for arbitrary meshes.
const std::vector<std::string>& convex_peers();
const std::vector<std::string>& mesh_peers();
/// Mesh libraries that no package provides. Somebody who has built one can name its module (bench_contact
/// --peer); the tables tell the others as not run.
const std::vector<std::string>& unpackaged_mesh_peers();

}  // namespace wrenchd::bench
