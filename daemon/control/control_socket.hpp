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

// What one client may use up. Beyond its share of lines it is read more slowly, and while it does not read
// its answers it is not read at all: who floods waits, and nobody else does.

inline constexpr std::size_t kMaxClients = 32;
/// A second, in the long run; a line costs one, another for each KiB of it, and a read by itself some.
inline constexpr double kLinesPerSecond = 500.0;
inline constexpr double kBurst_lines = 100.0;
/// In one round, so that the next client's turn comes soon.
inline constexpr int kLinesPerRound = 8;
inline constexpr std::size_t kReadPerRound_bytes = std::size_t{16} * 1024;
/// Of answers that wait to be sent; events stop at half of it, and one that is lost is counted.
inline constexpr std::size_t kMaxUnsent_bytes = std::size_t{256} * 1024;

/// Who connected, as the kernel says, or as a test wants it.
using IdentifyPeer = std::function<std::optional<Peer>(int socket)>;

/// Serves the control socket: one thread, all clients in turns. It does nothing while nobody asks.
///
/// When all places are taken a newcomer gets one of the user with the most connections: of those that have
/// never made a good request, else of all, the one that has been silent for longest; one that holds the lease
/// never gives way. So no user can keep another out, and anybody who may connect can stop.
class ControlSocket {
 public:
  /// Serves at once. All of these must outlive this; the table may not change any more. The lease belongs to
  /// the socket's thread from here on.
  ControlSocket(const ListeningSocket& listening, RoleRules rules, const MethodTable& methods,
                EventFeed& feed, Lease& lease, IdentifyPeer identify = peer_of);
  /// Ends the lease, tells what is left to tell to those who read it, and hangs up.
  ~ControlSocket();
  ControlSocket(const ControlSocket&) = delete;
  ControlSocket& operator=(const ControlSocket&) = delete;

 private:
  struct Chunk {
    std::string bytes;
    std::size_t sent = 0;
    OwnedFd fd;  ///< goes with the first byte
  };

  struct Client {
    std::uint64_t number = 0;
    OwnedFd socket;
    Peer peer;
    Role role = Role::observer;
    std::string input;
    bool has_complete_line = false;  ///< a whole one, in `in`
    std::deque<Chunk> output;
    std::size_t output_bytes = 0;
    double tokens =
        kBurst_lines;  ///< lines it may send now; what a long one costs too much makes it negative
    TimePoint tokens_refilled_at{};
    TimePoint last_received_at{};
    std::uint32_t epoll_events = 0;  ///< what we wait for
    bool readable = false;
    bool made_valid_request = false;  ///< it has made a good request
    bool write_side_closed = false;   ///< it has shut down its side; what it said before may not be read yet
    bool end_of_input = false;        ///< and it is
    bool disconnected = false;        ///< it has shut down both sides
    bool close_after_flush = false;   ///< once everything is sent
    bool to_remove = false;
    int pending_methods = 0;  ///< slow methods under way
    Subscription subscription;
  };

  struct Finished {
    std::uint64_t client = 0;
    std::string line;
    OwnedFd fd;
  };

  void run(const std::stop_token& stop);
  int wait_ms(TimePoint now) const;
  void handle_epoll_event(std::uint64_t who, std::uint32_t what);
  void accept_clients(TimePoint now);
  void evict_client();
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
  std::uint64_t last_client_number_ = 1;  ///< 0 and 1 are the listening socket and the wake-up
  TimePoint accept_again_at_{};           ///< no descriptors were left

  std::mutex finished_mutex_;
  std::vector<Finished> finished_;
  std::optional<WorkerQueue> worker_;

  std::jthread thread_;  ///< last: it uses all of the above
};

}  // namespace wrenchd
