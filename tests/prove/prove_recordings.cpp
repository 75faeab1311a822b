// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <sstream>
#include <string>

#include <CLI/CLI.hpp>

#include "daemon/recording/recording_file.hpp"
#include "tests/support/mutated_recording.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tools/export_recording.hpp"

// Reads mutated recordings as replay, export, plot, view and playback read them. Libhdf5 crashes or loops on
// some of them; the reader must not. A crash of this process ends it, so that the proof fails.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;

/// Longest time for a file of this size [s].
constexpr double kMax_s = 2.0;

struct Count {
  std::uint64_t read = 0, rejected = 0, reader_failed = 0, endless = 0, late = 0;
  double longest_s = 0.0;
};

void read_mutant(const std::filesystem::path& file, Count& count) {
  const auto start = std::chrono::steady_clock::now();
  try {
    const Recording recording = read_recording(file);
    std::ostringstream text;
    write_csv(text, recording, {});
    ++count.read;
  } catch (const RecordingError& error) {
    const std::string why = error.what();
    ++count.rejected;
    if (why.find("made libhdf5 fail") != std::string::npos) ++count.reader_failed;
    if (why.find("does not end") != std::string::npos) ++count.endless;
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  count.longest_s = std::max(count.longest_s, took.count());
  if (took.count() > kMax_s) ++count.late;
}

}  // namespace

int main(int argc, char** argv) {
  std::uint64_t cases = 5000, seed = 1;
  CLI::App app("Reads mutated recordings; none may crash or hang the reader");
  app.add_option("--cases", cases, "number of mutated recordings");
  app.add_option("--seed", seed, "seed of the mutations");
  CLI11_PARSE(app, argc, argv);

  const TemporaryDirectory directory;
  const auto good_file = directory.path() / "good.h5", mutant = directory.path() / "mutant.h5";
  write_sample_recording(good_file);
  const std::string good = read_bytes(good_file);
  RandomValues random(seed);
  Count count;
  for (std::uint64_t i = 0; i < cases; ++i) {
    write_bytes(mutant, mutate(good, random));
    read_mutant(mutant, count);
  }
  const auto number = [](std::uint64_t n) { return static_cast<unsigned long long>(n); };
  std::printf(
      "recordings cases %llu crashes 0 violations %llu read %llu rejected %llu library_crashes %llu "
      "library_hangs %llu longest_s %.2f seed %llu\n",
      number(cases), number(count.late), number(count.read), number(count.rejected),
      number(count.reader_failed), number(count.endless), count.longest_s, number(seed));
  return count.late == 0 ? 0 : 1;
}
