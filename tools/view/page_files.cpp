// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/page_files.hpp"

#include <array>
#include <iterator>
#include <stdexcept>

#include <openssl/evp.h>
#include <openssl/sha.h>

#include "core/files/opened_file.hpp"

namespace wrenchd {
namespace fs = std::filesystem;

namespace {

std::string type_of(const fs::path& file) {
  static const std::map<std::string, std::string> kTypes = {{".html", "text/html; charset=utf-8"},
                                                            {".js", "text/javascript; charset=utf-8"},
                                                            {".css", "text/css; charset=utf-8"},
                                                            {".svg", "image/svg+xml"},
                                                            {".txt", "text/plain; charset=utf-8"}};
  const auto found = kTypes.find(file.extension().string());
  return found == kTypes.end() ? "application/octet-stream" : found->second;
}

std::string sha256_base64(std::string_view text) {
  std::array<unsigned char, SHA256_DIGEST_LENGTH> digest{};
  SHA256(reinterpret_cast<const unsigned char*>(text.data()), text.size(), digest.data());
  std::array<unsigned char, 4 * ((SHA256_DIGEST_LENGTH + 2) / 3) + 1> out{};
  const int length = EVP_EncodeBlock(out.data(), digest.data(), static_cast<int>(digest.size()));
  return {reinterpret_cast<const char*>(out.data()), static_cast<std::size_t>(length)};
}

/// The browser requires the import map in the page itself, and accepts it only if the policy contains its
/// hash.
std::string policy_of(const std::string& page) {
  std::string scripts = "'self'";
  constexpr std::string_view kBegin = "<script type=\"importmap\">", kEnd = "</script>";
  if (const auto at = page.find(kBegin); at != std::string::npos) {
    const auto begin = at + kBegin.size();
    scripts += " 'sha256-" +
               sha256_base64(std::string_view(page).substr(begin, page.find(kEnd, begin) - begin)) + "'";
  }
  return "default-src 'none'; script-src " + scripts +
         "; style-src 'self'; img-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
         "frame-ancestors 'none'";
}

}  // namespace

PageFiles::PageFiles(const fs::path& directory) {
  std::error_code error;
  for (fs::recursive_directory_iterator entry(directory, error), end; !error && entry != end;
       entry.increment(error)) {
    if (!entry->is_regular_file()) continue;
    files_[entry->path().lexically_relative(directory).generic_string()] = {
        type_of(entry->path()), read_file_if_readable(entry->path()).value_or("")};
  }
  const auto page = files_.find("index.html");
  if (page == files_.end())
    throw std::runtime_error(
        directory.string() +
        ": contains no index.html, the page of the view; build or install wrenchd again");
  policy_ = policy_of(page->second.bytes);
}

const PageFiles::File* PageFiles::find(std::string_view name) const {
  const auto found = files_.find(name.empty() ? std::string_view("index.html") : name);
  return found == files_.end() ? nullptr : &found->second;
}

fs::path PageFiles::directory() {
  const fs::path beside =
      fs::read_symlink("/proc/self/exe").parent_path().parent_path() / "share" / "wrenchd" / "view";
  const fs::path installed = "/usr/share/wrenchd/view";
  for (const fs::path& place : {beside, installed})
    if (fs::exists(place / "index.html")) return place;
  throw std::runtime_error(
      "the page of the view is missing; searched " + beside.string() + ", " + installed.string() +
      "; build it (target view_page; needs npm, and WRENCHD_VIEW on), or install wrenchd");
}

}  // namespace wrenchd
