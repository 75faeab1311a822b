// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "collision/meshes/flat_regions.hpp"
#include "collision/meshes/half_edge_mesh.hpp"
#include "core/least_distance.hpp"
#include "core/pose.hpp"
#include "core/static_vector.hpp"

namespace wrenchd {

/// What is known of a face of a mesh that is being simplified.
struct FaceState {
  FlatRegions::Plane plane;
  /// bounds for the signed distance of the face from the original surface, positive outside [m]
  double high_m = 0.0, low_m = 0.0;
  double thinness = 0.0;  ///< altitude / longest side
};

/// Finds where the vertex may lie that replaces the ends u and w of an edge, so that the new faces enclose
/// the old ones and stay near them: core/METHOD.md, section 14.8. One object serves one thread. Not RT-safe:
/// takes microseconds.
class EdgeCollapse {
 public:
  /// Maximum number of faces around an edge. An edge with more faces is not collapsed.
  static constexpr std::size_t kMaxStar = 64;
  /// Because of rounding, a new vertex may lie below a plane that it should enclose by this fraction of the
  /// mesh's size in one collapse.
  static constexpr double kRounding = 2e-13;

  struct Limits {
    double size_m;       ///< largest distance of a vertex from the origin
    double tolerance_m;  ///< no face may be farther than this from the original surface
    double max_rise_m;   ///< no collapse may raise the surface by more than this
    double wanted_m;     ///< find() returns only a collapse that leaves its faces no farther than this
  };
  /// A position of the new vertex and bounds for the new faces, see FaceState.
  struct Candidate {
    Vector3d p_m;
    double high_m, low_m;
  };

  /// mesh, faces: must outlive this object.
  EdgeCollapse(const HalfEdgeMesh& mesh, const std::vector<FaceState>& faces) : mesh_(mesh), faces_(faces) {}

  /// Returns the best of three positions: u, w, and the enclosing point nearest to the middle of the edge. If
  /// max_rise_m is below the tolerance, only u and w are tried. Returns nothing if none is within `wanted_m`.
  std::optional<Candidate> find(std::uint32_t half_edge, const Limits& limits);

  /// Returns the least `wanted_m` with which find() would have returned a position for its last edge,
  /// infinity if there is none [m].
  double needed_m() const { return needed_m_; }

  /// Returns true if the new vertex replaces u more closely than w. Precondition: find() returned
  /// `candidate`.
  bool is_nearer_to_u(const Candidate& candidate) const {
    return (candidate.p_m - star_.u_m).squaredNorm() <= (candidate.p_m - star_.w_m).squaredNorm();
  }

  /// Calls use(face) for each face around the edge of the last find() that remains.
  template <class Use>
  void for_each_remaining_face(const Use& use) const {
    for (std::size_t i = 0; i < star_.ring_m.size(); ++i) use(star_.faces[i].number);
  }

 private:
  enum class NewVertex { at_u, at_w, elsewhere };

  /// The faces around an edge from u to w before its collapse. The collapse replaces them by the faces
  /// between a new vertex and the ring, the border of the star. Coordinates with the suffix _N_m are in a
  /// frame whose z axis is the mean normal.
  struct Star {
    struct Face {
      std::uint32_t number;
      Vector3d normal;
      double offset_m;
    };
    /// Face i has the corners u or w, ring[i] and ring[i + 1]; the last two faces, at the edge, disappear.
    StaticVector<Face, kMaxStar> faces;
    StaticVector<double, kMaxStar> cosines;  ///< for each face: cosine between its normal and the mean normal
    /// Anticlockwise as seen from outside. Corner 0 and corner w_begin are neighbours of both u and w; those
    /// between them are neighbours of u, those after w_begin are neighbours of w.
    StaticVector<Vector3d, kMaxStar> ring_m, ring_N_m;
    std::size_t w_begin = 0;
    Vector3d u_m, w_m, u_N_m, w_N_m;
    Eigen::Matrix3d R_NW;
    double high_m = 0.0, low_m = 0.0;  ///< bounds of all its faces, see FaceState
    double thinnest = 1.0;

    Vector3d middle_m() const { return 0.5 * (u_m + w_m); }
    Vector3d in_N(const Vector3d& x_m) const { return R_NW * (x_m - middle_m()); }
    const Vector3d& next_on_ring_N_m(std::size_t i) const {
      return ring_N_m[i + 1 < ring_N_m.size() ? i + 1 : 0];
    }

    /// Sets the frame N. Returns false if a face faces away from n.
    bool set_mean_normal(const Vector3d& n);
  };

  bool keeps_manifold(std::uint32_t half_edge);
  bool gather(std::uint32_t half_edge);
  std::optional<Vector3d> nearest_enclosing_point(const Limits& limits);
  std::optional<Candidate> evaluate(const Vector3d& p_m, NewVertex at, const Limits& limits) const;
  double largest_ring_height_m() const;
  bool new_faces_are_valid(const Vector3d& p_N_m) const;
  std::optional<double> largest_rise_m(const Vector3d& p_N_m, NewVertex at, double most_m) const;
  std::optional<double> height_above_old_faces_m(const Vector3d& p_N_m) const;
  std::optional<double> height_of_new_faces_m(const Vector3d& p_N_m, const Vector3d& x_N_m, std::size_t first,
                                              std::size_t last) const;

  const HalfEdgeMesh& mesh_;
  const std::vector<FaceState>& faces_;
  double needed_m_ = 0.0;
  StaticVector<std::uint32_t, kMaxStar> neighbours_;
  Star star_;
  LeastDistance<3, kMaxStar> problem_;
};

}  // namespace wrenchd
