// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "core/static_vector.hpp"

namespace wrenchd::test_static_vector {

using wrenchd::StaticVector;

TEST_CASE("a static vector stores up to its capacity, and a copy is independent", "[fixed_list]") {
  StaticVector<int, 3> list;
  CHECK(list.empty());
  CHECK(list.add(1));
  CHECK(list.add(2));
  CHECK(list.add(3));
  CHECK(list.full());
  CHECK_FALSE(list.add(4));
  CHECK(list.size() == 3);

  StaticVector<int, 3> copy = list;
  copy.remove_unordered(0);
  CHECK(copy.size() == 2);
  CHECK(copy[0] == 3);
  CHECK(copy[1] == 2);
  CHECK(list[0] == 1);
  list = copy;
  CHECK(list.size() == 2);
  CHECK(list[0] == 3);
  list.truncate(5);
  CHECK(list.size() == 2);
  list.truncate(1);
  CHECK(list.size() == 1);
  CHECK(list[0] == 3);
  list.clear();
  CHECK(list.begin() == list.end());
}

}  // namespace wrenchd::test_static_vector
