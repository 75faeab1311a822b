// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include <fcntl.h>

#include "config/calibration_store.hpp"
#include "config/known_profiles.hpp"
#include "core/files/opened_file.hpp"
#include "core/transitions.hpp"
#include "daemon/control/owned_fd.hpp"
#include "daemon/recording/recording_reader.hpp"
#include "devices/report_codec.hpp"
#include "tests/fuzz/fuzz_config.hpp"
#include "tests/fuzz/fuzz_mesh.hpp"
#include "tests/fuzz/fuzz_recording.hpp"
#include "tests/fuzz/fuzz_report.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/recording_mutation.hpp"
#include "tests/support/sample_descriptors.hpp"
#include "tests/support/sample_meshes.hpp"
#include "tests/support/temporary_directory.hpp"

// Writes the initial corpus of a fuzz target: small valid inputs into DIRECTORY, and a dictionary of words
// into DIRECTORY.dict. The inputs come from the shipped files and from the samples of the tests.

namespace {

using namespace wrenchd;
using namespace wrenchd::test;
namespace fs = std::filesystem;

const fs::path kConfig = test::source_path("config");

struct Seeds {
  std::vector<std::string> inputs;
  std::set<std::string> words;
};

std::string text_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error(file.string() + ": cannot be read");
  return {std::istreambuf_iterator<char>(in), {}};
}

char to_char(unsigned byte) {
  return static_cast<char>(static_cast<unsigned char>(byte));
}

/// Returns all runs of letters, digits, _ and - with 3 to 31 characters: keys and names.
std::set<std::string> words_in(const std::string& text) {
  std::set<std::string> words;
  std::string word;
  for (const char c : text + ' ') {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-') {
      word += c;
      continue;
    }
    if (word.size() > 2 && word.size() < 32) words.insert(word);
    word.clear();
  }
  return words;
}

/// Returns the words in quotation marks in the sources of a directory: all keys, also those that no shipped
/// file uses.
std::set<std::string> quoted_words(const fs::path& directory) {
  std::set<std::string> words;
  for (const auto& entry : fs::directory_iterator(directory)) {
    if (entry.path().extension() != ".cpp") continue;
    const std::string text = text_of(entry.path());
    for (std::size_t open = text.find('"'); open != std::string::npos;) {
      const std::size_t close = text.find('"', open + 1);
      if (close == std::string::npos) break;
      const std::string quoted = text.substr(open + 1, close - open - 1);
      if (words_in(quoted) == std::set<std::string>{quoted}) words.insert(quoted);
      open = text.find('"', close + 1);
    }
  }
  return words;
}

std::string without_comments(const std::string& text) {
  std::string out, line;
  for (const char c : text + '\n') {
    line += c;
    if (c != '\n') continue;
    if (line.find_first_not_of(" \n") != std::string::npos && line.front() != '#') out += line;
    line.clear();
  }
  return out;
}

/// Removes the directories of mesh paths, because fuzz_config stores its mesh beside the input.
std::string without_mesh_directory(std::string text) {
  for (std::size_t at; (at = text.find("../meshes/")) != std::string::npos;) text.erase(at, 10);
  return text;
}

Seeds config_seeds() {
  Seeds seeds;
  const auto add = [&](FileKind kind, const std::string& text) {
    seeds.inputs.push_back(to_char(static_cast<unsigned>(kind)) + text);
    seeds.words.merge(words_in(text));
  };
  const auto add_all = [&](FileKind kind, const fs::path& directory) {
    for (const auto& entry : fs::directory_iterator(directory))
      add(kind, without_mesh_directory(without_comments(text_of(entry.path()))));
  };
  add(FileKind::settings, without_comments(text_of(kConfig / "wrenchd.toml")));
  add_all(FileKind::scene, kConfig / "scenes");
  add_all(FileKind::profile, kConfig / "profiles");
  add_all(FileKind::hand_script, kConfig / "hands");
  const std::string calibration =
      to_text(Calibration{"polhem", "A-0017", {{"joint_1", 0.0125}, {"joint_2", -1.5}}});
  add(FileKind::calibration, calibration);
  add(FileKind::calibration_without_checksum, calibration.substr(0, calibration.rfind("# crc32")));
  seeds.words.merge(quoted_words(kConfig));
  for (const char* sign :
       {"[[", "]]", " = ", "= [", "{ ", " }", "\"\"\"", "'''", "nan", "inf", "1e308", "0x7f", "-1"})
    seeds.words.insert(sign);
  return seeds;
}

/// For each profile: ten reports 1 ms apart; the host reads each and writes a command.
Seeds report_seeds() {
  Seeds seeds;
  const auto profiles = known_profiles(SearchPath({kConfig})).profiles;
  const auto step = [](Step s) { return to_char(static_cast<unsigned>(s)); };
  for (std::size_t p = 0; p < profiles.size(); ++p) {
    std::string input(1, to_char(static_cast<unsigned>(p)));
    input += step(Step::read);
    for (unsigned i = 0; i < 10; ++i) {
      input += step(Step::advance) + std::string(1, to_char(0x6f));
      for (unsigned report = 0; report <= profiles[p].more_reports.size(); ++report) {
        input += step(Step::plausible) + std::string(1, to_char(report));
        input += std::string(1, '\0') + to_char(100) + std::string(1, '\0');  // sequence 1, time 1 ms later
        input += std::string(15 + 3 + kMaxJoints, to_char(i % 3)) + std::string(1, to_char(1));
      }
      input += step(Step::read);
      input += step(Step::command) + std::string(1, to_char(3)) + std::string(12, to_char(i));
    }
    seeds.inputs.push_back(input);
  }
  return seeds;
}

Seeds descriptor_seeds() {
  Seeds seeds;
  std::vector<Bytes> samples = sample_descriptors();
  samples.push_back(reference_descriptor());
  for (const Bytes& bytes : samples) {
    seeds.inputs.emplace_back(bytes.begin(), bytes.end());
    for (std::size_t i = 0; i + 1 < bytes.size(); ++i)
      seeds.words.emplace(bytes.begin() + static_cast<std::ptrdiff_t>(i),
                          bytes.begin() + static_cast<std::ptrdiff_t>(i + 2));
  }
  return seeds;
}

Seeds mesh_seeds() {
  Seeds seeds;
  const PolygonSoup quads = box({0, 0, 0}, {2, 3, 4}), triangles = triangulated(quads);
  const std::array<std::vector<std::string>, 4> texts = {{
      {as_off(quads), as_off(inside_out(quads)), as_off(concatenated(quads, box({5, 0, 0}, {6, 1, 1})))},
      {as_obj(quads), as_obj(triangles)},
      {as_ascii_stl(triangles), as_binary_stl(triangles)},
      {as_ascii_ply(quads), as_binary_ply(triangles), as_binary_ply(quads, true)},
  }};
  for (std::size_t format = 0; format < texts.size(); ++format)
    for (const std::string& text : texts[format])
      for (const unsigned surface : {0U, 4U}) {
        seeds.inputs.push_back(to_char(static_cast<unsigned>(format) + surface) + text);
        if (surface == 0 &&
            std::all_of(text.begin(), text.end(), [](char c) { return c == '\n' || (c >= ' ' && c <= '~'); }))
          seeds.words.merge(words_in(text));
      }
  for (const char* word : {"COFF",
                           "NOFF",
                           "STOFF",
                           "nOFF",
                           "4OFF",
                           "BINARY",
                           "vn ",
                           "vt ",
                           "usemtl",
                           "mtllib",
                           "f 1//1",
                           "-1",
                           "1/1/1",
                           "binary_little_endian",
                           "binary_big_endian",
                           "property list",
                           "uint8",
                           "float64",
                           "int32",
                           "ushort",
                           "short",
                           "char",
                           "obj_info",
                           "comment",
                           "nan",
                           "inf",
                           "1e308",
                           "1e-308",
                           "\r\n",
                           "\\\n"})
    seeds.words.insert(word);
  return seeds;
}

/// Passes the self-test, arms with a calm hand, and stays at full authority.
Seeds event_seeds() {
  constexpr int kArmed = 60, kTicks = 400;
  std::string run;
  for (int tick = 0; tick < kTicks; ++tick) {
    run += static_cast<char>(tick == kArmed ? 0x30 : 0x20);
    run += static_cast<char>(tick >= 24 && tick < 40 ? 0x04 : 0x02);
    if (tick == kArmed) run += static_cast<char>(Trigger::arm);
  }
  Seeds seeds;
  seeds.inputs.push_back(run);
  return seeds;
}

/// Valid requests, and requests that are rejected for each reason; the first byte selects the role.
Seeds request_seeds() {
  Seeds seeds;
  const std::string head = R"({"jsonrpc":"2.0","id":1,"method":")",
                    move = head + R"(scene.move","params":{"name":"a")";
  for (
      const std::string& line :
      {head + R"(stop"})", std::string(R"({"jsonrpc":"2.0","method":"stop","params":{}})"),
       move +
           R"(,"position_m":[0.1,-2e-3,3],"duration_s":0.5,"count":7,"names":["b"],"at_once":true,"more":{}}})",
       move + R"(,"position_m":[1,2]}})", move + R"(,"position":1}})", "[" + head + R"(stop"}])",
       move + R"(,"more":{"x":[[[1]]],"y":null,"y":1}}})",
       std::string(R"({"jsonrpc":"1.0","id":"x","method":5})")})
    for (const char role : {'\0', '\1', '\2'}) seeds.inputs.push_back(role + line + '\n' + line);
  for (const char* word : {"\"jsonrpc\":\"2.0\"",
                           "\"id\":",
                           "\"method\":",
                           "\"params\":{",
                           "scene.move",
                           "stop",
                           "name",
                           "position_m",
                           "duration_s",
                           "count",
                           "names",
                           "at_once",
                           "more",
                           "\\u0000",
                           "\\ud800",
                           "1e999",
                           "-9007199254740993",
                           "true",
                           "null",
                           "\xff",
                           "[[[[[[[[[[[[[[[[["})
    seeds.words.insert(word);
  return seeds;
}

/// A small recording as a file, and as the child process sends it.
Seeds recording_seeds() {
  const TemporaryDirectory directory;
  const fs::path file = directory.path() / "sample.h5", stream = directory.path() / "stream";
  write_sample_recording(file);
  {
    const OwnedFd out(::open(stream.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
    const OpenedFile opened(file);
    RecordingSender sender(out.get());
    send_hdf5(
        opened.fd(), opened.size_bytes(), [] {}, sender);
  }
  const auto kind = [](RecordingInput input) { return to_char(static_cast<unsigned>(input)); };
  Seeds seeds;
  seeds.inputs = {kind(RecordingInput::file) + text_of(file), kind(RecordingInput::stream) + text_of(stream)};
  for (const char* word :
       {"OHDR", "OCHK", "FRHP", "FHDB", "BTHD", "BTLF", "TREE", "SNOD", "HEAP", "GCOL", "\x89HDF\r\n\x1a\n"})
    seeds.words.insert(word);
  return seeds;
}

Seeds seeds_of(const std::string& target) {
  if (target == "fuzz_recording") return recording_seeds();
  if (target == "fuzz_events") return event_seeds();
  if (target == "fuzz_request") return request_seeds();
  if (target == "fuzz_config") return config_seeds();
  if (target == "fuzz_report") return report_seeds();
  if (target == "fuzz_report_descriptor") return descriptor_seeds();
  if (target == "fuzz_mesh") return mesh_seeds();
  return {};  // no initial corpus
}

void write(const Seeds& seeds, const fs::path& directory) {
  fs::create_directories(directory);
  for (std::size_t i = 0; i < seeds.inputs.size(); ++i)
    std::ofstream(directory / ("seed_" + std::to_string(i)), std::ios::binary) << seeds.inputs[i];
  std::ofstream dictionary(directory.string() + ".dict");
  for (const std::string& word : seeds.words) {
    dictionary << '"';
    for (const char c : word) {
      std::array<char, 5> code{};
      std::snprintf(code.data(), code.size(), "\\x%02X",
                    static_cast<unsigned>(static_cast<unsigned char>(c)));
      dictionary << code.data();
    }
    dictionary << "\"\n";
  }
  if (!dictionary)
    throw std::runtime_error(directory.string() + ": cannot be written; name another directory");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fputs("usage: fuzz_seeds TARGET DIRECTORY\n", stderr);
    return 2;
  }
  try {
    write(seeds_of(argv[1]), argv[2]);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "fuzz_seeds: %s\n", error.what());
    return 1;
  }
}
