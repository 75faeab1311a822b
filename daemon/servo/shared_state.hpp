// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "collision/touch.hpp"
#include "daemon/servo/tick_record.hpp"

namespace wrenchd {

/// What other processes see of one tick: its record, and the contacts that hold the proxy.
struct StateRecord {
  TickRecord tick;
  std::uint64_t contact_count = 0;  ///< of touches; record.contacts counts those left out too
  std::array<Touch, kMaxTouches> contacts{};
};

/// The loop's state at full rate, in memory that other processes map: a ring of records in a sealed memfd.
/// Whoever has its descriptor can read it, and can neither write nor resize it. Nobody there can make the
/// writer wait: it knows nothing of readers.
///
///   header     a page: what the memory is, and how many records were ever written
///   slots      record i in slot i % slots: a guard of 8 bytes, then the record
///
/// The guard of a slot is 2 i + 1 while record i is being written, and 2 i + 2 when it is whole. A reader
/// looks at the guard, copies, and looks again: two equal even numbers, of the record it wants, and the copy
/// is whole. A greater number says that it was overrun, and the header's count by how much.
///
/// No race: all that changes is atomic words of 8 bytes. Those of a record are stored with release order and
/// are to be loaded with acquire order, so whoever sees a word of a newer record sees its guard, too. On
/// x86 both are plain moves.
class SharedState {
 public:
  static constexpr std::array<char, 8> kMagic = {'W', 'R', 'E', 'N', 'C', 'H', 'S', 'T'};
  static constexpr std::uint64_t kVersion = 1;  ///< of header and slots; records are described by themselves
  static constexpr double kRetention_s = 2.0;   ///< what a reader may sleep and miss nothing
  static constexpr std::size_t kHeaderBytes = 4096;
  static constexpr std::size_t kSlotBytes = (8 + sizeof(StateRecord) + 63) / 64 * 64;

  /// The page at the start. All but `written` stays as it is.
  struct Header {
    std::array<char, 8> magic = kMagic;
    std::uint64_t version = kVersion;
    std::uint64_t header_bytes = kHeaderBytes;
    std::uint64_t slot_bytes = kSlotBytes;
    std::uint64_t record_bytes = sizeof(StateRecord);
    std::uint64_t slots = 0;
    std::array<std::uint64_t, 2> reserved{};
    std::atomic<std::uint64_t> written{0};  ///< records ever written; the newest is written - 1
  };
  static_assert(std::atomic<std::uint64_t>::is_always_lock_free && sizeof(std::atomic<std::uint64_t>) == 8);
  static_assert(sizeof(Header) <= kHeaderBytes && sizeof(StateRecord) % 8 == 0);

  /// Room for kRetention_s at this rate, touched page by page, so that no tick is the first to do so; some 2
  /// kB a tick. Throws std::system_error where the kernel gives no such memory.
  explicit SharedState(double rate_Hz);
  ~SharedState();
  SharedState(const SharedState&) = delete;
  SharedState& operator=(const SharedState&) = delete;

  /// By the servo thread only. RT safe.
  void write(const TickRecord& tick, const Touches& touches) noexcept;

  /// Record i, whole; of `out.touches` the first touch_count. False: it is not written yet, or a newer one
  /// has its place. Any thread of this process but the writer's; the writer never waits for it.
  bool read(std::uint64_t i, StateRecord& out) const noexcept;

  /// To be handed to readers. Stays open for as long as this is.
  int descriptor() const noexcept { return descriptor_; }
  std::size_t bytes() const noexcept { return kHeaderBytes + slots_ * kSlotBytes; }
  std::uint64_t slots() const noexcept { return slots_; }
  double rate_Hz() const noexcept { return rate_Hz_; }
  /// Any thread.
  std::uint64_t written() const noexcept { return header_->written.load(std::memory_order_acquire); }

 private:
  static constexpr std::size_t kRecordWords = sizeof(StateRecord) / 8;

  double rate_Hz_;
  std::uint64_t slots_;
  int descriptor_;
  void* memory_;
  Header* header_;
  std::atomic<std::uint64_t>* words_;  ///< of the slots, and nobody's but the writer's
  alignas(8)
      std::array<std::byte, sizeof(StateRecord)> record_buffer_{};  ///< what lies between fields stays zero
  std::size_t contact_count_ = 0;                                   ///< touches in next_
};

}  // namespace wrenchd
