// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdint>
#include <sstream>

#include <boost/crc.hpp>
#include <catch2/catch.hpp>

#include "tools/mcap_writer.hpp"

namespace wrenchd::test_mcap_writer {

namespace {

std::uint64_t number_at(const std::string& bytes, std::size_t at, std::size_t size) {
  std::uint64_t number = 0;
  for (std::size_t i = 0; i < size; ++i)
    number |= static_cast<std::uint64_t>(static_cast<unsigned char>(bytes[at + i])) << (8 * i);
  return number;
}

}  // namespace

// tests/exports reads whole exports with the reference reader; here are the parts of the format that it
// skips.
TEST_CASE("an MCAP file has its records in order, and its lengths and checksums agree", "[export]") {
  std::ostringstream out;
  McapWriter writer(out, "wrenchd test");
  const auto a = writer.add_channel("/a", "A", R"({"type":"object"})");
  const auto b = writer.add_channel("/b", "A", R"({"type":"object"})");
  CHECK(a != b);
  const std::string large(300'000, 'x');
  for (std::uint64_t i = 0; i < 10; ++i)
    writer.add_message(i % 2 == 0 ? a : b, 1000 + i, "{\"x\":\"" + large + "\"}");
  writer.close();
  const std::string file = out.str();
  const std::string magic("\x89MCAP0\r\n", 8);
  REQUIRE(file.starts_with(magic));
  REQUIRE(file.ends_with(magic));
  std::string opcodes;
  std::size_t at = magic.size(), data_end = 0;
  while (at < file.size() - magic.size()) {
    const char opcode = file[at];
    if (opcode == 0x0F) data_end = at;
    if (opcodes.empty() || opcodes.back() != opcode) opcodes += opcode;
    at += 9 + number_at(file, at + 1, 8);
  }
  CHECK(at == file.size() - magic.size());
  // header; chunks of about 1 MiB, each with its message indexes; end of the data; summary; footer
  CHECK(opcodes == "\x01\x06\x07\x06\x07\x06\x07\x0f\x03\x04\x0b\x08\x0e\x02");
  boost::crc_32_type crc;
  crc.process_bytes(file.data(), data_end);
  CHECK(number_at(file, data_end + 9, 4) == crc.checksum());
}

}  // namespace wrenchd::test_mcap_writer
