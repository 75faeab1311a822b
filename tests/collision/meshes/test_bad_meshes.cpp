// SPDX-License-Identifier: GPL-3.0-or-later
#include <chrono>
#include <functional>
#include <limits>

#include <catch2/catch.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "collision/meshes/mesh_file.hpp"
#include "collision/scene.hpp"
#include "core/inertia.hpp"
#include "tests/support/rejection.hpp"
#include "tests/support/sample_meshes.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_bad_meshes {

// Twelve defects, five severities, four formats: every file is accepted, repaired with a report, or rejected
// with its name, the location and the remedy.

namespace {

namespace fs = std::filesystem;
using namespace test;

constexpr std::array<std::size_t, 5> kCounts = {1, 2, 5, 20, 80};  ///< of 320 faces, by severity
constexpr double kVolume_m3 = 1.1e-4;                              ///< about the volume of the ball

PolygonSoup ball() {
  const TriangleMesh mesh = make_mesh({"sphere", 320});
  PolygonSoup soup{mesh.vertices_m, {}};
  for (const auto& [a, b, c] : mesh.triangles) soup.faces.push_back({a, b, c});
  return soup;
}

/// Returns the i-th of `count` evenly distributed face indices.
std::size_t spread(std::size_t i, std::size_t count, const PolygonSoup& soup) {
  return i * soup.faces.size() / count;
}

enum class Format { off, obj, stl, ply };
constexpr std::array<Format, 4> kFormats = {Format::off, Format::obj, Format::stl, Format::ply};

/// The severity selects text or binary STL and PLY, and the byte order of PLY.
bool binary(Format format, std::size_t severity) {
  return (format == Format::stl || format == Format::ply) && severity % 2 == 0;
}

std::string extension(Format format) {
  constexpr std::array<const char*, 4> names = {".off", ".obj", ".stl", ".ply"};
  return names[static_cast<std::size_t>(format)];
}

std::string written(const PolygonSoup& soup, Format format, std::size_t severity) {
  switch (format) {
    case Format::off:
      return as_off(soup);
    case Format::obj:
      return as_obj(soup);
    case Format::stl:
      return binary(format, severity) ? as_binary_stl(soup) : as_ascii_stl(soup);
    case Format::ply:
      break;
  }
  return binary(format, severity) ? as_binary_ply(soup, severity == 2) : as_ascii_ply(soup);
}

struct Expected {
  enum class Outcome { accepted, repaired, rejected } outcome;
  std::string words;        ///< part of the report or of the message
  bool as_surface = false;  ///< the mesh is valid as a surface
};
constexpr auto accepted = Expected::Outcome::accepted;
constexpr auto repaired = Expected::Outcome::repaired;
constexpr auto rejected = Expected::Outcome::rejected;

struct Defect {
  std::string name;
  std::function<std::string(std::size_t severity, Format)> bytes;
  std::function<Expected(std::size_t severity, Format)> expected;
};

std::string many(std::size_t count, const std::string& one) {
  return std::to_string(count) + " " + one + (count > 1 ? "s" : "");
}

void replace(std::string& text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  text.replace(at, from.size(), to);
}

PolygonSoup with_holes(std::size_t count) {
  PolygonSoup soup = ball();
  for (std::size_t i = count; i-- > 0;)
    soup.faces.erase(soup.faces.begin() + static_cast<std::ptrdiff_t>(spread(i, count, ball())));
  return soup;
}

PolygonSoup with_fins(std::size_t count) {
  PolygonSoup soup = ball();
  for (std::size_t i = 0; i < count; ++i) {
    const auto face = soup.faces[i * 320 / count];
    soup.faces.push_back({face[0], face[1], soup.vertices.size()});
    soup.vertices.push_back(0.7 * (soup.vertices[face[0]] + soup.vertices[face[1]]));
  }
  return soup;
}

PolygonSoup with_corners_of_their_own(std::size_t count) {
  PolygonSoup soup = ball();
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t& v : soup.faces[spread(i, count, soup)]) {
      soup.vertices.push_back(Vector3d(soup.vertices[v]));
      v = soup.vertices.size() - 1;
    }
  return soup;
}

PolygonSoup with_faces_twice(std::size_t count) {
  PolygonSoup soup = ball();
  for (std::size_t i = 0; i < count; ++i) {
    soup.faces.push_back(soup.faces[i * 320 / count]);
    if (i % 2 == 1) std::reverse(soup.faces.back().begin(), soup.faces.back().end());
  }
  return soup;
}

/// Splits a face through the middle of a side. A face without area closes the gap to the neighbour.
PolygonSoup with_caps(std::size_t count) {
  PolygonSoup soup = ball();
  for (std::size_t i = 0; i < count; ++i) {
    auto& face = soup.faces[i * 320 / count];
    const auto [a, b, c] = std::array{face[0], face[1], face[2]};
    const std::size_t m = soup.vertices.size();
    soup.vertices.push_back(0.5 * (soup.vertices[a] + soup.vertices[b]));
    face = {a, m, c};
    soup.faces.push_back({m, b, c});
    soup.faces.push_back({a, b, m});
  }
  return soup;
}

PolygonSoup with_faces_turned(std::size_t count) {
  PolygonSoup soup = ball();
  for (std::size_t i = 0; i < count; ++i) {
    auto& face = soup.faces[spread(i, count, soup)];
    std::reverse(face.begin(), face.end());
  }
  return soup;
}

PolygonSoup with_spikes_through(std::size_t count) {
  PolygonSoup soup = ball();
  for (std::size_t i = 0; i < std::min<std::size_t>(count, 20); ++i) soup.vertices[8 * i] *= -1.5;
  return soup;
}

std::string with_numbers_that_are_none(std::size_t severity, Format format) {
  PolygonSoup soup = ball();
  for (std::size_t i = 0; i < kCounts[severity]; ++i)
    soup.vertices[i][static_cast<Eigen::Index>(i % 3)] =
        i % 2 == 0 ? std::numeric_limits<double>::quiet_NaN() : -std::numeric_limits<double>::infinity();
  return written(soup, format, severity);
}

/// STL has no indices. Facets of four corners, or a wrong facet count, are the corresponding defect.
std::string with_indices_out_of_range(std::size_t severity, Format format) {
  PolygonSoup soup = ball();
  const std::size_t count = kCounts[severity];
  if (format == Format::stl && binary(format, severity)) {
    std::string bytes = as_binary_stl(soup);
    const auto more = static_cast<std::uint32_t>(soup.faces.size() + count);
    std::memcpy(bytes.data() + 80, &more, sizeof more);
    return bytes;
  }
  for (std::size_t i = 0; i < count; ++i) {
    auto& face = soup.faces[spread(i, count, soup)];
    if (format == Format::stl)
      face.push_back(face[0]);
    else
      face[1] = soup.vertices.size() + i;
  }
  return written(soup, format, severity);
}

std::string with_garbage(std::size_t severity, Format format) {
  const PolygonSoup soup = ball();
  std::string text = written(soup, format, severity);
  const std::string more = std::to_string(soup.faces.size() + kCounts[severity]);
  switch (format) {
    case Format::off:
      replace(text, " 320 0\n", " " + more + " 0\n");
      break;
    case Format::obj:
      replace(text, "\nf ", "\n" + std::string(kCounts[severity], '%') + " exported by mistake\nf ");
      break;
    case Format::stl:
      if (binary(format, severity))
        text += std::string(kCounts[severity], 'x');
      else
        replace(text, "endfacet", std::string(kCounts[severity], '%') + " endfacet");
      break;
    case Format::ply:
      replace(text, "face 320", "face " + more);
      break;
  }
  return text;
}

constexpr std::array<double, 5> kScales = {1e-30, 1e-6, 1e4, 1e6, 1e30};

std::string with_another_unit(std::size_t severity, Format format) {
  PolygonSoup soup = ball();
  for (Vector3d& p : soup.vertices) p *= kScales[severity];
  return written(soup, format, severity);
}

std::string cut_short(std::size_t severity, Format format) {
  constexpr std::array<double, 5> kept = {0.95, 0.8, 0.6, 0.4, 0.1};
  std::string bytes = written(ball(), format, severity);
  bytes.resize(static_cast<std::size_t>(kept[severity] * static_cast<double>(bytes.size())));
  return bytes;
}

/// A defect of the mesh itself, independent of the format.
auto in_any_format(PolygonSoup (*make)(std::size_t count)) {
  return [make](std::size_t severity, Format format) {
    return written(make(kCounts[severity]), format, severity);
  };
}

auto always(const Expected& expected) {
  return [expected](std::size_t, Format) { return expected; };
}

const std::vector<Defect>& defects() {
  static const std::vector<Defect> all = {
      {"truncated", cut_short,
       [](std::size_t severity, Format format) {
         // A truncated OBJ is a valid OBJ with a hole, or without faces.
         if (format != Format::obj) return Expected{rejected, "export the mesh again"};
         if (severity < 2) return Expected{rejected, "the surface is open", true};
         return Expected{rejected, severity == 2 ? "has no faces" : "expected 3 numbers"};
       }},
      {"not_finite", with_numbers_that_are_none, always({rejected, "number"})},
      {"out_of_range", with_indices_out_of_range,
       [](std::size_t severity, Format format) {
         if (format == Format::stl)
           return Expected{rejected, binary(format, severity) ? "bytes, not" : "has 4 vertices"};
         return Expected{rejected, binary(format, severity) ? "uses vertex 162"
                                   : format == Format::ply  ? "uses vertex 162"
                                                            : "there is no vertex '16"};
       }},
      {"hole", in_any_format(with_holes), always({rejected, "the surface is open", true})},
      {"fin", in_any_format(with_fins), always({rejected, "belongs to 3 faces", true})},
      {"duplicate_points", in_any_format(with_corners_of_their_own),
       [](std::size_t severity, Format format) {
         if (format == Format::stl) return Expected{accepted, ""};  // STL has no shared vertices
         // If all faces at a point have points of their own, the point is unused.
         if (severity > 2) return Expected{repaired, " duplicate points, first vertex 16"};
         return Expected{repaired, "merged " + std::to_string(3 * kCounts[severity]) + " duplicate points"};
       }},
      {"duplicate_faces", in_any_format(with_faces_twice),
       [](std::size_t severity, Format) {
         return Expected{repaired, "removed " + many(kCounts[severity], "duplicate face")};
       }},
      {"no_area", in_any_format(with_caps),
       [](std::size_t severity, Format) {
         return Expected{repaired, "removed " + many(kCounts[severity], "face") + " without area"};
       }},
      {"turned", in_any_format(with_faces_turned),
       [](std::size_t severity, Format) {
         return Expected{repaired, "flipped " + many(kCounts[severity], "face")};
       }},
      {"cut_through", in_any_format(with_spikes_through), always({rejected, "intersect each other", true})},
      {"garbage", with_garbage,
       [](std::size_t severity, Format format) {
         constexpr std::array<const char*, 4> words = {"ends before face 320 of ",
                                                       "is no statement of an OBJ file",
                                                       "is no word of an STL file", "face 320 of "};
         if (format == Format::stl && binary(format, severity)) return Expected{rejected, "bytes, not"};
         return Expected{rejected, words[static_cast<std::size_t>(format)]};
       }},
      {"unit", with_another_unit,
       [](std::size_t severity, Format) {
         if (kScales[severity] == 1e4)
           return Expected{repaired, "were millimetres taken for metres? 'scale' would be 0.001"};
         return Expected{rejected, "give 'scale' in metres per mesh unit"};
       }},
  };
  return all;
}

/// Returns a scene with the file as an obstacle and a valid tool.
SceneSettings scene_with(const fs::path& tool, const fs::path& file, BodyKind kind) {
  SceneSettings settings;
  settings.tool.mesh = tool;
  settings.tool.scale = 0.01;
  settings.tool.mass_kg = 0.1;
  MeshObstacleSettings& obstacle = settings.meshes.emplace_back();
  obstacle.name = "bad";
  obstacle.mesh = file;
  obstacle.kind = kind;
  return settings;
}

/// Checks a scene that was built although the mesh has a defect. Returns its repairs and warnings.
std::string check_accepted(const Scene& scene, const MeshLoader& loader, const Expected& expected) {
  std::string report;
  for (const std::string& change : loader.changes()) report += change + "\n";
  for (const std::string& warning : loader.warnings()) report += warning + "\n";
  INFO(report);
  CHECK(expected.outcome == (report.empty() ? accepted : repaired));
  const TriangleMesh& mesh = scene.meshes()[0].mesh->surface.mesh();
  const double size = report.find("millimetres") == std::string::npos ? 1.0 : 1e12;
  CHECK(solid_properties(mesh, 1.0).volume_m3 == Approx(kVolume_m3 * size).epsilon(0.02));
  return report;
}

void check_file(const fs::path& file, const fs::path& tool, const Expected& expected) {
  MeshLoader loader;
  std::string report;
  const std::string rejection = rejection_message<MeshError>([&] {
    const Scene scene(scene_with(tool, file, BodyKind::solid), loader);
    report = check_accepted(scene, loader, expected);
  });
  if (!rejection.empty()) report = rejection;
  INFO(report);
  if (!rejection.empty()) CHECK(expected.outcome == rejected);
  CHECK((report.empty() || report.find(file.string() + ":") == 0));
  CHECK(report.find(expected.words) != std::string::npos);
  CHECK((report.find("kind = \"surface\"") != std::string::npos) == expected.as_surface);
  if (expected.as_surface) {
    const Scene scene(scene_with(tool, file, BodyKind::surface), loader);
    CHECK(scene.meshes()[0].mesh->surface.kind() == BodyKind::surface);
    CHECK(scene.meshes()[0].mesh->surface.triangles().size() > 90);
  }
}

TEST_CASE("240 bad meshes are accepted, repaired with a report, or rejected with a reason", "[bad_meshes]") {
  const TemporaryDirectory dir;
  const fs::path tool = dir.write("tool.off", as_off(box({0, 0, 0}, {1, 1, 1})));
  int files = 0;
  for (const Defect& defect : defects())
    for (std::size_t severity = 0; severity < kCounts.size(); ++severity)
      for (const Format format : kFormats) {
        const fs::path file = dir.write(defect.name + std::to_string(severity) + extension(format),
                                        defect.bytes(severity, format));
        INFO(file.filename());
        const auto start = std::chrono::steady_clock::now();
        check_file(file, tool, defect.expected(severity, format));
        CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(2));
        ++files;
      }
  CHECK(files == 240);
}

}  // namespace
}  // namespace wrenchd::test_bad_meshes
