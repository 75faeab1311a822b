// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>

#include <CLI/CLI.hpp>
#include <hdf5.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "daemon/recording/recording_file.hpp"
#include "tests/support/recording_mutation.hpp"
#include "tests/support/temporary_directory.hpp"

// Reads damaged and hostile recordings. Each mutant is read or rejected; the reader does not crash, takes at
// most 2 s of processor time, and says nothing of a file to which the mutant refers. A process for every some
// mutants reads them, so that a crash of the reader is counted and does not end the proof.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;
namespace fs = std::filesystem;

constexpr double kMostTime_s = 2.0;
/// Longest time of the clock. A machine under load gives the reader a part of its processor only.
constexpr double kMostWall_s = 20.0;
constexpr const char* kSecret = "root:$6$sEcReT:19000:0:99999:7:::";

struct Figures {
  long read = 0, rejected = 0, leaks = 0, hangs = 0, crashes = 0;
  double slowest_s = 0.0, slowest_wall_s = 0.0;
};

double cpu_s() {
  double sum = 0.0;
  for (const int who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage used{};
    ::getrusage(who, &used);
    for (const timeval& part : {used.ru_utime, used.ru_stime})
      sum += static_cast<double>(part.tv_sec) + 1e-6 * static_cast<double>(part.tv_usec);
  }
  return sum;
}

bool quotes_secret(const Recording& recording) {
  const auto has = [](const std::string& text) { return text.find("sEcReT") != std::string::npos; };
  const RecordingHeader& header = recording.header;
  return has(header.scene) || has(header.settings) || has(header.profile) ||
         std::any_of(header.files.begin(), header.files.end(),
                     [&](const RecordedFile& file) { return has(file.bytes); });
}

void read_mutant(const fs::path& file, Figures& figures) {
  const double begin_s = cpu_s();
  const auto begin = std::chrono::steady_clock::now();
  try {
    const Recording recording = read_recording(file);
    // What every program does with a recording.
    for (std::size_t row = 0; row < recording.ticks.size(); ++row)
      static_cast<void>(recording.contacts_of(row));
    ++figures.read;
    if (quotes_secret(recording)) ++figures.leaks;
  } catch (const RecordingError& error) {
    ++figures.rejected;
    if (std::string(error.what()).find("sEcReT") != std::string::npos) ++figures.leaks;
  }
  const double took_s = cpu_s() - begin_s;
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  figures.slowest_s = std::max(figures.slowest_s, took_s);
  figures.slowest_wall_s = std::max(figures.slowest_wall_s, wall_s);
  if (took_s > kMostTime_s || wall_s > kMostWall_s) ++figures.hangs;
}

/// Reads the mutants [first, end) in a process of its own. A crash counts one, and the next process goes on
/// behind the mutant.
void read_in_processes(const fs::path& directory, std::uint64_t seed, long first, long end,
                       Figures& figures) {
  while (first < end) {
    std::array<int, 2> pipe{};
    if (::pipe(pipe.data()) != 0) throw std::runtime_error("pipe");
    const pid_t pid = ::fork();
    if (pid == 0) {
      ::close(pipe[0]);
      H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
      for (long i = first; i < end; ++i) {
        const fs::path file = directory / "mutant.h5";
        Figures one;
        mutate_recording(directory / "sample.h5", file, directory / "secret", seed,
                         static_cast<std::uint64_t>(i));
        read_mutant(file, one);
        if (::write(pipe[1], &one, sizeof one) != sizeof one) ::_exit(1);
      }
      ::_exit(0);
    }
    ::close(pipe[1]);
    Figures one;
    while (::read(pipe[0], &one, sizeof one) == sizeof one) {
      ++first;
      figures.read += one.read, figures.rejected += one.rejected, figures.leaks += one.leaks,
          figures.hangs += one.hangs;
      figures.slowest_s = std::max(figures.slowest_s, one.slowest_s);
      figures.slowest_wall_s = std::max(figures.slowest_wall_s, one.slowest_wall_s);
      if (one.leaks + one.hangs > 0)
        std::fprintf(stderr, "prove_recordings: mutant %ld: %s\n", first - 1,
                     one.leaks > 0 ? "quotes another file" : "takes too long");
    }
    ::close(pipe[0]);
    int status = 0;
    ::waitpid(pid, &status, 0);
    if (first >= end) break;
    ++figures.crashes;
    std::fprintf(stderr, "prove_recordings: mutant %ld ends the reader (status %d)\n", first, status);
    ++first;
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("prove_recordings: reads damaged and hostile recordings.");
  long cases = 1000;
  std::uint64_t seed = 1;
  app.add_option("--cases", cases, "number of mutants")
      ->check(CLI::Range(1L, 100'000'000L))
      ->capture_default_str();
  app.add_option("--seed", seed, "seed of the mutations")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    const TemporaryDirectory files;
    write_sample_recording(files.path() / "sample.h5");
    files.write("secret", std::string(kSecret) + "\n" + std::string(4000, 's'));
    Figures figures;
    constexpr long kPerProcess = 500;
    for (long first = 0; first < cases; first += kPerProcess)
      read_in_processes(files.path(), seed, first, std::min(first + kPerProcess, cases), figures);
    const long violations = figures.crashes + figures.hangs + figures.leaks;
    std::printf(
        "recordings cases %ld read %ld rejected %ld crashes %ld hangs %ld leaks %ld slowest_cpu_s %.2f "
        "slowest_s %.2f violations %ld seed %llu\n",
        cases, figures.read, figures.rejected, figures.crashes, figures.hangs, figures.leaks,
        figures.slowest_s, figures.slowest_wall_s, violations, static_cast<unsigned long long>(seed));
    return violations == 0 ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "prove_recordings: %s\n", error.what());
    return 1;
  }
}
