// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/cgal/exact_decisions.hpp"

#include <cmath>
#include <utility>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Exact_rational.h>
#include <CGAL/Interval_nt.h>

namespace wrenchd::exact {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;

/// A vector of a number type of CGAL.
template <class Number>
struct Vector {
  Number x, y, z;

  explicit Vector(const Vector3d& v) : x(v.x()), y(v.y()), z(v.z()) {}
  Vector(Number x_, Number y_, Number z_) : x(std::move(x_)), y(std::move(y_)), z(std::move(z_)) {}

  Vector operator-(const Vector& v) const { return {x - v.x, y - v.y, z - v.z}; }
  Number dot(const Vector& v) const { return x * v.x + y * v.y + z * v.z; }
  Vector cross(const Vector& v) const { return {y * v.z - z * v.y, z * v.x - x * v.z, x * v.y - y * v.x}; }
};

/// Evaluates a decision in interval arithmetic, then in rational arithmetic if that is not certain.
/// Decision: a class with the template <class Number> Answer of() const.
template <class Decision>
auto decide(const Decision& decision) {
  try {
    const CGAL::Protect_FPU_rounding<true> upward;
    return decision.template of<CGAL::Interval_nt_advanced>();
  } catch (const CGAL::Uncertain_conversion_exception&) {
    // The guard has restored the rounding mode.
  }
  return decision.template of<CGAL::Exact_rational>();
}

template <class Number>
int certain_sign(const Number& x) {
  return static_cast<int>(static_cast<CGAL::Sign>(CGAL::sign(x)));  // throws if an interval is not certain
}

struct Height {
  const MeshSurface::Plane& plane;
  double height_m;
  const Vector3d& p_m;

  template <class Number>
  int of() const {
    const Vector<Number> n(plane.normal), p(p_m);
    return certain_sign<Number>(n.dot(p) - Number(plane.offset_m) - Number(height_m));
  }
};

struct Inside {
  const Vector3d& p_m;
  const Triangle& triangle;
  const Vector3d& normal;
  double tolerance_m;

  template <class Number>
  bool of() const {
    const Vector<Number> p(p_m), n(normal);
    const Number tolerance2 = Number(tolerance_m) * Number(tolerance_m);
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector<Number> from(triangle[i]), along = Vector<Number>(triangle[i == 2 ? 0 : i + 1]) - from;
      const Number outside = along.cross(n).dot(p - from);
      if (certain_sign<Number>(outside) > 0 &&
          certain_sign<Number>(outside * outside - tolerance2 * along.dot(along)) > 0)
        return false;
    }
    return true;
  }
};

struct Rise {
  const Vector3d& normal;
  const Vector3d& direction;
  double drop_m;

  template <class Number>
  bool of() const {
    return certain_sign<Number>(Vector<Number>(normal).dot(Vector<Number>(direction)) + Number(drop_m)) >= 0;
  }
};

struct Gap {
  const EdgePair& pair;
  double height_m;

  /// Compares f / |N| with h by the signs of f and h and by the squares.
  template <class Number>
  int of() const {
    const Vector<Number> N = Vector<Number>(pair.da).cross(Vector<Number>(pair.db));
    const Number f = Number(pair.sign) * N.dot(Vector<Number>(pair.a0) - Vector<Number>(pair.b0));
    const int sign_f = certain_sign<Number>(f), sign_h = height_m > 0.0 ? 1 : height_m < 0.0 ? -1 : 0;
    if (sign_f != sign_h) return sign_f > sign_h ? 1 : -1;
    return sign_f * certain_sign<Number>(f * f - Number(height_m) * Number(height_m) * N.dot(N));
  }
};

struct Opposite {
  const EdgePair& pair;
  double tolerance_m;

  template <class Number>
  bool of() const {
    const Vector<Number> da(pair.da), db(pair.db);
    const Vector<Number> N = da.cross(db), w = Vector<Number>(pair.b0) - Vector<Number>(pair.a0);
    const Number NN = N.dot(N);
    if (certain_sign<Number>(NN) <= 0) return false;
    // The perpendicular meets the lines at a0 + x / NN da and b0 + y / NN db.
    const Number x = w.cross(db).dot(N), y = w.cross(da).dot(N);
    const Number room = Number(tolerance_m) * Number(tolerance_m) * NN * NN;
    const auto beyond = [&](const Number& distance, const Vector<Number>& along) {
      return certain_sign<Number>(distance) > 0 &&
             certain_sign<Number>(distance * distance * along.dot(along) - room) > 0;
    };
    return !beyond(-x, da) && !beyond(x - NN, da) && !beyond(-y, db) && !beyond(y - NN, db);
  }
};

Kernel::Triangle_3 to_triangle(const Triangle& t) {
  const auto point = [](const Vector3d& p) { return Kernel::Point_3(p.x(), p.y(), p.z()); };
  return {point(t[0]), point(t[1]), point(t[2])};
}

}  // namespace

/// Most points are far from the plane: then the rounding error of double precision decides nothing.
int side_of_plane(const MeshSurface::Plane& plane, double height_m, const Vector3d& p_m) {
  constexpr double kRounding = 1e-14;  // far above the rounding error of seven operations
  const double terms[] = {plane.normal.x() * p_m.x(), plane.normal.y() * p_m.y(), plane.normal.z() * p_m.z(),
                          -plane.offset_m, -height_m};
  double sum = 0.0, size = 0.0;
  for (const double term : terms) sum += term, size += std::abs(term);
  if (std::abs(sum) > kRounding * size) return sum > 0.0 ? 1 : -1;
  return decide(Height{plane, height_m, p_m});
}

bool triangles_intersect(const Triangle& p, const Triangle& q) {
  return CGAL::do_intersect(to_triangle(p), to_triangle(q));
}

bool projects_inside(const Vector3d& p_m, const Triangle& triangle, const Vector3d& normal,
                     double tolerance_m) {
  return decide(Inside{p_m, triangle, normal, tolerance_m});
}

bool rises(const Vector3d& n, const Vector3d& d, double drop_m) {
  return decide(Rise{n, d, drop_m});
}

int compare_gap(const EdgePair& pair, double height_m) {
  return decide(Gap{pair, height_m});
}

bool edges_opposite(const EdgePair& pair, double tolerance_m) {
  return decide(Opposite{pair, tolerance_m});
}

}  // namespace wrenchd::exact
