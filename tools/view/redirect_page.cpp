// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/redirect_page.hpp"

#include <cerrno>
#include <cstdlib>
#include <string_view>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "files/owned_fd.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const std::string& what) {
  throw std::system_error(errno, std::generic_category(), what);
}

/// Returns XDG_RUNTIME_DIR if only this user can write there; empty otherwise.
fs::path runtime_directory() {
  const char* const name = std::getenv("XDG_RUNTIME_DIR");
  struct stat status {};
  if (name == nullptr || *name != '/' || ::stat(name, &status) != 0) return {};
  const bool ours = S_ISDIR(status.st_mode) && status.st_uid == ::geteuid() && (status.st_mode & 022U) == 0;
  return ours ? fs::path(name) : fs::path();
}

fs::path make_directory() {
  std::string name = (fs::temp_directory_path() / "wrenchd-view-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) fail(name);
  return name;
}

}  // namespace

RedirectPage::RedirectPage(const std::string& url) {
  fs::path directory = runtime_directory();
  if (directory.empty()) directory = own_directory_ = make_directory();
  constexpr std::string_view kSuffix = ".html";
  std::string name = (directory / ("wrenchd-view-XXXXXX" + std::string(kSuffix))).string();
  const OwnedFd out(::mkostemps(name.data(), kSuffix.size(), O_CLOEXEC));  // mode 0600
  if (!out) fail(name);
  file_ = name;
  const std::string page =
      "<!DOCTYPE html><html><head><meta charset=\"utf-8\"><meta name=\"referrer\" content=\"no-referrer\">"
      "<meta http-equiv=\"refresh\" content=\"0;url=" +
      url + "\"><title>wrenchctl view</title></head><body><a href=\"" + url +
      "\">wrenchctl view</a></body></html>\n";
  for (std::string_view rest = page; !rest.empty();) {
    const ssize_t put = ::write(out.get(), rest.data(), rest.size());
    if (put < 0 && errno == EINTR) continue;
    if (put < 0) {
      const std::system_error error(errno, std::generic_category(), name);
      ::unlink(name.c_str());
      throw error;
    }
    rest.remove_prefix(static_cast<std::size_t>(put));
  }
}

RedirectPage::~RedirectPage() {
  ::unlink(file_.c_str());
  if (!own_directory_.empty()) ::rmdir(own_directory_.c_str());
}

}  // namespace wrenchd
