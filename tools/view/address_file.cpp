// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/address_file.hpp"

#include <cerrno>
#include <cstdlib>
#include <string_view>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "daemon/control/owned_fd.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

/// Returns the user's runtime directory if only the user can enter it, otherwise the temporary directory.
fs::path parent_directory() {
  const char* const given = std::getenv("XDG_RUNTIME_DIR");
  struct stat status {};
  if (given != nullptr && *given == '/' && ::stat(given, &status) == 0 && S_ISDIR(status.st_mode) &&
      status.st_uid == ::geteuid() && (status.st_mode & 077) == 0)
    return given;
  return fs::temp_directory_path();
}

}  // namespace

AddressFile::AddressFile(const std::string& url) {
  std::string name = (parent_directory() / "wrenchd-view-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) throw std::system_error(errno, std::generic_category(), name);
  directory_ = name;  // mkdtemp gives it to the owner alone
  path_ = directory_ / "open.html";
  const std::string page =
      "<!doctype html><meta charset=\"utf-8\"><meta name=\"referrer\" content=\"no-referrer\">"
      "<meta http-equiv=\"refresh\" content=\"0; url=" +
      url + "\"><title>wrenchd</title>\n";
  const OwnedFd fd(::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600));
  for (std::string_view rest = page; fd && !rest.empty();) {
    const ssize_t put = ::write(fd.get(), rest.data(), rest.size());
    if (put < 0 && errno == EINTR) continue;
    if (put < 0) break;
    rest.remove_prefix(static_cast<std::size_t>(put));
    if (rest.empty()) return;
  }
  const int error = errno;
  remove();
  throw std::system_error(error, std::generic_category(), path_.string());
}

void AddressFile::remove() noexcept {
  std::error_code ignored;
  if (!directory_.empty()) fs::remove_all(directory_, ignored);
  directory_.clear();
}

}  // namespace wrenchd
