// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/contact_detection.hpp"

#include "collision/cgal/cgal_contacts.hpp"
#include "collision/cgal/cgal_overlap_test.hpp"
#include "collision/mesh_contacts.hpp"

namespace wrenchd {

std::unique_ptr<SweepQuery> make_sweep_query(const Scene& scene, ContactBackend contacts) {
  if (contacts == ContactBackend::cgal) return std::make_unique<CgalContacts>(scene);
  return std::make_unique<MeshContacts>(scene);
}

std::unique_ptr<OverlapTest> make_overlap_test(const Scene& scene, ContactBackend contacts) {
  if (contacts == ContactBackend::cgal) return std::make_unique<CgalOverlapTest>(scene);
  return std::make_unique<NativeOverlapTest>(scene);
}

}  // namespace wrenchd
