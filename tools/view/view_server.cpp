// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/view_server.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <deque>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <utility>

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <sys/random.h>
#include <unistd.h>

#include "config/toml_files.hpp"
#include "core/fault.hpp"
#include "daemon/version.hpp"
#include "tools/view/connection_owner.hpp"
#include "tools/view/live_feed.hpp"
#include "tools/view/page_calls.hpp"
#include "tools/view/page_hand.hpp"
#include "tools/view/page_lease.hpp"
#include "tools/view/recorded_feed.hpp"

namespace wrenchd {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using namespace std::chrono_literals;

constexpr auto kFrameEvery = 16ms;
constexpr auto kTimesEvery = 250ms;
constexpr auto kRequestWithin = 20s;
constexpr std::size_t kMaxConnections = 32;
/// Maximum number of unsent messages per page; above it the server closes the connection.
constexpr std::size_t kMaxWaiting = 256;
constexpr std::size_t kMaxColumns = 1000;  ///< maximum number of columns of a curve
/// A change of the time in a recording by more than this [s] updates the tick durations at once.
constexpr double kTimesWithin_s = 1.0;
constexpr std::size_t kMaxMessageBytes = 4096;  ///< maximum size of a message from a page [bytes]

std::string random_token() {
  std::array<unsigned char, 16> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
    throw std::system_error(errno, std::generic_category(), "getrandom");
  std::string token;
  for (const unsigned char byte : bytes) {
    token += "0123456789abcdef"[byte >> 4U];
    token += "0123456789abcdef"[byte & 15U];
  }
  return token;
}

/// Compares in constant time, so that the duration reveals nothing about the token.
bool same(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  unsigned different = 0;
  for (std::size_t i = 0; i < a.size(); ++i) different |= static_cast<unsigned>(a[i] ^ b[i]);
  return different == 0;
}

std::shared_ptr<const std::string> text_of(const Json& json) {
  return std::make_shared<const std::string>(json.dump(-1, ' ', false, Json::error_handler_t::replace));
}

Json summary_json(const RollingHistogram::Summary& summary) {
  return {{"bins", summary.bins},
          {"count", summary.count},
          {"p50_us", summary.p50_us},
          {"p99_9_us", summary.p99_9_us},
          {"max_us", summary.max_us}};
}

Json times_json(const RollingHistogram::Summary& tick_duration,
                const RollingHistogram::Summary& wake_latency) {
  return {{"type", "times"},
          {"tick_duration", summary_json(tick_duration)},
          {"wake_latency", summary_json(wake_latency)}};
}

/// Returns this member of a message, an array of N finite numbers; empty if it is something else.
template <std::size_t N>
std::optional<std::array<double, N>> numbers_of(const Json& message, const char* name) {
  const auto found = message.find(name);
  if (found == message.end() || !found->is_array() || found->size() != N) return {};
  std::array<double, N> numbers{};
  for (std::size_t i = 0; i < N; ++i) {
    if (!(*found)[i].is_number()) return {};
    numbers[i] = (*found)[i].get<double>();
    if (!std::isfinite(numbers[i])) return {};
  }
  return numbers;
}

/// Returns message and remedy of all faults, which every page requires.
Json faults_json() {
  Json out = Json::object();
  for (const FaultRow& row : fault_rows())
    out[std::string(row.name)] = {{"message", row.message}, {"cure", row.cure}};
  return out;
}

/// Returns the names of the scenes along the search path, as scene.load takes them.
Json scenes_json() {
  Json names = Json::array();
  for (const std::filesystem::path& file : toml_files("scenes", SearchPath()))
    names.push_back("scenes/" + file.filename().string());
  return names;
}

}  // namespace

struct ViewServer::Server {
  class Page;

  PageFiles files;
  std::string token = random_token();
  std::uint16_t port = 0;
  LiveFeed* live = nullptr;
  const RecordedFeed* recorded = nullptr;
  const RecordedFeed* compared = nullptr;  ///< a second recording beside `recorded`; null: none
  std::map<std::uint64_t, std::weak_ptr<Page>> pages;
  std::uint64_t last_page = 0;
  std::size_t connections = 0;
  IdentifyConnection identify;
  std::function<void()> opened;      ///< called once, for the first page
  std::unique_ptr<PageLease> lease;  ///< its threads post to io; the destructor ends them first
  std::unique_ptr<PageHand> hand;    ///< its thread posts to io; the destructor ends it first
  std::unique_ptr<PageCalls> calls;  ///< its thread posts to io; the destructor ends it first
  /// Declared after all that a Page uses: the last handlers of a page end with io, and with them the page.
  asio::io_context io{1};
  tcp::acceptor acceptor{io};
  asio::steady_timer frame_timer{io};
  asio::signal_set signals{io};

  Server(std::uint16_t requested_port, PageFiles page_files);
  void listen(std::uint16_t wanted_port);
  ~Server() {
    lease.reset();
    hand.reset();
    calls.reset();
  }
  void accept();
  void push_frames();
  void tell(const PageLease::Reply& reply);
  void tell(const PageCalls::Reply& reply);
  bool is_permitted(const tcp::socket& socket) const;

  bool is_ours(beast::string_view authority) const {
    const std::string number = ":" + std::to_string(port);
    return authority == "127.0.0.1" + number || authority == "localhost" + number;
  }
  bool is_our_origin(beast::string_view origin) const {
    constexpr beast::string_view kScheme = "http://";
    return origin.starts_with(kScheme) && is_ours(origin.substr(kScheme.size()));
  }
};

/// The WebSocket of an open page.
class ViewServer::Server::Page : public std::enable_shared_from_this<Page> {
 public:
  Page(tcp::socket&& socket, Server& server)
      : socket_(std::move(socket)), server_(server), number_(++server.last_page) {}
  ~Page() {
    server_.pages.erase(number_);
    --server_.connections;
    if (server_.lease) server_.lease->page_closed(number_);
  }
  Page(const Page&) = delete;
  Page& operator=(const Page&) = delete;

  void open(const http::request<http::string_body>& request) {
    socket_.set_option(websocket::stream_base::timeout::suggested(beast::role_type::server));
    socket_.read_message_max(kMaxMessageBytes);
    socket_.async_accept(request, [self = shared_from_this()](beast::error_code error) {
      if (error) return;
      self->server_.pages[self->number_] = self;
      self->greet();
      self->read();
    });
  }

  void send(std::shared_ptr<const std::string> message, bool text = true) {
    if (waiting_.size() >= kMaxWaiting) return disconnect();
    waiting_.push_back({std::move(message), text});
    if (waiting_.size() == 1) write();
  }
  void send(const Json& json) { send(text_of(json)); }

  /// Sends new data, unless the page has not read the previous data yet.
  void push(const std::shared_ptr<const std::string>& frame, std::chrono::steady_clock::time_point now) {
    if (!waiting_.empty()) return;
    LiveFeed& feed = *server_.live;
    const LiveFeed::Link link = feed.link();
    if (link.revision != link_revision_) {
      link_revision_ = link.revision;
      send({{"type", "link"},
            {"connected", link.connected},
            {"error", link.error},
            {"socket", feed.socket()},
            {"rate_Hz", link.rate_Hz},
            {"status", link.status}});
    }
    const auto scene = feed.scene();
    if (scene != scene_) show(scene);
    if (const std::string error = feed.scene_error(); error != scene_error_) {
      scene_error_ = error;
      send({{"type", "no_scene"}, {"error", error}});
    }
    if (link.connected && frame) {
      std::string history;
      feed.with_history([&](const MinMaxHistory& extremes) {
        const bool reset = link.connection != history_of_ || history_at_ < extremes.first_index() ||
                           history_at_ > extremes.end_index();
        if (reset) history_at_ = extremes.first_index();
        if (reset || history_at_ < extremes.end_index())
          history = history_message(extremes, history_at_, extremes.end_index(), reset, 0);
        history_at_ = extremes.end_index();
        history_of_ = link.connection;
      });
      if (!history.empty()) send(std::make_shared<const std::string>(std::move(history)), false);
      send(frame);
    }
    if (link.connected && now >= times_at_) {
      times_at_ = now + kTimesEvery;
      send(times_json(feed.tick_duration(), feed.wake_latency()));
    }
  }

  void disconnect() {
    beast::error_code ignored;
    beast::get_lowest_layer(socket_).socket().close(ignored);
  }

 private:
  struct Message {
    std::shared_ptr<const std::string> bytes;
    bool text;
  };

  void greet() {
    Json hello = {{"type", "hello"}, {"version", kVersion}, {"page", number_}, {"faults", faults_json()}};
    if (const RecordedFeed* feed = server_.recorded) {
      hello.update({{"mode", "recording"},
                    {"name", feed->name()},
                    {"recorded_by", feed->version()},
                    {"duration_s", feed->duration_s()},
                    {"rate_Hz", feed->rate_Hz()},
                    {"changes", feed->state_changes()},
                    {"markers", feed->markers()}});
      if (const RecordedFeed* other = server_.compared)
        hello["compared"] = {{"name", other->name()},
                             {"recorded_by", other->version()},
                             {"duration_s", other->duration_s()},
                             {"same_scene", other->has_scene_of(*feed)}};
      send(hello);
      send_columns(ColumnsFor::overview, 0.0, feed->duration_s(), kMaxColumns);
      if (feed->scene()) show(feed->scene());
      if (!feed->scene_error().empty()) send({{"type", "no_scene"}, {"error", feed->scene_error()}});
      at(0.0);
    } else {
      hello.update({{"mode", "live"}, {"scenes", scenes_json()}});
      send(hello);
    }
  }

  void show(const std::shared_ptr<const ViewScene>& scene) {
    if (scene && !(scene_ && scene_->meshes() == scene->meshes()))
      for (const auto& mesh : scene->meshes()) send(mesh, false);
    if (scene) send(std::make_shared<const std::string>(scene->text()));
    scene_ = scene;
  }

  /// Sends the state of a recording at this time.
  void at(double t_s) {
    const auto now = std::chrono::steady_clock::now();
    if (std::abs(t_s - times_t_s_) > kTimesWithin_s || now >= times_at_) {
      times_at_ = now + kTimesEvery;
      times_timer_.cancel();
      tell_times(t_s);
    } else {  // posted, so that the page also receives the event that ends its input
      times_timer_.expires_at(times_at_);
      times_timer_.async_wait([self = shared_from_this(), t_s](beast::error_code error) {
        if (!error) self->tell_times(t_s);
      });
    }
    Json frame = server_.recorded->frame(t_s);
    if (const RecordedFeed* other = server_.compared)
      frame["compared"] = t_s <= other->duration_s() ? other->frame(t_s) : Json(nullptr);
    send(frame);  // sent last: the page requests the next frame when this one arrives
  }

  /// Sends the curves of both recordings in this range.
  void send_columns(ColumnsFor purpose, double from_s, double to_s, std::size_t count) {
    std::uint32_t number = 0;
    for (const RecordedFeed* feed : {server_.recorded, server_.compared}) {
      if (feed != nullptr)
        send(std::make_shared<const std::string>(
                 columns_message(purpose, number, feed->columns(from_s, to_s, count), feed->begin_ns())),
             false);
      ++number;
    }
  }

  /// Message {range: [begin [s], end [s], number of columns]}: the range of the page's plots.
  void plot(const Json& message) {
    const auto range = numbers_of<3>(message, "range");
    if (!range) return disconnect();
    const auto [from_s, to_s, count] = *range;
    send_columns(ColumnsFor::plots, from_s, to_s,
                 static_cast<std::size_t>(std::clamp(count, 2.0, static_cast<double>(kMaxColumns))));
  }

  void tell_times(double t_s) {
    times_t_s_ = t_s;
    const auto [took, late] = server_.recorded->tick_times(t_s);
    send(times_json(took, late));
  }

  void read() {
    socket_.async_read(buffer_, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (error) return self->disconnect();
      self->handle(beast::buffers_to_string(self->buffer_.data()));
      self->buffer_.consume(self->buffer_.size());
      self->read();
    });
  }

  void handle(const std::string& text) {
    const Json message = Json::parse(text, nullptr, false);
    if (!message.is_object() || !message.contains("type") || !message["type"].is_string())
      return disconnect();
    const std::string type = message["type"];
    if (server_.recorded != nullptr) {
      if (type == "at" && message.contains("t") && message["t"].is_number()) at(message["t"].get<double>());
      if (type == "plot") plot(message);
      return;
    }
    PageLease& lease = *server_.lease;
    if (type == "heartbeat") lease.heartbeat(number_);
    if (type == "stop") lease.submit(number_, PageLease::Request::stop);
    if (type == "arm") lease.submit(number_, PageLease::Request::arm);
    if (type == "disarm") lease.submit(number_, PageLease::Request::disarm);
    if (type == "acknowledge") lease.submit(number_, PageLease::Request::acknowledge);
    if (type == "hand") move_hand(message);
    if (type == "call") call(message);
  }

  /// Message {id, method, params}: a call of the drawer.
  void call(const Json& message) {
    const auto id = message.find("id"), method = message.find("method"), params = message.find("params");
    if (id == message.end() || !id->is_number_unsigned() || method == message.end() || !method->is_string() ||
        params == message.end() || !params->is_object())
      return disconnect();
    server_.calls->submit({number_, id->get<std::uint64_t>(), method->get<std::string>(), *params});
  }

  /// Message {from, d, r}: pose of the handle when the drag began, displacement and rotation since then.
  void move_hand(const Json& message) {
    const auto from = numbers_of<7>(message, "from");
    const auto d = numbers_of<3>(message, "d"), r = numbers_of<3>(message, "r");
    if (!from || !d || !r) return disconnect();
    const auto scene = server_.live->scene();
    const Pose X_BH = pose_from_numbers(*from);
    if (!scene || !(X_BH.rotation.norm() > 0.5)) return;  // a tick without a valid pose
    server_.hand->move(number_, dragged({X_BH.rotation.normalized(), X_BH.translation_m},
                                        scene->X_WB().rotation, Vector3d(d->data()), Vector3d(r->data())));
  }

  void write() {
    socket_.text(waiting_.front().text);
    socket_.async_write(asio::buffer(*waiting_.front().bytes),
                        [self = shared_from_this()](beast::error_code error, std::size_t) {
                          if (error) return self->disconnect();
                          self->waiting_.pop_front();
                          if (!self->waiting_.empty()) self->write();
                        });
  }

  websocket::stream<beast::tcp_stream> socket_;
  Server& server_;
  std::uint64_t number_;
  beast::flat_buffer buffer_;
  std::deque<Message> waiting_;
  std::uint64_t link_revision_ = ~std::uint64_t{0};
  std::shared_ptr<const ViewScene> scene_;
  std::string scene_error_;
  std::uint64_t history_of_ = 0, history_at_ = 0;
  std::chrono::steady_clock::time_point times_at_{};
  double times_t_s_ = std::numeric_limits<double>::infinity();  ///< time of the last tick durations [s]
  asio::steady_timer times_timer_{socket_.get_executor()};
};

namespace {

/// A connection before its HTTP request is complete.
template <class Server>
class Visit : public std::enable_shared_from_this<Visit<Server>> {
 public:
  Visit(tcp::socket&& socket, Server& server) : stream_(std::move(socket)), server_(server) {}
  ~Visit() {
    if (!became_page_) --server_.connections;
  }
  Visit(const Visit&) = delete;
  Visit& operator=(const Visit&) = delete;

  void read() {
    request_ = {};
    stream_.expires_after(kRequestWithin);
    http::async_read(stream_, buffer_, request_,
                     [self = this->shared_from_this()](beast::error_code error, std::size_t) {
                       if (!error) self->answer();
                     });
  }

 private:
  /// Returns the requested path below the token; empty if the token is wrong.
  std::optional<std::string> requested_path() const {
    const auto target = request_.target();
    const std::size_t end = server_.token.size() + 1;
    if (target.size() < end + 1 || target[0] != '/' || target[end] != '/') return {};
    if (!same({target.data() + 1, end - 1}, server_.token)) return {};
    return std::string(target.substr(end + 1));
  }

  void answer() {
    const auto origin = request_.find(http::field::origin);
    const bool from_us = origin == request_.end() || server_.is_our_origin(origin->value());
    const bool upgrade = websocket::is_upgrade(request_);
    if (!server_.is_ours(request_[http::field::host]) || !from_us || (upgrade && origin == request_.end()))
      return reject(http::status::forbidden,
                    "Only browsers that open the address from wrenchctl view may load this page.\n");
    const auto name = requested_path();
    if (!name)
      return reject(http::status::forbidden,
                    "The address is incomplete; open the whole address that wrenchctl view printed.\n");
    if (upgrade && *name == "live") {
      stream_.expires_never();
      became_page_ = true;
      std::make_shared<typename Server::Page>(stream_.release_socket(), server_)->open(request_);
      return;
    }
    if (request_.method() != http::verb::get && request_.method() != http::verb::head)
      return reject(http::status::method_not_allowed, "Only the method GET is supported.\n");
    const PageFiles::File* file = server_.files.find(*name);
    if (file == nullptr) return reject(http::status::not_found, "The file does not exist.\n");
    if (server_.opened) std::exchange(server_.opened, {})();
    respond(http::status::ok, file->type, file->bytes);
  }

  void reject(http::status status, const char* why) { respond(status, "text/plain; charset=utf-8", why); }

  void respond(http::status status, const std::string& type, const std::string& body) {
    auto response = std::make_shared<http::response<http::string_body>>(status, request_.version());
    response->set(http::field::server, "wrenchctl view");
    response->set(http::field::content_type, type);
    response->set(http::field::cache_control, "no-store");
    response->set("X-Content-Type-Options", "nosniff");
    response->set("Referrer-Policy", "no-referrer");
    response->set("Cross-Origin-Resource-Policy", "same-origin");
    response->set("Cross-Origin-Opener-Policy", "same-origin");
    response->set("Content-Security-Policy", server_.files.security_policy());
    response->keep_alive(request_.keep_alive());
    response->content_length(body.size());
    if (request_.method() != http::verb::head) response->body() = body;
    http::async_write(stream_, *response,
                      [self = this->shared_from_this(), response](beast::error_code error, std::size_t) {
                        if (!error && response->keep_alive()) return self->read();
                        self->stream_.socket().shutdown(tcp::socket::shutdown_send, error);
                      });
  }

  beast::tcp_stream stream_;
  Server& server_;
  beast::flat_buffer buffer_;
  http::request<http::string_body> request_;
  bool became_page_ = false;
};

}  // namespace

ViewServer::Server::Server(std::uint16_t requested_port, PageFiles page_files)
    : files(std::move(page_files)) {
  try {
    listen(requested_port);
  } catch (const boost::system::system_error& error) {
    // The address that is printed contains the port, so any free one serves.
    if (error.code() != asio::error::address_in_use || requested_port == 0)
      throw std::runtime_error("127.0.0.1:" + std::to_string(requested_port) + ": cannot listen: " +
                               error.code().message() + "; name another port with --port, or omit it");
    acceptor.close();
    listen(0);
  }
  port = acceptor.local_endpoint().port();
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) signals.add(signal);
  signals.async_wait([this](beast::error_code error, int) {
    if (!error) io.stop();
  });
}

void ViewServer::Server::listen(std::uint16_t wanted_port) {
  const tcp::endpoint here(asio::ip::address_v4::loopback(), wanted_port);
  acceptor.open(here.protocol());
  acceptor.set_option(tcp::acceptor::reuse_address(true));
  acceptor.bind(here);
  acceptor.listen();
}

/// Returns true if the other end belongs to the user of this process, or to root. The connection of another
/// user does not count, so that it takes no place from the owner.
bool ViewServer::Server::is_permitted(const tcp::socket& socket) const {
  beast::error_code error;
  const tcp::endpoint peer = socket.remote_endpoint(error);
  if (error) return false;
  const std::optional<uid_t> owner = identify(peer.port(), port);
  return owner && (*owner == ::geteuid() || *owner == 0);
}

void ViewServer::Server::accept() {
  acceptor.async_accept([this](beast::error_code error, tcp::socket socket) {
    if (error == asio::error::operation_aborted) return;
    if (!error && connections < kMaxConnections && is_permitted(socket)) {
      socket.set_option(tcp::no_delay(true), error);
      ++connections;
      std::make_shared<Visit<Server>>(std::move(socket), *this)->read();
    }
    accept();
  });
}

/// Sends the same frame to all pages that are ready to receive one.
void ViewServer::Server::push_frames() {
  frame_timer.expires_after(kFrameEvery);
  frame_timer.async_wait([this](beast::error_code error) {
    if (!error) push_frames();
  });
  live->set_watched(!pages.empty());
  const std::vector<std::string> events = live->events();
  lease->set_loop_state(live->state());
  if (pages.empty()) return;
  std::shared_ptr<const std::string> frame;
  if (const auto now = live->newest_sample()) {
    Json json = frame_json(now->tick, now->words, live->scene().get(), 0);
    json["missed"] = now->missed;
    json["held_by"] = lease->holder();
    frame = text_of(json);
  }
  const auto time = std::chrono::steady_clock::now();
  for (const auto& [number, weak] : pages) {
    const auto page = weak.lock();
    if (!page) continue;
    for (const std::string& event : events)
      page->send(std::make_shared<const std::string>(R"({"type":"event","event":)" + event + "}"));
    page->push(frame, time);
  }
}

void ViewServer::Server::tell(const PageLease::Reply& reply) {
  const auto found = pages.find(reply.page);
  if (found == pages.end()) return;
  if (const auto page = found->second.lock())
    page->send({{"type", "reply"},
                {"request", reply.request},
                {"accepted", reply.accepted},
                {"error", reply.error}});
}

void ViewServer::Server::tell(const PageCalls::Reply& reply) {
  const auto found = pages.find(reply.page);
  if (found == pages.end()) return;
  if (const auto page = found->second.lock())
    page->send({{"type", "result"}, {"id", reply.id}, {"result", reply.result}, {"error", reply.error}});
}

std::optional<uid_t> ViewServer::identify_connection(std::uint16_t peer_port, std::uint16_t own_port) {
  return connection_owner(peer_port, own_port);
}

ViewServer::ViewServer(std::uint16_t port, PageFiles files, LiveFeed& feed, IdentifyConnection identify)
    : server_(std::make_unique<Server>(port, std::move(files))) {
  server_->identify = std::move(identify);
  server_->live = &feed;
  server_->lease =
      std::make_unique<PageLease>(feed.socket(), [server = server_.get()](const PageLease::Reply& reply) {
        asio::post(server->io, [server, reply] { server->tell(reply); });
      });
  server_->hand = std::make_unique<PageHand>(
      feed.socket(), [server = server_.get()](std::uint64_t page, const std::string& error) {
        asio::post(server->io, [server, page, error] {
          server->tell(PageLease::Reply{page, "hand", false, error});
        });
      });
  server_->calls =
      std::make_unique<PageCalls>(feed.socket(), [server = server_.get()](const PageCalls::Reply& reply) {
        asio::post(server->io, [server, reply] { server->tell(reply); });
      });
}

ViewServer::ViewServer(std::uint16_t port, PageFiles files, const RecordedFeed& feed,
                       IdentifyConnection identify)
    : server_(std::make_unique<Server>(port, std::move(files))) {
  server_->identify = std::move(identify);
  server_->recorded = &feed;
}

ViewServer::~ViewServer() = default;

void ViewServer::compare_with(const RecordedFeed& other) noexcept {
  server_->compared = &other;
}

std::string ViewServer::url() const {
  return "http://127.0.0.1:" + std::to_string(server_->port) + "/" + server_->token + "/";
}

void ViewServer::on_first_page(std::function<void()> opened) {
  server_->opened = std::move(opened);
}

void ViewServer::run() {
  server_->accept();
  if (server_->live != nullptr) server_->push_frames();
  server_->io.run();
}

void ViewServer::stop() {
  server_->io.stop();
}

}  // namespace wrenchd
