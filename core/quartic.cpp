// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/quartic.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace wrenchd {
namespace {

/// A leading coefficient this small beside the largest one is zero: its root lies beyond 1e15 or is not there.
constexpr double kVanishes = 1e-15;
/// A discriminant this far below zero, relative to its terms, is a double root blurred by rounding.
constexpr double kBlurred = 1e-14;

void add(RealRoots& roots, double x) noexcept {
  if (roots.count < roots.x.size()) roots.x[roots.count++] = x;
}

/// x^2 + p x + q = 0, without cancellation.
void add_quadratic(RealRoots& roots, double p, double q) noexcept {
  double discriminant = 0.25 * p * p - q;
  if (discriminant < 0.0) {
    if (discriminant < -kBlurred * (0.25 * p * p + std::abs(q))) return;
    discriminant = 0.0;
  }
  const double larger = -0.5 * p - std::copysign(std::sqrt(discriminant), p);
  add(roots, larger);
  add(roots, larger != 0.0 ? q / larger : 0.0);
}

/// Real roots of x^3 + b x^2 + c x + d = 0 by Cardano's method, the trigonometric form where there are three.
RealRoots cubic_roots(double b, double c, double d) noexcept {
  RealRoots roots;
  const double shift = b / 3.0;
  const double p = c / 3.0 - shift * shift;                          // t^3 + 3 p t + 2 q = 0, x = t - shift
  const double q = 0.5 * (2.0 * shift * shift * shift - shift * c + d);
  const double discriminant = q * q + p * p * p;
  if (discriminant > 0.0) {
    const double s = std::cbrt(-q - std::copysign(std::sqrt(discriminant), q));
    add(roots, (s != 0.0 ? s - p / s : 0.0) - shift);
    return roots;
  }
  const double r = std::sqrt(-p);
  const double angle = r > 0.0 ? std::acos(std::clamp(-q / (r * r * r), -1.0, 1.0)) / 3.0 : 0.0;
  for (int k = 0; k < 3; ++k) add(roots, 2.0 * r * std::cos(angle + 2.0 * k * std::numbers::pi / 3.0) - shift);
  return roots;
}

/// Ferrari: the depressed quartic y^4 + p y^2 + q y + r is the difference of two squares,
///
///   (y^2 + m)^2 - (k y - q/(2k))^2,    k^2 = 2m - p,
///
/// where m solves the resolvent  m^3 - (p/2) m^2 - r m + (p r/2 - q^2/8) = 0. Its largest root keeps k^2 >= 0.
RealRoots quartic_roots(double b, double c, double d, double e) noexcept {
  const double shift = 0.25 * b;
  const double s2 = shift * shift;
  const double p = c - 6.0 * s2;
  const double q = d - 2.0 * shift * c + 8.0 * s2 * shift;
  const double r = e - shift * d + s2 * c - 3.0 * s2 * s2;

  const RealRoots resolvent = cubic_roots(-0.5 * p, -r, 0.5 * p * r - 0.125 * q * q);
  const double m = *std::max_element(resolvent.begin(), resolvent.end());
  const double k2 = 2.0 * m - p;
  RealRoots roots;
  if (k2 > 1e-14 * (std::abs(p) + std::abs(2.0 * m))) {
    const double k = std::sqrt(k2);
    add_quadratic(roots, k, m - 0.5 * q / k);
    add_quadratic(roots, -k, m + 0.5 * q / k);
  } else {  // biquadratic: y^4 + p y^2 + r
    RealRoots squares;
    add_quadratic(squares, p, r);
    for (const double y2 : squares) {
      if (y2 < 0.0) continue;
      add(roots, std::sqrt(y2));
      add(roots, -std::sqrt(y2));
    }
  }
  for (std::size_t i = 0; i < roots.count; ++i) roots.x[i] -= shift;
  return roots;
}

/// Two Newton steps on the polynomial itself take out the rounding of the closed form. A step that does not
/// improve is not taken.
double polished(const std::array<double, 5>& a, double x) noexcept {
  const auto value = [&a](double t) { return (((a[0] * t + a[1]) * t + a[2]) * t + a[3]) * t + a[4]; };
  const auto slope = [&a](double t) {
    return ((4.0 * a[0] * t + 3.0 * a[1]) * t + 2.0 * a[2]) * t + a[3];
  };
  for (int step = 0; step < 2; ++step) {
    const double next = x - value(x) / slope(x);
    if (!(std::abs(value(next)) < std::abs(value(x)))) break;  // also where the slope vanishes
    x = next;
  }
  return x;
}

}  // namespace

RealRoots real_roots(double A, double B, double C, double D, double E) noexcept {
  const double largest = std::max({std::abs(A), std::abs(B), std::abs(C), std::abs(D), std::abs(E)});
  RealRoots roots;
  if (!(largest > 0.0)) return roots;
  const std::array<double, 5> a = {A / largest, B / largest, C / largest, D / largest, E / largest};
  if (std::abs(a[0]) > kVanishes) {
    roots = quartic_roots(a[1] / a[0], a[2] / a[0], a[3] / a[0], a[4] / a[0]);
  } else if (std::abs(a[1]) > kVanishes) {
    roots = cubic_roots(a[2] / a[1], a[3] / a[1], a[4] / a[1]);
  } else if (std::abs(a[2]) > kVanishes) {
    add_quadratic(roots, a[3] / a[2], a[4] / a[2]);
  } else if (std::abs(a[3]) > kVanishes) {
    add(roots, -a[4] / a[3]);
  }
  for (std::size_t i = 0; i < roots.count; ++i) roots.x[i] = polished(a, roots.x[i]);
  return roots;
}

}  // namespace wrenchd
