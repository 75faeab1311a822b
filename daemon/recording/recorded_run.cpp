// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/recorded_run.hpp"

#include <cerrno>
#include <cstdlib>
#include <string>
#include <system_error>

#include "daemon/recording/recorded_inputs.hpp"

namespace wrenchd {
namespace {

std::filesystem::path new_directory() {
  std::string name = (std::filesystem::temp_directory_path() / "wrenchd-recorded-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) throw std::system_error(errno, std::generic_category(), name);
  return name;
}

void discard(const std::filesystem::path& directory) noexcept {
  std::error_code ignored;
  std::filesystem::remove_all(directory, ignored);
}

}  // namespace

RecordedRun::RecordedRun(const RecordingHeader& header) : directory_(new_directory()) {
  try {
    config_ = unpack_run_config(header, directory_);
  } catch (...) {
    discard(directory_);
    throw;
  }
}

RecordedRun::~RecordedRun() {
  discard(directory_);
}

}  // namespace wrenchd
