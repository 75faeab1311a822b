// SPDX-License-Identifier: GPL-3.0-or-later
#include <stdexcept>
#include <vector>

#include <catch2/catch.hpp>

#include "devices/conformance/direction_pulses.hpp"

namespace wrenchd::test_direction_pulses {

// DirectionPulses against a free body whose motion is integrated here: M a = P F, with the mass matrix M and
// the mistake P of a maker.

namespace {

using Catch::Contains;

/// Body with unequal masses along its axes. What is stated here holds for the rotation as well.
struct FreeBody final : PulsedDevice {
  Matrix3d inverse_mass = Matrix3d::Identity() / 0.2;
  Matrix3d mistake = Matrix3d::Identity();
  Vector3d drift_m_per_s = Vector3d::Zero();  ///< steady motion of the hand
  double most_N = 0.0;
  bool silent = false;

  std::vector<MotionSample> drive(Duration time, const Wrench& F) override {
    std::vector<MotionSample> samples;
    most_N = std::max({most_N, F.force_N.norm(), F.torque_Nm.norm()});
    for (Duration spent{}; spent < time; spent += std::chrono::milliseconds(1)) {
      v_ += 1e-3 * inverse_mass * mistake * F.force_N;
      w_ += 1e-3 * 1e3 * inverse_mass * mistake * F.torque_Nm;
      X_.translation_m += 1e-3 * (v_ + drift_m_per_s);
      X_.rotation = (rotation_from(1e-3 * w_) * X_.rotation).normalized();
      t_s_ += 1e-3;
      if (!silent) samples.push_back({t_s_, X_, {v_, w_}});
    }
    return samples;
  }

 private:
  Pose X_;
  Vector3d v_ = Vector3d::Zero(), w_ = Vector3d::Zero();
  double t_s_ = 0.0;
};

RuleFinding force_of(FreeBody body, DofMask axes = kLinearDofs) {
  return DirectionPulses(body, kBriefPulses).judge_force(0.25, axes, 1e-6);
}

RuleFinding torque_of(FreeBody body) {
  return DirectionPulses(body, kBriefPulses).judge_torque(0.01, kAngularDofs, 1e-6);
}

Matrix3d columns(const Vector3d& x, const Vector3d& y, const Vector3d& z) {
  Matrix3d m;
  m << x, y, z;
  return m;
}
const Vector3d kX = Vector3d::UnitX(), kY = Vector3d::UnitY(), kZ = Vector3d::UnitZ();

/// An arm that is 40 times heavier along one direction, (1, 1, 0), than across it. A force along x moves it
/// mostly along x - y.
Matrix3d unequal_arm() {
  const Vector3d heavy = Vector3d(1.0, 1.0, 0.2).normalized();
  return (Matrix3d::Identity() - (1.0 - 1.0 / 40.0) * heavy * heavy.transpose()) / 0.2;
}

}  // namespace

TEST_CASE("pulses find a right force and torque right", "[direction_pulses]") {
  FreeBody body;
  CHECK(force_of(body).judgement == Judgement::pass);
  CHECK(torque_of(body).judgement == Judgement::pass);
  body.drift_m_per_s = {0.02, -0.01, 0.03};
  CHECK(force_of(body).judgement == Judgement::pass);
}

TEST_CASE("pulses show an inverted axis, and name it", "[direction_pulses]") {
  for (int axis = 0; axis < 3; ++axis) {
    FreeBody body;
    body.mistake(axis, axis) = -1.0;
    const std::string inverted = std::string(kAxisNames[axis]) + ": -";
    for (const RuleFinding& finding : {force_of(body), torque_of(body)}) {
      CHECK(finding.judgement == Judgement::fail);
      CHECK_THAT(finding.seen, Contains(inverted) && Contains("the sign is inverted"));
    }
  }
}

TEST_CASE("pulses show swapped axes and a turned frame", "[direction_pulses]") {
  FreeBody body;
  body.mistake = columns(kY, kX, kZ);
  CHECK(force_of(body).judgement == Judgement::fail);
  CHECK_THAT(force_of(body).seen, Contains("x moves the handle along y"));
  body.mistake = columns(kY, -kX, kZ);
  CHECK(force_of(body).judgement == Judgement::fail);
  body.mistake = columns(kZ, kX, kY);
  CHECK(torque_of(body).judgement == Judgement::fail);
}

TEST_CASE("an arm with unequal masses is right although a force moves it mostly across",
          "[direction_pulses]") {
  FreeBody body;
  body.inverse_mass = columns({0.6, -0.7, 0.0}, {-0.7, 1.0, 0.0}, kZ) / 0.2;
  CHECK(force_of(body).judgement == Judgement::pass);
  body.inverse_mass = unequal_arm();
  CHECK(force_of(body).judgement == Judgement::pass);
  for (const Matrix3d& mistake :
       {columns(-kX, kY, kZ), columns(kX, kY, -kZ), columns(kY, -kX, kZ), columns(-kY, kX, kZ)}) {
    body.mistake = mistake;
    CHECK(force_of(body).judgement == Judgement::fail);
  }
}

TEST_CASE("only the axes that are driven get pulses", "[direction_pulses]") {
  FreeBody body;
  body.mistake(2, 2) = -1.0;
  CHECK(force_of(body, 0b011).judgement == Judgement::pass);
  CHECK(force_of(body, 0b111).judgement == Judgement::fail);
}

TEST_CASE("a handle that does not move, or moves too far, is not judged", "[direction_pulses]") {
  FreeBody body;
  body.inverse_mass.setZero();
  CHECK(force_of(body).judgement == Judgement::not_judged);
  CHECK_THAT(force_of(body).seen, Contains("direction of x y z"));
  body.inverse_mass = Matrix3d::Identity() / 1e-3;
  CHECK(force_of(body).judgement == Judgement::not_judged);
  CHECK_THAT(force_of(body).seen, Contains("too far"));
}

TEST_CASE("pulses stop with an error if the device falls silent", "[direction_pulses]") {
  FreeBody body;
  body.silent = true;
  CHECK_THROWS_WITH(force_of(body), Contains("stopped sending valid reports"));
}

TEST_CASE("a pulse is at most a twentieth of the limits of the profile, and at most half a newton",
          "[direction_pulses]") {
  DeviceProfile profile;
  profile.max_force_N = 5.0, profile.max_torque_Nm = 0.1;
  CHECK(pulse_force_N(profile) == Approx(0.25));
  CHECK(pulse_torque_Nm(profile) == Approx(0.005));
  profile.max_force_N = 40.0, profile.max_torque_Nm = 4.0;
  CHECK(pulse_force_N(profile) == kMaxPulse_N);
  CHECK(pulse_torque_Nm(profile) == kMaxPulse_Nm);
}

}  // namespace wrenchd::test_direction_pulses
