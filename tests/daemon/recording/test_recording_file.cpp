// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstring>
#include <fstream>
#include <limits>

#include <catch2/catch.hpp>
#include <hdf5.h>
#include <sys/stat.h>

#include "daemon/recording/recording_file.hpp"
#include "daemon/servo/record_fields.hpp"
#include "tests/support/random_values.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_recording_file {

using namespace wrenchd::test;

namespace {

/// A record with random bits in every field, padding left zero.
TickRecord random_record(RandomValues& random) {
  TickRecord r;
  const auto any = [&](auto& field) {
    field = static_cast<std::remove_reference_t<decltype(field)>>(random.bits());
  };
  any(r.tick), any(r.now_ns), any(r.arrived_ns), any(r.sequence), any(r.acknowledged_command),
      any(r.superseded);
  any(r.missing), any(r.rejected), any(r.buttons), any(r.fresh), any(r.motors_on), any(r.watchdog_tripped);
  any(r.commands), any(r.contacts), any(r.iterations), any(r.projection_status), any(r.state),
      any(r.state_cause), any(r.faults);
  any(r.limit_causes), any(r.undriven_dofs), any(r.sample_fault), any(r.write_fault), any(r.motors_commanded),
      any(r.homed), any(r.suspended_ns), any(r.wrench_ready_ns), any(r.repeated), any(r.last_command_sent),
      any(r.stiffness_scale), any(r.passivity_scale), any(r.energy_in_J), any(r.energy_out_J),
      any(r.injected_J), any(r.released), any(r.proxy_initialization), any(r.rendering_id),
      any(r.change_count), any(r.rendering_checksum);
  r.next_rendering_weight = random.normal(), r.contact_gain = random.normal();
  any(r.wake_latency_ns);
  for (auto& ns : r.stage_ns) any(ns);
  for (auto* list : {&r.X_BH, &r.X_WP, &r.X_WQ})
    for (double& x : *list) x = random.normal();
  for (auto* list : {&r.V_BH, &r.eps, &r.F_T, &r.F_out})
    for (double& x : *list) x = random.normal();
  r.device_time_s = random.normal();
  r.energy = -0.0;
  r.kkt_residual = std::numeric_limits<double>::denorm_min();
  r.authority = std::numeric_limits<double>::infinity();
  // A value that stands for a name has one.
  for (const RecordField& field : tick_fields()) {
    const std::size_t names = value_names(field.values).size();
    if (names == 0 || is_bits(field.values)) continue;
    auto* const lowest = reinterpret_cast<unsigned char*>(&r) + field.offset;
    const auto value = static_cast<unsigned char>(random.bits() % names);
    std::memset(lowest, 0, field.bytes());
    *lowest = value;
  }
  return r;
}

}  // namespace

TEST_CASE("a recording reads back as it was written, bit for bit", "[recording]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  RandomValues random(1);
  std::vector<TickRecord> records;
  for (int i = 0; i < 3000; ++i) records.push_back(random_record(random));
  {
    RecordingHeader header;
    header.version = "1.2.3";
    header.settings = "settings text";
    RecordingWriter writer(file, header);
    writer.append(std::span(records).first(1));
    writer.append(RecordBatch{});
    writer.append(std::span(records).subspan(1));
  }
  const Recording recording = read_recording(file);
  CHECK(recording.header.version == "1.2.3");
  CHECK(recording.header.settings == "settings text");
  CHECK(recording.header.profile.empty());
  REQUIRE(recording.ticks.size() == records.size());
  for (std::size_t i = 0; i < records.size(); ++i)
    REQUIRE(std::memcmp(&recording.ticks[i], &records[i], sizeof(TickRecord)) == 0);
}

TEST_CASE("a recording of another format is rejected with its version", "[recording]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  RecordingHeader header;
  header.version = "0.0.9";
  { const RecordingWriter writer(file, header); }
  const std::string named =
      GENERATE(std::string("1"), std::string("5"), std::string("6"), std::string("8"), std::string("10"));
  {
    const hid_t opened = H5Fopen(file.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t table = H5Dopen2(opened, "/ticks", H5P_DEFAULT);
    const auto put = [](hid_t object, const char* name, const std::string& text) {
      const hid_t type = H5Tcopy(H5T_C_S1);
      H5Tset_size(type, text.size());
      const hid_t space = H5Screate(H5S_SCALAR);
      const hid_t attribute = H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
      H5Awrite(attribute, type, text.data());
      H5Aclose(attribute), H5Sclose(space), H5Tclose(type);
    };
    H5Adelete(opened, "format");
    if (std::stoi(named) >= 6) {
      put(opened, "format", named);
    } else {  // formats up to 5 have the attribute at the table; format 1 has none
      if (named != "1") put(table, "format", named);
      put(table, "wrenchd_version", "0.0.9");
    }
    H5Dclose(table);
    H5Fclose(opened);
  }
  CHECK_THROWS_WITH(
      read_recording(file),
      Catch::Contains(file.string() + ": was written by wrenchd 0.0.9 in recording format " + named) &&
          Catch::Contains("replay or export it with the version that wrote it"));
}

TEST_CASE("a recording contains the contacts of each tick, independent of the pieces it was written in",
          "[recording]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  RandomValues random(2);
  RecordBatch all;
  std::vector<RecordBatch> pieces(1);
  for (int i = 0; i < 3000; ++i) {
    std::vector<Touch> contacts(random.bits() % 5);
    for (Touch& contact : contacts) {
      for (double& x : contact.point_W_m) x = random.normal();
      contact.load_fraction = random.normal();
      contact.obstacle = static_cast<std::uint32_t>(random.bits());
      contact.obstacle_feature_kind = 7;
    }
    const TickRecord tick = random_record(random);
    all.add(tick, contacts);
    if (i % 7 == 0) pieces.emplace_back();
    pieces.back().add(tick, contacts);
  }
  {
    RecordingWriter writer(file, {});
    for (const RecordBatch& piece : pieces) writer.append(piece);
  }
  const Recording recording = read_recording(file);
  REQUIRE(recording.ticks.size() == 3000);
  REQUIRE(recording.contacts.size() == all.contacts.size());
  for (std::size_t i = 0; i < 3000; ++i) {
    const auto contacts = recording.contacts_of(i);
    REQUIRE(contacts.size() == all.contact_ranges[i].count);
    for (std::size_t k = 0; k < contacts.size(); ++k)
      REQUIRE(std::memcmp(&contacts[k], &all.contacts[all.contact_ranges[i].first + k], sizeof(Touch)) == 0);
  }
}

TEST_CASE("the header of a recording reads back as it was written", "[recording]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  RecordingHeader header;
  header.version = "1.2.3";
  header.settings = std::string(100'000, 'x') + "\xC3\xA4";  // more than an attribute can hold
  header.scene_file = "/some/scene.toml";
  header.realtime = "off";
  header.rate_Hz = 4000.0;
  header.kernel = "Linux 6.1";
  header.virtual_time = true;
  header.hands = 2;
  header.hand = "left";
  header.started_ns = 12;
  header.started_unix_ns = 1'000'000'000'000'000'345;
  header.files = {{"hand_script", "/some/hand.toml", {}, true, "repeats = true"},
                  {"obstacle_0", "/some/large.off", "abcd", false, {}},
                  {"tool", "/some/cube.off", "ef01", true, std::string("OFF\0\1", 5)}};
  { const RecordingWriter writer(file, header); }
  const RecordingHeader read = read_recording(file).header;
  CHECK(read.version == header.version);
  CHECK(read.settings == header.settings);
  CHECK(read.scene_file == header.scene_file);
  CHECK(read.realtime == "off");
  CHECK(read.rate_Hz == 4000.0);
  CHECK(read.kernel == "Linux 6.1");
  CHECK(read.virtual_time);
  CHECK(read.hands == 2);
  CHECK(read.hand == "left");
  CHECK(read.started_ns == 12);
  CHECK(read.started_unix_ns == header.started_unix_ns);
  REQUIRE(read.files.size() == 3);
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK(read.files[i].role == header.files[i].role);
    CHECK(read.files[i].path == header.files[i].path);
    CHECK(read.files[i].sha256 == header.files[i].sha256);
    CHECK(read.files[i].embedded == header.files[i].embedded);
    CHECK(read.files[i].bytes == header.files[i].bytes);
  }
}

TEST_CASE("a recording that is cut short, or lacks a column, is rejected", "[recording]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  RandomValues random(3);
  std::vector<TickRecord> records;
  for (int i = 0; i < 2000; ++i) records.push_back(random_record(random));
  {
    RecordingWriter writer(file, {});
    writer.append(records);
  }
  const auto whole = std::filesystem::file_size(file);
  for (int i = 0; i < 40; ++i) {
    const auto cut = directory.path() / ("cut" + std::to_string(i) + ".h5");
    std::filesystem::copy_file(file, cut);
    std::filesystem::resize_file(cut, random.bits() % whole);
    CHECK_THROWS_WITH(read_recording(cut), Catch::Contains(cut.string()));
  }

  const auto other = directory.path() / "other.h5";
  const hid_t id = H5Fcreate(other.c_str(), H5F_ACC_EXCL, H5P_DEFAULT, H5P_DEFAULT);
  H5Fclose(id);
  CHECK_THROWS_WITH(read_recording(other), Catch::Contains("has no table 'ticks'"));

  // One column is renamed; all others are unchanged.
  std::ifstream in(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  const auto at = bytes.find("kkt_residual");
  REQUIRE(at != std::string::npos);
  bytes[at] = 'q';
  const auto renamed = directory.write("renamed.h5", bytes);
  CHECK_THROWS_WITH(read_recording(renamed), Catch::Contains("column 'kkt_residual' of table 'ticks' is"));
}

TEST_CASE("a recording with wrong bytes is read or rejected, without a crash", "[recording]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  RandomValues random(6);
  std::vector<TickRecord> records;
  for (int i = 0; i < 300; ++i) records.push_back(random_record(random));
  {
    RecordingWriter writer(file, {});
    writer.append(records);
  }
  std::ifstream in(file, std::ios::binary);
  const std::string good{std::istreambuf_iterator<char>(in), {}};
  int rejected = 0;
  for (int i = 0; i < 400; ++i) {
    std::string bytes = good;
    for (std::uint64_t k = 0; k <= random.bits() % 8; ++k)
      bytes[random.bits() % bytes.size()] = static_cast<char>(random.bits());
    const auto mutant = directory.write("mutant.h5", bytes);
    try {
      const Recording recording = read_recording(mutant);
      for (std::size_t row = 0; row < recording.ticks.size(); ++row)
        REQUIRE(recording.contacts_of(row).size() <= recording.contacts.size());
    } catch (const RecordingError& error) {
      ++rejected;
      REQUIRE(std::string(error.what()).find(mutant.string()) == 0);
    }
  }
  CHECK(rejected > 20);
}

/// Changes a recording through libhdf5. Returns the error of reading it.
template <class Change>
std::string rejection_after(const TemporaryDirectory& directory, const Change& change) {
  const auto file = directory.path() / "changed.h5";
  std::filesystem::remove(file);
  RandomValues random(8);
  {
    RecordingHeader header;
    header.scene = "scene text";
    header.files.push_back({"tool", "tool.off", std::string(64, '0'), true, "OFF"});
    RecordingWriter writer(file, header);
    writer.append(std::vector<TickRecord>(3, random_record(random)));
  }
  const hid_t id = H5Fopen(file.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  REQUIRE(id >= 0);
  change(id);
  H5Fclose(id);
  try {
    read_recording(file);
  } catch (const RecordingError& error) {
    CHECK_THAT(error.what(), Catch::StartsWith(file.string() + ": "));
    return error.what();
  }
  return {};
}

TEST_CASE("a recording that refers to other files or has other types is rejected with the reason",
          "[recording]") {
  using Catch::Contains;
  const TemporaryDirectory directory;
  const std::string secret = directory.write("secret", "root:$6$sEcReT:1:0:9:7:::\n").string();
  CHECK(rejection_after(directory, [](hid_t) {}).empty());

  const auto external_text = [&](hid_t file, const char* name) {
    H5Ldelete(file, name, H5P_DEFAULT);
    const hid_t plan = H5Pcreate(H5P_DATASET_CREATE), type = H5Tcopy(H5T_C_S1);
    H5Pset_external(plan, secret.c_str(), 0, 16);
    H5Tset_size(type, 16);
    const hid_t space = H5Screate(H5S_SCALAR);
    const hid_t set = H5Dcreate2(file, name, type, space, H5P_DEFAULT, plan, H5P_DEFAULT);
    REQUIRE(set >= 0);
    H5Dclose(set), H5Sclose(space), H5Tclose(type), H5Pclose(plan);
  };
  for (const char* name : {"/config/scene", "/config/settings"}) {
    const std::string text = rejection_after(directory, [&](hid_t file) { external_text(file, name); });
    CHECK_THAT(text, Contains("takes its data from another file (external storage)") && !Contains("sEcReT"));
  }
  CHECK_THAT(rejection_after(directory,
                             [&](hid_t file) {
                               H5Ldelete(file, "/meshes/tool", H5P_DEFAULT);
                               H5Lcreate_external(secret.c_str(), "/tool", file, "/meshes/tool", H5P_DEFAULT,
                                                  H5P_DEFAULT);
                             }),
             Contains("'tool' is a link to another file"));
  CHECK_THAT(rejection_after(directory,
                             [](hid_t file) {
                               H5Ldelete(file, "/ticks", H5P_DEFAULT);
                               H5Lcreate_soft("/contacts", file, "/ticks", H5P_DEFAULT, H5P_DEFAULT);
                             }),
             Contains("'ticks' is a symbolic link"));
  CHECK_THAT(rejection_after(directory,
                             [](hid_t file) {
                               H5Ldelete(file, "/ticks", H5P_DEFAULT);
                               const hid_t group =
                                   H5Gcreate2(file, "/ticks", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
                               H5Gclose(group);
                             }),
             Contains("'ticks' is no table and no text"));
  CHECK_THAT(rejection_after(directory,
                             [](hid_t file) {
                               H5Ldelete(file, "/ticks", H5P_DEFAULT);
                               const hsize_t rows = 4;
                               const hid_t plan = H5Pcreate(H5P_DATASET_CREATE),
                                           row = H5Tcreate(H5T_COMPOUND, 8);
                               H5Tinsert(row, "tick", 0, H5T_NATIVE_DOUBLE);
                               const hid_t space = H5Screate_simple(1, &rows, nullptr);
                               H5Pset_virtual(plan, space, "/etc/passwd", "/ticks", space);
                               const hid_t set =
                                   H5Dcreate2(file, "/ticks", row, space, H5P_DEFAULT, plan, H5P_DEFAULT);
                               REQUIRE(set >= 0);
                               H5Dclose(set), H5Sclose(space), H5Tclose(row), H5Pclose(plan);
                             }),
             Contains("takes its data from other data sets (virtual storage)"));
  CHECK_THAT(rejection_after(directory,
                             [](hid_t file) {
                               H5Ldelete(file, "/meshes/tool", H5P_DEFAULT);
                               const hsize_t many = hsize_t{1} << 40, piece = 1 << 16;
                               const hid_t plan = H5Pcreate(H5P_DATASET_CREATE);
                               H5Pset_chunk(plan, 1, &piece);
                               const hid_t space = H5Screate_simple(1, &many, nullptr);
                               const hid_t set = H5Dcreate2(file, "/meshes/tool", H5T_NATIVE_UINT8, space,
                                                            H5P_DEFAULT, plan, H5P_DEFAULT);
                               const std::uint8_t one = 1;
                               const hid_t scalar = H5Screate(H5S_SCALAR);
                               const hid_t embedded = H5Acreate2(set, "embedded", H5T_NATIVE_UINT8, scalar,
                                                                 H5P_DEFAULT, H5P_DEFAULT);
                               H5Awrite(embedded, H5T_NATIVE_UINT8, &one);
                               H5Aclose(embedded), H5Sclose(scalar);
                               H5Dclose(set), H5Sclose(space), H5Pclose(plan);
                             }),
             Contains("claims more bytes than the file can hold"));
  // A column of another type, and a value that no program has a name for.
  CHECK_THAT(rejection_after(directory,
                             [](hid_t file) {
                               H5Ldelete(file, "/contacts", H5P_DEFAULT);
                               const hsize_t none = 0;
                               const hid_t text = H5Tcopy(H5T_C_S1), row = H5Tcreate(H5T_COMPOUND, 256);
                               H5Tset_size(text, H5T_VARIABLE);
                               std::size_t at = 0;
                               for (const RecordField& field : contact_fields())
                                 H5Tinsert(row, field.name, (at += 8), text);
                               const hid_t space = H5Screate_simple(1, &none, nullptr);
                               const hid_t set = H5Dcreate2(file, "/contacts", row, space, H5P_DEFAULT,
                                                            H5P_DEFAULT, H5P_DEFAULT);
                               REQUIRE(set >= 0);
                               H5Dclose(set), H5Sclose(space), H5Tclose(row), H5Tclose(text);
                             }),
             Contains("has another type than in a recording"));
  const auto file = directory.path() / "value.h5";
  TickRecord tick;
  tick.state = 200;
  { RecordingWriter(file, {}).append(std::vector<TickRecord>(2, tick)); }
  CHECK_THROWS_WITH(read_recording(file),
                    Contains("column 'state' of table 'ticks' has the value 200 in row 0"));
}

TEST_CASE("a FIFO or a device in place of a recording is named as what it is", "[recording]") {
  const TemporaryDirectory directory;
  const auto fifo = directory.path() / "fifo.h5";
  REQUIRE(::mkfifo(fifo.c_str(), 0600) == 0);
  CHECK_THROWS_WITH(read_recording(fifo), Catch::Contains("is a FIFO; name a regular file"));
  CHECK_THROWS_WITH(read_recording("/dev/zero"), Catch::Contains("is a character device"));
}

TEST_CASE("recordings are rejected with the file and the remedy", "[recording]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  { const RecordingWriter writer(file, {}); }
  CHECK(read_recording(file).ticks.empty());
  CHECK_THROWS_WITH(RecordingWriter(file, {}), Catch::Contains("never overwrites"));
  CHECK_THROWS_WITH(RecordingWriter(directory.path() / "no" / "run.h5", {}),
                    Catch::Contains("cannot be created"));
  std::filesystem::create_symlink(directory.path() / "nowhere.h5", directory.path() / "link.h5");
  CHECK_THROWS_WITH(RecordingWriter(directory.path() / "link.h5", {}), Catch::Contains("never overwrites"));
  CHECK_THROWS_WITH(read_recording(directory.path() / "none.h5"), Catch::Contains("does not exist"));
  std::ofstream(directory.path() / "text.h5") << "not HDF5";
  CHECK_THROWS_WITH(read_recording(directory.path() / "text.h5"), Catch::Contains("is not an HDF5 file"));
}

TEST_CASE("ticks whose contacts were not written are dropped, and no contact is invented", "[recording]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  RandomValues random(3);
  Touch written{}, unwritten{};
  written.normal_W = {0.0, 0.0, 1.0};
  std::memset(static_cast<void*>(&unwritten), 0, sizeof unwritten);  // what HDF5 reads from a full disk
  RecordBatch batch;
  for (int i = 0; i < 20; ++i) {
    const bool lost = i == 5 || i >= 15;
    batch.add(random_record(random), std::vector<Touch>(2, lost ? unwritten : written));
  }
  { RecordingWriter(file, {}).append(batch); }
  const Recording recording = read_recording(file);
  REQUIRE(recording.ticks.size() == 15);
  for (std::size_t i = 0; i < 15; ++i) CHECK(recording.contacts_of(i).size() == (i == 5 ? 0 : 2));
}

TEST_CASE("a recording that is being written, or that another program has locked, is not called damaged",
          "[recording]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  RecordingWriter writer(file, {});
  const ProgramResult result = run_program("wrenchctl", {"replay", file.string()});
  CHECK(result.exit_code == 1);
  CHECK_THAT(result.err, Catch::Contains("is still being written, or another program has locked it") &&
                             !Catch::Contains("damaged"));
}

}  // namespace wrenchd::test_recording_file
