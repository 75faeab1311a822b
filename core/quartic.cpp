// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/quartic.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>

namespace wrenchd {
namespace {

/// A root beyond 2^250 is at infinity: its fourth power would overflow.
constexpr int kFarthest_log2 = 250;
/// A value this small beside the sum of its terms is zero: the rounding of four multiplications and
/// additions, and of coefficients that were rounded themselves.
constexpr double kRounding = 4.0 * std::numeric_limits<double>::epsilon();

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

}  // namespace

// Between two neighbouring roots of its derivative a polynomial is monotone and has one root or none. So the
// roots of the third derivative lead to those of the second, and so on up. Closed forms (Ferrari, ref. [24]
// of the paper) are shorter, but lose every digit where the coefficients differ much in size: a vertex nearly
// below the centre of mass gives two of 1e-8 among ones, and the answer was a half turn.
RealRoots real_roots(double A, double B, double C, double D, double E) noexcept {
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

}  // namespace wrenchd
