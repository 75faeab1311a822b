// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/no_allocation.hpp"

#include <cstddef>
#include <cstdlib>

#include <dlfcn.h>
#include <pthread.h>

// The program's own malloc precedes glibc's and forwards to it, so that it sees every allocation of the
// process. Under a sanitizer, malloc belongs to the sanitizer, which reports through a hook instead.

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define WRENCHD_SANITIZED 1
extern "C" int __sanitizer_install_malloc_and_free_hooks(void (*on_malloc)(const volatile void*, std::size_t),
                                                         void (*on_free)(const volatile void*));
#else
#define WRENCHD_SANITIZED 0
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* pointer, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* pointer);
}
#endif

namespace {

thread_local bool guarded = false;
thread_local std::uint64_t allocations_seen = 0;
thread_local std::uint64_t locks_seen = 0;

void saw_allocation() {
  if (guarded) ++allocations_seen;
}

#if WRENCHD_SANITIZED
void on_malloc(const volatile void*, std::size_t) {
  saw_allocation();
}
void on_free(const volatile void* pointer) {
  if (pointer != nullptr) saw_allocation();
}
const bool installed = (__sanitizer_install_malloc_and_free_hooks(on_malloc, on_free), true);
#endif

}  // namespace

#if !WRENCHD_SANITIZED
extern "C" {
void* malloc(std::size_t size) {
  saw_allocation();
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  saw_allocation();
  return __libc_calloc(count, size);
}
void* realloc(void* pointer, std::size_t size) {
  saw_allocation();
  return __libc_realloc(pointer, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
  saw_allocation();
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  saw_allocation();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** pointer, std::size_t alignment, std::size_t size) {
  saw_allocation();
  *pointer = __libc_memalign(alignment, size);
  return *pointer == nullptr ? 12 : 0;
}
void free(void* pointer) {
  if (pointer != nullptr) saw_allocation();
  __libc_free(pointer);
}

int pthread_mutex_lock(pthread_mutex_t* mutex) noexcept {
  using Lock = int (*)(pthread_mutex_t*);
  static const auto lock = reinterpret_cast<Lock>(dlsym(RTLD_NEXT, "pthread_mutex_lock"));
  if (guarded) ++locks_seen;
  return lock(mutex);
}
}
#endif

namespace wrenchd::test {

RealtimeGuard::RealtimeGuard() noexcept {
  allocations_seen = 0;
  locks_seen = 0;
  guarded = true;
}

RealtimeGuard::~RealtimeGuard() {
  guarded = false;
}

std::uint64_t RealtimeGuard::allocations() const noexcept {
  return allocations_seen;
}
std::uint64_t RealtimeGuard::locks() const noexcept {
  return locks_seen;
}

}  // namespace wrenchd::test
