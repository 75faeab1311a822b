// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>

#include "core/pose.hpp"

namespace wrenchd {

/// The largest distance found so far between a mesh and the surface that it approximates.
struct ChordError {
  double mm = 0.0;
  int face = 0;  ///< number of the face with the largest distance, in the order of the solid, from 1
  Vector3d place_mm = Vector3d::Zero();
};

/// Triangles of one face, with the parameters of their corners on its surface.
struct FaceTriangles {
  TopoDS_Face face;
  int number = 0;  ///< number of the face in the solid, from 1
  std::vector<Vector3d> corners_mm;
  std::vector<std::array<double, 2>> parameters;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// Segments that replace an edge, with the parameters of their ends on its curve.
struct EdgeSegments {
  TopoDS_Edge edge;
  int face = 0;  ///< number of a face with this edge
  std::vector<Vector3d> points_mm;
  std::vector<double> parameters;
};

/// Raises `worst` to the largest distance of points of the triangles from the surface of the face
/// (README.md). Not RT-safe: takes about 10 us per triangle of a curved face.
void measure_face(const FaceTriangles& face, ChordError& worst);

/// Raises `worst` to the largest distance of points of the curve from their segments. Not RT-safe.
void measure_edge(const EdgeSegments& edge, ChordError& worst);

/// The samples miss the largest distance of a triangle by less than this factor (README.md).
inline constexpr double kSamplingFactor = 1.01;

}  // namespace wrenchd
