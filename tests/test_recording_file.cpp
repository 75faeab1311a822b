// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstring>
#include <fstream>
#include <limits>

#include <catch2/catch.hpp>
#include <hdf5.h>

#include "daemon/recording_file.hpp"
#include "tests/support/random_values.hpp"
#include "tests/support/temporary_directory.hpp"

using namespace wrenchd;
using namespace wrenchd::test;

namespace {

/// A record with random bits in every field, padding left zero.
TickRecord random_record(RandomValues& random) {
  TickRecord r;
  const auto any = [&](auto& field) {
    field = static_cast<std::remove_reference_t<decltype(field)>>(random.bits());
  };
  any(r.tick), any(r.now_ns), any(r.arrived_ns), any(r.sequence), any(r.acknowledged), any(r.skipped);
  any(r.missing), any(r.rejected), any(r.buttons), any(r.fresh), any(r.motors_on), any(r.watchdog_tripped);
  any(r.commands), any(r.contacts), any(r.iterations), any(r.projection_status), any(r.state), any(r.cause),
      any(r.faults);
  any(r.limit_causes), any(r.dropped), any(r.sample_fault), any(r.write_fault), any(r.motors_told),
      any(r.homed), any(r.slept_ns), any(r.answered_ns), any(r.repeated), any(r.commanded),
      any(r.stiffness_share), any(r.guard_share), any(r.energy_in_J), any(r.energy_out_J), any(r.injected_J),
      any(r.released), any(r.placing);
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
    RecordingWriter writer(file, {"1.2.3", "settings text", "scene text", ""});
    writer.append(std::span(records).first(1));
    writer.append({});
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

TEST_CASE("a recording of another format is refused, with its version", "[recording]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  { const RecordingWriter writer(file, {"0.0.9", "", "", ""}); }
  const std::string named = GENERATE(std::string("1"), std::string("3"), std::string("6"));
  {
    const hid_t opened = H5Fopen(file.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t table = H5Dopen2(opened, "/ticks", H5P_DEFAULT);
    if (named == "1") {  // the first had no such attribute
      H5Adelete(table, "format");
    } else {
      const hid_t attribute = H5Aopen(table, "format", H5P_DEFAULT);
      const hid_t type = H5Aget_type(attribute);
      H5Awrite(attribute, type, named.data());
      H5Tclose(type);
      H5Aclose(attribute);
    }
    H5Dclose(table);
    H5Fclose(opened);
  }
  CHECK_THROWS_WITH(read_recording(file),
                    Catch::Contains(file.string() + ": is of format " + named) &&
                        Catch::Contains("replay it with the wrenchd that wrote it (0.0.9)"));
}

TEST_CASE("recordings are refused with the file and the cure", "[recording]") {
  const TemporaryDirectory directory;
  const auto file = directory.path() / "run.h5";
  { const RecordingWriter writer(file, {}); }
  CHECK(read_recording(file).ticks.empty());
  CHECK_THROWS_WITH(RecordingWriter(file, {}), Catch::Contains("never overwritten"));
  CHECK_THROWS_WITH(RecordingWriter(directory.path() / "no" / "run.h5", {}),
                    Catch::Contains("cannot be created"));
  CHECK_THROWS_WITH(read_recording(directory.path() / "none.h5"), Catch::Contains("is not there"));
  std::ofstream(directory.path() / "text.h5") << "not HDF5";
  CHECK_THROWS_WITH(read_recording(directory.path() / "text.h5"), Catch::Contains("is not an HDF5 file"));
}
