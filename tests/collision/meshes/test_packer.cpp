// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "collision/meshes/packer.hpp"

namespace wrenchd::test_packer {

namespace {

TEST_CASE("packed values are unpacked, and missing values are detected", "[packer]") {
  std::string bytes;
  const Packer pack(bytes);
  const std::vector<Vector3d> points = {{1, 2, 3}, {4, 5, 6}};
  const std::vector<std::string> words = {"some", "", "words"};
  pack(points);
  pack(words);
  pack(2.5);
  const auto unpacked = [](std::string_view from, std::vector<Vector3d>& p, std::vector<std::string>& w,
                           double& x) {
    const Unpacker unpack(from);
    unpack(p), unpack(w), unpack(x);
    return unpack.at_end();
  };
  std::vector<Vector3d> p;
  std::vector<std::string> w;
  double x = 0.0;
  CHECK(unpacked(bytes, p, w, x));
  CHECK(p == points);
  CHECK(w == words);
  CHECK(x == 2.5);
  CHECK_FALSE(unpacked(bytes + "x", p, w, x));
  for (std::size_t size = 0; size < bytes.size(); ++size)
    CHECK_FALSE(unpacked(std::string_view(bytes).substr(0, size), p, w, x));
  const std::uint64_t vast = ~std::uint64_t{0};
  bytes.replace(0, sizeof vast, reinterpret_cast<const char*>(&vast), sizeof vast);
  CHECK_FALSE(unpacked(bytes, p, w, x));
}

}  // namespace
}  // namespace wrenchd::test_packer
