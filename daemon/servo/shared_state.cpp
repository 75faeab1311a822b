// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/shared_state.hpp"

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <new>
#include <string>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "daemon/servo/record_fields.hpp"

namespace wrenchd {
namespace {

static_assert(sizeof(Touch) % 8 == 0 && offsetof(StateRecord, contacts) % 8 == 0);
constexpr std::size_t kWordsPerSlot = SharedState::kSlotBytes / 8;

[[noreturn]] void fail(const char* call) {
  throw std::system_error(errno, std::generic_category(),
                          std::string("cannot create the shared memory for tick records: ") + call);
}

/// Closes the descriptor if the constructor throws.
struct DescriptorGuard {
  int descriptor = -1;
  ~DescriptorGuard() {
    if (descriptor >= 0) close(descriptor);
  }
};

void copy_fields(std::span<const RecordField> fields, const void* from, std::byte* to) noexcept {
  for (const RecordField& field : fields)
    std::memcpy(to + field.offset, static_cast<const std::byte*>(from) + field.offset, field.bytes());
}

}  // namespace

SharedState::SharedState(double rate_Hz)
    : rate_Hz_(rate_Hz),
      slots_(std::bit_ceil(static_cast<std::uint64_t>(std::ceil(kRetention_s * rate_Hz)))) {
  DescriptorGuard opened{memfd_create("wrenchd-state", MFD_CLOEXEC | MFD_ALLOW_SEALING)};
  if (opened.descriptor < 0) fail("memfd_create");
  if (ftruncate(opened.descriptor, static_cast<off_t>(bytes())) != 0) fail("ftruncate");
  memory_ = mmap(nullptr, bytes(), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, opened.descriptor, 0);
  if (memory_ == MAP_FAILED) fail("mmap; the limit of locked memory (LimitMEMLOCK) may be too small");
  // The seals come last: the existing mapping stays writable, and new mappings are read-only.
  if (fcntl(opened.descriptor, F_ADD_SEALS,
            F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_FUTURE_WRITE | F_SEAL_SEAL) != 0) {
    munmap(memory_, bytes());
    fail("F_ADD_SEALS; needs Linux 5.1");
  }
  std::memset(memory_, 0, bytes());
  header_ = new (memory_) Header;
  header_->slots = slots_;
  words_ = new (static_cast<std::byte*>(memory_) + kHeaderBytes)
      std::atomic<std::uint64_t>[slots_ * kWordsPerSlot] {};
  descriptor_ = std::exchange(opened.descriptor, -1);
}

SharedState::~SharedState() {
  munmap(memory_, bytes());
  close(descriptor_);
}

void SharedState::write(const TickRecord& tick, const Touches& contacts) noexcept {
  copy_fields(tick_fields(), &tick, record_buffer_.data() + offsetof(StateRecord, tick));
  const std::uint64_t count = contacts.size();
  std::memcpy(record_buffer_.data() + offsetof(StateRecord, contact_count), &count, sizeof(count));
  std::byte* const destination = record_buffer_.data() + offsetof(StateRecord, contacts);
  for (std::size_t i = 0; i < contacts.size(); ++i)
    std::memcpy(destination + i * sizeof(Touch), &contacts[i], sizeof(Touch));
  if (contacts.size() < contact_count_)
    std::memset(destination + contacts.size() * sizeof(Touch), 0,
                (contact_count_ - contacts.size()) * sizeof(Touch));
  contact_count_ = contacts.size();

  const std::uint64_t i = header_->written.load(std::memory_order_relaxed);
  std::atomic<std::uint64_t>* const slot = words_ + (i % slots_) * kWordsPerSlot;
  slot[0].store(2 * i + 1, std::memory_order_relaxed);
  for (std::size_t k = 0; k < kRecordWords; ++k) {
    std::uint64_t word;
    std::memcpy(&word, record_buffer_.data() + 8 * k, 8);
    slot[1 + k].store(word, std::memory_order_release);
  }
  slot[0].store(2 * i + 2, std::memory_order_release);
  header_->written.store(i + 1, std::memory_order_release);
}

bool SharedState::read(std::uint64_t i, StateRecord& out) const noexcept {
  const std::atomic<std::uint64_t>* const slot = words_ + (i % slots_) * kWordsPerSlot;
  if (slot[0].load(std::memory_order_acquire) != 2 * i + 2) return false;
  auto* const bytes = reinterpret_cast<std::byte*>(&out);
  const auto copy = [&](std::size_t from, std::size_t to) {
    for (std::size_t k = from / 8; k < to / 8; ++k) {
      const std::uint64_t word = slot[1 + k].load(std::memory_order_acquire);
      std::memcpy(bytes + 8 * k, &word, 8);
    }
  };
  copy(0, offsetof(StateRecord, contacts));
  out.contact_count = std::min<std::uint64_t>(out.contact_count, kMaxTouches);
  copy(offsetof(StateRecord, contacts), offsetof(StateRecord, contacts) + out.contact_count * sizeof(Touch));
  return slot[0].load(std::memory_order_acquire) == 2 * i + 2;
}

}  // namespace wrenchd
