// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/proxy_initializer.hpp"

#include <chrono>

namespace wrenchd {
namespace {

/// How often the thread looks for a question. To wake it the servo thread would have to call the kernel; and
/// beside the tenth of a second of calm that goes before any force, nobody feels this.
constexpr auto kPause = std::chrono::milliseconds(5);

/// Whatever the method of rendering is, the way back is the exact one; and it is clear of what it touches, so
/// that a proxy can follow from it.
constexpr PenetrationDepth::Options kNearest = {Method::exact, 47, Proxy::kClearance_m};

PlacementAnswer sought(PenetrationDepth& penetration, const PlacementQuestion& question,
                       const std::stop_token& stop) noexcept {
  const Projection q = penetration.query(question.X_WP, stop, question.scene_time_s).projection;
  return {question.number, q.status != ProjectionStatus::infeasible, q.X_WQ, question.scene_time_s};
}

}  // namespace

const char* name(Placing placing) noexcept {
  switch (placing) {
    case Placing::following:
      return "following";
    case Placing::seeking:
      return "placing";
    case Placing::placed:
      return "placed";
    case Placing::nowhere:
      return "no place";
  }
  return "unknown";
}

PlacerThread::PlacerThread(const Scene& scene)
    : penetration_(scene, kNearest), thread_([this](const std::stop_token& stop) { run(stop); }) {}

void PlacerThread::run(const std::stop_token& stop) noexcept {
  PlacementQuestion question;
  while (!stop.stop_requested()) {
    if (asked_.read(question))
      answered_.write(sought(penetration_, question, stop));
    else
      std::this_thread::sleep_for(kPause);
  }
}

std::shared_ptr<Placer> make_placer(std::shared_ptr<const Scene> scene, PlaceIn place_in) {
  const Scene& its = *scene;
  const auto with_scene = [&scene](auto placer) {
    // The scene goes after the placer that uses it.
    return std::shared_ptr<Placer>(placer.release(), [scene = std::move(scene)](Placer* p) { delete p; });
  };
  if (place_in == PlaceIn::step) return with_scene(std::make_unique<PlacerInStep>(its));
  return with_scene(std::make_unique<PlacerThread>(its));
}

PlacerInStep::PlacerInStep(const Scene& scene) : penetration_(scene, kNearest) {}

void PlacerInStep::ask(const PlacementQuestion& question) noexcept {
  question_ = question;
  asked_ = true;
}

bool PlacerInStep::answer(PlacementAnswer& answer) noexcept {
  if (!asked_) return false;
  asked_ = false;
  answer = sought(penetration_, question_, {});
  return true;
}

}  // namespace wrenchd
