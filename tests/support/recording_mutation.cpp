// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/recording_mutation.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <iterator>
#include <random>
#include <stdexcept>
#include <vector>

#include <hdf5.h>

#include "daemon/recording/recording_file.hpp"

namespace wrenchd::test {
namespace {

namespace fs = std::filesystem;
using Random = std::mt19937_64;

std::uint64_t below(Random& random, std::uint64_t most) {
  return most == 0 ? 0 : random() % most;
}

std::string bytes_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void write(const fs::path& file, const std::string& bytes) {
  fs::remove(file);
  std::ofstream(file, std::ios::binary) << bytes;
}

/// Values at which sizes, counts and addresses break.
std::uint64_t edge_value(Random& random) {
  const std::array<std::uint64_t, 10> values = {0,          1,     0xff,      0xffff,     0x7fffffff,
                                                0xffffffff, ~0ULL, ~0ULL - 7, 1ULL << 40, 1ULL << 62};
  return values[below(random, values.size())];
}

void damage_bytes(std::string& bytes, Random& random) {
  for (std::uint64_t i = 0, many = 1 + below(random, 8); i < many; ++i)
    bytes[below(random, bytes.size())] = static_cast<char>(random());
}

/// libhdf5 stores its structures at multiples of 8 bytes.
void damage_number(std::string& bytes, Random& random) {
  constexpr std::array<std::size_t, 4> kSizes = {1, 2, 4, 8};
  for (std::uint64_t i = 0, many = 1 + below(random, 3); i < many; ++i) {
    const std::size_t size = kSizes[below(random, kSizes.size())];
    const std::uint64_t value = below(random, 3) == 0 ? below(random, bytes.size()) : edge_value(random);
    const std::size_t at = below(random, bytes.size() / 8 - 1) * 8 + below(random, 8 / size) * size;
    std::memcpy(bytes.data() + at, &value, size);
  }
}

void damage_length(std::string& bytes, Random& random) {
  if (below(random, 4) == 0)
    bytes.append(below(random, 5000), static_cast<char>(random()));
  else
    bytes.resize(below(random, bytes.size()));
}

void damage_block(std::string& bytes, Random& random) {
  const std::size_t size = 1 + below(random, 512);
  const std::string block = bytes.substr(below(random, bytes.size() - size), size);
  bytes.replace(below(random, bytes.size() - size), size, block);
}

constexpr std::array kSets = {
    "/ticks",          "/contacts",           "/fields",     "/config/settings", "/config/scene",
    "/config/profile", "/config/hand_script", "/meshes/tool"};

void damage_storage(hid_t file, const fs::path& secret, Random& random) {
  const char* const name = kSets[below(random, kSets.size())];
  const hid_t old = H5Dopen2(file, name, H5P_DEFAULT);
  const hid_t type = H5Dget_type(old);
  H5Dclose(old);
  H5Ldelete(file, name, H5P_DEFAULT);
  const hid_t plan = H5Pcreate(H5P_DATASET_CREATE);
  const hsize_t rows = 1 + below(random, 50);
  const hid_t space = H5Screate_simple(1, &rows, nullptr);
  if (below(random, 3) == 0)
    H5Pset_virtual(plan, space, secret.c_str(), "/ticks", space);
  else
    H5Pset_external(plan, secret.c_str(), static_cast<off_t>(below(random, 100)), rows * H5Tget_size(type));
  const hid_t made = H5Dcreate2(file, name, type, space, H5P_DEFAULT, plan, H5P_DEFAULT);
  if (made >= 0) H5Dclose(made);
  H5Sclose(space), H5Pclose(plan), H5Tclose(type);
}

void damage_link(hid_t file, const fs::path& secret, Random& random) {
  constexpr std::array kGroups = {"/config", "/meshes"};
  const std::uint64_t kind = below(random, 4);
  const char* const name =
      below(random, 4) == 0 ? kGroups[below(random, 2)] : kSets[below(random, kSets.size())];
  H5Ldelete(file, name, H5P_DEFAULT);
  if (kind == 0) H5Lcreate_external(secret.c_str(), "/ticks", file, name, H5P_DEFAULT, H5P_DEFAULT);
  if (kind == 1) H5Lcreate_soft(name, file, name, H5P_DEFAULT, H5P_DEFAULT);  // to itself
  if (kind == 2) H5Lcreate_soft(kSets[below(random, kSets.size())], file, name, H5P_DEFAULT, H5P_DEFAULT);
  if (kind == 3) H5Lcreate_hard(file, "/", file, name, H5P_DEFAULT, H5P_DEFAULT);
}

void damage_size(hid_t file, Random& random) {
  const hid_t set = H5Dopen2(file, below(random, 2) == 0 ? "/ticks" : "/contacts", H5P_DEFAULT);
  const hsize_t rows =
      below(random, 2) == 0 ? hsize_t{1} << (10 + below(random, 50)) : below(random, 100'000);
  H5Dset_extent(set, &rows);
  H5Dclose(set);
}

}  // namespace

const char* name(Damage damage) noexcept {
  constexpr std::array<const char*, kDamages> kNames = {"bytes",   "number", "cut", "block",
                                                        "storage", "link",   "size"};
  return kNames[static_cast<std::size_t>(damage)];
}

void write_sample_recording(const fs::path& file) {
  RecordingHeader header;
  header.version = "sample";
  header.settings = "scene = \"scene.toml\"\n";
  header.scene = "[tool]\nmesh = \"tool.off\"\n";
  header.profile = "name = \"loopback\"\n";
  header.files = {{"hand_script", "hand.toml", {}, true, "repeats = false\n"},
                  {"tool", "tool.off", std::string(64, '0'), true, std::string(3000, 'O')}};
  RecordingWriter writer(file, header);
  RecordBatch batch;
  Touch touch{};
  touch.normal_W = {0.0, 0.0, 1.0};
  for (int i = 0; i < 700; ++i) {
    TickRecord tick;
    tick.tick = static_cast<std::uint64_t>(i);
    tick.now_ns = 1'000'000 * (i + 1);
    tick.X_BH[0] = 1e-3 * i;
    batch.add(tick, std::vector<Touch>(static_cast<std::size_t>(i % 3), touch));
  }
  writer.append(batch);
  writer.flush();
}

Damage mutate_recording(const fs::path& sample, const fs::path& file, const fs::path& secret,
                        std::uint64_t seed, std::uint64_t number) {
  Random random(seed * 1'000'003 + number);
  // Two of three mutants have wrong bytes: these reach the parts of libhdf5 that no check of ours sees.
  constexpr std::array<Damage, 12> kOrder = {Damage::bytes,  Damage::number,  Damage::number, Damage::bytes,
                                             Damage::number, Damage::cut,     Damage::block,  Damage::number,
                                             Damage::bytes,  Damage::storage, Damage::link,   Damage::size};
  const Damage damage = kOrder[number % kOrder.size()];
  std::string bytes = bytes_of(sample);
  switch (damage) {
    case Damage::bytes:
      damage_bytes(bytes, random);
      break;
    case Damage::number:
      damage_number(bytes, random);
      break;
    case Damage::cut:
      damage_length(bytes, random);
      break;
    case Damage::block:
      damage_block(bytes, random);
      break;
    default:
      break;
  }
  write(file, bytes);
  if (damage < Damage::storage) return damage;
  const hid_t id = H5Fopen(file.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  if (id < 0) throw std::runtime_error(file.string() + ": the sample cannot be opened");
  if (damage == Damage::storage) damage_storage(id, secret, random);
  if (damage == Damage::link) damage_link(id, secret, random);
  if (damage == Damage::size) damage_size(id, random);
  H5Fclose(id);
  return damage;
}

}  // namespace wrenchd::test
