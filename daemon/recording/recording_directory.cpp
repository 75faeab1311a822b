// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/recording_directory.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <regex>
#include <tuple>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>

#include "config/calibration_store.hpp"
#include "config/toml_file.hpp"
#include "core/fault.hpp"
#include "daemon/hand_file.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFlight = "flight-";
constexpr std::size_t kLongestName = 100;

bool is_set(const char* variable) {
  const char* const value = std::getenv(variable);
  return value != nullptr && *value != '\0';
}

bool is_plain(const std::string& name) {
  const auto good = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_' || c == '.';
  };
  return !name.empty() && name.size() <= kLongestName && name.front() != '.' &&
         std::all_of(name.begin(), name.end(), good);
}

}  // namespace

fs::path recordings_directory(const RecordingSettings& settings) {
  if (!settings.directory.empty()) return settings.directory;
  if (is_set("STATE_DIRECTORY")) return state_directory() / "recordings";
  if (is_set("XDG_STATE_HOME")) return fs::path(std::getenv("XDG_STATE_HOME")) / "wrenchd/recordings";
  if (is_set("HOME")) return fs::path(std::getenv("HOME")) / ".local/state/wrenchd/recordings";
  return {};
}

void make_recordings_directory(const fs::path& directory) {
  if (directory.empty())
    throw RecordingError(
        "there is no directory for recordings: neither STATE_DIRECTORY nor HOME is set; set directory in "
        "[recording]");
  std::error_code error;
  if (fs::is_directory(directory, error)) return;
  fs::create_directories(directory, error);
  std::error_code ignored;
  if (!fs::is_directory(directory, ignored))
    throw RecordingError(directory.string() + ": cannot be created (" + error.message() +
                         "); create it, or set directory in [recording] to a writable one");
  fs::permissions(directory, fs::perms::owner_all | fs::perms::group_read | fs::perms::group_exec, error);
}

std::string utc_stamp(std::time_t utc) {
  std::tm parts{};
  gmtime_r(&utc, &parts);
  std::array<char, 32> text{};
  return {text.data(), std::strftime(text.data(), text.size(), "%Y%m%dT%H%M%SZ", &parts)};
}

fs::path recording_path(const std::string& asked, const fs::path& directory, bool anywhere) {
  fs::path name = asked;
  if (anywhere && name.is_absolute()) return name.lexically_normal();
  if (!is_plain(asked))
    throw RecordingError(
        "'" + printable(asked, 60) + "' is not a valid name of a recording: use letters, digits, -, _ " +
        "and dots, without a directory; recordings are stored in " + directory.string() +
        (anywhere ? "; or use an absolute path" : "; only administrators may use another directory"));
  if (name.extension() != ".h5") name += ".h5";
  return directory / name;
}

double free_MB(const fs::path& directory) {
  std::error_code error;
  const fs::space_info space = fs::space(directory, error);
  if (error)
    throw RecordingError(directory.string() + ": cannot read the free space (" + error.message() + ")");
  return 1e-6 * static_cast<double>(space.available);
}

void check_free_space(const fs::path& directory, const RecordingSettings& settings) {
  const double left_MB = free_MB(directory);
  if (left_MB > settings.keep_free_MB) return;
  throw RecordingError(directory.string() + ": " + std::to_string(static_cast<long>(left_MB)) +
                       " MB are free, and " + to_text(settings.keep_free_MB) +
                       " MB must stay free; remove old recordings, or lower keep_free_MB in [recording]");
}

std::vector<StoredRecording> stored_recordings(const fs::path& directory) {
  std::vector<StoredRecording> found;
  std::error_code error;
  for (fs::directory_iterator at(directory, error), end; !error && at != end; at.increment(error)) {
    struct stat status {};
    const std::string name = at->path().filename().string();
    if (!is_plain(name) || !name.ends_with(".h5")) continue;
    if (::lstat(at->path().c_str(), &status) != 0 || !S_ISREG(status.st_mode)) continue;
    found.push_back({name, static_cast<std::uint64_t>(status.st_size), status.st_mtime});
  }
  std::sort(found.begin(), found.end(), [](const StoredRecording& a, const StoredRecording& b) {
    return std::tie(a.modified_at, a.name) < std::tie(b.modified_at, b.name);
  });
  return found;
}

OwnedFd open_recording(const fs::path& directory, const std::string& name) {
  const fs::path file = recording_path(name, directory, false);
  // The flags avoid following a symbolic link and blocking on a FIFO.
  OwnedFd fd(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  struct stat status {};
  if (fd && ::fstat(fd.get(), &status) == 0 && S_ISREG(status.st_mode)) return fd;
  std::string there;
  for (const StoredRecording& one : stored_recordings(directory))
    there += (there.empty() ? "" : ", ") + one.name;
  throw RecordingError(file.string() +
                       ": is no readable recording; there are: " + (there.empty() ? "none" : there));
}

fs::path flight_path(const fs::path& directory, std::time_t utc, std::string_view fault,
                     const std::string& hand) {
  const std::string name = kFlight + utc_stamp(utc) + "-" + std::string(fault);
  const auto path = [&](const std::string& number) {
    return file_of_hand(directory / (name + number + ".h5"), hand);
  };
  std::error_code ignored;
  fs::path file = path("");
  for (int i = 2; fs::exists(file, ignored); ++i) file = path("-" + std::to_string(i));
  return file;
}

bool is_flight_name(const std::string& name, const std::string& hand) {
  static const std::regex form = [] {
    std::string faults;
    for (const FaultRow& row : fault_rows()) faults += (faults.empty() ? "" : "|") + std::string(row.name);
    return std::regex(kFlight + ("[0-9]{8}T[0-9]{6}Z-(" + faults) + ")(-[0-9]+)?");
  }();
  const std::string end = (hand.empty() ? "" : "-" + hand) + ".h5";
  return name.ends_with(end) && std::regex_match(name.substr(0, name.size() - end.size()), form);
}

void prune_flights(const fs::path& directory, std::size_t most, const std::string& hand) {
  std::vector<fs::path> flights;
  std::error_code error;
  for (fs::directory_iterator at(directory, error), end; !error && at != end; at.increment(error)) {
    const std::string name = at->path().filename().string();
    if (is_flight_name(name, hand) && at->is_regular_file(error)) flights.push_back(at->path());
  }
  std::sort(flights.begin(), flights.end());  // the names sort by time
  for (std::size_t i = 0; i + most < flights.size(); ++i) fs::remove(flights[i], error);
}

}  // namespace wrenchd
