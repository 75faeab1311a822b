// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/mutated_recording.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <string_view>
#include <vector>

#include "daemon/recording/recording_file.hpp"

namespace wrenchd::test {
namespace {

/// Signatures of HDF5 structures, and names in the file: near them are sizes, addresses and counts.
constexpr std::array<std::string_view, 12> kMarks = {"TREE", "SNOD", "HEAP",  "GCOL",     "OCHK",     "OHDR",
                                                     "FRHP", "BTHD", "ticks", "contacts", "settings", "tool"};

std::vector<std::size_t> marks_in(const std::string& bytes) {
  std::vector<std::size_t> at = {0};
  for (const std::string_view mark : kMarks)
    for (std::size_t i = bytes.find(mark); i != std::string::npos; i = bytes.find(mark, i + 1))
      at.push_back(i);
  return at;
}

void put_number(std::string& bytes, std::size_t at, std::size_t size, RandomValues& random) {
  const std::array<std::uint64_t, 8> extremes = {0,
                                                 1,
                                                 ~std::uint64_t{0},
                                                 std::uint64_t{1} << 31,
                                                 std::uint64_t{1} << 62,
                                                 bytes.size(),
                                                 at,
                                                 random.bits()};
  const std::uint64_t number = extremes[random.bits() % extremes.size()];
  for (std::size_t i = 0; i < size && at + i < bytes.size(); ++i)
    bytes[at + i] = static_cast<char>(number >> (8 * i));
}

}  // namespace

void write_sample_recording(const std::filesystem::path& file) {
  RecordingHeader header;
  header.version = "1.2.3";
  header.settings = "rate_Hz = 1000\n";
  header.scene = "[tool]\nmesh = \"tool.off\"\n";
  header.profile = "name = \"sample\"\n";
  header.settings_file = "/etc/wrenchd/wrenchd.toml";
  header.scene_file = "/etc/wrenchd/scene.toml";
  header.profile_file = "/etc/wrenchd/profiles/sample.toml";
  header.files.push_back({"hand_script", "hand.toml", {}, true, "repeats = false\n"});
  header.files.push_back({"tool", "tool.off", "00", true, std::string(3000, 'v')});
  header.rate_Hz = 1000.0;
  RecordingWriter writer(file, header);
  RecordBatch batch;
  for (std::size_t i = 0; i < kSampleTicks; ++i) {
    TickRecord tick;
    tick.tick = i;
    tick.now_ns = static_cast<std::int64_t>(1'000'000 * (i + 1));
    std::vector<Touch> contacts(i % 3);
    batch.add(tick, contacts);
  }
  writer.append(batch);
}

std::string read_bytes(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void write_bytes(const std::filesystem::path& file, const std::string& bytes) {
  std::filesystem::remove(file);
  std::ofstream(file, std::ios::binary) << bytes;
}

std::string mutate(const std::string& good, RandomValues& random) {
  std::string bytes = good;
  const std::vector<std::size_t> marks = marks_in(good);
  const std::uint64_t changes = 1 + random.bits() % 8;
  for (std::uint64_t change = 0; change < changes; ++change) {
    const bool near_mark = random.bits() % 2 == 0;
    const std::size_t at = std::min<std::size_t>(
        near_mark ? marks[random.bits() % marks.size()] + random.bits() % 64 : random.bits() % bytes.size(),
        bytes.size() - 1);
    switch (random.bits() % 6) {
      case 0:
        bytes[at] = static_cast<char>(static_cast<unsigned char>(bytes[at]) ^ (1U << (random.bits() % 8)));
        break;
      case 1:
        bytes[at] = static_cast<char>(random.bits());
        break;
      case 2:
      case 3:
        put_number(bytes, at, std::size_t{1} << (random.bits() % 4), random);
        break;
      case 4: {  // a part of the file over another part
        const std::size_t from = random.bits() % bytes.size();
        const std::size_t count =
            std::min({std::size_t{1} + random.bits() % 256, bytes.size() - at, bytes.size() - from});
        bytes.replace(at, count, bytes.substr(from, count));
        break;
      }
      default:
        if (random.bits() % 8 == 0) bytes.resize(std::max<std::size_t>(at, 1));
        break;
    }
  }
  return bytes;
}

}  // namespace wrenchd::test
