// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/contact_bench.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

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
            return Answer{static_cast<double>(intersecting_pair_count(*pairs, pair, pair.X_WP[i]))};
          }};
}

/// Times the whole tick: contacts, projection, verification and wrench. The value is the energy.
TimedMethod tick_runner(const MeshPair& pair, ContactBackend contacts = ContactBackend::native) {
  struct State {
    State(const MeshPair& pair, ContactBackend contacts) : proxy(pair.scene, contacts), X_WQ(pair.X_start) {}
    Proxy proxy;
    Pose X_WQ;
  };
  const auto state = std::make_shared<State>(pair, contacts);
  return {contacts == ContactBackend::cgal ? "whole tick, contacts = cgal" : "wrenchd whole tick",
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
  for (const Pose& X_WP : pair.X_WP) poses->push_back(peer_pose(pair.X_OW * X_WP));
  const auto opened = std::make_shared<PeerModule::Pair>(
      module.open(pair.tool_T->surface.mesh(), pair.obstacle_O->surface.mesh()));
  std::vector<TimedMethod> runners;
  for (int q = 0; q < static_cast<int>(module.queries().size()); ++q)
    runners.push_back({module.queries()[static_cast<std::size_t>(q)], [] {},
                       [opened, poses, q](std::size_t i) {
                         return Answer{static_cast<double>(opened->contacts(q, (*poses)[i]))};
                       }});
  return runners;
}

/// Returns the mean over the solved poses, and their number.
std::pair<double, std::size_t> mean(const MethodTiming& result) {
  double sum = 0.0;
  std::size_t count = 0;
  for (const Answer& answer : result.answers) {
    if (std::isnan(answer.value)) continue;
    sum += answer.value;
    ++count;
  }
  return {sum / static_cast<double>(count), count};
}

/// Returns the rate at which this machine reads a large array in sequence [bytes/s]: the best of some runs.
double measured_read_rate() {
  constexpr std::size_t kWords = std::size_t{1} << 25;  // 256 MB, more than the caches
  const std::vector<std::uint64_t> data(kWords, 1);
  double best = 0.0;
  for (int run = 0; run < 3; ++run) {
    std::uint64_t sum = 0;
    const auto begin = std::chrono::steady_clock::now();
    for (const std::uint64_t word : data) sum += word;
    const double s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    if (sum == kWords) best = std::max(best, 8.0 * static_cast<double>(kWords) / s);
  }
  return best;
}

struct Tables {
  Table times{"meshes: time of one pose [us]",
              {"p50", "p99", "p99.9", "max", "p99 / p50", "max / p50", "spread %", "verdict"}};
  Table ratios{"meshes: peer's p50 / wrenchd's",
               {"to all pairs", "to the whole tick", "p99 to the whole tick", "verdict"}};
  Table work{"meshes: work of the whole tick",
             {"visits p50", "visits p99", "visits max", "loaded contacts", "visits / contact", "ns / visit",
              "kB touched", "read rate GB/s", "machine's GB/s"}};
  double read_rate = measured_read_rate();  ///< [bytes/s]
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

void add_work(const MeshPair& pair, const MethodTiming& tick, const std::vector<double>& visits,
              const std::vector<double>& contacts, Tables& tables) {
  constexpr double kBytesPerVisit = sizeof(TriangleBvh::Box) + sizeof(TriangleBvh::Leaf);
  const Quantiles of = quantiles(visits);
  const double loaded = quantile(contacts, 0.5), bytes = kBytesPerVisit * of.p50;
  tables.work.add(pair.name, tick.name,
                  {fixed(of.p50, 0), fixed(of.p99, 0), fixed(of.max, 0), fixed(loaded, 0),
                   fixed(of.p50 / std::max(1.0, loaded), 0), fixed(tick.ns.p50 / std::max(1.0, of.p50), 0),
                   fixed(bytes / 1e3, 1), fixed(bytes / tick.ns.p50, 2), fixed(tables.read_rate / 1e9, 1)});
}

/// Names the libraries that no package provides, unless their module was given.
void add_unpackaged(const MeshPair& pair, std::span<const PeerModule> peers, Table& times) {
  for (const std::string& name : unpackaged_mesh_peers()) {
    const bool given = std::any_of(peers.begin(), peers.end(), [&](const PeerModule& module) {
      return std::any_of(module.queries().begin(), module.queries().end(),
                         [&](const std::string& query) { return query.starts_with(name); });
    });
    if (!given) times.add(pair.name, name, {"-", "-", "-", "-", "-", "-", "-", "not run here"});
  }
}

void bench_pair(const MeshPair& pair, const Effort& effort, const CounterScale& scale,
                std::span<const PeerModule> peers, std::size_t peers_every, Tables& tables) {
  std::vector<TimedMethod> runners = {pairs_runner(pair), tick_runner(pair)};
  constexpr std::size_t kMaxCgalTriangles = 100000;  // beyond, its passes take too long
  const std::size_t triangles = pair.scene.tool_mesh()->surface.triangles().size() +
                                pair.scene.meshes()[0].mesh->surface.triangles().size();
  const bool with_cgal = triangles <= kMaxCgalTriangles;
  if (with_cgal) runners.push_back(tick_runner(pair, ContactBackend::cgal));
  for (const PeerModule& module : peers)
    for (TimedMethod& runner : peer_runners(pair, module)) {
      runner.every = peers_every;
      runners.push_back(std::move(runner));
    }
  const std::vector<MethodTiming> results = time_methods(runners, pair.X_WP.size(), effort.passes, scale);
  const MethodTiming& pairs = results[0];
  const MethodTiming& tick = results[1];
  const auto is_tick = [&](const MethodTiming& result) {
    return &result == &tick || (with_cgal && &result == &results[2]);
  };
  for (const MethodTiming& result : results) {
    add_times(pair.name, result, tables.times);
    if (&result == &pairs || &result == &tick) continue;
    const bool clear = verdict(result).empty() && verdict(pairs).empty() && verdict(tick).empty();
    tables.ratios.add(pair.name, result.name,
                      {fixed(result.ns.p50 / pairs.ns.p50, 2), fixed(result.ns.p50 / tick.ns.p50, 2),
                       fixed(result.ns.p99 / tick.ns.p99, 2), clear ? "" : "inconclusive"});
  }

  add_unpackaged(pair, peers, tables.times);

  // Accuracy is checked before speed is measured.
  const test::ExactIntersection exact(pair.tool_T->surface.mesh(), pair.obstacle_O->surface.mesh());
  const std::size_t looked_at = std::min(kExactPoses, (pair.X_WP.size() + peers_every - 1) / peers_every);
  const std::size_t stride =
      std::max<std::size_t>(1, pair.X_WP.size() / looked_at / peers_every) * peers_every;
  std::vector<double> truth;
  for (std::size_t k = 0; k < looked_at; ++k)
    truth.push_back(static_cast<double>(exact.intersecting_pairs(pair.X_OW * pair.X_WP[k * stride])));
  for (const MethodTiming& result : results) {
    if (is_tick(result)) continue;
    std::size_t wrong = 0;
    for (std::size_t k = 0; k < looked_at; ++k) wrong += result.answers[k * stride].value != truth[k] ? 1 : 0;
    const auto [contacts_per_pose, count] = mean(result);
    tables.answers.add(
        pair.name, result.name,
        {whole(count), fixed(contacts_per_pose, 1), whole(wrong), whole(looked_at), "-", "-", "-"});
  }
  std::size_t overlapping = 0, unconverged = 0, looked = 0;
  double worst = 0.0;
  std::vector<double> visits, contacts;
  Proxy proxy(pair.scene);
  Pose X_WQ = pair.X_start;
  for (const Pose& X_WP : pair.X_WP_before) X_WQ = proxy.follow(X_WP, X_WQ).X_WQ;
  for (std::size_t i = 0; i < pair.X_WP.size(); ++i) {
    const Projection q = proxy.follow(pair.X_WP[i], X_WQ);
    X_WQ = q.X_WQ;
    visits.push_back(proxy.node_visits());
    contacts.push_back(static_cast<double>(std::count_if(
        q.active.begin(), q.active.end(), [](const ActiveContact& c) { return c.multiplier > 0.0; })));
    if (i % stride != 0) continue;
    overlapping += exact.intersect(pair.X_OW * X_WQ) ? 1 : 0;
    ++looked;
  }
  for (const Answer& answer : tick.answers) {
    unconverged += answer.converged ? 0 : 1;
    if (answer.converged) worst = std::max(worst, answer.kkt_residual);
  }
  add_work(pair, tick, visits, contacts, tables);
  tables.answers.add(pair.name, tick.name,
                     {whole(tick.answers.size()), "-", "-", whole(looked), whole(overlapping),
                      whole(unconverged), scientific(worst)});
}

}  // namespace

std::vector<Table> bench_meshes(const Effort& effort, const CounterScale& scale,
                                std::span<const PeerModule> peers, const std::string& only) {
  Tables tables;
  const auto run = [&](const std::string& name, const Effort& of, std::size_t peers_every,
                       const auto& make_pair) {
    if (name.find(only) == std::string::npos) return;
    MeshPair pair = make_pair(of.poses);
    pair.name = name;
    bench_pair(pair, of, scale, peers, peers_every, tables);
  };
  Effort fewest = effort;
  fewest.poses = 5;
  const auto bumps = [&](const std::string& name, std::size_t tool, std::size_t obstacle) {
    run(name, effort, 1, [=](std::size_t poses) { return sliding_bumps(tool, obstacle, poses); });
  };
  const auto peg = [&](const std::string& name, std::size_t tool, std::size_t obstacle, const Effort& of) {
    run(name, of, 1, [=](std::size_t poses) { return peg_in_hole(tool, obstacle, poses); });
  };
  // The peers list thousands of contacts, which takes up to seconds per pose. They solve few of the poses.
  const std::size_t peers_every = std::max<std::size_t>(effort.poses / 20, 1);
  const auto conforming = [&](const std::string& name, const std::string& of) {
    run(name, effort.quick ? fewest : effort, effort.quick ? 1 : peers_every,
        [&](std::size_t poses) { return conforming_pair(test::conforming_case(of), poses); });
  };
  bumps("bumps 2k x 2k", 2000, 2000);
  peg("peg 2k x 4k", 2000, 4000, effort.quick ? fewest : effort);
  if (effort.quick) {
    conforming("flat 10k x 10k, float", "cube 10k / 10k, float, rotated");
  } else {
    bumps("bumps 20k x 20k", 20480, 20480);
    bumps("bumps 200k x 200k", 200000, 200000);
    bumps("bumps 10k x 1M", 9680, 1003520);
    peg("peg 20k x 40k", 20000, 40000, effort);
    conforming("flat 200k x 12", "cube 200k / 12, exact");
    conforming("flat 200k x 200k", "cube 200k / 200k, exact");
    conforming("flat 200k x 200k, float", "cube 200k / 200k, float, rotated");
    conforming("bore 10 um 200k x 200k, float", "faceted shaft in bore 10 um 200k / 200k, float, rotated");
    conforming("gears 200k x 200k, float", "faceted gears 200k / 200k, float, rotated");
  }
  return {tables.times, tables.ratios, tables.work, tables.answers};
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
