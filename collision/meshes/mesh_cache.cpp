// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/mesh_cache.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <system_error>

#include <fcntl.h>
#include <openssl/evp.h>
#include <sys/stat.h>
#include <unistd.h>

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMagic = "wrenchd mesh cache 1\n";
constexpr std::string_view kSuffix = ".mesh";
constexpr std::size_t kHash = 32;  // SHA-256; collisions cannot be constructed
constexpr std::uintmax_t kMaxBytes = std::uintmax_t{2} << 30;
constexpr std::size_t kHeader = kMagic.size() + 3 * kHash;

std::string sha256(const std::vector<std::string_view>& parts) {
  const std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context(EVP_MD_CTX_new(), EVP_MD_CTX_free);
  std::string hash(kHash, '\0');
  bool good = context && EVP_DigestInit_ex(context.get(), EVP_sha256(), nullptr) == 1;
  for (const std::string_view part : parts) {
    const std::uint64_t size = part.size();  // so that "ab", "c" is not "a", "bc"
    good = good && EVP_DigestUpdate(context.get(), &size, sizeof size) == 1 &&
           EVP_DigestUpdate(context.get(), part.data(), part.size()) == 1;
  }
  if (!good || EVP_DigestFinal_ex(context.get(), reinterpret_cast<unsigned char*>(hash.data()), nullptr) != 1)
    throw std::runtime_error("OpenSSL has no SHA-256");
  return hash;
}

/// A file descriptor that the destructor closes.
class File {
 public:
  explicit File(int descriptor) : descriptor_(descriptor) {}
  ~File() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  int get() const noexcept { return descriptor_; }

  bool read(char* to, std::size_t size) const {
    while (size > 0) {
      const ssize_t n = ::read(descriptor_, to, size);
      if (n <= 0 && !(n < 0 && errno == EINTR)) return false;
      if (n > 0) to += n, size -= static_cast<std::size_t>(n);
    }
    return true;
  }
  bool write(std::string_view bytes) const {
    while (!bytes.empty()) {
      const ssize_t n = ::write(descriptor_, bytes.data(), bytes.size());
      if (n < 0 && errno != EINTR) return false;
      if (n > 0) bytes.remove_prefix(static_cast<std::size_t>(n));
    }
    return true;
  }

 private:
  int descriptor_;
};

std::string hexadecimal(std::string_view bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

/// Returns the header: magic, key, hash of the payload, and a hash of these three.
std::string header(const std::string& key, std::string_view bytes) {
  const std::string content = sha256({bytes});
  return std::string(kMagic) + key + content + sha256({kMagic, key, content});
}

}  // namespace

std::string sha256_text(std::string_view bytes) {
  std::string hash(kHash, '\0');
  if (EVP_Digest(bytes.data(), bytes.size(), reinterpret_cast<unsigned char*>(hash.data()), nullptr,
                 EVP_sha256(), nullptr) != 1)
    throw std::runtime_error("OpenSSL has no SHA-256");
  return hexadecimal(hash);
}

std::string MeshCache::key(const std::vector<std::string_view>& made_from) {
  std::vector<std::string_view> parts = made_from;
  parts.push_back(WRENCHD_MESH_SOURCES);
  return sha256(parts);
}

fs::path MeshCache::path_of(const std::string& key) const {
  return directory_ / (hexadecimal(key) + std::string(kSuffix));
}

std::optional<std::string> MeshCache::read(const std::string& key) const {
  if (disabled()) return {};
  const fs::path name = path_of(key);
  // Not OpenedFile: the cache follows no link, and requires owner and mode of the file.
  const File file(::open(name.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  struct stat status {};
  if (file.get() < 0 || ::fstat(file.get(), &status) != 0) return {};
  const bool ours =
      S_ISREG(status.st_mode) && status.st_uid == ::geteuid() && (status.st_mode & (S_IWGRP | S_IWOTH)) == 0;
  if (!ours || status.st_size < static_cast<off_t>(kHeader) ||
      static_cast<std::uintmax_t>(status.st_size) > kMaxBytes)
    return {};
  std::string head(kHeader, '\0');
  if (!file.read(head.data(), head.size())) return {};
  std::string bytes(static_cast<std::size_t>(status.st_size) - kHeader, '\0');
  if (!file.read(bytes.data(), bytes.size()) || head != header(key, bytes)) return {};
  ::futimens(file.get(), nullptr);  // marks the file as recently used
  return bytes;
}

bool MeshCache::fail(const std::string& why) {
  error_ = directory_.string() + ": " + why + "; results for large meshes are not cached";
  return false;
}

// Writes a temporary file and renames it, so that readers find a complete file or none.
bool MeshCache::write(const std::string& key, std::string_view bytes) {
  if (disabled()) return false;
  std::error_code error;
  fs::create_directories(directory_, error);
  if (error) return fail("cannot be made (" + error.message() + ")");
  std::string name = (directory_ / ("new-XXXXXX" + std::string(kSuffix))).string();
  const File file(::mkostemps(name.data(), static_cast<int>(kSuffix.size()), O_CLOEXEC));
  if (file.get() < 0) return fail(std::string("cannot be written to (") + std::strerror(errno) + ")");
  if (!file.write(header(key, bytes)) || !file.write(bytes) ||
      ::rename(name.c_str(), path_of(key).c_str()) != 0) {
    const std::string reason = std::strerror(errno);
    ::unlink(name.c_str());
    return fail("cannot be written to (" + reason + ")");
  }
  evict_oldest();
  return true;
}

void MeshCache::evict_oldest() const {
  struct Entry {
    fs::file_time_type time;
    std::uintmax_t size;
    fs::path file;
  };
  std::vector<Entry> all;
  std::uintmax_t bytes = 0;
  std::error_code error;
  for (fs::directory_iterator at(directory_, error), end; !error && at != end; at.increment(error)) {
    if (at->path().extension() != kSuffix) continue;
    std::error_code gone;
    const Entry entry{at->last_write_time(gone), at->file_size(gone), at->path()};
    if (gone) continue;
    bytes += entry.size;
    all.push_back(entry);
  }
  std::sort(all.begin(), all.end(), [](const Entry& a, const Entry& b) { return a.time < b.time; });
  for (const Entry& entry : all) {
    if (bytes <= kMaxBytes) return;
    bytes -= entry.size;
    fs::remove(entry.file, error);
  }
}

fs::path cache_directory() {
  const auto from = [](const char* variable) -> fs::path {
    const char* value = std::getenv(variable);
    const std::string text = value == nullptr ? "" : value;
    const fs::path path = text.substr(0, text.find(':'));  // systemd sets a list
    return path.is_absolute() ? path : fs::path();
  };
  if (const fs::path given = from("CACHE_DIRECTORY"); !given.empty()) return given;
  if (const fs::path base = from("XDG_CACHE_HOME"); !base.empty()) return base / "wrenchd";
  if (const fs::path home = from("HOME"); !home.empty()) return home / ".cache" / "wrenchd";
  return {};
}

}  // namespace wrenchd
