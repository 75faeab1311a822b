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

/// A root beyond 2^250 is at infinity: its fourth power would overflow.
constexpr int kFarthest_log2 = 250;
/// A value this small beside the sum of its terms is zero: the rounding of four multiplications and
/// additions, and of coefficients that were rounded themselves.
constexpr double kRounding = 4.0 * std::numeric_limits<double>::epsilon();
/// The closed form is for coefficients whose ratios, and the powers of these that it takes, stay far from
/// overflow and underflow.
constexpr double kWidest = 0x1p100;
/// rho in count_is_certain(): some hundred times what rounding leaves, that of the coefficients included.
constexpr double kExact = 1e-13;
/// s there, up to the factor of four: 4 sqrt(rho / 0.02) = 0.9e-5.
constexpr double kApart = 1e-5;

struct Polynomial {
  std::array<double, 5> a{};  ///< highest power first
  std::size_t degree = 0;

  struct At {
    double value;
    double slope;
    double noise;  ///< what rounding may have added to the value
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
  /// -1, 0 or 1; zero where rounding hides the sign.
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

/// Largest coefficient near 1 and leading coefficient not zero. Powers of two: nothing is rounded.
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

/// All roots, of the derivatives too, lie between plus and minus this (Fujiwara:  2 max |a_k / a_0|^(1/k)).
double bound(const Polynomial& p) noexcept {
  int log2 = -kFarthest_log2;
  for (std::size_t k = 1; k <= p.degree; ++k) {
    if (p.a[k] == 0.0) continue;
    const int ratio = std::ilogb(p.a[k]) + 1 - std::ilogb(p.a[0]);
    log2 = std::max(log2, static_cast<int>(std::ceil(ratio / static_cast<double>(k))) + 2);
  }
  return std::scalbn(1.0, std::min(log2, kFarthest_log2));
}

/// As many doubles lie below this number as above it, between a and b.
double middle(double a, double b) noexcept {
  constexpr std::int64_t sign_bit = std::numeric_limits<std::int64_t>::min();
  const auto rank = [](double x) noexcept {
    const auto bits = std::bit_cast<std::int64_t>(x);
    return bits < 0 ? sign_bit - bits : bits;
  };
  const std::int64_t mid = std::midpoint(rank(a), rank(b));
  return std::bit_cast<double>(mid < 0 ? sign_bit - mid : mid);
}

/// The root between two points where p has different signs and is monotone in between: Newton's method while
/// each of its steps is at most half the one before, else bisection of the doubles that are left, which ends
/// it after 64 of them whatever the scales.
double root_between(const Polynomial& p, double below, double above, bool rising) noexcept {
  constexpr int kPatience = 40;  // quadratic convergence takes less than ten
  double x = 0.5 * (below + above);
  double last_step = above - below;
  for (int count = 0; below < x && x < above; ++count) {
    const auto [value, slope, noise] = p.at(x);
    if (value == 0.0) return x;
    ((value < 0.0) == rising ? below : above) = x;
    const double step = -value / slope;
    const double next = x + step;
    if (std::abs(value) <= 0.25 * noise) return std::clamp(next, below, above);  // no more digits to be had
    const bool inside = below < next && next < above;
    const bool converging = inside && std::abs(step) <= 0.5 * std::abs(last_step) && count < kPatience;
    last_step = step;
    x = converging ? next : middle(below, above);
  }
  return x;
}

/// The roots of p, given those of its derivative in rising order: one in each piece between them at whose
/// ends the signs differ, and each end that is a root itself.
RealRoots roots_between(const Polynomial& p, const RealRoots& turning, double far) noexcept {
  RealRoots roots;
  double below = -far;
  int sign_below = p.sign(below);
  for (std::size_t i = 0; i <= turning.count; ++i) {
    const double above = i < turning.count ? turning.x[i] : far;
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

/// What two quadratics are taken for: their product is the quartic.
struct Factors {
  Quadratic f;
  Quadratic g;
};

/// The largest real root of  t^3 = 3 p t + 2 q; NaN where p and q are zero.
///
/// With D = q^2 - p^3 > 0 it is the only one (Cardano):  t = w + p/w,  w^3 = q +- sqrt(D), taken with the
/// sign of q. Where p < 0 the two cancel, and
///
///   w - |p|/w = 2 |q| / (w^2 + |p| + p^2/w^2)
///
/// does not. Else (Vieta)  t = 2 sqrt(p) cos(acos(k)/3),  k = q / p^(3/2).
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

/// middle - half and middle + half, whose product is given: the smaller of the two is a quotient, not a
/// difference.
Around around(double middle, double half, double product) noexcept {
  Around out{middle - half, middle + half};
  double& larger = middle * half >= 0.0 ? out.plus : out.minus;
  double& smaller = middle * half >= 0.0 ? out.minus : out.plus;
  if (larger != 0.0) smaller = product / larger;
  return out;
}

// Ferrari (ref. [24] of the paper). For every y
//
//   x^4 + b x^3 + c x^2 + d x + e = (x^2 + b/2 x + y/2)^2
//                                   - [(b^2/4 - c + y) x^2 + (b y/2 - d) x + (y^2/4 - e)]
//
// and the bracket is a square (R x + S)^2,  R^2 = b^2/4 - c + y,  S^2 = y^2/4 - e,  2 R S = b y/2 - d,  where
// its discriminant vanishes, which is the resolvent cubic
//
//   y^3 - c y^2 + (b d - 4 e) y + (4 c - b^2) e - d^2 = 0,      t = y - c/3,   t^3 = 3 p t + 2 q,
//   p = (c^2 - 3 b d + 12 e) / 9,   q = (2 c^3 - 9 b c d + 27 d^2 + 27 b^2 e - 72 c e) / 54.
//
// A difference of squares is a product:  (x^2 + (b/2 - R) x + y/2 - S) (x^2 + (b/2 + R) x + y/2 + S),
// where the product of the two b is c - y and that of the two c is e.
//
// The largest real y is the one for which R^2 >= 0 is certain. Of R and S one may vanish (R for a biquadratic
// with e < 0): the one further from zero is taken by its root, the other follows.
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

/// The same for  x (x^3 + b x^2 + c x + d): one root r of the cubic goes with the zero.
Factors cardano(const Monic& a) noexcept {
  const auto [b, c, d, zero] = a;
  const double p = (b * b - 3.0 * c) / 9.0;
  const double q = (b * (9.0 * c - 2.0 * b * b) - 27.0 * d) / 54.0;
  const double r = largest_root(p, q) - b / 3.0;
  return {{-r, zero}, {b + r, c + r * (b + r)}};
}

/// What the product lacks: the quartic minus f g, whose x^4 is gone.
Monic residual(const Monic& a, const Factors& by) noexcept {
  const auto& [f, g] = by;
  return {a.b - (f.b + g.b), a.c - (f.c + g.c + f.b * g.b), a.d - (f.b * g.c + g.b * f.c), a.e - f.c * g.c};
}

/// prod (z_i - z_j) over the roots z_i of f and z_j of g, with no more rounding than their sizes ask for.
double resultant(const Quadratic& f, const Quadratic& g) noexcept {
  const double v = f.c - g.c;
  return v * v + (f.b - g.b) * (f.b * g.c - g.b * f.c);
}

/// Newton's method for f, which leads the residual r to zero together with the same step for g:
///
///   g df + f dg = r    so    (u x + v) df = r  modulo f,    u x + v = g - f = g modulo f,
///
/// two equations for df = db x + dc, whose determinant is the resultant of f and g (Bairstow).
Quadratic corrected(const Quadratic& f, const Quadratic& g, const Monic& r) noexcept {
  const double u = g.b - f.b;
  const double v = g.c - f.c;
  const double r1 = r.d - f.b * r.c + (f.b * f.b - f.c) * r.b;
  const double r0 = r.e - f.c * r.c + f.b * f.c * r.b;
  const double determinant = resultant(f, g);
  return {f.b + (v * r1 - u * r0) / determinant, f.c + ((v - f.b * u) * r0 + f.c * u * r1) / determinant};
}

/// Are there as many real roots as the factors have? Let z_j be the four roots of f g, and
///
///   |r(x)| <= rho m(x),   m(x) = prod_j (|x| + |z_j|),    s_ij = |z_i - z_j| / (|z_i| + |z_j|) <= 1,
///
/// where r is the residual, and let s be the product of all six s_ij, so s <= each. On the circle of radius
/// s/4 |z_j| about z_j,  |f g| >= s/9 (0.6)^3 s m > 0.02 s^2 m. So if  rho < 0.02 s^2,  Rouche's theorem
/// leaves just one root of the quartic in each circle. They do not meet each other; those about a complex z_j
/// do not meet the real line, and in one about a real z_j the root is real, or its conjugate were there too.
///
/// Per factor, with the root w of |discriminant|,  n = max(|b|, w) <= |z_1| + |z_2| <= sqrt(2) n  and
/// s_12 >= w / (sqrt(2) n);  the product of the other four s_ij is the resultant over that of (|z_i| +
/// |z_j|). What sqrt(2) may take, at most a factor of four in s, is in the number asked for.
bool count_is_certain(const Factors& by, const Monic& r) noexcept {
  const auto& [f, g] = by;
  const double w_f = std::sqrt(std::abs(f.discriminant()));
  const double w_g = std::sqrt(std::abs(g.discriminant()));
  const double n_f = std::max(std::abs(f.b), w_f);
  const double n_g = std::max(std::abs(g.b), w_g);
  const double c_f = std::abs(f.c);
  const double c_g = std::abs(g.c);
  const double crossed = n_f * c_g + n_g * c_f;
  if (!(std::abs(r.b) <= kExact * (n_f + n_g) && std::abs(r.c) <= kExact * (c_f + c_g + n_f * n_g) &&
        std::abs(r.d) <= kExact * crossed && std::abs(r.e) <= kExact * (c_f * c_g)))
    return false;
  const double largest = (c_f - c_g) * (c_f - c_g) + (n_f + n_g) * crossed;
  return w_f * w_g * std::abs(resultant(f, g)) >= kApart * (n_f * n_g * largest);
}

/// A root of the quartic from one nearly so, by Newton's method. NaN where it is none, to rounding.
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

/// The factors, where they vouch for the number of real roots. Not all of a is zero.
std::optional<Factors> factors_of(const Monic& a) noexcept {
  constexpr int kCorrections = 2;  // seldom needed; a third would seldom help
  if (a.d == 0.0 && a.e == 0.0) {
    const Factors by{{0.0, 0.0}, {a.b, a.c}};
    const bool certain = std::abs(by.g.discriminant()) >= kApart * (a.b * a.b + std::abs(a.c));
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

/// Keeps the order that rises.
void insert(double x, RealRoots& roots) noexcept {
  std::size_t i = roots.count++;
  for (; i > 0 && roots.x[i - 1] > x; --i) roots.x[i] = roots.x[i - 1];
  roots.x[i] = x;
}

/// Adds the real roots of f but zero, as roots of a. False where one is none.
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

/// All real roots in closed form, or nothing where that cannot vouch for their number and digits. Leading
/// zeros are shifted out, which multiplies by x: zero is a root of the polynomial asked for only if E is
/// zero.
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
  const auto within = [](double x) noexcept { return std::abs(x) <= kWidest; };
  if (!(within(a.b) && within(a.c) && within(a.d) && within(a.e) && within(A / last))) return std::nullopt;
  const auto by = factors_of(a);
  if (!by || !add_roots(a, by->f, roots) || !add_roots(a, by->g, roots)) return std::nullopt;
  return roots;
}

}  // namespace

// Between two neighbouring roots of its derivative a polynomial is monotone and has one root or none. So the
// roots of the third derivative lead to those of the second, and so on up.
RealRoots real_roots_by_bracketing(double A, double B, double C, double D, double E) noexcept {
  const Polynomial p = normalised({A, B, C, D, E});
  if (p.degree == 0) return {};
  std::array<Polynomial, 5> by_degree;
  by_degree[p.degree] = p;
  for (std::size_t k = p.degree; k > 1; --k) by_degree[k - 1] = by_degree[k].derivative();
  const double far = bound(p);
  RealRoots roots;
  for (std::size_t k = 1; k <= p.degree; ++k) roots = roots_between(by_degree[k], roots, far);
  return roots;
}

RealRoots real_roots(double A, double B, double C, double D, double E) noexcept {
  const auto roots = closed_form(A, B, C, D, E);
  return roots ? *roots : real_roots_by_bracketing(A, B, C, D, E);
}

}  // namespace wrenchd
