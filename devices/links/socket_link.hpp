// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "devices/links/latest_writer.hpp"
#include "devices/links/link_settings.hpp"
#include "devices/links/report_link.hpp"

namespace wrenchd {

/// A device in another process: reports come and go over a connected local socket that keeps their bounds
/// (SOCK_SEQPACKET), one report a packet, its id first where the device numbers its reports. What is at the
/// other end outlives this process, as hardware does: an emulator, a bridge to a transport of one's own.
///
/// The socket is inherited, so nobody else can come to it. It stays with the link through close() and open():
/// when the other end is gone it is gone for good.
class SocketLink final : public ReportLink {
 public:
  /// Takes the descriptor over, whatever it is; open() looks at it. -1: none.
  explicit SocketLink(int socket, LinkSettings settings = {})
      : socket_(socket), settings_(std::move(settings)) {}
  ~SocketLink() override;
  SocketLink(const SocketLink&) = delete;
  SocketLink& operator=(const SocketLink&) = delete;

  /// Throws std::runtime_error where the descriptor is no connected socket of that kind, or nobody is at its
  /// other end any more. What waits in it stays: the device's first read throws that away.
  void open() override;
  /// A report is taken to have arrived now. What waits is read to its end after the other end is gone.
  LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept override;
  /// By a thread of the link's own, as with other links: it lives on where the loop is stuck.
  LinkStatus write(TimePoint now, std::span<const std::uint8_t> report) noexcept override;
  void wait_readable(TimePoint deadline) noexcept override;
  /// Nothing is read or written until it is opened again.
  void close() noexcept override { writer_.reset(); }

 private:
  int socket_;
  LinkSettings settings_;
  std::optional<LatestWriter> writer_;
};

}  // namespace wrenchd
