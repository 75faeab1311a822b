// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "devices/links/latest_writer.hpp"
#include "devices/links/link_settings.hpp"
#include "devices/links/report_link.hpp"

namespace wrenchd {

/// Device in another process. Reports travel over a connected local socket that keeps their boundaries
/// (SOCK_SEQPACKET): one report per packet, its id first if the device numbers its reports. The other process
/// may outlive this one, as hardware does: an emulator, or a bridge to another transport.
///
/// The socket is inherited, so no other process can access it. The link keeps the socket through close() and
/// open(). After the other end has closed the socket, the link cannot be used again.
class SocketLink final : public ReportLink {
 public:
  /// Takes ownership of the file descriptor without a check; open() checks it. -1: none.
  explicit SocketLink(int socket, LinkSettings settings = {})
      : socket_(socket), settings_(std::move(settings)) {}
  ~SocketLink() override;
  SocketLink(const SocketLink&) = delete;
  SocketLink& operator=(const SocketLink&) = delete;

  /// Throws std::runtime_error if the descriptor is not a connected socket of this type, or its other end is
  /// closed. Waiting reports stay in the socket; the first read of the device discards them. Not RT-safe:
  /// starts a thread.
  void open() override;
  /// Reads a report; its arrival time is `now`. After the other end is closed, reads the remaining reports
  /// first. RT-safe.
  LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept override;
  /// Submits the report to the writer thread of the link, which also runs the host watchdog. RT-safe.
  LinkStatus write(TimePoint now, std::span<const std::uint8_t> report) noexcept override;
  void wait_readable(TimePoint deadline) noexcept override;
  /// Stops reading and writing until the next open(). Not RT-safe: waits for the writer thread.
  void close() noexcept override { writer_.reset(); }

 private:
  int socket_;
  LinkSettings settings_;
  std::optional<LatestWriter> writer_;
};

}  // namespace wrenchd
