// SPDX-License-Identifier: GPL-3.0-or-later
// Couples a robot arm in MuJoCo with the hand, in both directions: a spring and a damper connect the tip of
// the arm with the handle. The arm swings, the hand feels its pull, and the hand moves the arm. If this
// program dies, the force on the hand fades out.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>

#include <mujoco/mujoco.h>
#include <wrenchd/client.hpp>

namespace {

using Vector = std::array<double, 3>;

/// Three joints with position servos, soft enough for a hand to move them.
constexpr const char* kArm = R"(<mujoco>
  <option timestep='0.001' gravity='0 0 0'/>
  <worldbody>
    <body pos='-0.25 0 0.07'>
      <joint name='yaw' axis='0 0 1' damping='0.05'/>
      <geom type='capsule' fromto='0 0 0 0.14 0 0' size='0.01' mass='0.1'/>
      <body pos='0.14 0 0'>
        <joint name='shoulder' axis='0 1 0' damping='0.05'/>
        <geom type='capsule' fromto='0 0 0 0.11 0 0' size='0.008' mass='0.05'/>
        <body name='tip' pos='0.11 0 0'>
          <joint name='slide' type='slide' axis='1 0 0' damping='2'/>
          <geom type='sphere' size='0.01' mass='0.05'/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position joint='yaw' kp='3'/>
    <position joint='shoulder' kp='3'/>
    <position joint='slide' kp='60'/>
  </actuator>
</mujoco>)";

constexpr double kSpring_N_per_m = 150.0, kDamper_N_s_per_m = 1.5;
constexpr double kMaxForce_N = 4.0;
constexpr double kSwing_rad = 0.12, kSwing_Hz = 0.5;
constexpr auto kCycle = std::chrono::milliseconds(2);
constexpr auto kExpiry = std::chrono::milliseconds(50);
/// Energy that the account needs in reserve while the wrench acts. It comes back when the wrench ends.
constexpr double kReserve_J = 0.2;

class Arm {
 public:
  Arm() {
    const auto files = std::make_unique<mjVFS>();
    mj_defaultVFS(files.get());
    std::array<char, 1000> error{};
    if (mj_makeEmptyFileVFS(files.get(), "arm.xml", static_cast<int>(std::strlen(kArm))) == 0) {
      std::memcpy(files->filedata[mj_findFileVFS(files.get(), "arm.xml")], kArm, std::strlen(kArm));
      model_.reset(mj_loadXML("arm.xml", files.get(), error.data(), static_cast<int>(error.size())));
    }
    mj_deleteVFS(files.get());
    if (!model_) throw std::runtime_error(std::string("MuJoCo rejects the arm: ") + error.data());
    data_.reset(mj_makeData(model_.get()));
    tip_ = mj_name2id(model_.get(), mjOBJ_BODY, "tip");
    mj_forward(model_.get(), data_.get());
  }

  /// Advances by one step of 1 ms with this force on the tip.
  void step(const Vector& force_N) {
    data_->ctrl[0] = kSwing_rad * std::sin(2.0 * mjPI * kSwing_Hz * data_->time);
    std::copy(force_N.begin(), force_N.end(), data_->xfrc_applied + 6 * tip_);
    mj_step(model_.get(), data_.get());
  }
  Vector tip_m() const {
    const mjtNum* p = data_->xpos + 3 * tip_;
    return {p[0], p[1], p[2]};
  }

 private:
  std::unique_ptr<mjModel, decltype(&mj_deleteModel)> model_{nullptr, mj_deleteModel};
  std::unique_ptr<mjData, decltype(&mj_deleteData)> data_{nullptr, mj_deleteData};
  int tip_ = 0;
};

Vector handle_m(const wrenchd::TickState& tick) {
  const auto X_BH = tick.numbers<7>("X_BH");
  return {X_BH[0], X_BH[1], X_BH[2]};
}

double dot(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// Couples arm and hand for this time, or for ever if it is negative.
void couple(wrenchd::Client& client, double seconds) {
  const wrenchd::StateReader reader = client.open_state();
  wrenchd::TickState tick;
  while (!reader.latest(tick)) std::this_thread::sleep_for(kCycle);
  Arm arm;
  // The spring is at rest at the start, wherever the handle is.
  Vector handle = handle_m(tick), tip = arm.tip_m(), tip_before = tip, rest{};
  for (int i = 0; i < 3; ++i) rest[i] = tip[i] - handle[i];
  double energy_J = kReserve_J, declared_J = 0.0, time_s = 0.0, printed_s = 0.0;
  const double cycle_s = std::chrono::duration<double>(kCycle).count();
  for (auto due = std::chrono::steady_clock::now(); seconds < 0.0 || time_s < seconds; time_s += cycle_s) {
    reader.latest(tick);
    const Vector handle_before = handle;
    handle = handle_m(tick);
    Vector on_hand{};
    for (int i = 0; i < 3; ++i) {
      const double stretch_m = tip[i] - handle[i] - rest[i];
      const double rate_m_per_s = (tip[i] - tip_before[i] - handle[i] + handle_before[i]) / cycle_s;
      on_hand[i] = kSpring_N_per_m * stretch_m + kDamper_N_s_per_m * rate_m_per_s;
    }
    if (const double length = std::sqrt(dot(on_hand, on_hand)); length > kMaxForce_N)
      for (double& x : on_hand) x *= kMaxForce_N / length;
    client.set_wrench(on_hand, {}, std::clamp(energy_J, 0.0, 1.0), kExpiry);
    declared_J += energy_J;
    tip_before = tip;
    const Vector on_tip = {-on_hand[0], -on_hand[1], -on_hand[2]};
    for (int i = 0; i < 2; ++i) arm.step(on_tip);
    tip = arm.tip_m();
    // What the arm does by pulling the spring may reach the hand.
    energy_J =
        std::max(dot(on_hand, {tip[0] - tip_before[0], tip[1] - tip_before[1], tip[2] - tip_before[2]}), 0.0);
    if (time_s >= printed_s) {
      printed_s += 0.5;
      std::printf(
          "%5.1f s  arm %+6.1f %+6.1f %+6.1f mm  handle %+6.1f %+6.1f %+6.1f mm  on the hand %+5.2f %+5.2f "
          "%+5.2f N, declared "
          "%.3f J\n",
          time_s, 1e3 * tip[0], 1e3 * tip[1], 1e3 * tip[2], 1e3 * handle[0], 1e3 * handle[1], 1e3 * handle[2],
          tick.number("F_external", 0), tick.number("F_external", 1), tick.number("F_external", 2),
          declared_J);
      std::fflush(stdout);
    }
    std::this_thread::sleep_until(due += kCycle);
  }
}

}  // namespace

int main(int argc, char** argv) {
  double seconds = -1.0;
  if (argc > 1) {
    char* end = nullptr;
    seconds = std::strtod(argv[1], &end);
    if (argc > 2 || *end != '\0' || !(seconds > 0.0)) {
      std::fprintf(stderr, "usage: %s [SECONDS]; without SECONDS until Ctrl-C\n", argv[0]);
      return 2;
    }
  }
  try {
    wrenchd::Client client;
    couple(client, seconds);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
