// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/import_report.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>

#include <Eigen/Geometry>

#include "tools/import/length.hpp"

namespace wrenchd {
namespace {

[[gnu::format(printf, 1, 2)]] std::string line(const char* format, ...) {
  std::array<char, 256> text{};
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text.data(), text.size(), format, arguments);
  va_end(arguments);
  return text.data() + std::string("\n");
}

std::string row(const char* label, const std::string& value) {
  std::string text = label;
  text.resize(std::max<std::size_t>(text.size(), 18), ' ');
  return text + " " + value + "\n";
}

std::string compared(const char* label, double exact, double mesh, double reference, const char* unit) {
  const double relative = reference != 0.0 ? (mesh - exact) / std::abs(reference) : 0.0;
  return line("%-18s %.9g %.9g %+.2e %s", label, exact, mesh, relative, unit);
}

std::string three(const Vector3d& v) {
  std::array<char, 96> text{};
  std::snprintf(text.data(), text.size(), "%.9g %.9g %.9g", v.x(), v.y(), v.z());
  return text.data();
}

/// Inertia per kilogram of the uniform solid [m^2].
Matrix3d specific_inertia_m2(const GeometricProperties& solid) {
  return solid.inertia_mm5 / solid.volume_mm3 * 1e-6;
}

}  // namespace

std::string rounded_up(double x) {
  if (!(x > 0.0)) return "0";
  const double step = std::pow(10.0, std::floor(std::log10(x)) - 2);
  return short_number(std::ceil(x / step * (1.0 - 1e-12)) * step);
}

std::string statement_text(const ImportedBody& body, const StatedError& error, const std::string& source) {
  return "unit mm, scale 0.001, " +
         (body.has_exact_surface ? "chord error " + rounded_up(error.mm) + " mm"
                                 : "triangles as in the file, rounding " + rounded_up(error.mm) + " mm") +
         ", " + printable_name(source);
}

std::string report_text(const ImportedBody& body, const StatedError& error) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : body.mesh_mm.vertices_m) box.extend(p);
  std::string text = row("triangles", std::to_string(body.mesh_mm.triangles.size())) +
                     row("size", three(1e-3 * box.sizes()) + " m");
  if (body.has_exact_surface) {
    std::string chord = "at most " + rounded_up(error.mm) + " mm, measured";
    if (error.rounding_mm > 0.0)
      chord += ", of which " + rounded_up(error.rounding_mm) + " mm from single precision";
    if (error.mm > error.rounding_mm) chord += "; " + body.worst_place;
    text += row("chord error", chord);
  } else {
    text += row("chord error", "the triangles are those of the file" +
                                   (error.mm > 0.0 ? ", rounded by at most " + rounded_up(error.mm) + " mm"
                                                   : std::string()));
  }
  if (body.surface) return text;
  const GeometricProperties mesh = geometric_properties(body.mesh_mm);
  const Matrix3d H = specific_inertia_m2(mesh);
  if (!body.has_exact_surface || body.overlap_mm3 > 1e-9 * body.exact.volume_mm3) {
    text += line("%-18s %.9g m^3", "volume", 1e-9 * mesh.volume_mm3) +
            line("%-18s %.9g m^2", "area", 1e-6 * mesh.area_mm2) +
            row("centre of mass", three(1e-3 * mesh.centre_mm) + " m") +
            row("inertia xx yy zz",
                three(H.diagonal()) + " m^2 (per kg, uniform solid, about the centre of mass)") +
            row("inertia xy xz yz", three({H(0, 1), H(0, 2), H(1, 2)}) + " m^2");
    return text;
  }
  const Matrix3d E = specific_inertia_m2(body.exact);
  const double largest = E.diagonal().maxCoeff();
  text +=
      row("", "exact, mesh, difference relative to exact") +
      compared("volume", 1e-9 * body.exact.volume_mm3, 1e-9 * mesh.volume_mm3, 1e-9 * body.exact.volume_mm3,
               "m^3") +
      compared("area", 1e-6 * body.exact.area_mm2, 1e-6 * mesh.area_mm2, 1e-6 * body.exact.area_mm2, "m^2");
  const double size_m = 1e-3 * box.sizes().norm();
  constexpr std::array<const char*, 3> kAxes = {"x", "y", "z"};
  for (int k = 0; k < 3; ++k)
    text += compared((std::string("centre of mass ") + kAxes[static_cast<std::size_t>(k)]).c_str(),
                     1e-3 * body.exact.centre_mm[k], 1e-3 * mesh.centre_mm[k], size_m,
                     k == 0 ? "m (relative to the size)" : "m");
  constexpr std::array<std::array<int, 2>, 6> kEntries = {{{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};
  for (const auto& [i, j] : kEntries)
    text += compared(
        (std::string("inertia ") + kAxes[static_cast<std::size_t>(i)] + kAxes[static_cast<std::size_t>(j)])
            .c_str(),
        E(i, j), H(i, j), largest,
        i == 0 && j == 0 ? "m^2 (per kg, uniform solid, about the centre of mass; relative to "
                           "the largest)"
                         : "m^2");
  return text;
}

}  // namespace wrenchd
