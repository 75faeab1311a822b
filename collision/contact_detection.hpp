// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "collision/overlap_test.hpp"
#include "collision/scene.hpp"
#include "collision/sweep_query.hpp"
#include "core/contact_backend.hpp"

namespace wrenchd {

/// Make the queries of a backend. The scene must outlive the result. Not RT-safe: allocates, and builds
/// CGAL's trees, which takes about a second for a million triangles.
std::unique_ptr<SweepQuery> make_sweep_query(const Scene& scene, ContactBackend contacts);
std::unique_ptr<OverlapTest> make_overlap_test(const Scene& scene, ContactBackend contacts);

}  // namespace wrenchd
