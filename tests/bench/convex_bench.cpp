// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/convex_bench.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "collision/penetration.hpp"
#include "tests/bench/convex_pair.hpp"

namespace wrenchd::bench {
namespace {

/// Relative error up to which a depth counts as correct in double precision.
constexpr double kDouble = 1e-6;
constexpr double kFloat = 1e-3;  ///< relative error up to which a depth counts as correct in single precision
/// A method whose depth is wrong at more than 1 % of the poses is not eligible as the fastest method.
constexpr double kRightOften = 0.99;
/// Depths with a relative difference below this value count as equal.
constexpr double kSameDepth = 1e-9;
/// Overlap that may remain at q: well above rounding error, well below what a hand or a display resolves.
constexpr double kStillOverlapping_m = 1e-9;

/// The proxy of wrenchd, warm started with the result of the previous pose.
class Follower {
 public:
  Follower(const ConvexPair& pair, Method method) : pair_(pair) { options_.method = method; }

  /// Resets the proxy as if it had been at the first pose before; the proxy needs its approach to the
  /// contact.
  void restart() {
    depth_ = std::make_unique<PenetrationDepth>(pair_.scene, options_);
    X_last_ = depth_->query(pair_.X_WP.front()).projection.X_WQ;
  }
  Penetration follow(std::size_t i) {
    Penetration out = depth_->follow(pair_.X_WP[i], X_last_);
    X_last_ = out.projection.X_WQ;
    return out;
  }

 private:
  const ConvexPair& pair_;
  PenetrationDepth::Options options_;
  std::unique_ptr<PenetrationDepth> depth_;
  Pose X_last_;
};

/// The value is the depth that corresponds to the energy as a translation, T = m depth^2. For the
/// translational method this is the penetration depth.
TimedMethod wrenchd_runner(std::string name, const ConvexPair& pair, Method method) {
  const auto follower = std::make_shared<Follower>(pair, method);
  const double mass_kg = pair.scene.tool().solid.inertia.mass_kg;
  return {std::move(name), [follower] { follower->restart(); },
          [follower, mass_kg](std::size_t i) -> Answer {
            const Penetration out = follower->follow(i);
            const Projection& q = out.projection;
            const bool found = q.status != ProjectionStatus::infeasible && q.status != ProjectionStatus::free;
            return {found ? std::sqrt(q.energy / mass_kg) : kNoAnswer, q.kkt_residual, q.active.size(),
                    q.status == ProjectionStatus::converged};
          }};
}

std::vector<TimedMethod> peer_runners(const ConvexPair& pair, const PeerModule& module) {
  std::vector<PeerPose> converted;
  for (const Pose& X_WP : pair.X_WP) converted.push_back(peer_pose(X_WP));
  const auto poses = std::make_shared<const std::vector<PeerPose>>(std::move(converted));
  std::vector<TimedMethod> runners;
  for (int q = 0; q < static_cast<int>(module.queries().size()); ++q)
    runners.push_back({module.queries()[static_cast<std::size_t>(q)], [] {},
                       [opened = module.open(pair.tool_T, pair.obstacle_W), poses, q](std::size_t i) {
                         return Answer{opened.depth_m(q, (*poses)[i])};
                       }});
  return runners;
}

/// Errors of one method's depths against the exact depths.
struct Depths {
  std::size_t missed = 0;  ///< number of overlaps that the method did not detect
  /// Number of depths with a relative error above kDouble, and above kFloat.
  std::size_t off_double = 0, off_float = 0;
  double shallowest = 0.0, deepest = 0.0;  ///< extreme relative errors: most negative, most positive
};

Depths compare(const MethodTiming& result, const std::vector<double>& exact_m) {
  Depths depths;
  for (std::size_t i = 0; i < exact_m.size(); ++i) {
    const double error = result.answers[i].value / exact_m[i] - 1.0;
    if (std::isnan(error)) {
      ++depths.missed;
      continue;
    }
    depths.off_double += std::abs(error) > kDouble ? 1 : 0;
    depths.off_float += std::abs(error) > kFloat ? 1 : 0;
    depths.shallowest = std::min(depths.shallowest, error);
    depths.deepest = std::max(depths.deepest, error);
  }
  return depths;
}

/// Returns true if the method is accurate enough to count as a penetration query.
bool right(const Depths& depths, std::size_t poses) {
  const std::size_t wrong = depths.missed + depths.off_float;
  return static_cast<double>(poses - wrong) >= kRightOften * static_cast<double>(poses);
}

/// Checks of the exact method's answers: outside the obstacle, and not worse than the best translation. A
/// proxy that stays on its side of an edge may be worse.
struct Soundness {
  std::size_t above_translation = 0;
  double worst_above = 0.0;  ///< largest relative excess of the depth that corresponds to the energy
  std::size_t overlapping = 0;
  std::size_t unconverged = 0;
  double worst_residual = 0.0;
};

Soundness examine(const ConvexPair& pair, const MethodTiming& exact) {
  Soundness found;
  Follower follower(pair, Method::exact);
  follower.restart();
  for (std::size_t i = 0; i < pair.X_WP.size(); ++i) {
    const Pose X_WQ = follower.follow(i).projection.X_WQ;
    const Overlap left = overlap(pair.tool_surface_T.transformed(X_WQ), pair.obstacle_surface_W);
    found.overlapping += left.depth_m > kStillOverlapping_m ? 1 : 0;
    const Answer& answer = exact.answers[i];
    found.above_translation += answer.value <= pair.depth_m[i] * (1.0 + kSameDepth) ? 0 : 1;
    found.worst_above = std::max(found.worst_above, answer.value / pair.depth_m[i] - 1.0);
    found.unconverged += answer.converged ? 0 : 1;
    found.worst_residual = std::max(found.worst_residual, answer.kkt_residual);
  }
  return found;
}

struct Tables {
  Table times{"convex on convex: time of one query [ns]",
              {"p50", "p99", "p99.9", "max", "/ exact p50", "/ exact p99", "spread %", "verdict"}};
  Table depths{"convex on convex: depths against the exact ones (poses, relative errors)",
               {"poses", "missed", "off > 1e-6", "off > 1e-3", "shallowest", "deepest", "right"}};
  Table soundness{
      "convex on convex: the exact method's answers (poses)",
      {"poses", "above translation", "worst above", "overlapping at q", "unconverged", "worst KKT"}};
  Table ratios{"convex on convex: peer / wrenchd exact",
               {"p50 ratio", "p99 ratio", "p50 ratio to translational", "verdict"}};
};

/// Returns the fastest result by p50 among those for which `allowed` is true; null if there is none.
template <class Allowed>
const MethodTiming* fastest(std::span<const MethodTiming> results, const Allowed& allowed) {
  const MethodTiming* best = nullptr;
  for (const MethodTiming& result : results)
    if (allowed(result) && (best == nullptr || result.ns.p50 < best->ns.p50)) best = &result;
  return best;
}

void add_ratio(const std::string& of_case, const std::string& which, const MethodTiming* peer,
               const MethodTiming& exact, const MethodTiming& translational, Table& ratios) {
  if (peer == nullptr) {
    ratios.add(of_case, which + ": none", {"-", "-", "-", ""});
    return;
  }
  const bool clear = verdict(*peer).empty() && verdict(exact).empty();
  ratios.add(of_case, which + ": " + peer->name,
             {fixed(peer->ns.p50 / exact.ns.p50, 2), fixed(peer->ns.p99 / exact.ns.p99, 2),
              fixed(peer->ns.p50 / translational.ns.p50, 2), clear ? "" : "inconclusive"});
}

void bench_pair(const ConvexPair& pair, const Effort& effort, const CounterScale& scale,
                std::span<const PeerModule> peers, Tables& tables) {
  std::vector<TimedMethod> runners = {wrenchd_runner("wrenchd exact", pair, Method::exact),
                                      wrenchd_runner("wrenchd translational", pair, Method::translational)};
  for (const PeerModule& module : peers)
    for (TimedMethod& runner : peer_runners(pair, module)) runners.push_back(std::move(runner));
  const std::vector<MethodTiming> results = time_methods(runners, pair.X_WP.size(), effort.passes, scale);

  const MethodTiming& exact = results[0];
  const std::size_t poses = pair.X_WP.size();
  for (const MethodTiming& result : results) {
    tables.times.add(
        pair.name, result.name,
        {fixed(result.ns.p50, 0), fixed(result.ns.p99, 0), fixed(result.ns.p999, 0), fixed(result.ns.max, 0),
         fixed(result.ns.p50 / exact.ns.p50, 2), fixed(result.ns.p99 / exact.ns.p99, 2),
         fixed(100.0 * result.relative_spread, 1), verdict(result)});
    if (&result == &exact) continue;  // the exact method also rotates, so its depth is smaller
    const Depths depths = compare(result, pair.depth_m);
    tables.depths.add(
        pair.name, result.name,
        {whole(poses), whole(depths.missed), whole(depths.off_double), whole(depths.off_float),
         scientific(depths.shallowest), scientific(depths.deepest), right(depths, poses) ? "yes" : "no"});
  }
  const Soundness found = examine(pair, exact);
  tables.soundness.add(
      pair.name, exact.name,
      {whole(poses), whole(found.above_translation), scientific(found.worst_above), whole(found.overlapping),
       whole(found.unconverged), scientific(found.worst_residual)});

  const auto of_peers = std::span(results).subspan(2);
  add_ratio(pair.name, "best right",
            fastest(of_peers,
                    [&](const MethodTiming& result) { return right(compare(result, pair.depth_m), poses); }),
            exact, results[1], tables.ratios);
  add_ratio(pair.name, "fastest, right or wrong", fastest(of_peers, [](const MethodTiming&) { return true; }),
            exact, results[1], tables.ratios);
}

}  // namespace

std::vector<Table> bench_convex(const Effort& effort, const CounterScale& scale,
                                std::span<const PeerModule> peers) {
  Tables tables;
  for (const std::size_t vertices : {8u, 42u, 162u, 642u}) {
    if (effort.quick && vertices > 42) break;
    bench_pair(sliding_pair(vertices, effort.poses), effort, scale, peers, tables);
  }
  return {tables.times, tables.depths, tables.ratios, tables.soundness};
}

}  // namespace wrenchd::bench
