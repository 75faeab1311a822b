// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "collision/touch.hpp"
#include "daemon/servo/tick_record.hpp"

namespace wrenchd {

/// One tick as other processes see it: its record and the contacts that hold the proxy.
struct StateRecord {
  TickRecord tick;
  std::uint64_t contact_count = 0;  ///< Used elements of `contacts`; tick.contacts also counts omitted ones.
  std::array<Touch, kMaxTouches> contacts{};
};

/// Publishes the state of every tick to other processes: a ring of records in a sealed memfd. A process that
/// receives the descriptor can map the memory read-only; it can neither write nor resize it. Readers never
/// delay the writer. Memory layout, and how a reader detects that a record was overwritten:
/// daemon/servo/README.md, section "Shared memory".
class SharedState {
 public:
  static constexpr std::array<char, 8> kMagic = {'W', 'R', 'E', 'N', 'C', 'H', 'S', 'T'};
  static constexpr std::uint64_t kVersion = 2;  ///< Version of header, slots and field names.
  static constexpr double kRetention_s = 2.0;   ///< Time for which a record stays readable.
  static constexpr std::size_t kHeaderBytes = 4096;
  static constexpr std::size_t kSlotBytes = (8 + sizeof(StateRecord) + 63) / 64 * 64;

  /// First page of the memory. Only `written` changes after construction.
  struct Header {
    std::array<char, 8> magic = kMagic;
    std::uint64_t version = kVersion;
    std::uint64_t header_bytes = kHeaderBytes;
    std::uint64_t slot_bytes = kSlotBytes;
    std::uint64_t record_bytes = sizeof(StateRecord);
    std::uint64_t slots = 0;
    std::array<std::uint64_t, 2> reserved{};
    std::atomic<std::uint64_t> written{0};  ///< Number of records written so far; the newest is written - 1.
  };
  static_assert(std::atomic<std::uint64_t>::is_always_lock_free && sizeof(std::atomic<std::uint64_t>) == 8);
  static_assert(sizeof(Header) <= kHeaderBytes && sizeof(StateRecord) % 8 == 0);

  /// Allocates memory for kRetention_s at rate_Hz, about 2 kB per tick, and touches every page so that no
  /// tick causes a page fault. Throws std::system_error if the kernel rejects the request. Not RT-safe:
  /// system calls.
  explicit SharedState(double rate_Hz);
  /// Unmaps the memory and closes the descriptor. Not RT-safe: system calls.
  ~SharedState();
  SharedState(const SharedState&) = delete;
  SharedState& operator=(const SharedState&) = delete;

  /// Writes one record. For the servo thread only. RT-safe.
  void write(const TickRecord& tick, const Touches& contacts) noexcept;

  /// Copies record `i` to `out`, with the first contact_count elements of out.contacts. Returns false if the
  /// record is not written yet or was overwritten. For any other thread of this process. RT-safe.
  bool read(std::uint64_t i, StateRecord& out) const noexcept;

  /// Returns the descriptor to pass to readers. It stays open until destruction. RT-safe.
  int descriptor() const noexcept { return descriptor_; }
  std::size_t bytes() const noexcept {
    return kHeaderBytes + slots_ * kSlotBytes;
  }                                                        ///< Memory size. RT-safe.
  std::uint64_t slots() const noexcept { return slots_; }  ///< Ring size. RT-safe.
  double rate_Hz() const noexcept { return rate_Hz_; }     ///< RT-safe.
  /// Returns the number of records written so far. For any thread. RT-safe.
  std::uint64_t written() const noexcept { return header_->written.load(std::memory_order_acquire); }

 private:
  static constexpr std::size_t kRecordWords = sizeof(StateRecord) / 8;

  double rate_Hz_;
  std::uint64_t slots_;
  int descriptor_;
  void* memory_;
  Header* header_;
  std::atomic<std::uint64_t>* words_;  ///< All slots, as 64-bit words. Only the writer stores.
  alignas(8) std::array<std::byte, sizeof(StateRecord)> record_buffer_{};  ///< Padding bytes stay zero.
  std::size_t contact_count_ = 0;  ///< Number of contacts in record_buffer_.
};

}  // namespace wrenchd
