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

/// A contact that constrains the proxy.
struct ProxyContact {
  std::array<double, 3> point_W_m{};  ///< contact point in the world
  std::array<double, 3> normal_W{};   ///< unit normal from the obstacle to the tool, in the world
  double load_fraction = 0.0;         ///< multiplier divided by the sum of all multipliers, 0 to 1
  /// Lagrange multiplier; the sum of multiplier times normal over all contacts is 2 m (x_q - x_p).
  double multiplier_kg_m = 0.0;
  std::uint32_t obstacle_number = 0;
  std::string obstacle;          ///< obstacle name in the scene of that tick, or "obstacle 2"
  std::string tool_feature;      ///< "vertex 12", "edge 3-7", "face 5", "hull vertex 1"
  std::string obstacle_feature;  ///< obstacle feature in the same format, or "plane"
};

/// One tick of the servo loop. Poses are x y z [m], qx qy qz qw. Wrenches are fx fy fz [N], tx ty tz [N.m].
/// Every field is accessible by its name; StateReader::describe() lists the fields.
class TickState {
 public:
  std::uint64_t tick() const { return static_cast<std::uint64_t>(integer("tick")); }
  std::int64_t time_ns() const { return integer("now_ns"); }  ///< CLOCK_MONOTONIC
  std::string state() const { return text("state"); }         ///< state of the loop, such as "active"
  std::array<double, 7> hand_pose() const { return numbers<7>("X_WP"); }  ///< p: pose that the hand commands
  /// Q: pose that the obstacles allow.
  std::array<double, 7> proxy_pose() const { return numbers<7>("X_WQ"); }
  std::array<double, 6> wrench() const { return numbers<6>("F_out"); }  ///< wrench sent to the device
  /// Returns the contacts in descending order of their load. After a change of the scene, the first call
  /// requests the obstacle names from the daemon.
  std::vector<ProxyContact> contacts() const;

  /// Returns the i-th number of a field. Throws ClientError if the field does not exist.
  double number(std::string_view field, std::size_t i = 0) const;
  std::int64_t integer(std::string_view field, std::size_t i = 0) const;
  template <std::size_t N>
  std::array<double, N> numbers(std::string_view field) const {
    std::array<double, N> out{};
    for (std::size_t i = 0; i < N; ++i) out[i] = number(field, i);
    return out;
  }
  /// Returns the name of a value, or the names of all set bits: "active", "force slew, authority", "".
  std::string text(std::string_view field) const;

 private:
  friend class StateReader;
  struct Layout;
  class Names;

  std::shared_ptr<const Layout> layout_;
  std::shared_ptr<Names> names_;
  std::vector<std::uint64_t> words_;
};

/// Reads the daemon's state at the rate of its servo loop from shared memory, which this process maps
/// read-only. The daemon does not wait for readers: a slow reader misses ticks, and missed() counts them.
/// Each thread needs its own object. Not RT-safe: next() waits for the daemon.
class StateReader {
 public:
  /// layout: the layout text in the response to `state.open`. descriptor: the file descriptor of that
  /// response; this object closes it. is_there: returns true while the daemon is connected. ask_names:
  /// returns the response to `state.obstacles`. Client::open_state() supplies all arguments. Throws
  /// ClientError.
  StateReader(const std::string& layout, int descriptor, std::function<bool()> is_there = {},
              std::function<std::string()> ask_names = {});
  ~StateReader();
  StateReader(StateReader&& other) noexcept;
  StateReader& operator=(StateReader&& other) noexcept;

  /// Waits for the next tick; the first call waits for the first tick after the construction. Returns false
  /// if none came in time. If the daemon has overwritten ticks, next() continues with newer ones and missed()
  /// grows. Throws ClientError::kDisconnected if the daemon is gone.
  bool next(TickState& out, std::chrono::milliseconds timeout = std::chrono::seconds(1));

  /// Copies the newest tick, independent of next(). Returns false if there is no tick yet.
  bool latest(TickState& out) const;

  /// Returns the number of ticks that the daemon overwrote before next() read them, since the construction.
  std::uint64_t missed() const noexcept { return missed_; }
  /// Returns the number of ticks that next() has not read yet.
  std::uint64_t unread() const noexcept;

  double rate_Hz() const noexcept;  ///< configured rate of the servo loop
  /// Returns one text per field: name, unit in brackets, and meaning.
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
  std::chrono::steady_clock::time_point next_check_{};  ///< next time to ask whether the daemon is connected
};

}  // namespace wrenchd
