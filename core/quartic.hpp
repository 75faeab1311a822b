// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>

namespace wrenchd {

/// Real roots of a polynomial of degree four or less, at most four of them.
struct RealRoots {
  std::array<double, 4> x{};
  std::size_t count = 0;

  const double* begin() const noexcept { return x.data(); }
  const double* end() const noexcept { return x.data() + count; }
};

/// Real roots of  A x^4 + B x^3 + C x^2 + D x + E = 0  (Eq. 25), in rising order, whatever the scales of the
/// coefficients: each satisfies the equation to rounding, and none that stands apart from the others is
/// missed. A multiple root comes once, or as often as rounding has split it. Any leading coefficients may
/// vanish: what is left is solved as a cubic, quadratic or line. The zero polynomial has no roots here.
/// Coefficients must be finite. RT safe.
RealRoots real_roots(double A, double B, double C, double D, double E) noexcept;

/// The same by a search that works whatever the polynomial, at seven times the price: what real_roots() falls
/// back on where the closed form cannot vouch for its answer, and what tests hold it against. RT safe.
RealRoots real_roots_by_bracketing(double A, double B, double C, double D, double E) noexcept;

}  // namespace wrenchd
