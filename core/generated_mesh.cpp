// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/generated_mesh.hpp"

#include <array>
#include <charconv>

namespace wrenchd {

const std::vector<MeshKind>& mesh_kinds() {
  static const std::vector<MeshKind> kinds = {
      {"cube", "side 50 mm"},
      {"plate", "100 x 100 x 1 mm"},
      {"table", "300 x 300 x 20 mm"},
      {"sphere", "radius 30 mm"},
      {"bumpy", "radius 40 mm, bumps all over"},
      {"boulder", "radius 60 mm, bumps all over"},
      {"peg", "radius 9.8 mm, length 60 mm, bumps of 20 um"},
      {"hole", "tube for the peg: radii 10 and 20 mm, length 80 mm"},
      {"bolt", "radius 4.9 mm, length 30 mm, thread of pitch 1.5 mm"},
      {"nut", "for the bolt: 17 mm across flats, 0.1 mm of play"},
      {"gear", "20 teeth, radius 23 mm, 10 mm thick"},
      {"box", "sides of 50 mm, or size_m in a scene"},
      {"dowel", "radius 9.9 mm, length 60 mm, chamfered"},
      {"socket", "for the dowel: radii 10 and 20 mm, length 50 mm, chamfered above"},
      {"key", "shaft of radius 3 mm, length 50 mm, bit that reaches 8 mm towards +x"},
      {"lock", "for the key: plate of 6 mm above a chamber of 12 mm, 0.3 mm of play"},
      {"screw", "radius 5 mm, thread of pitch 3 mm along 30 mm, with a head"},
      {"screw_nut", "for the screw: 14 mm high, 0.1 mm of play"},
      {"hare", "an animal with ears and feet, 120 mm high"},
      {"bowl", "radius 51 mm, 30 mm high, inside a part of a sphere of radius 60 mm"},
      {"ratchet", "disc of radius 20 mm with eight saw teeth above; two of them fit face to face"},
  };
  return kinds;
}

std::string generated_mesh_name(const GeneratedMesh& made) {
  const auto number = [](double x) {
    std::array<char, 32> text{};
    return std::string(text.data(), std::to_chars(text.data(), text.data() + text.size(), x).ptr);
  };
  std::string name = "made " + made.kind;
  if (made.kind == "box")
    name += ' ' + number(made.size_m.x()) + " x " + number(made.size_m.y()) + " x " +
            number(made.size_m.z()) + " m";
  name += ", " + std::to_string(made.triangles) + " triangles";
  if (made.seed != GeneratedMesh().seed) name += ", seed " + std::to_string(made.seed);
  return name;
}

}  // namespace wrenchd
