// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/half_space_bench.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <span>
#include <string>

#include "collision/penetration.hpp"
#include "tests/bench/pressed_body.hpp"

namespace wrenchd::bench {
namespace {

constexpr int kPlanes = 47;  // number of planes in the paper
/// Energies with a relative difference below this value count as equal. The value is well above rounding
/// error.
constexpr double kSameEnergy = 1e-9;
/// The order of the methods. The methods up to kFollow are exact.
enum Row : std::size_t { kCold, kWarm, kFollow, kPlanar };

Answer answer_of(const Projection& q) {
  if (q.status == ProjectionStatus::infeasible) return {kNoAnswer, 0.0, 0, false};
  return {q.energy, q.kkt_residual, q.active.size(), q.status == ProjectionStatus::converged};
}

/// The exact method alone, started at p without history.
TimedMethod exact_cold(const PressedBody& body) {
  struct State {
    explicit State(const Scene& scene) : contacts(scene), exact(scene.tool().solid.inertia) {}
    SceneContacts contacts;
    ExactProjection exact;
  };
  const auto state = std::make_shared<State>(body.scene);
  return {"exact, cold", [] {},
          [state, &body](std::size_t i) {
            const Pose& X_WP = body.X_WP[i];
            return answer_of(state->exact.project(X_WP, state->contacts, X_WP));
          }};
}

/// The exact method alone, warm started with the rotation and the active contacts of the previous pose.
TimedMethod exact_warm(const PressedBody& body) {
  struct State {
    explicit State(const Scene& scene) : contacts(scene), exact(scene.tool().solid.inertia) {}
    SceneContacts contacts;
    ExactProjection exact;
    Pose X_last;
    StaticVector<ActiveContact, ContactSet::kCapacity> known;
  };
  const auto state = std::make_shared<State>(body.scene);
  const auto solve = [state](const Pose& X_WP) {
    const std::span known(state->known.begin(), state->known.end());
    const Projection q = state->exact.project(X_WP, state->contacts, state->X_last, known);
    state->X_last = q.X_WQ;
    state->known.clear();
    for (const ActiveContact& active : q.active)
      if (active.multiplier > 0.0) state->known.add(active);
    return answer_of(q);
  };
  return {"exact, warm",
          [state, solve, &body] {
            state->X_last = body.X_WP.front();
            state->known.clear();
            solve(body.X_WP.front());
          },
          [solve, &body](std::size_t i) { return solve(body.X_WP[i]); }};
}

/// A method as the servo loop calls it: follow(), including all work around the solve.
TimedMethod followed(std::string name, const PressedBody& body, Method method) {
  struct State {
    std::unique_ptr<PenetrationDepth> depth;
    Pose X_last;
  };
  const auto state = std::make_shared<State>();
  return {std::move(name),
          [state, &body, method] {
            const PenetrationDepth::Options options{method, kPlanes};
            state->depth = std::make_unique<PenetrationDepth>(body.scene, options);
            state->X_last = state->depth->query(body.X_WP.front()).projection.X_WQ;
          },
          [state, &body](std::size_t i) {
            const Penetration out = state->depth->follow(body.X_WP[i], state->X_last);
            state->X_last = out.projection.X_WQ;
            return answer_of(out.projection);
          }};
}

/// Returns the minimum energy at each pose, independent of the previous poses.
std::vector<double> optima(const PressedBody& body) {
  PenetrationDepth depth(body.scene, {Method::exact, kPlanes});
  std::vector<double> energies;
  for (const Pose& X_WP : body.X_WP) energies.push_back(depth.query(X_WP).projection.energy);
  return energies;
}

std::vector<double> excess(const MethodTiming& result, const std::vector<double>& optimum) {
  std::vector<double> shares;
  for (std::size_t i = 0; i < optimum.size(); ++i)
    shares.push_back(result.answers[i].value / optimum[i] - 1.0);
  return shares;
}

/// Returns the number of poses at which `one` found a higher energy than `other`, or no solution.
std::size_t above(const MethodTiming& one, const MethodTiming& other) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < one.answers.size(); ++i)
    count += one.answers[i].value <= other.answers[i].value * (1.0 + kSameEnergy) ? 0 : 1;
  return count;
}

void add_rows(const PressedBody& body, const std::vector<MethodTiming>& results, Table& times,
              Table& energies) {
  const std::vector<double> optimum = optima(body);
  const MethodTiming& planar = results[kPlanar];
  for (std::size_t r = 0; r < results.size(); ++r) {
    const MethodTiming& result = results[r];
    times.add(
        body.name, result.name,
        {fixed(result.ns.p50, 0), fixed(result.ns.p99, 0), fixed(result.ns.p999, 0), fixed(result.ns.max, 0),
         fixed(result.ns.p50 / results[kCold].ns.p50, 2), fixed(result.ns.p50 / results[kWarm].ns.p50, 2),
         fixed(result.ns.p50 / results[kFollow].ns.p50, 2), fixed(100.0 * result.relative_spread, 1),
         verdict(result)});

    std::vector<double> active;
    double worst_residual = 0.0;
    std::size_t unconverged = 0;
    for (const Answer& answer : result.answers) {
      active.push_back(static_cast<double>(answer.active));
      worst_residual = std::max(worst_residual, answer.kkt_residual);
      unconverged += answer.converged ? 0 : 1;
    }
    const bool exact = r <= kFollow;
    const std::vector<double> shares = excess(result, optimum);
    energies.add(body.name, result.name,
                 {scientific(quantile(shares, 0.5)), scientific(quantile(shares, 1.0)),
                  scientific(quantile(shares, 0.0)), fixed(quantile(active, 0.5), 0),
                  exact ? scientific(worst_residual) : "-", exact ? whole(unconverged) : "-",
                  exact ? whole(above(result, planar)) : "-"});
  }
}

}  // namespace

std::vector<Table> bench_half_space(const Effort& effort, const CounterScale& scale) {
  Table times("half-space: time of one solve [ns]",
              {"p50", "p99", "p99.9", "max", "/ cold", "/ warm", "/ follow", "spread %", "verdict"});
  Table energies("half-space: energy above the optimum [share]",
                 {"median", "worst", "least", "active", "worst KKT", "unconverged", "above planar"});
  std::vector<PressedBody> bodies;
  for (const std::size_t contacts : {1u, 4u, 16u, 64u}) {
    if (effort.quick && contacts > 4) break;
    bodies.push_back(pressed_bowl(contacts, effort.poses));
    if (contacts >= 3) bodies.push_back(pressed_face(contacts, effort.poses));
  }
  for (const PressedBody& body : bodies) {
    const std::vector<TimedMethod> runners = {exact_cold(body),
                                              exact_warm(body),
                                              followed("exact, follow", body, Method::exact),
                                              followed("planar 47", body, Method::planar),
                                              followed("descent", body, Method::descent),
                                              followed("translational", body, Method::translational)};
    add_rows(body, time_methods(runners, body.X_WP.size(), effort.passes, scale), times, energies);
  }
  return {times, energies};
}

Table bench_planar_family(const Effort& effort, const CounterScale& scale) {
  Table table(
      "planar family at one contact: time [ns], and cycles of the time-stamp counter",
      {"p50", "p99", "max", "ns / plane", "cycles / plane", "p99 cycles / plane", "spread %", "verdict"});
  const PressedBody body = pressed_bowl(1, effort.poses);
  const SceneContacts scene(body.scene);
  const PlanarFamily family(body.scene.tool().solid.inertia, body.scene.tool().hull, kPlanes);
  std::vector<Contact> contacts;
  for (const Pose& X_WP : body.X_WP) {
    ContactSet set;
    scene.add_violated(X_WP, 0.0, set);
    contacts.push_back(set[0]);
  }
  const auto planes = [&](std::string name, int count) {
    return TimedMethod{std::move(name), [] {},
                       [&, count](std::size_t i) {
                         const auto at = family.at(body.X_WP[i], contacts[i]);
                         double least = std::numeric_limits<double>::infinity();
                         for (int k = 0; k < count; ++k) least = std::min(least, at.solve(k).minimum.T);
                         return Answer{least};
                       }};
  };
  const std::vector<int> counts = {1, kPlanes};
  const std::vector<MethodTiming> results = time_methods({planes("1 plane", 1), planes("47 planes", kPlanes)},
                                                         body.X_WP.size(), effort.passes, scale);
  for (std::size_t r = 0; r < results.size(); ++r) {
    const Quantiles& ns = results[r].ns;
    table.add(
        body.name, results[r].name,
        {fixed(ns.p50, 0), fixed(ns.p99, 0), fixed(ns.max, 0), fixed(ns.p50 / counts[r], 1),
         fixed(ns.p50 / counts[r] / scale.ns_per_count, 0), fixed(ns.p99 / counts[r] / scale.ns_per_count, 0),
         fixed(100.0 * results[r].relative_spread, 1), verdict(results[r])});
  }
  return table;
}

}  // namespace wrenchd::bench
