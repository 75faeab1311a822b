// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/control_socket.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include <fcntl.h>
#include <pthread.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

// A round: wait; let newcomers in; each client in turn, the most modest first, is read, a few of its lines
// are done, and it is sent what is there for it; who holds the lease in silence loses it.

namespace wrenchd {
namespace {

constexpr std::uint64_t kListening = 0;
constexpr std::uint64_t kWake = 1;
constexpr int kAdmitPerRound = 16;
constexpr Duration kNoDescriptors = std::chrono::milliseconds(100);
/// What a read costs, so that nobody gains by sending a byte at a time.
constexpr double kRead_lines = 0.25;
/// Events are handed over in pieces of this, so that one client's backlog does not hold up the others.
constexpr std::size_t kEventsPerRound_bytes = std::size_t{32} * 1024;

TimePoint wall_now() {
  return std::chrono::steady_clock::now();
}

OwnedFd checked(int fd, const char* what) {
  if (fd < 0) throw std::runtime_error(std::string(what) + ": " + std::strerror(errno));
  return OwnedFd(fd);
}

void add(int epoll, int fd, std::uint64_t who) {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.u64 = who;
  if (epoll_ctl(epoll, EPOLL_CTL_ADD, fd, &event) != 0)
    throw std::runtime_error(std::string("epoll_ctl: ") + std::strerror(errno));
}

void notify(int eventfd) {
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = ::write(eventfd, &one, sizeof one);  // full is awake
}

double cost_lines(std::size_t bytes) {
  return 1.0 + static_cast<double>(bytes) / 1024.0;
}

/// With the descriptor beside its first byte, where there is one. As send(2).
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

/// To somebody who is not let in: one line, if there is room for it.
void turn_away(int socket, const std::string& sentence) {
  send_some(socket, error_line(nullptr, RpcError(RpcCode::not_allowed, sentence)), -1);
}

}  // namespace

ControlSocket::ControlSocket(const ListeningSocket& listening, RoleRules rules, const MethodTable& methods,
                             EventFeed& feed, Lease& lease, Identify identify)
    : listening_(listening),
      rules_(std::move(rules)),
      methods_(methods),
      feed_(feed),
      lease_(lease),
      identify_(std::move(identify)),
      epoll_(checked(epoll_create1(EPOLL_CLOEXEC), "epoll_create1")),
      wake_(checked(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK), "eventfd")) {
  add(epoll_.get(), listening_.fd(), kListening);
  add(epoll_.get(), wake_.get(), kWake);
  slow_work_.emplace();
  feed_.wake(wake_.get());
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  pthread_setname_np(thread_.native_handle(), "control");
}

ControlSocket::~ControlSocket() {
  thread_.request_stop();
  notify(wake_.get());
  thread_.join();
  slow_work_.reset();  // uses what follows
  feed_.wake(-1);
}

void ControlSocket::run(const std::stop_token& stop) {
  std::vector<Client*> turns;
  while (!stop.stop_requested()) {
    std::array<epoll_event, kMostClients + 2> events{};
    const int count =
        epoll_wait(epoll_.get(), events.data(), static_cast<int>(events.size()), wait_ms(wall_now()));
    for (int i = 0; i < count; ++i)
      hear(events[static_cast<std::size_t>(i)].data.u64, events[static_cast<std::size_t>(i)].events);
    const TimePoint now = wall_now();
    admit(now);
    collect_finished();
    turns.clear();
    for (auto& [number, client] : clients_) turns.push_back(&client);
    std::stable_sort(turns.begin(), turns.end(),
                     [](const Client* a, const Client* b) { return a->tokens > b->tokens; });
    for (Client* client : turns) serve(*client, now);
    lease_.look(wall_now());
    bury();
  }
  last_words();
}

/// Until something has to be done that no descriptor tells of.
int ControlSocket::wait_ms(TimePoint now) const {
  TimePoint until = lease_.look_again_at();
  if (admit_again_at_ > now) until = std::min(until, admit_again_at_);
  for (const auto& [number, client] : clients_) {
    if (client.closing || client.out_bytes >= kMostUnread_bytes) continue;
    if (client.no_more_input && !client.line_waits) continue;
    if (client.tokens <= 0.0)
      until = std::min(until, now + from_seconds(-client.tokens / kLinesPerSecond));
    else if (client.line_waits || client.hung_up)
      return 0;
  }
  if (until == TimePoint::max()) return -1;
  return static_cast<int>(
      std::chrono::ceil<std::chrono::milliseconds>(std::max(until - now, Duration{0})).count());
}

void ControlSocket::hear(std::uint64_t who, std::uint32_t what) {
  if (who == kWake) {
    std::uint64_t ignored = 0;
    [[maybe_unused]] const ssize_t got = ::read(wake_.get(), &ignored, sizeof ignored);
  }
  const auto found = clients_.find(who);
  if (found == clients_.end()) return;
  Client& client = found->second;
  if ((what & EPOLLIN) != 0) client.readable = true;
  // Whoever can say nothing more can give no sign of life: the hand is not kept until that is read.
  if ((what & (EPOLLRDHUP | EPOLLHUP | EPOLLERR)) != 0) {
    client.half_closed = true;
    lease_.hung_up(who);
  }
  if ((what & (EPOLLHUP | EPOLLERR)) == 0) return;
  // What it said before is still done, as far as its share goes; epoll would not stop telling meanwhile.
  client.hung_up = true;
  client.subscription.on = false;
  epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, client.socket.get(), nullptr);
}

void ControlSocket::admit(TimePoint now) {
  if (now < admit_again_at_) return;
  for (int i = 0; i < kAdmitPerRound; ++i) {
    OwnedFd socket(::accept4(listening_.fd(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (!socket) {
      if (errno == EAGAIN || errno == EINTR || errno == ECONNABORTED) return;
      admit_again_at_ = now + kNoDescriptors;
      return;
    }
    const std::optional<Peer> peer = identify_(socket.get());
    const std::optional<Role> role = peer ? role_of(*peer, rules_) : std::nullopt;
    if (!role) {
      turn_away(
          socket.get(),
          "You may not connect: you are in none of the groups that [control] in wrenchd.toml names. Ask "
          "its administrator to add you to the one of its observers.");
      continue;
    }
    if (clients_.size() >= kMostClients) make_room();
    Client client;
    client.number = ++last_number_;
    client.socket = std::move(socket);
    client.peer = *peer;
    client.role = *role;
    client.refilled = client.last_heard = now;
    client.told_epoll = EPOLLIN | EPOLLRDHUP;
    epoll_event event{};
    event.events = client.told_epoll;
    event.data.u64 = client.number;
    if (epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, client.socket.get(), &event) != 0) continue;
    clients_.emplace(client.number, std::move(client));
  }
}

void ControlSocket::make_room() {
  std::map<uid_t, int> connections;
  for (const auto& [number, client] : clients_) ++connections[client.peer.uid];
  auto leaves = clients_.end();
  const auto before = [&](const Client& a, const Client& b) {
    const int of_a = connections[a.peer.uid], of_b = connections[b.peer.uid];
    if (of_a != of_b) return of_a > of_b;
    return a.spoke != b.spoke ? !a.spoke : a.last_heard < b.last_heard;
  };
  for (auto client = clients_.begin(); client != clients_.end(); ++client)
    if (!lease_.held_by(client->first) &&
        (leaves == clients_.end() || before(client->second, leaves->second)))
      leaves = client;
  turn_away(leaves->second.socket.get(),
            "You were silent for longest, and another needs the place; connect again.");
  clients_.erase(leaves);
}

/// Not before its share allows, nor before it has read what it asked for.
bool ControlSocket::may_take(const Client& client) const noexcept {
  return client.tokens > 0.0 && client.out_bytes < kMostUnread_bytes && !client.closing && !client.dead;
}

void ControlSocket::serve(Client& client, TimePoint now) {
  client.tokens = std::min(kBurst_lines, client.tokens + kLinesPerSecond * seconds(now - client.refilled));
  client.refilled = now;
  if ((client.readable || client.hung_up) && !client.line_waits && may_take(client)) read(client, now);
  take_lines(client);
  tell_events(client);
  flush(client);
  const bool done =
      client.no_more_input && !client.line_waits && client.pending == 0 && !client.subscription.on;
  if (client.out.empty() && (client.closing || done)) client.dead = true;
  if (client.hung_up && (done || client.tokens <= 0.0)) client.dead = true;
  if (!client.dead) want(client);
}

void ControlSocket::read(Client& client, TimePoint now) {
  client.readable = false;
  client.tokens -= kRead_lines;
  std::array<char, kReadPerRound_bytes> bytes;
  const ssize_t got = ::recv(client.socket.get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
  if (got > 0) {
    client.in.append(bytes.data(), static_cast<std::size_t>(got));
    client.last_heard = now;
  } else if (got == 0 || (errno != EAGAIN && errno != EINTR)) {
    client.no_more_input = true;
    lease_.hung_up(client.number);
    if (got < 0) client.dead = true;
  }
}

/// A few whole lines, if there are any.
void ControlSocket::take_lines(Client& client) {
  std::size_t begin = 0;
  for (int lines = 0; lines < kLinesPerRound && may_take(client); ++lines) {
    const std::size_t end = client.in.find('\n', begin);
    if (end == std::string::npos) break;
    client.tokens -= cost_lines(end - begin);
    take_line(client, std::string_view(client.in).substr(begin, end - begin));
    begin = end + 1;
  }
  client.in.erase(0, begin);
  const bool whole = client.in.find('\n') != std::string::npos;
  client.line_waits = whole;
  if (whole || client.in.size() <= kMaxLineBytes || client.closing) return;
  // Nobody knows where its next line would begin.
  send(client, error_line(nullptr, RpcError(RpcCode::no_json, "The line is longer than " +
                                                                  std::to_string(kMaxLineBytes) +
                                                                  " bytes, and the connection ends here; "
                                                                  "send less at once.")));
  client.closing = true;
  client.in.clear();
}

void ControlSocket::take_line(Client& client, std::string_view line) {
  const auto read = read_request(line);
  if (const auto* refused = std::get_if<RefusedLine>(&read))
    return send(client, error_line(refused->id, refused->error));
  const auto& request = std::get<RpcRequest>(read);
  Caller caller{client.number, client.role, client.peer.text(), &client.subscription};
  try {
    const MethodRow& row = methods_.look_up(request, client.role);
    client.spoke = true;
    if (row.slow) return do_slowly(client, row, request, caller);
    const Answer answer = MethodTable::run(row, request.params, caller);
    if (!request.wants_reply) return;
    OwnedFd fd;
    if (answer.fd >= 0) fd = OwnedFd(::fcntl(answer.fd, F_DUPFD_CLOEXEC, 0));
    send(client, reply_line(request.id, answer.result), std::move(fd));
  } catch (const RpcError& error) {
    if (request.wants_reply) send(client, error_line(request.id, error));
  }
}

void ControlSocket::do_slowly(Client& client, const MethodRow& row, const RpcRequest& request,
                              const Caller& caller) {
  if (client.pending > 0)
    throw RpcError(RpcCode::not_now,
                   "Your last request of this kind is still under way; wait for its answer.");
  Caller away = caller;
  away.subscription = nullptr;
  const bool posted = slow_work_->post([this, &row, request, away] {
    Finished finished{away.client, {}, {}};
    try {
      const Answer answer = MethodTable::run(row, request.params, away);
      if (answer.fd >= 0) finished.fd = OwnedFd(::fcntl(answer.fd, F_DUPFD_CLOEXEC, 0));
      if (request.wants_reply) finished.line = reply_line(request.id, answer.result);
    } catch (const RpcError& error) {
      if (request.wants_reply) finished.line = error_line(request.id, error);
    }
    {
      const std::scoped_lock lock(finished_mutex_);
      finished_.push_back(std::move(finished));
    }
    notify(wake_.get());
  });
  if (!posted)
    throw RpcError(RpcCode::not_now, "Others have asked for so much that takes long; try again in a moment.");
  ++client.pending;
}

void ControlSocket::collect_finished() {
  std::vector<Finished> finished;
  {
    const std::scoped_lock lock(finished_mutex_);
    finished.swap(finished_);
  }
  for (Finished& one : finished) {
    const auto found = clients_.find(one.client);
    if (found == clients_.end()) continue;
    --found->second.pending;
    if (!one.line.empty()) send(found->second, std::move(one.line), std::move(one.fd));
  }
}

/// What it does not read stays in the feed, for as long as that keeps it.
void ControlSocket::tell_events(Client& client) {
  Subscription& subscription = client.subscription;
  if (!subscription.on || client.dead || client.out_bytes >= kMostUnread_bytes / 2) return;
  EventFeed::Batch batch = feed_.since(subscription.next, subscription.names, kEventsPerRound_bytes);
  if (batch.lost > 0)
    send(client,
         notification_line("event", {{"sequence", subscription.next + batch.lost - 1},
                                     {"time_ns", wall_now().time_since_epoch().count()},
                                     {"name", "lost"},
                                     {"level", "warning"},
                                     {"text", std::to_string(batch.lost) +
                                                  " events were lost: they were not read in time; ask "
                                                  "for the status"},
                                     {"count", batch.lost}}));
  subscription.next = batch.next;
  subscription.behind = batch.more;
  for (std::string& line : batch.lines) send(client, std::move(line));
}

void ControlSocket::send(Client& client, std::string line, OwnedFd fd) {
  client.out_bytes += line.size();
  client.out.push_back({std::move(line), 0, std::move(fd)});
}

void ControlSocket::flush(Client& client) {
  while (!client.out.empty() && !client.dead) {
    Chunk& chunk = client.out.front();
    const std::string_view rest = std::string_view(chunk.bytes).substr(chunk.sent);
    const ssize_t sent = send_some(client.socket.get(), rest, chunk.fd.get());
    if (sent < 0 && (errno == EAGAIN || errno == EINTR || errno == ENOBUFS || errno == ETOOMANYREFS)) return;
    if (sent < 0) {  // nobody is there to read it; what it said is still done
      client.out.clear();
      client.out_bytes = 0;
      client.subscription.on = false;
      if (!client.hung_up) client.dead = true;
      return;
    }
    chunk.fd.reset();
    chunk.sent += static_cast<std::size_t>(sent);
    if (chunk.sent < chunk.bytes.size()) continue;
    client.out_bytes -= chunk.bytes.size();
    client.out.pop_front();
  }
}

/// Tells epoll what there is to wait for: nothing from who may not go on.
void ControlSocket::want(Client& client) {
  if (client.hung_up) return;
  std::uint32_t wanted = 0;
  if (!client.no_more_input && !client.closing) {
    if (!client.half_closed) wanted |= EPOLLRDHUP;
    if (!client.line_waits && may_take(client)) wanted |= EPOLLIN;
  }
  // No news comes of events that did not fit into this round: the next is asked for.
  const bool behind = client.subscription.on && client.subscription.behind;
  if (!client.out.empty() || behind) wanted |= EPOLLOUT;
  if (wanted == client.told_epoll) return;
  epoll_event event{};
  event.events = wanted;
  event.data.u64 = client.number;
  epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, client.socket.get(), &event);
  client.told_epoll = wanted;
}

void ControlSocket::bury() {
  for (auto client = clients_.begin(); client != clients_.end();) {
    if (!client->second.dead) {
      ++client;
      continue;
    }
    lease_.hung_up(client->first);
    client = clients_.erase(client);
  }
}

/// The loop has ended, or is about to: those who listen are told so as far as they read it.
void ControlSocket::last_words() {
  lease_.give("loses it: the daemon ends");
  feed_.drain();
  for (auto& [number, client] : clients_) {
    tell_events(client);
    flush(client);
  }
  clients_.clear();
}

}  // namespace wrenchd
