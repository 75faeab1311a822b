// SPDX-License-Identifier: GPL-3.0-or-later
// Linked into the test programs that tools/mutate traces: notes which basic blocks run, and writes their
// addresses to the file that WRENCHD_TRACE names, followed by the process number.

#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include <sys/mman.h>
#include <unistd.h>

extern "C" {
extern const char __executable_start;
extern const char etext;

void __sanitizer_cov_trace_pc() noexcept;
}

namespace {

/// One byte for each byte of code: 1 if the block that returns there has run. Pages that are
/// never written need no memory.
unsigned char* ran() noexcept {
  static unsigned char* const bytes = [] {
    const auto size = static_cast<std::size_t>(&etext - &__executable_start);
    void* const memory =
        mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (memory == MAP_FAILED) std::abort();
    return static_cast<unsigned char*>(memory);
  }();
  return bytes;
}

struct WriteAtExit {
  ~WriteAtExit() {
    const char* const place = std::getenv("WRENCHD_TRACE");
    if (!place) return;
    char name[4096];
    std::snprintf(name, sizeof name, "%s.%d", place, static_cast<int>(getpid()));
    std::FILE* const file = std::fopen(name, "wb");
    if (!file) return;
    const auto size = static_cast<std::uint32_t>(&etext - &__executable_start);
    for (std::uint32_t at = 0; at < size; ++at)
      if (ran()[at]) std::fwrite(&at, sizeof at, 1, file);
    std::fclose(file);
  }
} write_at_exit;

}  // namespace

void __sanitizer_cov_trace_pc() noexcept {
  ran()[static_cast<const char*>(__builtin_return_address(0)) - &__executable_start] = 1;
}
