// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "core/metric.hpp"
#include "core/projection.hpp"
#include "tests/support/overlapping_scene.hpp"

namespace wrenchd::test_projection {

using namespace wrenchd::test;

namespace {

/// T for the rotation R_p' R_q = E and the least translation out of one half-space, as a function of E.
double energy_of_rotation(const Scene& scene, const Pose& X_WP, const Quaterniond& E) {
  const Pose X_WQ{X_WP.rotation * E, X_WP.translation_m};
  const double lift_m = std::max(0.0, -least_gap_m(scene, X_WQ));
  const Inertia& M = scene.tool().solid.inertia;
  return M.mass_kg * lift_m * lift_m + 4.0 * E.vec().dot(M.H_kg_m2 * E.vec());
}

/// The optimum against one half-space by brute force: random rotations, the best refined by ever smaller
/// random steps.
double brute_force(const Scene& scene, const Pose& X_WP, RandomValues& random) {
  double best = std::numeric_limits<double>::infinity();
  Quaterniond best_E = Quaterniond::Identity();
  const auto try_rotation = [&](const Quaterniond& E) {
    const double T = energy_of_rotation(scene, X_WP, E);
    if (T >= best) return false;
    best = T;
    best_E = E;
    return true;
  };
  for (int i = 0; i < 3000; ++i) try_rotation(random.rotation(random.uniform(0.0, 2.0)));
  double step_rad = 0.2;
  for (int i = 0; i < 6000; ++i) step_rad *= try_rotation(best_E * random.rotation(step_rad)) ? 1.2 : 0.99;
  return best;
}

void check_consistent(const Scene& scene, const Pose& X_WP, const Projection& q, double residual = 1e-9) {
  CHECK(least_gap_m(scene, q.X_WQ) > -1e-12);
  CHECK(q.energy == Approx(energy(scene.tool().solid.inertia, X_WP, q.X_WQ)).epsilon(1e-12));
  CHECK(q.kkt_residual < residual);
  for (std::size_t i = 0; i < q.active.size(); ++i) CHECK(q.active[i].multiplier > -1e-12);
}

}  // namespace

TEST_CASE("the exact projection reproduces example 4.1 of the paper", "[projection]") {
  for (const double scale : {1.0, 10.0}) {
    const Scene scene(box(Vector3d::Constant(50.0 * scale)), {half_space(Vector3d::UnitY(), 0.0)});
    const Inertia& M = scene.tool().solid.inertia;
    CHECK(M.H_kg_m2.isApprox(2500.0 / 6.0 * scale * scale * Matrix3d::Identity(), 1e-12));
    const Pose X_WP{Quaterniond(Eigen::AngleAxisd(-0.2, Vector3d::UnitZ())), {0.0, 25.0 * scale, 0.0}};
    ExactProjection exact(M);
    const Projection q = exact.project_globally(X_WP, SceneContacts(scene));

    CHECK(q.status == ProjectionStatus::converged);
    CHECK(q.proven_global);
    CHECK(q.active.size() == 2);
    CHECK(std::abs(q.energy / (scale * scale) - 9.63154218539309) < 1e-12);
    CHECK(std::abs(q.X_WQ.translation_m.y() / scale - 27.0712157435851) < 1e-12);
    CHECK(std::abs(q.X_WQ.translation_m.x()) < 1e-12 * scale);
    const Vector6d xi_q = log(q.X_WQ);
    CHECK(std::abs(xi_q[5] - -0.0867146202807576) < 1e-14);
    CHECK(std::abs(xi_q[0] / scale - -1.1737351) < 5e-8);
    CHECK(std::abs(xi_q[1] / scale - 27.05425029) < 5e-9);
    const Vector6d eps = log(inverse(X_WP) * q.X_WQ);
    CHECK(std::abs(eps[0] / scale - -0.29606622) < 5e-9);
    CHECK(std::abs(eps[1] / scale - 2.05106566) < 5e-9);
    CHECK(std::abs(eps[5] - 0.11328538) < 5e-9);
  }
}

TEST_CASE("against a half-space brute force finds no closer pose", "[projection]") {
  RandomValues random(1);
  for (int i = 0; i < 60; ++i) {
    const OverlappingScene c = overlap_half_space(random, 0.05, 0.3);
    ExactProjection exact(c.scene.tool().solid.inertia);
    const Projection q = exact.project_globally(c.X_WP, SceneContacts(c.scene));
    INFO("case " << i);
    REQUIRE(q.status == ProjectionStatus::converged);
    check_consistent(c.scene, c.X_WP, q);
    CHECK(q.energy <= brute_force(c.scene, c.X_WP, random) * (1.0 + 1e-9));
  }
}

TEST_CASE("optimality is proven in nearly every case, and no proof is wrong", "[projection]") {
  RandomValues random(2);
  int proven = 0;
  constexpr int kCases = 300;
  for (int i = 0; i < kCases; ++i) {
    const OverlappingScene c = overlap_half_space(random, 0.05, 0.3);
    ExactProjection exact(c.scene.tool().solid.inertia);
    const Projection q = exact.project_globally(c.X_WP, SceneContacts(c.scene));
    if (!q.proven_global) continue;
    ++proven;
    for (int start = 0; start < 5; ++start) {
      const Pose elsewhere{c.X_WP.rotation * random.rotation(random.uniform(0.0, 2.5)), c.X_WP.translation_m};
      const Projection other = exact.project(c.X_WP, SceneContacts(c.scene), elsewhere);
      CHECK(other.energy >= q.energy * (1.0 - 1e-9));
    }
  }
  CHECK(proven >= kCases * 8 / 10);
}

TEST_CASE("an admissible pose is its own projection, touching or not", "[projection]") {
  const Scene scene(box({1.0, 1.0, 1.0}), {half_space(Vector3d::UnitZ(), 0.0)});
  ExactProjection exact(scene.tool().solid.inertia);
  for (const double height_m : {0.5, 0.7}) {
    const Pose X_WP{Quaterniond::Identity(), {0.3, -0.2, height_m}};
    const Projection q = exact.project_globally(X_WP, SceneContacts(scene));
    CHECK(q.status == ProjectionStatus::free);
    CHECK(q.energy == 0.0);
    CHECK(q.X_WQ.translation_m == X_WP.translation_m);
    CHECK(q.active.size() == 0);
  }
}

TEST_CASE("a face pressed flat moves out along the normal, for any number of vertices", "[projection]") {
  for (const int corners : {4, 12, 40}) {
    std::vector<Vector3d> prism;
    for (int i = 0; i < corners; ++i) {
      const double angle = 2.0 * M_PI * i / corners;
      for (const double z : {-0.3, 0.3}) prism.emplace_back(std::cos(angle), std::sin(angle), z);
    }
    const Scene scene(tool_of(prism), {half_space(Vector3d::UnitZ(), 0.0)});
    ExactProjection exact(scene.tool().solid.inertia);
    const Pose X_WP{Quaterniond::Identity(), {0.0, 0.0, 0.25}};
    const Projection q = exact.project_globally(X_WP, SceneContacts(scene));
    CHECK(q.status == ProjectionStatus::converged);
    CHECK(std::abs(q.X_WQ.translation_m.z() - 0.3) < 1e-14);
    CHECK(q.X_WQ.rotation.vec().norm() < 1e-12);
    double carried = 0.0;
    for (std::size_t i = 0; i < q.active.size(); ++i) carried += q.active[i].multiplier;
    CHECK(carried == Approx(2.0 * 0.05));  // 2 m s = sum of multipliers times normals
  }
}

TEST_CASE("several half-spaces together: a box pressed into a corner", "[projection]") {
  RandomValues random(3);
  for (int i = 0; i < 50; ++i) {
    const std::vector<HalfSpaceSettings> room = {half_space(Vector3d::UnitX(), 0.0),
                                                 half_space(Vector3d::UnitY(), 0.0),
                                                 half_space(Vector3d::UnitZ(), 0.0)};
    const Scene scene(box({1.0, 0.8, 0.6}), room);
    ExactProjection exact(scene.tool().solid.inertia);
    const Pose X_WP{random.rotation(0.3), {0.4, 0.35, 0.25}};
    const Projection q = exact.project_globally(X_WP, SceneContacts(scene));
    REQUIRE(q.status == ProjectionStatus::converged);
    check_consistent(scene, X_WP, q);
    const Projection lifted = exact.translate(X_WP, SceneContacts(scene), X_WP);
    CHECK(q.energy <= lifted.energy * (1.0 + 1e-12));
  }
}

TEST_CASE("the projection rotates a body to fit it into a narrow slot", "[projection]") {
  // A plate of 1 x 1 x 0.2 lies across a slot of width 0.5: only a rotation about x makes it admissible.
  const Scene scene(box({1.0, 1.0, 0.2}),
                    {half_space(Vector3d::UnitY(), -0.25), half_space(-Vector3d::UnitY(), -0.25)});
  ExactProjection exact(scene.tool().solid.inertia);
  const Pose X_WP{Quaterniond(Eigen::AngleAxisd(0.3, Vector3d::UnitX())), Vector3d::Zero()};
  CHECK(exact.translate(X_WP, SceneContacts(scene), X_WP).status == ProjectionStatus::infeasible);
  const Projection q = exact.project_globally(X_WP, SceneContacts(scene));
  REQUIRE(q.status == ProjectionStatus::converged);
  check_consistent(scene, X_WP, q);
}

TEST_CASE("obstacles that leave no room are reported as infeasible", "[projection]") {
  const Scene scene(box({1.0, 1.0, 1.0}),
                    {half_space(Vector3d::UnitZ(), 0.0), half_space(-Vector3d::UnitZ(), -0.5)});
  ExactProjection exact(scene.tool().solid.inertia);
  const Pose X_WP{Quaterniond::Identity(), {0.0, 0.0, 0.25}};
  CHECK(exact.project_globally(X_WP, SceneContacts(scene)).status == ProjectionStatus::infeasible);
  CHECK(exact.project(X_WP, SceneContacts(scene), X_WP).status == ProjectionStatus::infeasible);
}

TEST_CASE("the unit of length changes nothing: 1e-4 m and 1e4 m", "[projection]") {
  RandomValues random(4);
  for (int i = 0; i < 40; ++i) {
    const OverlappingScene c = overlap_half_space(random, 0.05, 0.3);
    ExactProjection exact(c.scene.tool().solid.inertia);
    const Projection q = exact.project_globally(c.X_WP, SceneContacts(c.scene));
    for (const double scale : {1e-4, 1e4}) {
      std::vector<Vector3d> points = c.scene.tool().hull.vertices_T_m;
      for (Vector3d& p : points) p *= scale;
      const HalfSpaceSettings& h = c.scene.half_spaces()[0];
      const Scene scaled(tool_of(points), {half_space(h.normal_W, scale * h.offset_m)});
      const Pose X_WP{c.X_WP.rotation, scale * c.X_WP.translation_m};
      ExactProjection other(scaled.tool().solid.inertia);
      const Projection r = other.project_globally(X_WP, SceneContacts(scaled));
      CHECK(r.energy / (scale * scale) == Approx(q.energy).epsilon(1e-9));
      CHECK(r.X_WQ.rotation.angularDistance(q.X_WQ.rotation) < 1e-7);
    }
  }
}

TEST_CASE("the projection is invariant under motions of the world and of the mesh frame", "[projection]") {
  RandomValues random(5);
  for (int i = 0; i < 40; ++i) {
    const OverlappingScene c = overlap_half_space(random, 0.05, 0.3);
    const Inertia& M = c.scene.tool().solid.inertia;
    ExactProjection exact(M);
    const Projection q = exact.project_globally(c.X_WP, SceneContacts(c.scene));
    const Pose a = random.pose(3.0);
    const Scene elsewhere(c.scene.tool(), transformed(a, c.scene.half_spaces()));
    const Projection r = exact.project_globally(a * c.X_WP, SceneContacts(elsewhere));
    CHECK(r.energy == Approx(q.energy).epsilon(1e-10));
    const Pose difference = inverse(a * q.X_WQ) * r.X_WQ;
    CHECK(log(difference).norm() < 1e-7);
  }
}

TEST_CASE("the mass scales the energy and keeps the projection", "[projection]") {
  RandomValues random(6);
  const OverlappingScene c = overlap_half_space(random, 0.05, 0.3);
  const Inertia& M = c.scene.tool().solid.inertia;
  ExactProjection light(M);
  ExactProjection heavy({7.0 * M.mass_kg, 7.0 * M.H_kg_m2});
  const Projection q = light.project_globally(c.X_WP, SceneContacts(c.scene));
  const Projection r = heavy.project_globally(c.X_WP, SceneContacts(c.scene));
  CHECK(r.energy == Approx(7.0 * q.energy).epsilon(1e-12));
  CHECK(log(inverse(q.X_WQ) * r.X_WQ).norm() < 1e-9);
}

TEST_CASE("needles with an inertia of 1 to 1e6 converge like other bodies", "[projection]") {
  RandomValues random(7);
  for (int i = 0; i < 60; ++i) {
    std::vector<Vector3d> points;
    for (int k = 0; k < 12; ++k) points.push_back(random.unit<3>().cwiseProduct(Vector3d(1.0, 1e-3, 1e-3)));
    const Vector3d n = random.unit<3>();
    const Scene scene(tool_of(points), {half_space(n, 0.0)});
    Pose X_WP{random.rotation(), Vector3d::Zero()};
    X_WP.translation_m -= (least_gap_m(scene, X_WP) + random.uniform(0.01, 0.1)) * n;
    ExactProjection exact(scene.tool().solid.inertia);
    const Projection q = exact.project_globally(X_WP, SceneContacts(scene));
    INFO("case " << i);
    REQUIRE(q.status == ProjectionStatus::converged);
    check_consistent(scene, X_WP, q, 1e-7);  // a roll has the weight 1e-6 here, which limits its accuracy
    CHECK(q.energy <= brute_force(scene, X_WP, random) * (1.0 + 1e-9));
  }
}

TEST_CASE("a proxy is admissible at every step and converges to the optimum", "[projection]") {
  RandomValues random(8);
  for (int body = 0; body < 10; ++body) {
    const OverlappingScene c = overlap_half_space(random, 0.05, 0.3);
    ExactProjection exact(c.scene.tool().solid.inertia);
    const Vector3d& n = c.scene.half_spaces()[0].normal_W;
    Pose X_WQ =
        exact.project_globally({c.X_WP.rotation, c.X_WP.translation_m + n}, SceneContacts(c.scene)).X_WQ;
    Pose X_WP = X_WQ;
    for (int step = 0; step < 500; ++step) {
      X_WP = Pose{(X_WP.rotation * random.rotation(0.02)).normalized(),
                  X_WP.translation_m + 0.01 * random.vector<3>() - 0.004 * n};
      const Projection q = exact.project(X_WP, SceneContacts(c.scene), X_WQ);
      REQUIRE((q.status == ProjectionStatus::free || q.status == ProjectionStatus::converged));
      X_WQ = q.X_WQ;
      REQUIRE(least_gap_m(c.scene, X_WQ) > -1e-12);
      if (q.status == ProjectionStatus::converged) REQUIRE(q.kkt_residual < 1e-8);
    }
    const Projection again = exact.project(X_WP, SceneContacts(c.scene), X_WQ);
    CHECK(again.energy ==
          Approx(exact.project(X_WP, SceneContacts(c.scene), again.X_WQ).energy).epsilon(1e-12));
  }
}

// The proxy among meshes uses short steps, each with less energy, to the result of project().
TEST_CASE("with a step limit the energy decreases in every step to the optimum", "[projection]") {
  RandomValues random(10);
  for (int body = 0; body < 20; ++body) {
    const OverlappingScene c = overlap_half_space(random, 0.05, 0.3);
    const Inertia M = c.scene.tool().solid.inertia;
    ExactProjection exact(M);
    const Projection whole = exact.project(c.X_WP, SceneContacts(c.scene), c.X_WP);
    std::vector<ActiveContact> known;
    const auto& floor = c.scene.half_spaces()[0];
    for (std::size_t v = 0; v < c.scene.tool().hull.vertices_T_m.size(); ++v) {
      Contact contact;
      contact.p_TCa_m = c.scene.tool().hull.vertices_T_m[v];
      contact.n_W = floor.normal_W;
      contact.p_WCb_m = floor.offset_m * floor.normal_W;
      contact.offset_m = floor.offset_m;
      contact.tool_feature = static_cast<std::uint32_t>(v);
      known.push_back({contact, 0.0});
    }
    const ExactProjection::StepLimit leash = {0.02, 0.03};
    Pose X_WQ = {whole.X_WQ.rotation * random.rotation(0.3), whole.X_WQ.translation_m + 3.0 * floor.normal_W};
    double T = energy(M, c.X_WP, X_WQ);
    Projection q;
    for (int step = 0; step < 1000; ++step) {
      q = exact.step(c.X_WP, X_WQ, known, leash);
      REQUIRE((q.status == ProjectionStatus::converged || q.status == ProjectionStatus::budget_spent));
      CHECK((q.X_WQ.translation_m - X_WQ.translation_m).norm() <= leash.translation_m * (1.0 + 1e-9));
      CHECK(q.X_WQ.rotation.angularDistance(X_WQ.rotation) <= leash.rotation_rad + 1e-9);
      CHECK(least_gap_m(c.scene, q.X_WQ) > -1e-12);
      CHECK(energy(M, c.X_WP, q.X_WQ) <= T * (1.0 + 1e-12));
      T = energy(M, c.X_WP, q.X_WQ);
      X_WQ = q.X_WQ;
      if (q.status == ProjectionStatus::converged) break;
    }
    CHECK(q.status == ProjectionStatus::converged);
    CHECK(q.kkt_residual < 1e-8);
  }
}

// A peg of 0.1 kg jammed in its hole, a few micrometres from the optimum. Steps below rounding once used all
// iterations of every sweep of a tick.
TEST_CASE("steps within rounding count as converged", "[projection]") {
  Inertia M;
  M.mass_kg = 0.1;
  M.H_kg_m2 = Vector3d(3.2385630792490916e-05, 3.2385630792490916e-05, 4.7712615571153614e-06).asDiagonal();
  const Pose X_WP = {
      {0.99822427505494826, 0.00054135875248338954, 0.00022088457081877641, 0.059564711295619889},
      {0.00012910555943592143, 8.7569800207081236e-05, 0.0067797181045571491}};
  const Pose X_WT = {
      {0.99822085862906185, 0.00043937281808227694, 0.00035483276671892475, 0.059622130480997057},
      {0.00011041140835353479, 7.0032908039778239e-05, 0.0067797300022461949}};
  Contact on_face;
  on_face.p_TCa_m = {0.0096106140468828743, 0.0019116699920376679, 0.029999999999999999};
  on_face.p_WCb_m = {0.0094502496392558158, 0.0028741318137598987, -1.6047026989022393e-05};
  on_face.n_W = {-0.95672987638471518, -0.29097303032816207, 0.0016245782633905709};
  on_face.offset_m = -0.0098776570822334507;
  Contact edges;
  edges.kind = ContactKind::edge_edge;
  edges.p_TCa_m = {0.0090687523687773778, 0.0037564002249507226, -0.012580645161290323};
  edges.p_WCb_m = {0.0092228253057413077, 0.0038202193250358365, -0.0038709677419354852};
  edges.d_T = {0.00087203711252448039, 0.00036120959889981069, 0.99999955453935074};
  edges.d_W = {-0.4652742741224028, 0.88516656615569866, 0.0};
  edges.n_W = {-0.88516589822310499, -0.46527392303384546, 0.0012284818186439515};
  Contact other_edges = edges;
  other_edges.p_TCa_m = {0.0069386711296257064, 0.0069386711296257047, -0.0048387096774193542};
  other_edges.p_WCb_m = {0.0070617127911089782, 0.0070617127911089764, 0.0038709677419354804};
  other_edges.d_T = {0.00017067915382291445, 0.00017067915382291445, 0.99999997086862613};
  other_edges.d_W = {-0.77465953089864248, 0.63237853473050087, 0.0};
  other_edges.n_W = {-0.63237853289367196, -0.77465952864853926, 7.6218568983923827e-05};
  const std::vector<ActiveContact> known = {{on_face, 1.502097730081543e-07},
                                            {edges, 1.5189875077011699e-06},
                                            {other_edges, 3.5588875652134989e-06}};
  constexpr double kClearance_m = 1e-9;
  ExactProjection exact(M, {}, kClearance_m);
  const Projection q = exact.step(X_WP, X_WT, known, {0.01, 0.05});
  CHECK(q.status == ProjectionStatus::converged);
  CHECK(q.iterations < 10);
  CHECK(q.kkt_residual < 1e-8);
  for (const ActiveContact& active : known) CHECK(gap_m(active.contact, q.X_WQ) > 0.99 * kClearance_m);
}

TEST_CASE("at the iteration limit the result is admissible and no worse than translation", "[projection]") {
  RandomValues random(9);
  for (int i = 0; i < 50; ++i) {
    const OverlappingScene c = overlap_half_space(random, 0.05, 0.3);
    ExactProjection hurried(c.scene.tool().solid.inertia, {1, 24});
    const Projection q = hurried.project(c.X_WP, SceneContacts(c.scene), c.X_WP);
    REQUIRE(q.status != ProjectionStatus::infeasible);
    CHECK(least_gap_m(c.scene, q.X_WQ) > -1e-12);
    CHECK(q.energy <= hurried.translate(c.X_WP, SceneContacts(c.scene), c.X_WP).energy * (1.0 + 1e-9));
  }
}

TEST_CASE("balance finds the multipliers of an optimum and the pull that no contact balances",
          "[projection]") {
  RandomValues random(17);
  for (int i = 0; i < 60; ++i) {
    const OverlappingScene c = overlap_half_space(random, 0.05, 0.3);
    ExactProjection exact(c.scene.tool().solid.inertia);
    const Projection q = exact.project_globally(c.X_WP, SceneContacts(c.scene));
    REQUIRE(q.status == ProjectionStatus::converged);
    Projection again = q;
    again.active.clear();
    for (const ActiveContact& active : q.active) again.active.add({active.contact, 0.0});
    exact.balance(c.X_WP, again);
    CHECK(again.kkt_residual < 1e-9);
    REQUIRE(again.active.size() == q.active.size());
    double load = 0.0, same_load = 0.0;
    for (std::size_t k = 0; k < q.active.size(); ++k) {
      CHECK(again.active[k].multiplier >= 0.0);
      load += q.active[k].multiplier;
      same_load += again.active[k].multiplier;
    }
    CHECK(same_load == Approx(load).epsilon(1e-8));  // all normals are equal, so the sum is unique
    // Without its contacts nothing balances the pull. Contacts that do not touch do not count.
    Projection none = q;
    none.active.clear();
    exact.balance(c.X_WP, none);
    CHECK(none.kkt_residual == Approx(1.0));
    Projection apart = again;
    apart.X_WQ.translation_m += 1e-6 * c.scene.half_spaces()[0].normal_W;
    exact.balance(c.X_WP, apart);
    CHECK(apart.kkt_residual == Approx(1.0));
    for (const ActiveContact& active : apart.active) CHECK(active.multiplier == 0.0);
    // A sideways displacement along the plane is not balanced, the normal part is.
    Projection beside = again;
    const Vector3d along = c.scene.half_spaces()[0].normal_W.unitOrthogonal();
    beside.X_WQ.translation_m += 0.1 * along;
    exact.balance(c.X_WP, beside);
    CHECK(beside.kkt_residual > 1e-3);
    CHECK(beside.kkt_residual < 1.0);
  }
}

}  // namespace wrenchd::test_projection
