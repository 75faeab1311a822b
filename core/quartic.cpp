// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/quartic.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>

namespace wrenchd {
namespace {

/// A root beyond 2^250 counts as infinite: its fourth power would overflow.
constexpr int kMaxRoot_log2 = 250;
/// A sum below this fraction of the sum of its absolute terms counts as zero: rounding of four
/// multiplications and additions, and of the coefficients.
constexpr double kRounding = 4.0 * std::numeric_limits<double>::epsilon();
/// Range of coefficient ratios for the closed form. Their powers stay far from overflow and underflow.
constexpr double kMaxRatio = 0x1p100;
/// rho in count_is_certain(): about a hundred times the rounding error of the coefficients and the factors.
constexpr double kMaxResidual = 1e-13;
/// s in count_is_certain(), up to the factor of four: 4 sqrt(rho / 0.02) = 0.9e-5.
constexpr double kMinSeparation = 1e-5;

struct Polynomial {
  std::array<double, 5> a{};  ///< descending powers
  std::size_t degree = 0;

  struct At {
    double value;
    double slope;
    double noise;  ///< bound of the rounding error of the value
  };
  At at(double x) const noexcept {
    double value = a[0];
    double slope = 0.0;
    double terms = std::abs(a[0]);
    for (std::size_t i = 1; i <= degree; ++i) {
      slope = slope * x + value;
      value = value * x + a[i];
      terms = terms * std::abs(x) + std::abs(a[i]);
    }
    return {value, slope, kRounding * terms};
  }
  /// Sign of the polynomial: -1 or 1; 0 if rounding hides it.
  int sign(double x) const noexcept {
    const At here = at(x);
    if (std::abs(here.value) <= here.noise) return 0;
    return here.value > 0.0 ? 1 : -1;
  }
  Polynomial derivative() const noexcept {
    Polynomial d;
    d.degree = degree - 1;
    for (std::size_t i = 0; i < degree; ++i) d.a[i] = static_cast<double>(degree - i) * a[i];
    return d;
  }
};

/// Scales by a power of two, without rounding, so that the largest coefficient is near 1. Removes leading
/// zeros.
Polynomial normalised(std::array<double, 5> a) noexcept {
  const auto magnitude = [](double x, double y) { return std::abs(x) < std::abs(y); };
  const double largest = *std::max_element(a.begin(), a.end(), magnitude);
  if (largest == 0.0) return {};
  for (double& coefficient : a) coefficient = std::scalbn(coefficient, -std::ilogb(largest));
  const auto leading = std::find_if(a.begin(), a.end(), [](double x) { return x != 0.0; });
  Polynomial p;
  p.degree = static_cast<std::size_t>(a.end() - leading) - 1;
  std::copy(leading, a.end(), p.a.begin());
  return p;
}

/// All roots of the polynomial and its derivatives are between minus and plus this bound (Fujiwara: 2 max
/// |a_k / a_0|^(1/k)).
double bound(const Polynomial& p) noexcept {
  int log2 = -kMaxRoot_log2;
  for (std::size_t k = 1; k <= p.degree; ++k) {
    if (p.a[k] == 0.0) continue;
    const int ratio = std::ilogb(p.a[k]) + 1 - std::ilogb(p.a[0]);
    log2 = std::max(log2, static_cast<int>(std::ceil(ratio / static_cast<double>(k))) + 2);
  }
  return std::scalbn(1.0, std::min(log2, kMaxRoot_log2));
}

/// The number that halves the set of doubles between a and b.
double middle(double a, double b) noexcept {
  constexpr std::int64_t sign_bit = std::numeric_limits<std::int64_t>::min();
  const auto rank = [](double x) noexcept {
    const auto bits = std::bit_cast<std::int64_t>(x);
    return bits < 0 ? sign_bit - bits : bits;
  };
  const std::int64_t mid = std::midpoint(rank(a), rank(b));
  return std::bit_cast<double>(mid < 0 ? sign_bit - mid : mid);
}

/// The root between two points of opposite sign; p is monotone between them. Newton's method while each step
/// is at most half of the previous one; otherwise bisection of the set of doubles, at most 64 steps for any
/// scale.
double root_between(const Polynomial& p, double below, double above, bool rising) noexcept {
  constexpr int kMaxNewtonSteps = 40;  // quadratic convergence takes fewer than ten
  double x = 0.5 * (below + above);
  double last_step = above - below;
  for (int count = 0; below < x && x < above; ++count) {
    const auto [value, slope, noise] = p.at(x);
    if (value == 0.0) return x;
    ((value < 0.0) == rising ? below : above) = x;
    const double step = -value / slope;
    const double next = x + step;
    // rounding limits the accuracy
    if (std::abs(value) <= 0.25 * noise) return std::clamp(next, below, above);
    const bool inside = below < next && next < above;
    const bool converging = inside && std::abs(step) <= 0.5 * std::abs(last_step) && count < kMaxNewtonSteps;
    last_step = step;
    x = converging ? next : middle(below, above);
  }
  return x;
}

/// The roots of p, given the roots of its derivative in ascending order: one between two neighbours if the
/// signs of p differ there, and each neighbour that is a root itself.
RealRoots roots_between(const Polynomial& p, const RealRoots& extrema, double bound_x) noexcept {
  RealRoots roots;
  double below = -bound_x;
  int sign_below = p.sign(below);
  for (std::size_t i = 0; i <= extrema.count; ++i) {
    const double above = i < extrema.count ? extrema.x[i] : bound_x;
    const int sign_above = p.sign(above);
    if (sign_below * sign_above < 0) roots.x[roots.count++] = root_between(p, below, above, sign_below < 0);
    if (sign_above == 0) roots.x[roots.count++] = above;
    below = above;
    sign_below = sign_above;
  }
  return roots;
}

/// x^2 + b x + c.
struct Quadratic {
  double b;
  double c;
  double discriminant() const noexcept { return b * b - 4.0 * c; }
};

/// x^4 + b x^3 + c x^2 + d x + e.
struct Monic {
  double b, c, d, e;
};

/// Two quadratics whose product approximates the quartic.
struct Factors {
  Quadratic f;
  Quadratic g;
};

/// The largest real root of t^3 = 3 p t + 2 q; NaN if p and q are zero.
///
/// For D = q^2 - p^3 > 0 it is the only real root (Cardano): t = w + p/w, w^3 = q +- sqrt(D), with the sign
/// of q. For p < 0 the two terms cancel; this form does not:
///
///   w - |p|/w = 2 |q| / (w^2 + |p| + p^2/w^2)
///
/// Otherwise (Vieta) t = 2 sqrt(p) cos(acos(k)/3), k = q / p^(3/2).
double largest_root(double p, double q) noexcept {
  const double D = q * q - p * p * p;
  if (D > 0.0) {
    const double w = std::cbrt(std::abs(q) + std::sqrt(D));
    const double v = p / w;
    return std::copysign(p >= 0.0 ? w + v : 2.0 * std::abs(q) / (w * w - p + v * v), q);
  }
  const double root_p = std::sqrt(p);
  const double k = std::clamp(q / (p * root_p), -1.0, 1.0);
  return 2.0 * root_p * std::cos(std::acos(k) / 3.0);
}

struct Around {
  double minus;
  double plus;
};

/// middle - half and middle + half for a given product: the smaller one is a quotient and loses no digits.
Around around(double middle, double half, double product) noexcept {
  Around out{middle - half, middle + half};
  double& larger = middle * half >= 0.0 ? out.plus : out.minus;
  double& smaller = middle * half >= 0.0 ? out.minus : out.plus;
  if (larger != 0.0) smaller = product / larger;
  return out;
}

// Ferrari's factors, METHOD (54). For every y
//
//   x^4 + b x^3 + c x^2 + d x + e = (x^2 + b/2 x + y/2)^2
//                                   - [(b^2/4 - c + y) x^2 + (b y/2 - d) x + (y^2/4 - e)]
//
// The bracket is a square (R x + S)^2, R^2 = b^2/4 - c + y, S^2 = y^2/4 - e, 2 R S = b y/2 - d, if y solves
// the resolvent cubic
//
//   y^3 - c y^2 + (b d - 4 e) y + (4 c - b^2) e - d^2 = 0,      t = y - c/3,   t^3 = 3 p t + 2 q,
//   p = (c^2 - 3 b d + 12 e) / 9,   q = (2 c^3 - 9 b c d + 27 d^2 + 27 b^2 e - 72 c e) / 54.
//
// The factors are (x^2 + (b/2 - R) x + y/2 - S) (x^2 + (b/2 + R) x + y/2 + S). The product of their b is c -
// y, that of their c is e. For the largest real y, R^2 >= 0 is certain. R or S may be zero: the larger one is
// computed by its root, the other from 2 R S.
Factors ferrari(const Monic& a) noexcept {
  const auto [b, c, d, e] = a;
  const double p = (c * c - 3.0 * b * d + 12.0 * e) / 9.0;
  const double q = (c * (2.0 * c * c - 9.0 * b * d - 72.0 * e) + 27.0 * (d * d + b * b * e)) / 54.0;
  const double y = c / 3.0 + largest_root(p, q);
  const double RR = 0.25 * b * b - c + y;
  const double SS = 0.25 * y * y - e;
  const double RS = 0.5 * (0.5 * b * y - d);
  const bool R_first = RR * (0.25 * y * y + std::abs(e)) > SS * (0.25 * b * b + std::abs(c) + std::abs(y));
  const double first = std::sqrt(R_first ? RR : SS);
  const double second = RS / first;
  const double R = R_first ? first : second;
  const double S = R_first ? second : first;
  const auto [b_f, b_g] = around(0.5 * b, R, c - y);
  const auto [c_f, c_g] = around(0.5 * y, S, e);
  return {{b_f, c_f}, {b_g, c_g}};
}

/// Factors of x (x^3 + b x^2 + c x + d): the real root r of the cubic and zero form one factor (Cardano).
Factors cardano(const Monic& a) noexcept {
  const auto [b, c, d, zero] = a;
  const double p = (b * b - 3.0 * c) / 9.0;
  const double q = (b * (9.0 * c - 2.0 * b * b) - 27.0 * d) / 54.0;
  const double r = largest_root(p, q) - b / 3.0;
  return {{-r, zero}, {b + r, c + r * (b + r)}};
}

/// The quartic minus the product f g; its x^4 term is zero.
Monic residual(const Monic& a, const Factors& by) noexcept {
  const auto& [f, g] = by;
  return {a.b - (f.b + g.b), a.c - (f.c + g.c + f.b * g.b), a.d - (f.b * g.c + g.b * f.c), a.e - f.c * g.c};
}

/// Resultant: prod (z_i - z_j) over the roots z_i of f and z_j of g, in a form with little rounding.
double resultant(const Quadratic& f, const Quadratic& g) noexcept {
  const double v = f.c - g.c;
  return v * v + (f.b - g.b) * (f.b * g.c - g.b * f.c);
}

/// One Newton step for f that, together with the same step for g, reduces the residual r to zero (Bairstow):
///
///   g df + f dg = r    so    (u x + v) df = r  modulo f,    u x + v = g - f = g modulo f
///
/// These are two equations for df = db x + dc; their determinant is the resultant of f and g.
Quadratic corrected(const Quadratic& f, const Quadratic& g, const Monic& r) noexcept {
  const double u = g.b - f.b;
  const double v = g.c - f.c;
  const double r1 = r.d - f.b * r.c + (f.b * f.b - f.c) * r.b;
  const double r0 = r.e - f.c * r.c + f.b * f.c * r.b;
  const double determinant = resultant(f, g);
  return {f.b + (v * r1 - u * r0) / determinant, f.c + ((v - f.b * u) * r0 + f.c * u * r1) / determinant};
}

/// True if the quartic has as many real roots as the factors, METHOD (55). z_j: the four roots of f g; r: the
/// residual;
///
///   |r(x)| <= rho m(x),   m(x) = prod_j (|x| + |z_j|),    s_ij = |z_i - z_j| / (|z_i| + |z_j|) <= 1
///
/// s: product of all six s_ij. On the circle of radius s/4 |z_j| about z_j, |f g| >= s/9 (0.6)^3 s m > 0.02
/// s^2 m. If rho < 0.02 s^2, Rouche's theorem gives exactly one root of the quartic in each circle. The
/// circles are disjoint. The circle of a complex z_j does not reach the real axis; in that of a real z_j the
/// root is real.
///
/// Per factor, with w the root of |discriminant|: n = max(|b|, w) <= |z_1| + |z_2| <= sqrt(2) n and s_12 >= w
/// / (sqrt(2) n). The product of the other four s_ij is the resultant divided by that of (|z_i| + |z_j|).
/// kMinSeparation includes the factors sqrt(2), at most four in s.
bool count_is_certain(const Factors& by, const Monic& r) noexcept {
  const auto& [f, g] = by;
  const double w_f = std::sqrt(std::abs(f.discriminant()));
  const double w_g = std::sqrt(std::abs(g.discriminant()));
  const double n_f = std::max(std::abs(f.b), w_f);
  const double n_g = std::max(std::abs(g.b), w_g);
  const double c_f = std::abs(f.c);
  const double c_g = std::abs(g.c);
  const double crossed = n_f * c_g + n_g * c_f;
  if (!(std::abs(r.b) <= kMaxResidual * (n_f + n_g) &&
        std::abs(r.c) <= kMaxResidual * (c_f + c_g + n_f * n_g) && std::abs(r.d) <= kMaxResidual * crossed &&
        std::abs(r.e) <= kMaxResidual * (c_f * c_g)))
    return false;
  const double largest = (c_f - c_g) * (c_f - c_g) + (n_f + n_g) * crossed;
  return w_f * w_g * std::abs(resultant(f, g)) >= kMinSeparation * (n_f * n_g * largest);
}

/// Improves an approximate root of the quartic by Newton's method. NaN if the result is no root up to
/// rounding.
double polished(const Monic& a, double x) noexcept {
  struct At {
    double value;
    double slope;
  };
  const auto at = [&a](double t) noexcept -> At {
    return {(((t + a.b) * t + a.c) * t + a.d) * t + a.e, ((4.0 * t + 3.0 * a.b) * t + 2.0 * a.c) * t + a.d};
  };
  const At before = at(x);
  x -= before.value / before.slope;
  const At after = at(x);
  const double size = std::abs(x);
  const double terms =
      (((size + std::abs(a.b)) * size + std::abs(a.c)) * size + std::abs(a.d)) * size + std::abs(a.e);
  if (!(std::abs(after.value) <= kRounding * terms)) return std::numeric_limits<double>::quiet_NaN();
  return x - after.value / after.slope;
}

/// The factors if their number of real roots is certain, otherwise nothing. Precondition: a is not zero.
std::optional<Factors> factors_of(const Monic& a) noexcept {
  constexpr int kCorrections = 2;  // rarely needed; a third does not help
  if (a.d == 0.0 && a.e == 0.0) {
    const Factors by{{0.0, 0.0}, {a.b, a.c}};
    const bool certain = std::abs(by.g.discriminant()) >= kMinSeparation * (a.b * a.b + std::abs(a.c));
    return certain ? std::optional(by) : std::nullopt;
  }
  Factors by = a.e == 0.0 ? cardano(a) : ferrari(a);
  for (int corrections = 0; corrections <= kCorrections; ++corrections) {
    const Monic r = residual(a, by);
    if (count_is_certain(by, r)) return by;
    by = {corrected(by.f, by.g, r), corrected(by.g, by.f, r)};
  }
  return std::nullopt;
}

/// Inserts x and keeps the ascending order.
void insert(double x, RealRoots& roots) noexcept {
  std::size_t i = roots.count++;
  for (; i > 0 && roots.x[i - 1] > x; --i) roots.x[i] = roots.x[i - 1];
  roots.x[i] = x;
}

/// Adds the real non-zero roots of f as roots of a. Returns false if one is no root of a.
bool add_roots(const Monic& a, const Quadratic& f, RealRoots& roots) noexcept {
  const double discriminant = f.discriminant();
  if (discriminant < 0.0) return true;
  const double larger = -0.5 * (f.b + std::copysign(std::sqrt(discriminant), f.b));
  if (larger == 0.0) return true;
  for (const double x : {larger, f.c / larger}) {
    if (x == 0.0) continue;
    const double root = polished(a, x);
    if (!std::isfinite(root)) return false;
    insert(root, roots);
  }
  return true;
}

/// All real roots in closed form; nothing if their number or accuracy is not certain. Removes leading zeros
/// by shifting, which multiplies by x: zero is a root only if E is zero.
std::optional<RealRoots> closed_form(double A, double B, double C, double D, double E) noexcept {
  RealRoots roots;
  if (E == 0.0) roots.count = 1;
  for (int shifts = 0; A == 0.0 && shifts < 4; ++shifts) {
    A = B;
    B = C;
    C = D;
    D = E;
    E = 0.0;
  }
  const double last = E != 0.0 ? E : D != 0.0 ? D : C != 0.0 ? C : B;
  const Monic a{B / A, C / A, D / A, E / A};
  const auto within = [](double x) noexcept { return std::abs(x) <= kMaxRatio; };
  if (!(within(a.b) && within(a.c) && within(a.d) && within(a.e) && within(A / last))) return std::nullopt;
  const auto by = factors_of(a);
  if (!by || !add_roots(a, by->f, roots) || !add_roots(a, by->g, roots)) return std::nullopt;
  return roots;
}

}  // namespace

// Between neighbouring roots of its derivative a polynomial is monotone and has at most one root. The roots
// of the third derivative give those of the second, and so on.
RealRoots real_roots_by_bracketing(double A, double B, double C, double D, double E) noexcept {
  const Polynomial p = normalised({A, B, C, D, E});
  if (p.degree == 0) return {};
  std::array<Polynomial, 5> by_degree;
  by_degree[p.degree] = p;
  for (std::size_t k = p.degree; k > 1; --k) by_degree[k - 1] = by_degree[k].derivative();
  const double bound_x = bound(p);
  RealRoots roots;
  for (std::size_t k = 1; k <= p.degree; ++k) roots = roots_between(by_degree[k], roots, bound_x);
  return roots;
}

RealRoots real_roots(double A, double B, double C, double D, double E) noexcept {
  const auto roots = closed_form(A, B, C, D, E);
  return roots ? *roots : real_roots_by_bracketing(A, B, C, D, E);
}

}  // namespace wrenchd
