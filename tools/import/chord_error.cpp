// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/chord_error.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include <BRepAdaptor_Curve.hxx>
#include <BRepAdaptor_Surface.hxx>
#include <gp_Cone.hxx>
#include <gp_Cylinder.hxx>
#include <gp_Pln.hxx>
#include <gp_Sphere.hxx>
#include <gp_Torus.hxx>

namespace wrenchd {
namespace {

/// Samples of a triangle lie on a grid with this number of intervals along each side. If they come near the
/// largest distance so far, the fine grid decides.
constexpr int kCoarse = 4, kFine = 12;
constexpr double kNearLargest = 0.8;
constexpr int kEdgeIntervals = 8;

Vector3d vector(const gp_XYZ& p) {
  return {p.X(), p.Y(), p.Z()};
}

/// A surface and the range of its parameters.
class Surface {
 public:
  explicit Surface(const TopoDS_Face& face) : surface_(face, false) {
    for (std::size_t k = 0; k < 2; ++k) {
      low_[k] = k == 0 ? surface_.FirstUParameter() : surface_.FirstVParameter();
      high_[k] = k == 0 ? surface_.LastUParameter() : surface_.LastVParameter();
      periodic_[k] = k == 0 ? surface_.IsUPeriodic() : surface_.IsVPeriodic();
    }
  }

  bool plane() const { return surface_.GetType() == GeomAbs_Plane; }

  /// Returns the distance of p from an elementary surface; nothing for other surfaces.
  std::optional<double> elementary_distance(const Vector3d& p) const {
    switch (surface_.GetType()) {
      case GeomAbs_Plane:
        return surface_.Plane().Distance(gp_Pnt(p.x(), p.y(), p.z()));
      case GeomAbs_Cylinder: {
        const gp_Cylinder cylinder = surface_.Cylinder();
        return std::abs(from_axis(cylinder.Position(), p)[0] - cylinder.Radius());
      }
      case GeomAbs_Sphere: {
        const gp_Sphere sphere = surface_.Sphere();
        return std::abs((p - vector(sphere.Location().XYZ())).norm() - sphere.Radius());
      }
      case GeomAbs_Cone: {
        const gp_Cone cone = surface_.Cone();
        const auto [radius, height] = from_axis(cone.Position(), p);
        const double c = std::cos(cone.SemiAngle()), s = std::sin(cone.SemiAngle());
        const double above = height * s + cone.RefRadius() * c;
        return std::min(std::abs(radius * c - above), std::abs(radius * c + above));  // both halves
      }
      case GeomAbs_Torus: {
        const gp_Torus torus = surface_.Torus();
        const auto [radius, height] = from_axis(torus.Position(), p);
        return std::abs(std::hypot(radius - torus.MajorRadius(), height) - torus.MinorRadius());
      }
      default:
        return {};
    }
  }

  /// Returns the distance of p from the surface, searched from the parameters w on: Gauss-Newton steps on
  /// |p - S(u,v)|^2, damped until they improve. A distance of at most `enough` is returned at once. The
  /// result is never smaller than the distance from the nearest point of the surface.
  double distance(const Vector3d& p, std::array<double, 2> w, double enough) const {
    gp_Pnt s;
    gp_Vec du, dv;
    surface_.D1(w[0], w[1], s, du, dv);
    Vector3d r = p - vector(s.XYZ());
    double best = r.norm();
    constexpr int kSteps = 25;
    double damping = 1e-12;
    for (int i = 0; i < kSteps && best > enough; ++i) {
      const Vector3d a = vector(du.XYZ()), b = vector(dv.XYZ());
      const double aa = a.squaredNorm() * (1.0 + damping) + 1e-300;
      const double bb = b.squaredNorm() * (1.0 + damping) + 1e-300;
      const double ab = a.dot(b), det = aa * bb - ab * ab;
      const double ra = r.dot(a), rb = r.dot(b);
      std::array<double, 2> next = w;
      if (det > 1e-14 * aa * bb) {
        next = {w[0] + (bb * ra - ab * rb) / det, w[1] + (aa * rb - ab * ra) / det};
      } else {  // a singular point: along the longer derivative only
        const std::size_t k = aa > bb ? 0 : 1;
        next[k] += k == 0 ? ra / aa : rb / bb;
      }
      for (std::size_t k = 0; k < 2; ++k)
        if (!periodic_[k]) next[k] = std::clamp(next[k], low_[k], high_[k]);
      gp_Pnt s_next;
      gp_Vec du_next, dv_next;
      surface_.D1(next[0], next[1], s_next, du_next, dv_next);
      const Vector3d r_next = p - vector(s_next.XYZ());
      const double found = r_next.norm();
      if (!(found < best)) {
        if (damping > 1e6) break;
        damping = std::max(1e-3, 10.0 * damping);
        continue;
      }
      const bool converged = best - found < 1e-4 * best;
      damping = std::max(1e-12, 0.1 * damping);
      w = next;
      r = r_next;
      du = du_next;
      dv = dv_next;
      best = found;
      if (converged) break;
    }
    return best;
  }

 private:
  /// Returns the distance of p from the axis, and its height along the axis.
  static std::array<double, 2> from_axis(const gp_Ax3& axes, const Vector3d& p) {
    const Vector3d d = p - vector(axes.Location().XYZ()), z = vector(axes.Direction().XYZ());
    return {(d - d.dot(z) * z).norm(), d.dot(z)};
  }

  BRepAdaptor_Surface surface_;
  std::array<double, 2> low_{}, high_{};
  std::array<bool, 2> periodic_{};
};

void raise(double distance, int face, const Vector3d& place, ChordError& worst) {
  if (distance > worst.mm) worst = {distance, face, place};
}

/// Returns the distance of the point p of a triangle from the surface. A distance of at most `enough` needs
/// no exact value. At a pole all values of a parameter give one point, so that the interpolated parameters w
/// can be far from the nearest point; then the search also starts between the other corners.
double distance(const Surface& surface, const FaceTriangles& face, const std::array<std::uint32_t, 3>& t,
                const Vector3d& p, const std::array<double, 2>& w, double enough) {
  if (const auto exact = surface.elementary_distance(p)) return *exact;
  double best = surface.distance(p, w, enough);
  for (std::size_t k = 0; k < 6 && best > enough; ++k) {
    const auto& a = face.parameters[t[k % 3]];
    const auto& b = face.parameters[t[k < 3 ? k : (k + 1) % 3]];
    best = std::min(best, surface.distance(p, {0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])}, enough));
  }
  return best;
}

/// Samples one triangle. Returns its largest distance.
double sample(const Surface& surface, const FaceTriangles& face, const std::array<std::uint32_t, 3>& t, int n,
              ChordError& worst) {
  double largest = 0.0;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n - i; ++j) {
      const std::array<double, 3> c = {double(i) / n, double(j) / n, double(n - i - j) / n};
      Vector3d p = Vector3d::Zero();
      std::array<double, 2> w = {0.0, 0.0};
      for (std::size_t k = 0; k < 3; ++k) {
        p += c[k] * face.corners_mm[t[k]];
        for (std::size_t d = 0; d < 2; ++d) w[d] += c[k] * face.parameters[t[k]][d];
      }
      const double found = distance(surface, face, t, p, w, 0.5 * kNearLargest * worst.mm);
      largest = std::max(largest, found);
      raise(found, face.number, p, worst);
    }
  return largest;
}

double distance_to_segment(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const Vector3d d = b - a;
  const double length2 = d.squaredNorm();
  const double t = length2 > 0.0 ? std::clamp((p - a).dot(d) / length2, 0.0, 1.0) : 0.0;
  return (p - a - t * d).norm();
}

}  // namespace

void measure_face(const FaceTriangles& face, ChordError& worst) {
  const Surface surface(face.face);
  if (surface.plane()) {  // the largest distance of a triangle from a plane is that of a corner
    for (const auto& t : face.triangles)
      for (const std::uint32_t v : t)
        raise(*surface.elementary_distance(face.corners_mm[v]), face.number, face.corners_mm[v], worst);
    return;
  }
  for (const auto& t : face.triangles)
    if (sample(surface, face, t, kCoarse, worst) >= kNearLargest * worst.mm)
      sample(surface, face, t, kFine, worst);
}

void measure_edge(const EdgeSegments& edge, ChordError& worst) {
  const BRepAdaptor_Curve curve(edge.edge);
  for (std::size_t i = 0; i + 1 < edge.points_mm.size(); ++i)
    for (int k = 0; k <= kEdgeIntervals; ++k) {
      const double s = double(k) / kEdgeIntervals;
      const double t = (1.0 - s) * edge.parameters[i] + s * edge.parameters[i + 1];
      const Vector3d p = vector(curve.Value(t).XYZ());
      raise(distance_to_segment(p, edge.points_mm[i], edge.points_mm[i + 1]), edge.face, p, worst);
    }
}

}  // namespace wrenchd
