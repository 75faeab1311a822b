// SPDX-License-Identifier: GPL-3.0-or-later
#include <csignal>
#include <cstddef>
#include <cstdlib>
#include <functional>
#include <iomanip>
#include <limits>
#include <sstream>

#include <boost/crc.hpp>
#include <catch2/catch.hpp>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "config/calibration_store.hpp"
#include "tests/support/random_values.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_calibration_store {

namespace {

namespace fs = std::filesystem;
using namespace test;

const Calibration kOld{"polhem", "A-0017", {{"joint_1", 0.0125}, {"joint_2", -1e-7}, {"joint_3", 3.0}}};
const Calibration kNew{"polhem", "A-0017", {{"joint_1", 0.5}, {"joint_2", 0.25}, {"joint_3", -0.125}}};

bool same(const Calibration& a, const Calibration& b) {
  const auto same_offset = [](const AxisOffset& x, const AxisOffset& y) {
    return x.axis == y.axis && x.offset == y.offset;
  };
  return a.profile == b.profile && a.serial == b.serial &&
         std::equal(a.offsets.begin(), a.offsets.end(), b.offsets.begin(), b.offsets.end(), same_offset);
}

std::string contents(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// A store in a separate directory that does not exist yet.
struct Bench {
  TemporaryDirectory dir;
  fs::path place = dir.path() / "state" / "calibration";
  CalibrationStore store{place};
  fs::path file = store.file_of("polhem", "A-0017");

  bool holds(const Calibration& calibration) const {
    const auto read = store.read(calibration.profile, calibration.serial);
    return read && same(*read, calibration);
  }
  /// Returns the message with which the file is rejected; empty if it is read.
  std::string rejection() const {
    try {
      store.read("polhem", "A-0017");
    } catch (const ConfigError& error) {
      return error.what();
    }
    return {};
  }
  void put(const std::string& text) const {
    fs::create_directories(place);
    std::ofstream(file, std::ios::binary) << text;
  }
};

/// Returns the text with a valid checksum, so that the test covers its content.
std::string sealed(const std::string& body) {
  boost::crc_32_type crc;
  crc.process_bytes(body.data(), body.size());
  std::ostringstream text;
  text << body << "# crc32 " << std::hex << std::setfill('0') << std::setw(8) << crc.checksum() << '\n';
  return text.str();
}

TEST_CASE("a written calibration is read back bit for bit", "[calibration]") {
  Bench bench;
  CHECK_FALSE(bench.store.read("polhem", "A-0017"));  // a missing calibration is not an error
  bench.store.write(kOld);
  CHECK(bench.holds(kOld));
  bench.store.write(kNew);
  CHECK(bench.holds(kNew));
  CHECK_FALSE(bench.store.read("polhem", "A-0018"));
  CHECK_FALSE(bench.store.read("other", "A-0017"));  // same serial number, other model

  RandomValues random(6);
  for (int i = 0; i < 100; ++i) {
    Calibration calibration{"polhem", "A-0017", {}};
    for (int k = random.integer(0, 32); k > 0; --k)
      calibration.offsets.push_back(
          {"axis_" + std::to_string(k), random.normal() * random.log_uniform(1e-12, 1e3)});
    bench.store.write(calibration);
    CHECK(bench.holds(calibration));
  }
}

TEST_CASE("the file is text and readable by all users", "[calibration]") {
  Bench bench;
  bench.store.write(kOld);
  CHECK(contents(bench.file)
            .find("# wrenchd calibration 1\nprofile = \"polhem\"\nserial = \"A-0017\"\n"
                  "[[offset]]\naxis = \"joint_1\"\nvalue = 0.0125\n[[offset]]\n") == 0);
  CHECK(bench.file.filename() == "polhem@A-0017.toml");
  struct stat status {};
  REQUIRE(stat(bench.file.c_str(), &status) == 0);
  CHECK((status.st_mode & 0777) == 0644);
  CHECK(std::distance(fs::directory_iterator(bench.place), {}) == 1);  // no temporary file remains
}

TEST_CASE("every truncation of a file is rejected", "[calibration]") {
  Bench bench;
  const std::string whole = to_text(kOld);
  bench.put(whole);
  REQUIRE(bench.holds(kOld));
  for (std::size_t length = 0; length < whole.size(); ++length) {
    bench.put(whole.substr(0, length));
    CHECK_FALSE(bench.rejection().empty());
  }
}

TEST_CASE("every change of one byte and every additional byte is rejected", "[calibration]") {
  const std::string whole = to_text(kOld);
  const auto rejected = [](const std::string& text) {
    try {
      parse_calibration(text, "a file");
    } catch (const ConfigError&) {
      return true;
    }
    return false;
  };
  REQUIRE_FALSE(rejected(whole));
  int accepted = 0;
  for (std::size_t i = 0; i < whole.size(); ++i)
    for (int byte = 0; byte < 256; ++byte) {
      std::string changed = whole;
      changed[i] = static_cast<char>(byte);
      accepted += changed != whole && !rejected(changed);
    }
  for (std::size_t i = 0; i <= whole.size(); ++i)
    for (const char more : {'0', '\n', ' ', '\0'}) {
      std::string longer = whole;
      longer.insert(i, 1, more);
      accepted += longer != whole && !rejected(longer);
      std::string shorter = whole;
      shorter.erase(i, 1);
      accepted += i < whole.size() && !rejected(shorter);
    }
  CHECK(accepted == 0);
}

TEST_CASE("other files and other format versions are rejected with the remedy", "[calibration]") {
  struct Bad {
    std::string text;
    std::string message;
  };
  const std::string title = "# wrenchd calibration 1\n";
  const std::string names = "profile = \"polhem\"\nserial = \"A-0017\"\n";
  std::string many;
  for (int i = 0; i < 33; ++i) many += "[[offset]]\naxis = \"a" + std::to_string(i) + "\"\nvalue = 0\n";
  Bench bench;
  for (const Bad& bad : std::vector<Bad>{
           {"", "is no calibration of a device, or is damaged; remove it and calibrate the device again"},
           {"name = \"loopback\"\n", "is no calibration of a device"},
           {std::string(70000, 'x'), "is larger than 64 KiB"},
           {sealed("# wrenchd calibration 2\n" + names),
            "is a calibration of format 2, and this wrenchd supports format 1"},
           {title + names, "is damaged: its checksum does not fit"},
           {sealed(title + "profile = \"polhem\"\nserial = \"A-0018\"\n"),
            "is of device 'A-0018' with profile"},
           {sealed(title + "profile = \"falcon\"\nserial = \"A-0017\"\n"), "with profile 'falcon'"},
           {sealed(title + "profile = \"polhem\"\n"), "key 'serial' is missing"},
           {sealed(title + names + "gain = 2.0\n"), "key 'gain' is not known"},
           {sealed(title + names + "[[offset]]\naxis = \"x\"\n"), "key 'offset[0].value' is missing"},
           {sealed(title + names + "[[offset]]\naxis = \"x\"\nvalue = nan\n"), "expected a number"},
           {sealed(title + names + "[[offset]]\naxis = \"x\"\nvalue = 1e5\n"),
            "expected a number from -10000"},
           {sealed(title + names + "[[offset]]\naxis = \"../x\"\nvalue = 0\n"),
            "'../x' is no name of an axis"},
           {sealed(title + names +
                   "[[offset]]\naxis = \"x\"\nvalue = 0\n[[offset]]\naxis = \"x\"\nvalue = 1\n"),
            "axis 'x' has two offsets"},
           {sealed(title + names + many), "more than 32 axes have an offset"},
           {sealed(title + names + "value = \n"), "is not valid TOML"},
       }) {
    INFO(bad.text.substr(0, 200));
    bench.put(bad.text);
    const std::string message = bench.rejection();
    INFO(message);
    CHECK(message.find(bench.file.string()) == 0);
    CHECK(message.find(bad.message) != std::string::npos);
  }
}

TEST_CASE("only regular files are accepted", "[calibration]") {
  Bench bench;
  fs::create_directories(bench.file);
  CHECK(bench.rejection().find("is not a regular file") != std::string::npos);
  fs::remove(bench.file);
  const auto elsewhere = bench.dir.write("elsewhere", to_text(kOld));
  fs::create_symlink(elsewhere, bench.file);
  CHECK(bench.rejection().find("cannot be opened") != std::string::npos);
  fs::remove(bench.file);
  REQUIRE(mkfifo(bench.file.c_str(), 0600) == 0);
  CHECK(bench.rejection().find("is not a regular file") !=
        std::string::npos);  // the read does not wait for a writer
  // Writing replaces any file of that name and follows no link.
  fs::remove(bench.file);
  fs::create_symlink(elsewhere, bench.file);
  bench.store.write(kNew);
  CHECK(bench.holds(kNew));
  CHECK(contents(elsewhere) == to_text(kOld));
}

TEST_CASE("any serial number gets a file of its own inside the directory", "[calibration]") {
  Bench bench;
  const std::vector<std::string> names = {".",
                                          "..",
                                          "../../etc/passwd",
                                          "/etc/passwd",
                                          "a/b",
                                          "a%2Fb",
                                          "a\\b",
                                          "-rf",
                                          "~root",
                                          "$(reboot)",
                                          std::string("a\0b", 3),
                                          "a\nb",
                                          "\"]\n[limits]",
                                          "\xff\xfe",
                                          "A",
                                          "a",
                                          "a b",
                                          " a",
                                          "a.",
                                          ".a",
                                          "@",
                                          "a@b",
                                          "%",
                                          "%41",
                                          "ein Ger\xc3\xa4t",
                                          std::string(200, 'x')};
  std::size_t made = 0;
  for (const std::string& profile : {std::string("polhem"), std::string("../x"), std::string("polhem@")})
    for (const std::string& serial : names) {
      const fs::path file = bench.store.file_of(profile, serial);
      CHECK(file.parent_path() == bench.place);
      CHECK(file.filename().string().front() != '.');
      const Calibration calibration{profile, serial, {{"x", static_cast<double>(++made)}}};
      bench.store.write(calibration);
      CHECK(bench.holds(calibration));
    }
  CHECK(static_cast<std::size_t>(std::distance(fs::directory_iterator(bench.place), {})) == made);
  CHECK(std::distance(fs::directory_iterator(bench.dir.path()), {}) == 1);
  CHECK(bench.store.read("polhem", "..")->offsets.at(0).offset == 2.0);  // each name has its own file

  CHECK_THROWS_WITH(bench.store.file_of("polhem", ""), Catch::Contains("has no serial number"));
  CHECK_THROWS_WITH(bench.store.file_of("", "A"), Catch::Contains("has no name"));
  CHECK_THROWS_WITH(bench.store.file_of("polhem", std::string(80, '/')), Catch::Contains("too long"));
}

TEST_CASE("a calibration that could not be read back is not written", "[calibration]") {
  Bench bench;
  bench.store.write(kOld);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const std::vector<AxisOffset>& offsets :
       {std::vector<AxisOffset>{{"x", nan}}, {{"x", 1e9}}, {{"x", 0}, {"x", 1}}, {{"", 0}}, {{"a\"b", 0}}})
    CHECK_THROWS_AS(bench.store.write({"polhem", "A-0017", offsets}), std::invalid_argument);
  CHECK(bench.holds(kOld));
}

TEST_CASE("the state directory is that of systemd, or the default", "[calibration]") {
  const char* before = std::getenv("STATE_DIRECTORY");
  const std::string kept = before != nullptr ? before : "";
  setenv("STATE_DIRECTORY", "/var/lib/one:/var/lib/two", 1);
  CHECK(state_directory() == "/var/lib/one");
  setenv("STATE_DIRECTORY", "", 1);
  CHECK(state_directory() == "/var/lib/wrenchd");
  unsetenv("STATE_DIRECTORY");
  CHECK(state_directory() == "/var/lib/wrenchd");
  if (before != nullptr) setenv("STATE_DIRECTORY", kept.c_str(), 1);
}

/// Runs `prepare` and then `work` in a child process. Returns its exit status.
int in_child(const std::function<bool()>& prepare, const std::function<int()>& work) {
  const pid_t child = fork();
  REQUIRE(child >= 0);
  if (child == 0) _exit(prepare() ? work() : 90);
  int status = 0;
  REQUIRE(waitpid(child, &status, 0) == child);
  return status;
}

/// Makes one system call fail in this way from now on.
bool forbid(long call, std::uint32_t fate) {
  sock_filter filter[] = {
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(call), 0, 1),
      BPF_STMT(BPF_RET | BPF_K, fate),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
  };
  const sock_fprog program{4, filter};
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
}

/// Limits the size of files from now on: bytes beyond the limit are not written.
bool let_files_be_short(rlim_t bytes) {
  std::signal(SIGXFSZ, SIG_IGN);
  const rlimit limit{bytes, bytes};
  return setrlimit(RLIMIT_FSIZE, &limit) == 0;
}

#ifdef SYS_rename
constexpr long kRename = SYS_rename;
#else
constexpr long kRename = SYS_renameat;
#endif

TEST_CASE("a crash between any two steps leaves the old calibration or the new one", "[calibration]") {
  struct Step {
    long call;
    const char* before;
    const Calibration* left;
  };
  for (const Step& step :
       {Step{SYS_write, "the first byte", &kOld}, Step{SYS_fchmod, "the mode", &kOld},
        Step{SYS_fdatasync, "the data are on the disk", &kOld}, Step{kRename, "the new name", &kOld},
        Step{SYS_fsync, "the name is on the disk", &kNew}}) {
    INFO("killed before " << step.before);
    Bench bench;
    bench.store.write(kOld);
    const int status = in_child([&] { return forbid(step.call, SECCOMP_RET_KILL_PROCESS); },
                                [&] {
                                  bench.store.write(kNew);
                                  return 0;
                                });
    REQUIRE(WIFSIGNALED(status));
    REQUIRE(WTERMSIG(status) == SIGSYS);
    CHECK(bench.holds(*step.left));
    bench.store.write(kNew);  // a remaining temporary file does not interfere
    CHECK(bench.holds(kNew));
  }
}

TEST_CASE("a disk that is full, or a directory that is locked, leaves the old calibration", "[calibration]") {
  struct Trouble {
    std::function<bool()> prepare;
    std::string message;
  };
  const auto fails = [](long call) { return [call] { return forbid(call, SECCOMP_RET_ERRNO | ENOSPC); }; };
  for (const Trouble& trouble : {Trouble{[] { return let_files_be_short(0); }, "File too large"},
                                 Trouble{[] { return let_files_be_short(100); }, "File too large"},
                                 Trouble{fails(SYS_fchmod), "No space left on device"},
                                 Trouble{fails(SYS_fdatasync), "No space left on device"},
                                 Trouble{fails(kRename), "No space left on device"}}) {
    Bench bench;
    bench.store.write(kOld);
    const int status = in_child(trouble.prepare, [&] {
      try {
        bench.store.write(kNew);
      } catch (const std::runtime_error& error) {
        return std::string(error.what()).find(trouble.message) != std::string::npos ? 42 : 43;
      }
      return 44;
    });
    REQUIRE(WIFEXITED(status));
    CHECK(WEXITSTATUS(status) == 42);
    CHECK(bench.holds(kOld));
    CHECK(std::distance(fs::directory_iterator(bench.place), {}) == 1);  // no temporary file remains
  }
  const CalibrationStore nowhere("/proc/wrenchd/calibration");
  CHECK_THROWS_WITH(nowhere.write(kOld),
                    Catch::Contains("cannot be made") && Catch::Contains("STATE_DIRECTORY"));
}

}  // namespace
}  // namespace wrenchd::test_calibration_store
