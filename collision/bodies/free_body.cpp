// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/bodies/free_body.hpp"

#include <utility>

#include "collision/meshes/mesh_size.hpp"

namespace wrenchd {

FreeBody load_free_body(const BodySettings& settings, const SceneSettings& scene, MeshLoader& loader) {
  FreeBody out;
  out.name = settings.name;
  out.body = load_tool(settings.shape, loader);
  require_size_for_contacts(out.body.mesh, 1.0, settings.shape.mesh);
  Inertia& M = out.body.solid.inertia;
  if (settings.density_kg_per_m3) {
    const double mass_kg = *settings.density_kg_per_m3 * out.body.solid.volume_m3;
    M.H_kg_m2 *= mass_kg / M.mass_kg;
    M.mass_kg = mass_kg;
  }
  out.mesh = loader.build_bvh(out.body.mesh, out.body.kind, settings.shape.mesh, scene.surface_tolerance_m,
                              {scene.smoothing_m});
  if (scene.smoothing_m > 0.0) out.body.hull = hull_of(*out.mesh, settings.shape.mesh, loader);
  out.motion.X_WB = settings.X_WM * out.body.X_MT();
  out.motion.velocity_W_m_per_s = settings.velocity_m_per_s;
  set_angular_velocity_W(M, settings.spin_rad_per_s, out.motion);
  out.friction = settings.friction;
  out.restitution = settings.restitution;
  out.linear_damping_per_s = settings.linear_damping_per_s;
  out.angular_damping_per_s = settings.angular_damping_per_s;
  return out;
}

}  // namespace wrenchd
