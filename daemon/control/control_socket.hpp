// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "core/clock.hpp"
#include "daemon/control/control_methods.hpp"
#include "daemon/control/event_feed.hpp"
#include "daemon/control/lease.hpp"
#include "daemon/control/listening_socket.hpp"
#include "daemon/control/role.hpp"
#include "daemon/control/worker_queue.hpp"

namespace wrenchd {

// Limits of one client (token bucket). The socket reads a client that exceeds its rate more slowly, and does
// not read a client that leaves its replies unread. A client that floods delays only itself.

inline constexpr std::size_t kMaxClients = 32;
/// Connections of one user without a higher role than observer. The other places stay free for other users.
inline constexpr std::size_t kMaxObserverClients = 24;
/// Descriptors that wait in replies, or that clients have not read yet, of one connection, of one user, and
/// of all. Observers and operators together may use kMaxDescriptors minus kReservedDescriptors.
inline constexpr std::size_t kMaxClientDescriptors = 4;
inline constexpr std::size_t kMaxUserDescriptors = 16;
inline constexpr std::size_t kMaxDescriptors = 64;
inline constexpr std::size_t kReservedDescriptors = 16;
/// Rate at which a client gains tokens. A line costs one token, plus one for each KiB; each read costs a
/// quarter.
inline constexpr double kLinesPerSecond = 500.0;
/// Largest number of tokens of a client.
inline constexpr double kBurst_lines = 100.0;
/// Lines of one client in one round. A small number keeps the latency of the other clients low.
inline constexpr int kLinesPerRound = 8;
inline constexpr std::size_t kReadPerRound_bytes = std::size_t{16} * 1024;
/// Largest amount of unsent replies. Events stop at half of it; the feed counts events that are lost
/// meanwhile.
inline constexpr std::size_t kMaxUnsent_bytes = std::size_t{256} * 1024;

/// Returns the peer of a socket. Tests replace peer_of().
using IdentifyPeer = std::function<std::optional<Peer>(int socket)>;

/// Serves the control socket: one thread, all clients in turn. The thread sleeps while no client sends. Not
/// RT-safe.
///
/// If kMaxClients are connected, a new client replaces one connection of the user with the most connections.
/// Connections without a valid request come first, then the one that has been silent for longest. The holder
/// of the lease is never replaced. So no user can lock out another, and every permitted user can always stop.
/// An observer who has kMaxObserverClients connections replaces one of his own.
///
/// A reply without its descriptor would be a success that is none: if the process or the limits allow no
/// descriptor, the client receives an error.
class ControlSocket {
 public:
  /// Starts to serve. All arguments must outlive this object, and the table must not change any more. From
  /// now on only the thread of this object uses the lease.
  ControlSocket(const ListeningSocket& listening, RoleRules rules, const MethodTable& methods,
                EventFeed& feed, Lease& lease, IdentifyPeer identify = peer_of);
  /// Ends the lease, sends the remaining events to the clients that read them, and closes the connections.
  ~ControlSocket();
  ControlSocket(const ControlSocket&) = delete;
  ControlSocket& operator=(const ControlSocket&) = delete;

 private:
  struct Chunk {
    std::string bytes;
    std::size_t sent = 0;
    OwnedFd fd;  ///< sent with the first byte
  };

  struct Client {
    std::uint64_t number = 0;
    OwnedFd socket;
    Peer peer;
    Role role = Role::observer;
    std::string input;
    bool has_complete_line = false;  ///< `input` holds a complete line
    std::deque<Chunk> output;
    std::size_t output_bytes = 0;
    double tokens =
        kBurst_lines;  ///< lines it may send now; what a long one costs too much makes it negative
    TimePoint tokens_refilled_at{};
    TimePoint last_received_at{};
    std::uint32_t epoll_events = 0;   ///< what we wait for
    bool readable = false;            ///< epoll has reported input
    bool made_valid_request = false;  ///< the client has made at least one valid request
    bool write_side_closed = false;   ///< the client sends no more; earlier input may be unread
    bool end_of_input = false;        ///< the client sends no more, and all input is read
    bool disconnected = false;        ///< the client has closed both directions
    bool close_after_flush = false;   ///< close the connection when the output is sent
    bool to_remove = false;           ///< remove the client at the end of the round
    int pending_methods = 0;          ///< slow methods that run or are queued
    std::size_t queued_fds = 0;       ///< descriptors in `output`
    std::size_t unread_fds = 0;       ///< descriptors that were sent and may be unread
    TimePoint send_again_at{};        ///< the kernel accepts no descriptor before
    Subscription subscription;
  };

  struct Finished {
    std::uint64_t client = 0;
    std::string line;
    OwnedFd fd;
    bool has_fd = false;  ///< the result has a descriptor, even if `fd` could not be made
    Json id = nullptr;
  };

  void run(const std::stop_token& stop);
  int wait_ms(TimePoint now) const;
  void handle_epoll_event(std::uint64_t number, std::uint32_t events);
  void accept_clients(TimePoint now);
  bool make_room_for(const Peer& peer, Role role);
  void evict_client(std::optional<uid_t> user);
  std::string reason_without_descriptor(Client& client);
  void queue_reply(Client& client, const Json& id, std::string line, bool has_fd, OwnedFd fd);
  static std::size_t held_fds(Client& client);
  void serve(Client& client, TimePoint now);
  void read_input(Client& client, TimePoint now);
  void process_lines(Client& client);
  void process_line(Client& client, std::string_view line);
  void run_slow_method(Client& client, const MethodRow& row, const RpcRequest& request, const Caller& caller);
  void send_finished_results();
  void send_events(Client& client);
  void queue_line(Client& client, std::string line, OwnedFd fd = {});
  void flush(Client& client);
  void update_epoll_events(Client& client);
  void remove_clients();
  bool can_process_line(const Client& client) const noexcept;
  void flush_before_exit();

  const ListeningSocket& listening_;
  RoleRules rules_;
  const MethodTable& methods_;
  EventFeed& feed_;
  Lease& lease_;
  IdentifyPeer identify_peer_;

  OwnedFd epoll_;
  OwnedFd wake_fd_;
  std::map<std::uint64_t, Client> clients_;
  std::uint64_t last_client_number_ = 1;  ///< 0 is the listening socket, 1 the wake-up descriptor
  bool round_is_cut_ = false;             ///< the last round ended before it had served every client
  TimePoint accept_again_at_{};           ///< the process had no free descriptors: accept no client before

  std::mutex finished_mutex_;
  std::vector<Finished> finished_;
  std::optional<WorkerQueue> worker_;

  std::jthread thread_;  ///< last member: it uses the members above
};

}  // namespace wrenchd
