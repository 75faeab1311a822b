// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "tests/support/shipped_config.hpp"

namespace wrenchd::test {

/// A hand with an open simulated device, on a clock that another hand may share.
struct SimulatedHand {
  SimulatedDevice device;
  LoopbackLink link;
  Runtime runtime;

  SimulatedHand(const RunConfig& config, Clock& clock, ProxySearchMode search, const MeshLoader& meshes = {},
                const HandScene& scene = {})
      : device(config.profile, config.settings.simulation),
        link(device, clock, config.settings.simulation),
        runtime(config, link, clock, search, meshes, scene) {
    runtime.enable_shared_state();
    runtime.open();
  }

  ServoLoop& loop() { return runtime.loop(); }
  State state() { return loop().telemetry().state(); }
  std::uint64_t ticks() { return loop().telemetry().timing().tick.count(); }
  /// The newest record; before the first tick an empty one.
  const TickRecord& newest() {
    loop().telemetry().latest_record().read(newest_);  // keeps the record if there is no newer one
    return newest_;
  }

 private:
  TickRecord newest_;
};

}  // namespace wrenchd::test
