// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/guide_line.hpp"

#include <system_error>

namespace wrenchd {
namespace fs = std::filesystem;
namespace {

bool is_file(const fs::path& file) {
  std::error_code ignored;
  return fs::is_regular_file(file, ignored);
}

fs::path share_of_program() {
  std::error_code failed;
  const fs::path program = fs::read_symlink("/proc/self/exe", failed);
  return failed ? fs::path() : program.parent_path().parent_path() / "share";
}

}  // namespace

std::string guide_line(const fs::path& share, const fs::path& source) {
  const fs::path installed = share / "doc/wrenchd" / "README.md";
  const fs::path references = share / "doc/wrenchd-doc/reference/index.html";
  std::string line;
  if (is_file(installed)) {
    line = "Guides: " + installed.string();
  } else if (!source.empty() && is_file(source / "README.md")) {
    line = "Guides: " + (source / "README.md").string();
  }
  if (is_file(references)) line += (line.empty() ? "References: " : "; references: ") + references.string();
  return line;
}

std::string with_guide_line(const std::string& footer) {
#ifdef WRENCHD_SOURCE_DIR
  const std::string line = guide_line(share_of_program(), WRENCHD_SOURCE_DIR);
#else
  const std::string line = guide_line(share_of_program(), {});
#endif
  return line.empty() ? footer : footer + '\n' + line;
}

}  // namespace wrenchd
