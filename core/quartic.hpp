// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>

namespace wrenchd {

/// Real roots of a polynomial of degree four or less: at most four.
struct RealRoots {
  std::array<double, 4> x{};
  std::size_t count = 0;

  const double* begin() const noexcept { return x.data(); }
  const double* end() const noexcept { return x.data() + count; }
};

/// Real roots of A x^4 + B x^3 + C x^2 + D x + E = 0, Eq. (25), in ascending order (core/METHOD.md, section
/// 7.2). Each root satisfies the equation up to rounding, for any scale of the coefficients; no separated
/// root is missing. A multiple root appears once, or as often as rounding splits it. Leading coefficients may
/// be zero. The zero polynomial returns no roots. Precondition: finite coefficients. RT-safe.
RealRoots real_roots(double A, double B, double C, double D, double E) noexcept;

/// The same roots by a bracketing search, which works for every polynomial and takes about seven times as
/// long. real_roots() uses it if the closed form is not certain; tests compare both. RT-safe.
RealRoots real_roots_by_bracketing(double A, double B, double C, double D, double E) noexcept;

}  // namespace wrenchd
