// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/output_set.hpp"

#include <stdexcept>
#include <system_error>

#include <unistd.h>

#include "tools/output_file.hpp"

namespace wrenchd {

namespace fs = std::filesystem;

OutputSet::~OutputSet() {
  std::error_code ignored;
  for (const auto& [temporary, file] : staged_) fs::remove(temporary, ignored);
}

void OutputSet::add(const fs::path& file, const std::string& content) {
  std::error_code error;
  const fs::path place = fs::is_symlink(file, error) ? fs::weakly_canonical(file, error) : file;
  if (fs::exists(place, error) && !fs::is_regular_file(place, error))
    throw std::runtime_error(file.string() + ": is no regular file; name another file");
  const fs::path temporary = place.string() + "." + std::to_string(getpid()) + ".part";
  staged_.emplace_back(temporary, place);
  try {
    write_output(temporary.string(), content);
  } catch (const std::runtime_error&) {
    throw std::runtime_error(file.string() +
                             ": cannot be written; name a file in an existing, writable directory");
  }
}

void OutputSet::commit() {
  for (const auto& [temporary, file] : staged_) {
    std::error_code error;
    fs::rename(temporary, file, error);
    if (error)
      throw std::runtime_error(file.string() + ": cannot be written (" + error.message() +
                               "); name another file");
  }
  staged_.clear();
}

}  // namespace wrenchd
