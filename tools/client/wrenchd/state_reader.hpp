// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <wrenchd/client_error.hpp>

namespace wrenchd {

/// A contact that holds the proxy.
struct ProxyContact {
  std::array<double, 3> point_W_m{};  ///< where tool and obstacle touch, in the world
  std::array<double, 3> normal_W{};   ///< unit, from the obstacle to the tool
  double share = 0.0;                 ///< of what all contacts carry, 0 to 1
  double multiplier_kg_m = 0.0;       ///< the sum of multiplier times normal is 2 m (x_q - x_p)
  std::uint32_t obstacle_number = 0;
  std::string obstacle;          ///< as the scene of that tick names it, or "obstacle 2"
  std::string tool_feature;      ///< "vertex 12", "edge 3-7", "face 5", "hull vertex 1"
  std::string obstacle_feature;  ///< likewise, or "plane"
};

/// One tick of the servo loop. Poses are x y z [m], qx qy qz qw. Wrenches are fx fy fz [N], tx ty tz [N.m].
/// Every field that the daemon describes can be asked for by its name; `describe` of the layout lists them.
class TickState {
 public:
  std::uint64_t tick() const { return static_cast<std::uint64_t>(integer("tick")); }
  std::int64_t time_ns() const { return integer("now_ns"); }               ///< CLOCK_MONOTONIC
  std::string state() const { return text("state"); }                      ///< "active"
  std::array<double, 7> hand_pose() const { return numbers<7>("X_WP"); }   ///< p: what the hand asks for
  std::array<double, 7> proxy_pose() const { return numbers<7>("X_WQ"); }  ///< q: what the world allows
  std::array<double, 6> wrench() const { return numbers<6>("F_out"); }     ///< told to the device
  /// The contacts that carry most first. Where the scene was changed the daemon is asked once for the names
  /// of its obstacles.
  std::vector<ProxyContact> contacts() const;

  /// The i-th number of a field. Throws ClientError where there is none of that name.
  double number(std::string_view field, std::size_t i = 0) const;
  std::int64_t integer(std::string_view field, std::size_t i = 0) const;
  template <std::size_t N>
  std::array<double, N> numbers(std::string_view field) const {
    std::array<double, N> out{};
    for (std::size_t i = 0; i < N; ++i) out[i] = number(field, i);
    return out;
  }
  /// The name of a value, or of all bits that are set: "active", "force slew, authority", "".
  std::string text(std::string_view field) const;

 private:
  friend class StateReader;
  struct Layout;
  class Names;

  std::shared_ptr<const Layout> layout_;
  std::shared_ptr<Names> names_;
  std::vector<std::uint64_t> words_;
};

/// Reads the daemon's state at the rate of its servo loop, from memory that the daemon writes and this maps
/// read-only. The daemon knows nothing of readers: one that is slow misses ticks, and is told how many. One
/// object serves one thread.
class StateReader {
 public:
  /// layout: the text of the layout in the answer to `state.open`; descriptor: that came with it, and is
  /// closed here. is_there: whether the daemon is there still. ask_names: what it answers to `state.names`.
  /// Client::open_state() fills all in. Throws ClientError.
  StateReader(const std::string& layout, int descriptor, std::function<bool()> is_there = {},
              std::function<std::string()> ask_names = {});
  ~StateReader();
  StateReader(StateReader&& other) noexcept;
  StateReader& operator=(StateReader&& other) noexcept;

  /// Waits for the tick after the last one taken; at first, for the first after this object was made. False
  /// where none came in time. A reader that was overrun goes on with newer ones, and missed() grows. Throws
  /// ClientError::kDisconnected where the daemon is gone.
  bool next(TickState& out, std::chrono::milliseconds timeout = std::chrono::seconds(1));

  /// The newest tick, whatever was taken before. False where there was none at all.
  bool latest(TickState& out) const;

  /// Ticks that were overwritten before they were taken by next(), since this object was made.
  std::uint64_t missed() const noexcept { return missed_; }
  /// Ticks that were written and not taken by next() yet.
  std::uint64_t unread() const noexcept;

  double rate_Hz() const noexcept;  ///< of the servo loop, as configured
  /// Every field by name, with its unit in brackets and what it means.
  std::vector<std::string> describe() const;

 private:
  enum class CopyResult : std::uint8_t { complete, overrun };

  CopyResult copy(std::uint64_t i, TickState& out) const;
  void skip_overwritten();
  void unmap() noexcept;

  std::shared_ptr<const TickState::Layout> layout_;
  std::shared_ptr<TickState::Names> names_;
  std::function<bool()> is_connected_;
  const std::byte* memory_ = nullptr;
  std::size_t bytes_ = 0;
  std::uint64_t next_ = 0;
  std::uint64_t missed_ = 0;
};

}  // namespace wrenchd
