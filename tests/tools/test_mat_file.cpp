// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>

#include <catch2/catch.hpp>

#include "tools/mat_file.hpp"

namespace wrenchd::test_mat_file {

// tests/exports reads whole exports with scipy; here is what every reader relies on.
TEST_CASE("elements of a MAT-file have multiples of 8 bytes, and the size that their tag states",
          "[export]") {
  CHECK(mat_header().size() == 128);
  CHECK(mat_header().ends_with(std::string("\0\1IM", 4)));
  const std::array<std::string, 3> texts = {"", "a", "\xc3\xa4\xe2\x82\xac\xf0\x9f\x98\x80\xff"};
  const std::array<std::pair<std::string, std::string>, 1> members = {{{"x", mat_text("", "abc")}}};
  for (const std::string& element :
       {mat_matrix("x", FieldType::u8, 3, 1, "abc"), mat_matrix("long_name", FieldType::u16, 0, 1, ""),
        mat_text("t", "some text"), mat_texts("c", texts), mat_struct("s", members)}) {
    CHECK(element.size() % 8 == 0);
    std::size_t stated = 0;
    for (std::size_t i = 0; i < 4; ++i)
      stated |= static_cast<std::size_t>(static_cast<unsigned char>(element[4 + i])) << (8 * i);
    CHECK(stated == element.size() - 8);
    CHECK(element[0] == 14);
  }
}

}  // namespace wrenchd::test_mat_file
