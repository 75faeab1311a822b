// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <catch2/catch.hpp>

#include "core/quartic.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_quartic {

using test::RandomValues;

namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

/// A polynomial made from its factors. Highest power first; multiplied out in long double, then rounded once.
struct Made {
  std::vector<long double> a;
  std::vector<long double> roots;

  explicit Made(double leading) : a{leading} {}
  Made& root(double r) {
    times({1.0L, -static_cast<long double>(r)});
    roots.push_back(r);
    return *this;
  }
  /// The conjugate pair re +- i im.
  Made& pair(double re, double im) {
    const long double x = re;
    const long double y = im;
    times({1.0L, -2.0L * x, x * x + y * y});
    return *this;
  }
  std::array<double, 5> coefficients() const {
    std::array<double, 5> c{};
    for (std::size_t i = 0; i < a.size(); ++i) c[5 - a.size() + i] = static_cast<double>(a[i]);
    return c;
  }

 private:
  void times(const std::vector<long double>& b) {
    std::vector<long double> product(a.size() + b.size() - 1);
    for (std::size_t i = 0; i < a.size(); ++i)
      for (std::size_t j = 0; j < b.size(); ++j) product[i + j] += a[i] * b[j];
    a = product;
  }
};

RealRoots solve(const std::array<double, 5>& c) {
  return real_roots(c[0], c[1], c[2], c[3], c[4]);
}

/// Returns the uncertainty of the value at x from the rounding of the coefficients.
double noise_at(const std::array<double, 5>& c, long double x) {
  long double terms = 0.0L;
  for (const double coefficient : c) terms = terms * std::abs(x) + std::abs(coefficient);
  return static_cast<double>(terms) * kEpsilon;
}

double value_at(const std::array<double, 5>& c, long double x) {
  long double value = 0.0L;
  for (const double coefficient : c) value = value * x + coefficient;
  return static_cast<double>(value);
}

double slope_at(const std::array<double, 5>& c, long double x) {
  return static_cast<double>(((4.0L * c[0] * x + 3.0L * c[1]) * x + 2.0L * c[2]) * x + c[3]);
}

double nearest(const RealRoots& found, long double root) {
  double least = std::numeric_limits<double>::infinity();
  for (const double x : found) least = std::min(least, static_cast<double>(std::abs(x - root)));
  return least;
}

/// Checks that every returned root satisfies the equation up to rounding, in ascending order, at most as many
/// as the degree.
void require_no_spurious(const std::array<double, 5>& c, const RealRoots& found) {
  const auto degree = c.end() - std::find_if(c.begin(), c.end(), [](double x) { return x != 0.0; }) - 1;
  REQUIRE(found.end() - found.begin() <= std::max<std::ptrdiff_t>(degree, 0));
  REQUIRE(std::is_sorted(found.begin(), found.end()));
  for (const double x : found) {
    INFO(c[0] << " " << c[1] << " " << c[2] << " " << c[3] << " " << c[4] << " at " << x);
    REQUIRE(std::isfinite(x));
    REQUIRE(std::abs(value_at(c, x)) <= 8.0 * noise_at(c, x));
  }
}

/// Checks that every real root that is separated from the others by more than the rounding of the
/// coefficients is found.
void require_separated_found(const Made& made, const std::array<double, 5>& c, const RealRoots& found) {
  for (std::size_t i = 0; i < made.roots.size(); ++i) {
    const long double r = made.roots[i];
    const double uncertain = noise_at(c, r) / std::abs(slope_at(c, r));
    bool apart = true;
    for (std::size_t k = 0; k < made.roots.size(); ++k)
      apart = apart && (k == i || std::abs(made.roots[k] - r) > 1e4 * uncertain);
    if (!apart || uncertain > 1e-3 * std::abs(static_cast<double>(r))) continue;
    INFO(c[0] << " " << c[1] << " " << c[2] << " " << c[3] << " " << c[4] << " has "
              << static_cast<double>(r));
    REQUIRE(nearest(found, r) <= 10.0 * uncertain);
  }
}

void require_solved(const Made& made) {
  const auto c = made.coefficients();
  const RealRoots found = solve(c);
  require_no_spurious(c, found);
  require_separated_found(made, c, found);
}

/// Checks that closed form and search have the same roots, up to the rounding of the coefficients.
void require_same_as_bracketing(const std::array<double, 5>& c) {
  const RealRoots found = solve(c);
  const RealRoots searched = real_roots_by_bracketing(c[0], c[1], c[2], c[3], c[4]);
  INFO(c[0] << " " << c[1] << " " << c[2] << " " << c[3] << " " << c[4]);
  require_no_spurious(c, found);
  REQUIRE(found.count == searched.count);
  for (std::size_t i = 0; i < found.count; ++i) {
    const double x = searched.x[i];
    const double least = std::numeric_limits<double>::min();  // a zero by bisection
    const double uncertain = noise_at(c, x) / std::abs(slope_at(c, x));
    if (found.x[i] != x) REQUIRE(std::abs(found.x[i] - x) <= 4.0 * uncertain + least);
  }
}

double leading(RandomValues& random) {
  return random.log_uniform(1e-3, 1e3) * (random.chance(0.5) ? 1.0 : -1.0);
}

}  // namespace

TEST_CASE("the quartic of example 4.1 has its known roots", "[quartic]") {
  // Eqs. (26)-(30) for the cube of side 50, m = 1, H = 2500/6, vertex (25, -25), h = 25, phi = -0.2. The
  // paper's theta is absolute.
  const double m = 1.0, H = 2500.0 / 6.0, vx = 25.0, vy = -25.0, h = 25.0, phi = -0.2;
  const std::array<double, 5> c = {m * vx * vy - m * vx * h + H * std::sin(phi),
                                   2.0 * (H * std::cos(phi) - m * h * vy - m * vx * vx + m * vy * vy),
                                   -6.0 * m * vx * vy,
                                   2.0 * (H * std::cos(phi) - m * h * vy + m * vx * vx - m * vy * vy),
                                   m * vx * vy + m * vx * h - H * std::sin(phi)};
  const RealRoots found = solve(c);
  require_no_spurious(c, found);
  REQUIRE(found.count == 2);
  CHECK(found.x[0] == Approx(-0.04338450).epsilon(1e-7));
  CHECK(found.x[1] == Approx(2.77097204).epsilon(1e-8));
  CHECK(2.0 * std::atan(found.x[0]) == Approx(-0.0867146202807576).epsilon(1e-13));
}

TEST_CASE("four real roots", "[quartic]") {
  RandomValues random(1);
  for (int i = 0; i < 5'000; ++i)
    require_solved(Made(leading(random))
                       .root(random.normal())
                       .root(random.normal())
                       .root(random.normal())
                       .root(random.normal()));
}

TEST_CASE("two real roots and a complex pair", "[quartic]") {
  RandomValues random(2);
  for (int i = 0; i < 5'000; ++i)
    require_solved(Made(leading(random))
                       .root(random.normal())
                       .root(random.normal())
                       .pair(random.normal(), random.normal()));
}

TEST_CASE("two complex pairs: no real root", "[quartic]") {
  RandomValues random(3);
  for (int i = 0; i < 5'000; ++i) {
    const auto away = [&random] { return random.uniform(0.01, 2.0); };
    const auto c =
        Made(leading(random)).pair(random.normal(), away()).pair(random.normal(), away()).coefficients();
    REQUIRE(solve(c).count == 0);
  }
}

TEST_CASE("a double root is found beside other roots", "[quartic]") {
  RandomValues random(4);
  for (int i = 0; i < 5'000; ++i) {
    const double r = random.normal();
    Made made = Made(leading(random)).root(r).root(r);
    if (i % 2 == 0)
      made.root(random.normal()).root(random.normal());
    else
      made.pair(random.normal(), random.normal());
    require_solved(made);
    REQUIRE(nearest(solve(made.coefficients()), r) <= 1e-5 * (1.0 + std::abs(r)));
  }
}

TEST_CASE("two double roots are found", "[quartic]") {
  RandomValues random(5);
  for (int i = 0; i < 5'000; ++i) {
    const double r = random.normal();
    const double s = r + random.uniform(0.1, 2.0);
    const auto c = Made(leading(random)).root(r).root(r).root(s).root(s).coefficients();
    const RealRoots found = solve(c);
    require_no_spurious(c, found);
    REQUIRE(nearest(found, r) <= 1e-6 * (1.0 + std::abs(r) + std::abs(s)));
    REQUIRE(nearest(found, s) <= 1e-6 * (1.0 + std::abs(r) + std::abs(s)));
  }
}

TEST_CASE("triple and quadruple roots are found", "[quartic]") {
  RandomValues random(6);
  for (int i = 0; i < 5'000; ++i) {
    const double r = random.normal();
    const Made triple = Made(leading(random)).root(r).root(r).root(r).root(random.normal());
    require_solved(triple);
    REQUIRE(nearest(solve(triple.coefficients()), r) <= 1e-3 * (1.0 + std::abs(r)));
    const auto c = Made(leading(random)).root(r).root(r).root(r).root(r).coefficients();
    const RealRoots found = solve(c);
    require_no_spurious(c, found);
    REQUIRE(nearest(found, r) <= 1e-3 * (1.0 + std::abs(r)));
  }
  // With exact coefficients the roots are exact.
  CHECK(real_roots(1.0, -4.0, 6.0, -4.0, 1.0).count == 1);
  CHECK(real_roots(1.0, -4.0, 6.0, -4.0, 1.0).x[0] == 1.0);
  CHECK(real_roots(3.0, 0.0, 0.0, 0.0, 0.0).count == 1);
  CHECK(real_roots(3.0, 0.0, 0.0, 0.0, 0.0).x[0] == 0.0);
}

TEST_CASE("nearly double roots", "[quartic]") {
  RandomValues random(7);
  for (int i = 0; i < 5'000; ++i) {
    const double r = random.normal();
    const double apart = random.log_uniform(1e-12, 1e-2);
    Made made = Made(leading(random)).root(random.normal()).root(random.normal());
    if (i % 2 == 0)
      made.root(r).root(r + apart);
    else
      made.pair(r, apart);
    require_solved(made);
  }
}

TEST_CASE("roots of very different magnitude", "[quartic]") {
  RandomValues random(8);
  for (int i = 0; i < 5'000; ++i) {
    const auto any = [&random] { return random.normal() * random.log_uniform(1e-10, 1e10); };
    require_solved(Made(leading(random)).root(any()).root(any()).root(any()).root(any()));
  }
}

TEST_CASE("coefficients of very different magnitude: one root at each change of sign, no others",
          "[quartic]") {
  RandomValues random(9);
  for (int i = 0; i < 5'000; ++i) {
    std::array<double, 5> c;
    for (double& coefficient : c) coefficient = random.normal() * random.log_uniform(1e-40, 1e40);
    const RealRoots found = solve(c);
    require_no_spurious(c, found);
    double below = -1e60;
    for (int decade = -120; decade <= 120; ++decade) {
      const double above = std::copysign(std::pow(10.0, std::abs(decade) - 60), decade);
      if (decade == 0 || above <= below) continue;
      const double at_below = value_at(c, below);
      const double at_above = value_at(c, above);
      const bool certain =
          std::abs(at_below) > 100.0 * noise_at(c, below) && std::abs(at_above) > 100.0 * noise_at(c, above);
      if (certain && (at_below < 0.0) != (at_above < 0.0)) {
        const double from = below;
        REQUIRE(std::any_of(found.begin(), found.end(), [&](double x) { return from < x && x < above; }));
      }
      below = above;
    }
  }
}

TEST_CASE("a leading coefficient of zero leaves the roots of lower degree", "[quartic]") {
  RandomValues random(10);
  for (int i = 0; i < 5'000; ++i) {
    Made cubic = Made(leading(random)).root(random.normal()).root(random.normal()).root(random.normal());
    for (const double tiny : {0.0, -0.0, 1e-300, -1e-300, 1e-30, 1e-17, -1e-14, 1e-10, 1e-6}) {
      auto c = cubic.coefficients();
      c[0] = tiny;
      const RealRoots found = solve(c);
      require_no_spurious(c, found);
      if (std::abs(tiny) <= 1e-30) require_separated_found(cubic, c, found);
    }
  }
}

TEST_CASE("cubics, quadratics and lines", "[quartic]") {
  RandomValues random(11);
  for (int i = 0; i < 4'000; ++i) {
    require_solved(Made(leading(random)).root(random.normal()).root(random.normal()).root(random.normal()));
    require_solved(Made(leading(random)).root(random.normal()).pair(random.normal(), random.normal()));
    require_solved(Made(leading(random)).root(random.normal()).root(random.normal()));
    require_solved(Made(leading(random)).root(random.normal()));
    REQUIRE(
        solve(Made(leading(random)).pair(random.normal(), random.uniform(0.01, 2.0)).coefficients()).count ==
        0);
  }
}

TEST_CASE("a quadratic loses no digits to cancellation", "[quartic]") {
  const RealRoots found = real_roots(0.0, 0.0, 1.0, -1e9, 1.0);
  REQUIRE(found.count == 2);
  CHECK(found.x[0] == Approx(1e-9).epsilon(1e-15));
  CHECK(found.x[1] == Approx(1e9).epsilon(1e-15));
}

TEST_CASE("biquadratic: the roots are pairs of both signs", "[quartic]") {
  RandomValues random(12);
  for (int i = 0; i < 4'000; ++i) {
    const double r = random.log_uniform(1e-3, 1e3);
    const double s = random.log_uniform(1e-3, 1e3);
    const Made real = Made(leading(random)).root(r).root(-r).root(s).root(-s);
    require_solved(real);
    const Made mixed = Made(leading(random)).root(r).root(-r).pair(0.0, s);
    require_solved(mixed);
    const RealRoots found = solve(mixed.coefficients());
    REQUIRE(found.count == 2);
    REQUIRE(found.x[0] == Approx(-found.x[1]).epsilon(1e-14));
  }
}

TEST_CASE("a root at zero is zero", "[quartic]") {
  RandomValues random(13);
  for (int i = 0; i < 5'000; ++i) {
    const auto c = Made(leading(random))
                       .root(0.0)
                       .root(random.normal())
                       .root(random.normal())
                       .root(random.normal())
                       .coefficients();
    REQUIRE(nearest(solve(c), 0.0L) <= 1e-300);
  }
}

TEST_CASE("a constant has no roots, not even zero itself", "[quartic]") {
  CHECK(real_roots(0.0, 0.0, 0.0, 0.0, 0.0).count == 0);
  CHECK(real_roots(0.0, 0.0, 0.0, 0.0, 1.0).count == 0);
  CHECK(real_roots(0.0, 0.0, 0.0, 0.0, -1e-300).count == 0);
}

TEST_CASE("all coefficients times c: the same roots", "[quartic]") {
  RandomValues random(14);
  for (int i = 0; i < 5'000; ++i) {
    auto c = Made(leading(random)).root(random.normal()).root(random.normal()).pair(0.1, 1.0).coefficients();
    const RealRoots before = solve(c);
    const int power = random.integer(-600, 600);  // a power of two, which is exact
    for (double& coefficient : c) coefficient = std::ldexp(coefficient, power);
    const RealRoots after = solve(c);
    REQUIRE(std::equal(before.begin(), before.end(), after.begin(), after.end()));
  }
}

TEST_CASE("the largest and the smallest finite coefficients", "[quartic]") {
  constexpr double kMost = std::numeric_limits<double>::max();
  constexpr double kLeast = std::numeric_limits<double>::denorm_min();
  for (const double a : {kMost, -kMost, kLeast, -kLeast, 0.0, 1.0})
    for (const double b : {kMost, -kMost, kLeast, 0.0, 1.0})
      for (const double c : {kMost, -kMost, kLeast, 0.0, 1.0})
        for (const double d : {kMost, -kMost, kLeast, 0.0, 1.0})
          for (const double e : {kMost, -kMost, kLeast, 0.0, 1.0}) {
            const RealRoots found = real_roots(a, b, c, d, e);
            REQUIRE(found.count <= 4);
            for (const double x : found) REQUIRE(std::isfinite(x));
          }
}

TEST_CASE("the closed form and the bracketing search have the same roots, at any scale", "[quartic]") {
  RandomValues random(15);
  for (const double most : {1.0, 1e2, 1e4, 1e8, 1e15}) {
    const auto any = [&] { return random.normal() * random.log_uniform(1.0 / most, most); };
    for (int i = 0; i < 2'000; ++i) {
      require_same_as_bracketing(
          Made(leading(random)).root(any()).root(any()).root(any()).root(any()).coefficients());
      require_same_as_bracketing(
          Made(leading(random)).root(any()).root(any()).pair(any(), any()).coefficients());
      require_same_as_bracketing(Made(leading(random)).pair(any(), any()).pair(any(), any()).coefficients());
      require_same_as_bracketing(Made(leading(random)).root(any()).root(any()).root(any()).coefficients());
      require_same_as_bracketing(Made(leading(random)).root(any()).pair(any(), any()).coefficients());
      require_same_as_bracketing(Made(leading(random)).root(any()).root(any()).coefficients());
      require_same_as_bracketing(Made(leading(random)).pair(any(), any()).coefficients());
      require_same_as_bracketing(Made(leading(random)).root(any()).coefficients());
    }
  }
}

TEST_CASE("closed form and search agree with any coefficient zero, tiny or huge", "[quartic]") {
  RandomValues random(16);
  for (const double odd : {0.0, 1e-300, 1e-100, 1e-17, 1e-8, 1e-4, 1e4, 1e8, 1e17, 1e60})
    for (int which = 1; which < 32; ++which)
      for (int i = 0; i < 60; ++i) {
        std::array<double, 5> c;
        for (int k = 0; k < 5; ++k)
          c[static_cast<std::size_t>(k)] = random.normal() * ((which >> k) % 2 == 0 ? 1.0 : odd);
        require_same_as_bracketing(c);
      }
}

TEST_CASE("closed form and search agree at multiple and nearly multiple roots", "[quartic]") {
  RandomValues random(17);
  for (int i = 0; i < 3'000; ++i) {
    const double r = random.normal();
    const double im = random.normal();
    const double s = r + random.normal() * (i % 5 == 0 ? 0.0 : random.log_uniform(1e-14, 1e-1));
    const double apart = (s - r) * random.normal();
    for (const Made& made :
         {Made(1.0).root(r).root(s).root(random.normal()).root(random.normal()),
          Made(1.0).root(r).root(s).pair(random.normal(), random.normal()),
          Made(1.0).pair(r, s - r).root(random.normal()).root(random.normal()),
          Made(1.0).pair(r, s - r).pair(random.normal(), random.normal()), Made(1.0).pair(r, im).pair(s, im),
          Made(1.0).pair(r, im).pair(r, im + apart), Made(1.0).root(r).root(r).root(s).root(s),
          Made(1.0).root(r).root(s).root(r + apart).root(random.normal()),
          Made(1.0).root(r).root(s).root(r + apart)}) {
      const auto c = made.coefficients();
      require_no_spurious(c, solve(c));
      require_separated_found(made, c, solve(c));
    }
  }
}

TEST_CASE("a vertex nearly below the centre of mass: the smallest root is found", "[quartic]") {
  // Eqs. (26)-(30) at phi = 0. Two coefficients of 1e-8 among ones once gave a wrong result of half a turn.
  RandomValues random(18);
  for (int i = 0; i < 5'000; ++i) {
    const double m = 1.0, H = random.uniform(0.02, 0.5), vy = -random.uniform(0.3, 0.9);
    const double vx = random.normal() * random.log_uniform(1e-18, 1e-1);
    const double h = -vy - random.log_uniform(1e-9, 0.3);
    require_same_as_bracketing({m * vx * vy - m * vx * h, 2.0 * (H - m * h * vy - m * vx * vx + m * vy * vy),
                                -6.0 * m * vx * vy, 2.0 * (H - m * h * vy + m * vx * vx - m * vy * vy),
                                m * vx * vy + m * vx * h});
  }
}

TEST_CASE("roots that agree in eight digits, beside a root at 1e13, are not accepted unchecked",
          "[quartic]") {
  // A resultant with too much rounding once accepted them: its terms were much larger than the roots.
  require_same_as_bracketing(
      {1.0, 17386765417461.773, -3575334326662.4648, 161440795724.83173, -2099485800.5785661});
  require_same_as_bracketing(
      {1.0, -619835687117844.0, 3029575534.8516641, -3702.3660256170242, 1.0905661672880543e-06});
  require_same_as_bracketing(
      {1.0, -712605607013475.62, 10717106309.629679, 30734.579894808445, 0.020287685223639978});
}

TEST_CASE("pure powers", "[quartic]") {
  CHECK(real_roots(1.0, 0.0, 0.0, 0.0, 1.0).count == 0);
  const RealRoots fourth = real_roots(1.0, 0.0, 0.0, 0.0, -16.0);
  REQUIRE(fourth.count == 2);
  CHECK(fourth.x[0] == -2.0);
  CHECK(fourth.x[1] == 2.0);
  const RealRoots third = real_roots(0.0, 1.0, 0.0, 0.0, -27.0);
  REQUIRE(third.count == 1);
  CHECK(third.x[0] == Approx(3.0).epsilon(1e-15));
  const RealRoots with_zero = real_roots(1.0, 0.0, 0.0, -27.0, 0.0);
  REQUIRE(with_zero.count == 2);
  CHECK(with_zero.x[0] == 0.0);
  CHECK(with_zero.x[1] == Approx(3.0).epsilon(1e-15));
}

}  // namespace wrenchd::test_quartic
