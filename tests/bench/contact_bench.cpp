// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/contact_bench.hpp"

#include <algorithm>
#include <memory>
#include <string>

#include "collision/proxy.hpp"
#include "core/energy_law.hpp"
#include "tests/bench/mesh_pair.hpp"
#include "tests/support/exact_intersection.hpp"

namespace wrenchd::bench {
namespace {

/// Number of poses whose pairs the benchmark also checks in exact arithmetic, which is slow.
constexpr std::size_t kExactPoses = 10;

constexpr int kTicksAtRest = 20;

/// The value is the number of intersecting triangle pairs.
TimedMethod pairs_runner(const MeshPair& pair) {
  const auto pairs = std::make_shared<IntersectingPairs>();
  return {"wrenchd all pairs", [] {},
          [pairs, &pair](std::size_t i) {
            return Answer{static_cast<double>(intersecting_pair_count(*pairs, pair.scene, pair.X_WP[i]))};
          }};
}

/// Times the whole tick: contacts, projection, verification and wrench. The value is the energy.
TimedMethod tick_runner(const MeshPair& pair) {
  struct State {
    explicit State(const MeshPair& pair) : proxy(pair.scene), X_WQ(pair.X_start) {}
    Proxy proxy;
    Pose X_WQ;
  };
  const auto state = std::make_shared<State>(pair);
  return {"wrenchd whole tick",
          [state, &pair] {
            state->proxy.clear_history();
            // Untimed. The hand starts at rest and moves to the first pose without a jump.
            state->X_WQ = pair.X_start;
            for (int i = 0; i < kTicksAtRest; ++i)
              state->X_WQ = state->proxy.follow(pair.X_WP_before.front(), state->X_WQ).X_WQ;
            for (const Pose& X_WP : pair.X_WP_before)
              state->X_WQ = state->proxy.follow(X_WP, state->X_WQ).X_WQ;
          },
          [state, &pair](std::size_t i) {
            const Pose& X_WP = pair.X_WP[i];
            const Projection q = state->proxy.follow(X_WP, state->X_WQ);
            state->X_WQ = q.X_WQ;
            const Wrench F = energy_wrench(pair.scene.tool().solid.inertia, 1e5, X_WP, q.X_WQ);
            Answer answer{q.energy + 0.0 * F.force_N.x(), q.kkt_residual, q.active.size()};
            answer.converged = q.status == ProjectionStatus::converged || q.status == ProjectionStatus::free;
            return answer;
          }};
}

std::vector<TimedMethod> peer_runners(const MeshPair& pair, const PeerModule& module) {
  const auto poses = std::make_shared<std::vector<PeerPose>>();
  for (const Pose& X_WP : pair.X_WP) poses->push_back(peer_pose(X_WP));
  const auto opened = std::make_shared<PeerModule::Pair>(
      module.open(pair.scene.tool_mesh()->surface.mesh(), pair.scene.meshes()[0].mesh->surface.mesh()));
  std::vector<TimedMethod> runners;
  for (int q = 0; q < static_cast<int>(module.queries().size()); ++q)
    runners.push_back({module.queries()[static_cast<std::size_t>(q)], [] {},
                       [opened, poses, q](std::size_t i) {
                         return Answer{static_cast<double>(opened->contacts(q, (*poses)[i]))};
                       }});
  return runners;
}

double mean(const MethodTiming& result) {
  double sum = 0.0;
  for (const Answer& answer : result.answers) sum += answer.value;
  return sum / static_cast<double>(result.answers.size());
}

struct Tables {
  Table times{"meshes: time of one pose [us]",
              {"p50", "p99", "p99.9", "max", "p99 / p50", "max / p50", "spread %", "verdict"}};
  Table ratios{"meshes: peer's p50 / wrenchd's",
               {"to all pairs", "to the whole tick", "p99 to the whole tick", "verdict"}};
  Table answers{
      "meshes: results",
      {"poses", "contacts per pose", "wrong at", "of", "overlapping at q", "unconverged", "worst KKT"}};
};

std::string us(double ns) {
  return fixed(ns / 1000.0, 1);
}

void add_times(const std::string& of_case, const MethodTiming& r, Table& table) {
  table.add(of_case, r.name,
            {us(r.ns.p50), us(r.ns.p99), us(r.ns.p999), us(r.ns.max), fixed(r.ns.p99 / r.ns.p50, 2),
             fixed(r.ns.max / r.ns.p50, 2), fixed(100.0 * r.relative_spread, 1), verdict(r)});
}

void bench_pair(const MeshPair& pair, const Effort& effort, const CounterScale& scale,
                std::span<const PeerModule> peers, Tables& tables) {
  std::vector<TimedMethod> runners = {pairs_runner(pair), tick_runner(pair)};
  for (const PeerModule& module : peers)
    for (TimedMethod& runner : peer_runners(pair, module)) runners.push_back(std::move(runner));
  const std::vector<MethodTiming> results = time_methods(runners, pair.X_WP.size(), effort.passes, scale);
  const MethodTiming& pairs = results[0];
  const MethodTiming& tick = results[1];
  for (const MethodTiming& result : results) {
    add_times(pair.name, result, tables.times);
    if (&result == &pairs || &result == &tick) continue;
    const bool clear = verdict(result).empty() && verdict(pairs).empty() && verdict(tick).empty();
    tables.ratios.add(pair.name, result.name,
                      {fixed(result.ns.p50 / pairs.ns.p50, 2), fixed(result.ns.p50 / tick.ns.p50, 2),
                       fixed(result.ns.p99 / tick.ns.p99, 2), clear ? "" : "inconclusive"});
  }

  // Accuracy is checked before speed is measured.
  const test::ExactIntersection exact(pair.scene.tool_mesh()->surface.mesh(),
                                      pair.scene.meshes()[0].mesh->surface.mesh());
  const std::size_t looked_at = std::min(kExactPoses, pair.X_WP.size());
  const std::size_t stride = pair.X_WP.size() / looked_at;
  std::vector<double> truth;
  for (std::size_t k = 0; k < looked_at; ++k)
    truth.push_back(static_cast<double>(exact.intersecting_pairs(pair.X_WP[k * stride])));
  for (const MethodTiming& result : results) {
    if (&result == &tick) continue;
    std::size_t wrong = 0;
    for (std::size_t k = 0; k < looked_at; ++k) wrong += result.answers[k * stride].value != truth[k] ? 1 : 0;
    tables.answers.add(pair.name, result.name,
                       {whole(result.answers.size()), fixed(mean(result), 1), whole(wrong), whole(looked_at),
                        "-", "-", "-"});
  }
  std::size_t overlapping = 0, unconverged = 0, looked = 0;
  double worst = 0.0;
  Proxy proxy(pair.scene);
  Pose X_WQ = pair.X_start;
  for (const Pose& X_WP : pair.X_WP_before) X_WQ = proxy.follow(X_WP, X_WQ).X_WQ;
  for (std::size_t i = 0; i < pair.X_WP.size(); ++i) {
    X_WQ = proxy.follow(pair.X_WP[i], X_WQ).X_WQ;
    if (i % stride != 0) continue;
    overlapping += exact.intersect(X_WQ) ? 1 : 0;
    ++looked;
  }
  for (const Answer& answer : tick.answers) {
    unconverged += answer.converged ? 0 : 1;
    if (answer.converged) worst = std::max(worst, answer.kkt_residual);
  }
  tables.answers.add(pair.name, tick.name,
                     {whole(tick.answers.size()), "-", "-", whole(looked), whole(overlapping),
                      whole(unconverged), scientific(worst)});
}

}  // namespace

std::vector<Table> bench_meshes(const Effort& effort, const CounterScale& scale,
                                std::span<const PeerModule> peers) {
  Tables tables;
  const auto run = [&](std::string name, MeshPair pair) {
    pair.name = std::move(name);
    bench_pair(pair, effort, scale, peers, tables);
  };
  run("bumps 2k x 2k", sliding_bumps(2000, 2000, effort.poses));
  run("peg 2k x 4k", peg_in_hole(2000, 4000, effort.quick ? 5 : effort.poses));
  if (!effort.quick) {
    run("bumps 20k x 20k", sliding_bumps(20480, 20480, effort.poses));
    run("bumps 200k x 200k", sliding_bumps(200000, 200000, effort.poses));
    run("bumps 10k x 1M", sliding_bumps(9680, 1003520, effort.poses));
    run("peg 20k x 40k", peg_in_hole(20000, 40000, effort.poses));
  }
  return {tables.times, tables.ratios, tables.answers};
}

Table bench_growth(const Effort& effort, const CounterScale& scale) {
  Table table("growth: a tool of 10k triangles on a boulder with N triangles [us]",
              {"triangles", "p50", "p99", "max"});
  for (const std::size_t triangles : {2000, 6000, 20000, 60000, 200000, 600000, 2000000}) {
    if (effort.quick && triangles > 6000) break;
    const MeshPair pair = sliding_bumps(9680, triangles, effort.poses);
    const std::vector<MethodTiming> results =
        time_methods({pairs_runner(pair), tick_runner(pair)}, pair.X_WP.size(), effort.passes, scale);
    const std::size_t count = pair.scene.meshes()[0].mesh->surface.triangles().size();
    for (const MethodTiming& r : results)
      table.add(std::to_string(triangles), r.name, {whole(count), us(r.ns.p50), us(r.ns.p99), us(r.ns.max)});
  }
  return table;
}

}  // namespace wrenchd::bench
