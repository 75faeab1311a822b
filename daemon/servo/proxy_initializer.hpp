// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <thread>

#include "collision/penetration.hpp"
#include "collision/scene.hpp"
#include "core/latest_value.hpp"
#include "core/pose.hpp"

namespace wrenchd {

/// Where the proxy stands, as the servo loop knows it. While it is not following there is no contact force.
enum class Placing : std::uint8_t {
  following,  ///< q is this tick's, and follows the hand
  seeking,    ///< there is no q: the admissible pose nearest to p is being looked for
  placed,     ///< it was found and is q; the next fresh sample is followed from there
  nowhere,    ///< there is no q, and none was found: asked for again in a moment
};

/// "following", "placing", "placed", "no place".
const char* name(Placing placing) noexcept;

/// Which admissible pose is nearest to p, with the obstacles where they stand at that scene time?
struct PlacementQuestion {
  std::uint32_t number = 0;  ///< comes back with the answer
  Pose X_WP;
  double scene_time_s = 0.0;  ///< comes back as well: obstacles that move have gone on meanwhile
};

struct PlacementAnswer {
  std::uint32_t number = 0;
  bool found = false;         ///< false: no admissible pose was found, and X_WQ is not set
  Pose X_WQ;                  ///< admissible
  double scene_time_s = 0.0;  ///< at this scene time: the question's
};

/// Looks for the admissible pose from which the proxy may follow the hand, where there is no last one: at the
/// start, after arming, after the tool or the scene was changed. One question at a time; a new one takes the
/// place of the last.
class Placer {
 public:
  virtual ~Placer() = default;

  /// Hands the question over. RT safe: never waits.
  virtual void ask(const PlacementQuestion& question) noexcept = 0;
  /// Takes the newest answer, if there is one that was not taken yet. RT safe: never waits.
  virtual bool answer(PlacementAnswer& answer) noexcept = 0;
};

/// Where the proxy's place is looked for when it is not known.
enum class PlaceIn : std::uint8_t {
  thread,  ///< beside the servo loop
  step,    ///< in the tick: virtual time, every run the same
};

/// Looks on a thread of its own, with the priority of the thread that makes it. For a search of any length.
class PlacerThread final : public Placer {
 public:
  /// Starts at once. The scene is kept by reference and must outlive this.
  explicit PlacerThread(const Scene& scene);
  /// Ends a search that is under way, which takes a few milliseconds (Placement::nearest()), and joins.
  ~PlacerThread() override = default;

  void ask(const PlacementQuestion& question) noexcept override { asked_.write(question); }
  bool answer(PlacementAnswer& answer) noexcept override { return answered_.read(answer); }

 private:
  void run(const std::stop_token& stop) noexcept;

  PenetrationDepth penetration_;  ///< belongs to the thread
  LatestValue<PlacementQuestion> asked_;
  LatestValue<PlacementAnswer> answered_;
  std::jthread thread_;  ///< the last: it uses all of the above
};

/// Looks when the answer is asked for: in virtual time, where a search takes none and every run is to be the
/// same. Neither allocates nor locks, but takes its time.
class PlacerInStep final : public Placer {
 public:
  /// The scene is kept by reference and must outlive this.
  explicit PlacerInStep(const Scene& scene);

  void ask(const PlacementQuestion& question) noexcept override;
  bool answer(PlacementAnswer& answer) noexcept override;

 private:
  PenetrationDepth penetration_;
  PlacementQuestion question_;
  bool asked_ = false;
};

/// One that keeps its scene.
std::shared_ptr<Placer> make_placer(std::shared_ptr<const Scene> scene, PlaceIn place_in);

}  // namespace wrenchd
