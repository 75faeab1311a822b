// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/mesh_size.hpp"

#include <algorithm>
#include <cmath>
#include <locale>
#include <sstream>

#include <Eigen/Geometry>

#include "collision/meshes/mesh_file.hpp"

namespace wrenchd {
namespace {

/// A thousand times the clearance of the proxy.
constexpr double kMinSide_m = 1e-6;
/// At this coordinate rounding is a thousandth of the clearance.
constexpr double kMaxCoordinate_m = 1e4;

double largest_side(const TriangleMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : mesh.vertices_m) box.extend(p);
  return box.isEmpty() ? 0.0 : box.sizes().maxCoeff();
}

std::string size_text(double side_m, double scale) {
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text.precision(3);
  text << "its largest side is " << side_m << " m at scale " << scale;
  return text.str();
}

/// Suggests a scale that makes the size plausible: a factor of 1000 up or down.
std::string scale_question(double side_m, double scale, PlausibleSize likely) {
  std::ostringstream text;
  text.imbue(std::locale::classic());
  const double factor = side_m > likely.max_m ? 1e-3 : 1e3;
  const double other_m = side_m * factor;
  if (other_m < likely.min_m || other_m > likely.max_m) return "give 'scale' in metres per mesh unit";
  text << (factor < 1.0 ? "were millimetres taken for metres? 'scale' would be "
                        : "were metres taken for millimetres? 'scale' would be ")
       << scale * factor;
  return text.str();
}

}  // namespace

std::optional<std::string> implausible_size(const TriangleMesh& mesh, double scale, PlausibleSize likely) {
  const double side_m = scale * largest_side(mesh);
  if (side_m >= likely.min_m && side_m <= likely.max_m) return {};
  return size_text(side_m, scale) + ": " + scale_question(side_m, scale, likely);
}

void require_size_for_contacts(const TriangleMesh& mesh, double scale, const std::filesystem::path& file) {
  const double side_m = scale * largest_side(mesh);
  double farthest = 0.0;
  for (const Vector3d& p : mesh.vertices_m) farthest = std::max(farthest, p.lpNorm<Eigen::Infinity>());
  if (!(side_m >= kMinSide_m && side_m <= kMaxCoordinate_m))
    throw MeshError(file.string() + ": " + size_text(side_m, scale) +
                    ", and contacts between meshes can be found from 1e-06 to 10000 m; give 'scale' in "
                    "metres per mesh unit");
  if (!(scale * farthest <= kMaxCoordinate_m)) {
    std::ostringstream text;
    text.imbue(std::locale::classic());
    text << file.string() << ": lies up to " << scale * farthest
         << " m from its own origin, where a contact is rounded away; move it to within 10000 m in the "
            "modeller";
    throw MeshError(text.str());
  }
}

}  // namespace wrenchd
