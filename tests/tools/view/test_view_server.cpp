// SPDX-License-Identifier: GPL-3.0-or-later
#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "daemon/control/owned_fd.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tools/view/live_feed.hpp"
#include "tools/view/recorded_feed.hpp"
#include "tools/view/view_server.hpp"

namespace wrenchd::test_view_server {

namespace {

using namespace test;

/// Opens the WebSocket of a page, as a browser does. url: "http://127.0.0.1:PORT/TOKEN/". The page stays open
/// as long as the descriptor.
OwnedFd open_page(const std::string& url) {
  const std::string authority = url.substr(7, url.find('/', 7) - 7);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(std::stoi(authority.substr(authority.find(':') + 1))));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  OwnedFd fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  REQUIRE(::connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
  const std::string request = "GET " + url.substr(7 + authority.size()) +
                              "live HTTP/1.1\r\nHost: " + authority + "\r\nOrigin: http://" + authority +
                              "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                              "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n";
  REQUIRE(::send(fd.get(), request.data(), request.size(), MSG_NOSIGNAL) ==
          static_cast<ssize_t>(request.size()));
  std::string received;
  while (received.find("\"hello\"") == std::string::npos) {
    std::string piece(4096, '\0');
    const ssize_t got = ::recv(fd.get(), piece.data(), piece.size(), 0);
    REQUIRE(got > 0);
    received.append(piece.data(), static_cast<std::size_t>(got));
  }
  CHECK(received.starts_with("HTTP/1.1 101 "));
  return fd;
}

/// Opens pages and ends the server while they are open.
void end_with_open_pages(std::unique_ptr<ViewServer> server) {
  std::thread running([&] { server->run(); });
  std::vector<OwnedFd> pages;
  for (int i = 0; i < 8; ++i) pages.push_back(open_page(server->url()));
  server->stop();
  running.join();
  server.reset();
}

PageFiles page_files(const TemporaryDirectory& directory) {
  directory.write("index.html", "<!doctype html>");
  return PageFiles(directory.path());
}

TEST_CASE("the view of a recording ends while pages are open", "[view]") {
  const TemporaryDirectory directory;
  Recording recording;
  recording.ticks.resize(2);
  recording.contact_ranges.resize(2);
  recording.ticks[1].now_ns = 1'000'000;
  const RecordedFeed feed("run.h5", std::move(recording), nullptr, "the test has no scene");
  end_with_open_pages(std::make_unique<ViewServer>(std::uint16_t{0}, page_files(directory), feed));
}

TEST_CASE("the live view ends while pages are open", "[view]") {
  const TemporaryDirectory directory;
  LiveFeed feed((directory.path() / "nobody.sock").string());
  end_with_open_pages(std::make_unique<ViewServer>(std::uint16_t{0}, page_files(directory), feed));
}

std::uint16_t port_of(const ViewServer& server) {
  const std::string url = server.url();
  return static_cast<std::uint16_t>(std::stoi(url.substr(url.find(':', 7) + 1)));
}

TEST_CASE("a second view on the same port takes another one, and ends as the first", "[view]") {
  const TemporaryDirectory directory;
  LiveFeed feed((directory.path() / "nobody.sock").string());
  const ViewServer first(0, page_files(directory), feed);
  auto second = std::make_unique<ViewServer>(port_of(first), page_files(directory), feed);
  CHECK(port_of(*second) != port_of(first));
  end_with_open_pages(std::move(second));
}

/// Connects to the server. Returns true if it answers a request, false if it closes the connection at once.
bool is_answered(const std::string& url, const std::string& path) {
  const std::string authority = url.substr(7, url.find('/', 7) - 7);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(std::stoi(authority.substr(authority.find(':') + 1))));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const OwnedFd fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (::connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) return false;
  const std::string request = "GET " + path + " HTTP/1.1\r\nHost: " + authority + "\r\n\r\n";
  ::send(fd.get(), request.data(), request.size(), MSG_NOSIGNAL);
  char byte = 0;
  return ::recv(fd.get(), &byte, 1, 0) == 1;
}

TEST_CASE("other users get no answer, even with the token, and take no connection from the owner", "[view]") {
  const TemporaryDirectory directory;
  LiveFeed feed((directory.path() / "nobody.sock").string());
  std::atomic<bool> owned{false};
  std::atomic<int> opened{0};
  ViewServer server(0, page_files(directory), feed, [&owned](std::uint16_t, std::uint16_t) {
    return owned ? std::optional<uid_t>(::geteuid()) : std::optional<uid_t>(::geteuid() + 12345);
  });
  server.on_first_page([&opened] { ++opened; });
  std::thread running([&] { server.run(); });
  const std::string url = server.url(), path = url.substr(url.find('/', 7));
  CHECK_FALSE(is_answered(url, path));
  // More idle strangers than there are connections.
  const std::string authority = url.substr(7, url.find('/', 7) - 7);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(std::stoi(authority.substr(authority.find(':') + 1))));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  std::vector<OwnedFd> strangers;
  for (int i = 0; i < 100; ++i) {
    strangers.emplace_back(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    REQUIRE(::connect(strangers.back().get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) ==
            0);
  }
  char byte = 0;
  CHECK(::recv(strangers.back().get(), &byte, 1, 0) <= 0);
  CHECK(opened == 0);
  owned = true;
  CHECK(is_answered(url, path));
  CHECK(is_answered(url, path));
  CHECK(opened == 1);
  server.stop();
  running.join();
}

}  // namespace
}  // namespace wrenchd::test_view_server
