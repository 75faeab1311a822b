// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/control_socket.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include <fcntl.h>
#include <linux/sockios.h>
#include <pthread.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "daemon/thread_guard.hpp"

// A round: wait for input; accept new clients; then serve each client, the one with the most tokens first:
// read, process a few lines, send replies and events. At its end the round checks the lease. A round that
// takes long ends before it has served every client; the others have more tokens left, so the next one serves
// them first.

namespace wrenchd {
namespace {

constexpr std::uint64_t kListening = 0;
constexpr std::uint64_t kWake = 1;
constexpr int kAcceptPerRound = 16;
/// A round serves no further client after this time. A client that has tokens, such as one that requests a
/// stop, is among the first of the next round, so this is about how long it waits.
constexpr Duration kLongestRound = std::chrono::milliseconds(2);
/// Pause before the next accept() if the process has no free descriptors.
constexpr Duration kAcceptPause = std::chrono::milliseconds(100);
/// Pause before the next attempt if the kernel accepts no descriptor: too many are unread.
constexpr Duration kSendPause = std::chrono::milliseconds(100);
/// Cost of a read. It makes many small writes no cheaper than one large write.
constexpr double kRead_lines = 0.25;
/// Events for one client in one round, so that the backlog of one client does not delay the others.
constexpr std::size_t kEventsPerRound_bytes = std::size_t{32} * 1024;

TimePoint wall_now() {
  return std::chrono::steady_clock::now();
}

OwnedFd checked(int fd, const char* call) {
  if (fd < 0) throw std::runtime_error(std::string(call) + ": " + std::strerror(errno));
  return OwnedFd(fd);
}

void add(int epoll, int fd, std::uint64_t number) {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.u64 = number;
  if (epoll_ctl(epoll, EPOLL_CTL_ADD, fd, &event) != 0)
    throw std::runtime_error(std::string("epoll_ctl: ") + std::strerror(errno));
}

void notify(int eventfd) {
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = ::write(eventfd, &one, sizeof one);  // a full counter wakes too
}

double cost_lines(std::size_t bytes) {
  return 1.0 + static_cast<double>(bytes) / 1024.0;
}

/// Sends bytes like send(2). If fd >= 0, sends the descriptor with the first byte.
ssize_t send_some(int socket, std::string_view bytes, int fd) {
  iovec part{const_cast<char*>(bytes.data()), bytes.size()};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
  if (fd >= 0) {
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    cmsghdr* header = CMSG_FIRSTHDR(&message);
    header->cmsg_level = SOL_SOCKET;
    header->cmsg_type = SCM_RIGHTS;
    header->cmsg_len = CMSG_LEN(sizeof(int));
    std::memcpy(CMSG_DATA(header), &fd, sizeof fd);
  }
  return ::sendmsg(socket, &message, MSG_DONTWAIT | MSG_NOSIGNAL);
}

/// Sends one error line, if the socket has room for it.
void send_rejection(int socket, const std::string& message) {
  send_some(socket, error_line(nullptr, RpcError(RpcCode::permission_denied, message)), -1);
}

}  // namespace

ControlSocket::ControlSocket(const ListeningSocket& listening, RoleRules rules, const MethodTable& methods,
                             EventFeed& feed, Lease& lease, IdentifyPeer identify)
    : listening_(listening),
      rules_(std::move(rules)),
      methods_(methods),
      feed_(feed),
      lease_(lease),
      identify_peer_(std::move(identify)),
      epoll_(checked(epoll_create1(EPOLL_CLOEXEC), "epoll_create1")),
      wake_fd_(checked(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK), "eventfd")) {
  add(epoll_.get(), listening_.fd(), kListening);
  add(epoll_.get(), wake_fd_.get(), kWake);
  worker_.emplace();
  feed_.set_wake_fd(wake_fd_.get());
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  pthread_setname_np(thread_.native_handle(), "control");
}

ControlSocket::~ControlSocket() {
  thread_.request_stop();
  notify(wake_fd_.get());
  thread_.join();
  worker_.reset();  // its tasks use the members
  feed_.set_wake_fd(-1);
}

void ControlSocket::run(const std::stop_token& stop) {
  ThreadGuard guard("control socket");
  std::vector<Client*> turns;
  turns.reserve(kMaxClients + kAcceptPerRound);
  while (!stop.stop_requested()) {
    std::array<epoll_event, kMaxClients + 2> events{};
    const int count =
        epoll_wait(epoll_.get(), events.data(), static_cast<int>(events.size()), wait_ms(wall_now()));
    for (int i = 0; i < count; ++i)
      guard.run([&] {
        handle_epoll_event(events[static_cast<std::size_t>(i)].data.u64,
                           events[static_cast<std::size_t>(i)].events);
      });
    const TimePoint now = wall_now();
    guard.run([&] { accept_clients(now); });
    guard.run([&] { send_finished_results(); });
    turns.clear();
    for (auto& [number, client] : clients_) turns.push_back(&client);
    std::stable_sort(turns.begin(), turns.end(),
                     [](const Client* a, const Client* b) { return a->tokens > b->tokens; });
    std::size_t served = 0;
    while (served < turns.size() && (served == 0 || wall_now() - now < kLongestRound)) {
      Client* client = turns[served++];
      if (!guard.run([&] { serve(*client, now); })) client->to_remove = true;
    }
    round_is_cut_ = served < turns.size();
    guard.run([&] { lease_.check(wall_now()); });
    guard.run([&] { remove_clients(); });
  }
  guard.run([&] { flush_before_exit(); });
}

/// Returns the time until the next action that no descriptor triggers [ms]; -1: none.
int ControlSocket::wait_ms(TimePoint now) const {
  if (round_is_cut_) return 0;
  TimePoint until = lease_.next_check_at();
  if (accept_again_at_ > now) until = std::min(until, accept_again_at_);
  for (const auto& [number, client] : clients_) {
    if (!client.output.empty() && client.send_again_at > now) until = std::min(until, client.send_again_at);
    if (client.close_after_flush || client.output_bytes >= kMaxUnsent_bytes) continue;
    if (client.end_of_input && !client.has_complete_line) continue;
    if (client.tokens <= 0.0)
      until = std::min(until, now + from_seconds(-client.tokens / kLinesPerSecond));
    else if (client.has_complete_line || client.disconnected)
      return 0;
  }
  if (until == TimePoint::max()) return -1;
  return static_cast<int>(
      std::chrono::ceil<std::chrono::milliseconds>(std::max(until - now, Duration{0})).count());
}

void ControlSocket::handle_epoll_event(std::uint64_t number, std::uint32_t events) {
  if (number == kWake) {
    std::uint64_t ignored = 0;
    [[maybe_unused]] const ssize_t got = ::read(wake_fd_.get(), &ignored, sizeof ignored);
  }
  const auto found = clients_.find(number);
  if (found == clients_.end()) return;
  Client& client = found->second;
  if ((events & EPOLLIN) != 0) client.readable = true;
  // No heartbeat can follow: end the lease at once, before the remaining input is read.
  if ((events & (EPOLLRDHUP | EPOLLHUP | EPOLLERR)) != 0) {
    client.write_side_closed = true;
    lease_.client_lost(number);
  }
  if ((events & (EPOLLHUP | EPOLLERR)) == 0) return;
  // The remaining input is still processed, as far as the tokens allow. Epoll would report the event
  // meanwhile.
  client.disconnected = true;
  client.subscription.active = false;
  epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, client.socket.get(), nullptr);
}

void ControlSocket::accept_clients(TimePoint now) {
  if (now < accept_again_at_) return;
  for (int i = 0; i < kAcceptPerRound; ++i) {
    OwnedFd socket(::accept4(listening_.fd(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (!socket) {
      if (errno == EAGAIN || errno == EINTR || errno == ECONNABORTED) return;
      accept_again_at_ = now + kAcceptPause;
      return;
    }
    const std::optional<Peer> peer = identify_peer_(socket.get());
    const std::optional<Role> role = peer ? role_of(*peer, rules_) : std::nullopt;
    if (!role) {
      send_rejection(
          socket.get(),
          "You may not connect: you are in none of the groups under [control] in wrenchd.toml. Ask the "
          "administrator to add you to the group of the observers.");
      continue;
    }
    if (!make_room_for(*peer, *role)) continue;
    Client client;
    client.number = ++last_client_number_;
    client.socket = std::move(socket);
    client.peer = *peer;
    client.role = *role;
    client.tokens_refilled_at = client.last_received_at = now;
    client.epoll_events = EPOLLIN | EPOLLRDHUP;
    epoll_event event{};
    event.events = client.epoll_events;
    event.data.u64 = client.number;
    if (epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, client.socket.get(), &event) != 0) continue;
    clients_.emplace(client.number, std::move(client));
  }
}

/// Removes a connection if a new one would exceed a limit. Returns false if none can be removed.
bool ControlSocket::make_room_for(const Peer& peer, Role role) {
  const auto own = std::count_if(clients_.begin(), clients_.end(),
                                 [&peer](const auto& one) { return one.second.peer.uid == peer.uid; });
  const std::size_t before = clients_.size();
  if (role == Role::observer && static_cast<std::size_t>(own) >= kMaxObserverClients)
    evict_client(peer.uid);
  else if (before >= kMaxClients)
    evict_client({});
  else
    return true;
  return clients_.size() < before;
}

/// Removes a connection of this user, or of the user with the most connections.
void ControlSocket::evict_client(std::optional<uid_t> user) {
  std::map<uid_t, int> connections;
  for (const auto& [number, client] : clients_) ++connections[client.peer.uid];
  auto evicted = clients_.end();
  const auto before = [&](const Client& a, const Client& b) {
    const int of_a = connections[a.peer.uid], of_b = connections[b.peer.uid];
    if (of_a != of_b) return of_a > of_b;
    return a.made_valid_request != b.made_valid_request ? !a.made_valid_request
                                                        : a.last_received_at < b.last_received_at;
  };
  for (auto client = clients_.begin(); client != clients_.end(); ++client)
    if (!lease_.held_by(client->first) && (!user || client->second.peer.uid == *user) &&
        (evicted == clients_.end() || before(client->second, evicted->second)))
      evicted = client;
  if (evicted == clients_.end()) return;
  send_rejection(evicted->second.socket.get(),
                 "There are too many connections, and yours was silent for longest; connect again.");
  clients_.erase(evicted);
}

/// Returns how many descriptors the client keeps open outside of its own process: in replies that are not
/// sent, and in the socket.
std::size_t ControlSocket::held_fds(Client& client) {
  int unread_bytes = 0;
  if (client.unread_fds > 0 && ::ioctl(client.socket.get(), SIOCOUTQ, &unread_bytes) == 0 &&
      unread_bytes == 0)
    client.unread_fds = 0;  // the client has read all that was sent
  return client.queued_fds + client.unread_fds;
}

/// Returns why the client may receive no descriptor now; empty if it may.
std::string ControlSocket::reason_without_descriptor(Client& client) {
  std::size_t of_user = 0, of_all = 0;
  for (auto& [number, other] : clients_) {
    const std::size_t held = held_fds(other);
    of_all += held;
    if (other.peer.uid == client.peer.uid) of_user += held;
  }
  const std::size_t most =
      client.role == Role::administrator ? kMaxDescriptors : kMaxDescriptors - kReservedDescriptors;
  if (held_fds(client) >= kMaxClientDescriptors)
    return "Replies with descriptors wait for you; read them, and request this again.";
  if (of_user >= kMaxUserDescriptors)
    return "Replies with descriptors wait for other programs of your user; request this again when they have "
           "read "
           "them.";
  if (of_all >= most) return "Too many replies with descriptors wait for clients; try again in a moment.";
  return {};
}

/// Queues the reply to a method. has_fd: the result has a descriptor; without one the reply is an error.
void ControlSocket::queue_reply(Client& client, const Json& id, std::string line, bool has_fd, OwnedFd fd) {
  std::string reason;
  if (has_fd && !fd)
    reason = "The daemon has no free descriptor for the reply; try again in a moment.";
  else if (has_fd)
    reason = reason_without_descriptor(client);
  if (reason.empty()) return queue_line(client, std::move(line), std::move(fd));
  queue_line(client, error_line(id, RpcError(RpcCode::invalid_state, reason)));
}

/// Returns true if the client has tokens and reads its replies.
bool ControlSocket::can_process_line(const Client& client) const noexcept {
  return client.tokens > 0.0 && client.output_bytes < kMaxUnsent_bytes && !client.close_after_flush &&
         !client.to_remove;
}

void ControlSocket::serve(Client& client, TimePoint now) {
  client.tokens =
      std::min(kBurst_lines, client.tokens + kLinesPerSecond * seconds(now - client.tokens_refilled_at));
  client.tokens_refilled_at = now;
  if ((client.readable || client.disconnected) && !client.has_complete_line && can_process_line(client))
    read_input(client, now);
  process_lines(client);
  send_events(client);
  flush(client);
  const bool done = client.end_of_input && !client.has_complete_line && client.pending_methods == 0 &&
                    !client.subscription.active;
  if (client.output.empty() && (client.close_after_flush || done)) client.to_remove = true;
  if (client.disconnected && (done || client.tokens <= 0.0)) client.to_remove = true;
  if (!client.to_remove) update_epoll_events(client);
}

void ControlSocket::read_input(Client& client, TimePoint now) {
  client.readable = false;
  client.tokens -= kRead_lines;
  std::array<char, kReadPerRound_bytes> bytes;
  const ssize_t got = ::recv(client.socket.get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
  if (got > 0) {
    client.input.append(bytes.data(), static_cast<std::size_t>(got));
    client.last_received_at = now;
  } else if (got == 0 || (errno != EAGAIN && errno != EINTR)) {
    client.end_of_input = true;
    lease_.client_lost(client.number);
    if (got < 0) client.to_remove = true;
  }
}

/// Processes at most kLinesPerRound complete lines.
void ControlSocket::process_lines(Client& client) {
  std::size_t begin = 0;
  for (int lines = 0; lines < kLinesPerRound && can_process_line(client); ++lines) {
    const std::size_t end = client.input.find('\n', begin);
    if (end == std::string::npos) break;
    client.tokens -= cost_lines(end - begin);
    process_line(client, std::string_view(client.input).substr(begin, end - begin));
    begin = end + 1;
  }
  client.input.erase(0, begin);
  client.has_complete_line = client.input.find('\n') != std::string::npos;
  if (client.has_complete_line || client.input.size() <= kMaxLineBytes || client.close_after_flush) return;
  // The start of the next line is unknown, so the connection ends.
  queue_line(client, error_line(nullptr, RpcError(RpcCode::parse_error,
                                                  "The line is longer than " + std::to_string(kMaxLineBytes) +
                                                      " bytes, and the connection ends here; "
                                                      "send less at once.")));
  client.close_after_flush = true;
  client.input.clear();
}

void ControlSocket::process_line(Client& client, std::string_view line) {
  const auto read = parse_request(line);
  if (const auto* rejected = std::get_if<InvalidRequest>(&read))
    return queue_line(client, error_line(rejected->id, rejected->error));
  const auto& request = std::get<RpcRequest>(read);
  Caller caller{client.number, client.role, client.peer.description(), &client.subscription};
  try {
    const MethodRow& row = methods_.look_up(request, client.role);
    client.made_valid_request = true;
    if (row.slow) return run_slow_method(client, row, request, caller);
    const MethodResult answer = MethodTable::run(row, request.params, caller);
    if (!request.wants_reply) return;
    OwnedFd fd;
    if (answer.fd >= 0) fd = OwnedFd(::fcntl(answer.fd, F_DUPFD_CLOEXEC, 0));
    queue_reply(client, request.id, reply_line(request.id, answer.result), answer.fd >= 0, std::move(fd));
  } catch (const RpcError& error) {
    if (request.wants_reply) queue_line(client, error_line(request.id, error));
  }
}

void ControlSocket::run_slow_method(Client& client, const MethodRow& row, const RpcRequest& request,
                                    const Caller& caller) {
  if (client.pending_methods > 0)
    throw RpcError(RpcCode::invalid_state, "Your last request of this kind still runs; wait for its reply.");
  Caller worker_caller = caller;
  worker_caller.subscription = nullptr;
  const auto posted = worker_->post(client.peer.uid, client.role, [this, &row, request, worker_caller] {
    Finished finished{worker_caller.client, {}, {}, false, request.id};
    try {
      const MethodResult answer = MethodTable::run(row, request.params, worker_caller);
      finished.has_fd = answer.fd >= 0;
      if (finished.has_fd) finished.fd = OwnedFd(::fcntl(answer.fd, F_DUPFD_CLOEXEC, 0));
      if (request.wants_reply) finished.line = reply_line(request.id, answer.result);
    } catch (const RpcError& error) {
      if (request.wants_reply) finished.line = error_line(request.id, error);
    } catch (const std::exception& error) {  // no memory for the reply
      finished.fd.reset();
      finished.has_fd = false;
      if (request.wants_reply)
        finished.line = error_line(request.id, RpcError(RpcCode::internal_error, error.what()));
    }
    {
      const std::scoped_lock lock(finished_mutex_);
      finished_.push_back(std::move(finished));
    }
    notify(wake_fd_.get());
  });
  if (posted == WorkerQueue::Posted::user_has_too_many)
    throw RpcError(RpcCode::invalid_state, "Other programs of your user wait for " +
                                               std::to_string(WorkerQueue::kMaxQueuedPerUser) +
                                               " requests of this kind; try again in a moment.");
  if (posted == WorkerQueue::Posted::full)
    throw RpcError(RpcCode::invalid_state, "The queue of slow requests is full; try again in a moment.");
  ++client.pending_methods;
}

void ControlSocket::send_finished_results() {
  std::vector<Finished> finished;
  {
    const std::scoped_lock lock(finished_mutex_);
    finished.swap(finished_);
  }
  for (Finished& one : finished) {
    const auto found = clients_.find(one.client);
    if (found == clients_.end()) continue;
    --found->second.pending_methods;
    if (!one.line.empty())
      queue_reply(found->second, one.id, std::move(one.line), one.has_fd, std::move(one.fd));
  }
}

/// Sends the next events of the subscription. Events that the client does not read stay in the feed's
/// history.
void ControlSocket::send_events(Client& client) {
  Subscription& subscription = client.subscription;
  if (!subscription.active || client.to_remove || client.output_bytes >= kMaxUnsent_bytes / 2) return;
  EventFeed::Batch batch =
      feed_.events_since(subscription.next_sequence, subscription.event_names, kEventsPerRound_bytes);
  if (batch.lost > 0)
    queue_line(client,
               notification_line("event", {{"sequence", subscription.next_sequence + batch.lost - 1},
                                           {"time_ns", wall_now().time_since_epoch().count()},
                                           {"name", "events_lost"},
                                           {"level", "warning"},
                                           {"text", std::to_string(batch.lost) +
                                                        " events were lost: the client did not read them in "
                                                        "time; request the status"},
                                           {"count", batch.lost}}));
  subscription.next_sequence = batch.next;
  subscription.has_backlog = batch.more;
  for (std::string& line : batch.lines) queue_line(client, std::move(line));
}

void ControlSocket::queue_line(Client& client, std::string line, OwnedFd fd) {
  client.output_bytes += line.size();
  if (fd) ++client.queued_fds;
  client.output.push_back({std::move(line), 0, std::move(fd)});
}

void ControlSocket::flush(Client& client) {
  if (client.send_again_at > wall_now()) return;
  while (!client.output.empty() && !client.to_remove) {
    Chunk& chunk = client.output.front();
    const std::string_view rest = std::string_view(chunk.bytes).substr(chunk.sent);
    const ssize_t sent = send_some(client.socket.get(), rest, chunk.fd.get());
    if (sent < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (sent < 0 && (errno == ENOBUFS || errno == ETOOMANYREFS)) {
      client.send_again_at = wall_now() + kSendPause;
      return;
    }
    if (sent < 0) {  // the client does not read any more; its earlier requests are still processed
      client.output.clear();
      client.output_bytes = 0;
      client.queued_fds = 0;
      client.subscription.active = false;
      if (!client.disconnected) client.to_remove = true;
      return;
    }
    if (chunk.fd) {
      chunk.fd.reset();
      --client.queued_fds;
      ++client.unread_fds;
    }
    chunk.sent += static_cast<std::size_t>(sent);
    if (chunk.sent < chunk.bytes.size()) continue;
    client.output_bytes -= chunk.bytes.size();
    client.output.pop_front();
  }
}

/// Sets the events that epoll reports for the client. No input is reported while can_process_line() is false.
void ControlSocket::update_epoll_events(Client& client) {
  if (client.disconnected) return;
  std::uint32_t wanted = 0;
  if (!client.end_of_input && !client.close_after_flush) {
    if (!client.write_side_closed) wanted |= EPOLLRDHUP;
    if (!client.has_complete_line && can_process_line(client)) wanted |= EPOLLIN;
  }
  // The feed does not wake this thread for events that did not fit into this round. EPOLLOUT starts the next
  // one.
  const bool behind = client.subscription.active && client.subscription.has_backlog;
  // While the kernel accepts no descriptor, the socket is writable, and EPOLLOUT would wake this thread all
  // the time. wait_ms() ends the pause.
  if ((!client.output.empty() || behind) && client.send_again_at <= wall_now()) wanted |= EPOLLOUT;
  if (wanted == client.epoll_events) return;
  epoll_event event{};
  event.events = wanted;
  event.data.u64 = client.number;
  epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, client.socket.get(), &event);
  client.epoll_events = wanted;
}

void ControlSocket::remove_clients() {
  for (auto client = clients_.begin(); client != clients_.end();) {
    if (!client->second.to_remove) {
      ++client;
      continue;
    }
    lease_.client_lost(client->first);
    client = clients_.erase(client);
  }
}

/// Sends the last events to the subscribers, as far as they read them.
void ControlSocket::flush_before_exit() {
  lease_.release("loses it because the daemon ends");
  feed_.drain();
  for (auto& [number, client] : clients_) {
    send_events(client);
    flush(client);
  }
  clients_.clear();
}

}  // namespace wrenchd
