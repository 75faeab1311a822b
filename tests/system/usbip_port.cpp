// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/system/usbip_port.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <utility>

#include <arpa/inet.h>
#include <poll.h>
#include <sched.h>
#include <sys/socket.h>
#include <unistd.h>

#include "devices/links/latest_writer.hpp"
#include "devices/links/wake_up.hpp"

namespace wrenchd::test {
namespace {

const std::string kController = "/sys/devices/platform/vhci_hcd.0/";

// USB/IP, Documentation/usb/usbip_protocol.rst of the kernel. Every message begins with 48 bytes of
// big-endian words: command, number, device, direction, endpoint; then, at byte 20, what belongs to the
// command.
constexpr std::size_t kHeader = 48;
constexpr std::uint32_t kSubmit = 1, kUnlink = 2, kSubmitReply = 3, kUnlinkReply = 4;
constexpr int kFullSpeed = 2, kHighSpeed = 3;

std::uint32_t word(std::span<const std::uint8_t> bytes, std::size_t at) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, 4);
  return ntohl(value);
}

void put(std::span<std::uint8_t> bytes, std::size_t at, std::uint32_t value) {
  value = htonl(value);
  std::memcpy(bytes.data() + at, &value, 4);
}

constexpr std::uint8_t low(unsigned v) {
  return static_cast<std::uint8_t>(v & 0xFFU);
}
constexpr std::uint8_t high(unsigned v) {
  return static_cast<std::uint8_t>(v >> 8U);
}

/// The controller's threads are ordinary ones; those of a real one are interrupt threads, and SCHED_FIFO.
void raise_controller(int priority) {
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const int process = std::atoi(entry.path().filename().c_str());
    std::string name;
    std::getline(std::ifstream(entry.path() / "comm"), name);
    if (process == 0 || (name != "vhci_rx" && name != "vhci_tx")) continue;
    sched_param parameters{};
    parameters.sched_priority = priority;
    sched_setscheduler(process, SCHED_FIFO, &parameters);
  }
}

}  // namespace

UsbipPort::UsbipPort(UsbIdentity identity, UsbShape shape, int priority)
    : identity_(std::move(identity)), shape_(std::move(shape)), priority_(priority) {}

UsbipPort::~UsbipPort() {
  unplug();
}

// --- connection
// ---------------------------------------------------------------------------------------------

void UsbipPort::plug(int port) {
  std::array<int, 2> pair{};
  if (socketpair(AF_UNIX, SOCK_STREAM, 0, pair.data()) != 0) throw std::runtime_error("no socket pair");
  // The controller needs time after the previous device of the port.
  bool attached = false;
  for (int i = 0; i < 1000 && !attached; ++i) {
    if (i > 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    // port, socket, device (bus 1, address 1 of the far side), speed
    std::ofstream attach(kController + "attach");
    attach << port << ' ' << pair[1] << ' ' << 0x10001 << ' ' << (shape_.high_speed ? kHighSpeed : kFullSpeed)
           << std::flush;
    attached = static_cast<bool>(attach);
  }
  ::close(pair[1]);
  if (!attached) {
    ::close(pair[0]);
    throw std::runtime_error("nothing can be plugged into port " + std::to_string(port) + " of " +
                             kController);
  }
  socket_ = pair[0];
  port_ = port;
  pulled_ = false;
  received_bytes_ = 0;
  raise_controller(priority_);
  thread_ = std::thread([this] { run(); });
  raise_priority(thread_, priority_);
}

void UsbipPort::unplug() {
  if (port_ < 0) return;
  std::ofstream(kController + "detach") << port_ << std::flush;
  pulled_ = true;
  shutdown(socket_, SHUT_RDWR);
  thread_.join();
  ::close(socket_);
  port_ = -1;
}

// --- the device's thread ----------------------------------------------------------------------------------

void UsbipPort::run() {
  TimePoint next;
  {
    const std::lock_guard lock(mutex_);
    next = begin(std::chrono::steady_clock::now());
  }
  bool connected = true;
  while (connected && !pulled_) {
    const short ready = wait_for_fd(socket_, POLLIN, next);
    const TimePoint now = std::chrono::steady_clock::now();
    const std::lock_guard lock(mutex_);
    if (now >= next) next = on_time(now);
    if (ready != 0) serve_host(connected);
  }
}

void UsbipPort::serve_host(bool& connected) {
  const std::span<std::uint8_t> room = std::span(received_).subspan(received_bytes_);
  const ssize_t n = ::recv(socket_, room.data(), room.size(), MSG_DONTWAIT);
  if (n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR)) connected = false;
  if (n <= 0) return;
  received_bytes_ += static_cast<std::size_t>(n);
  std::size_t done = 0;
  while (const std::size_t served = serve(std::span(received_).subspan(done, received_bytes_ - done)))
    done += served;
  std::copy(received_.begin() + static_cast<std::ptrdiff_t>(done),
            received_.begin() + static_cast<std::ptrdiff_t>(received_bytes_), received_.begin());
  received_bytes_ -= done;
}

/// Processes the first message in the bytes. Returns its length; 0 if it is incomplete.
std::size_t UsbipPort::serve(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < kHeader) return 0;
  const std::uint32_t number = word(bytes, 4);
  if (word(bytes, 0) == kUnlink) {
    unlinked(number, word(bytes, 20));
    return kHeader;
  }
  const std::uint32_t direction = word(bytes, 12);
  const std::uint32_t length = word(bytes, 24);
  const std::size_t sent = direction == 0 ? length : 0;
  if (bytes.size() < kHeader + sent) return 0;
  if (word(bytes, 0) == kSubmit)
    submitted(number, direction, word(bytes, 16), length, bytes.subspan(40, 8), bytes.subspan(kHeader, sent));
  return kHeader + sent;
}

void UsbipPort::submitted(std::uint32_t number, std::uint32_t direction, std::uint32_t endpoint,
                          std::uint32_t length, std::span<const std::uint8_t> setup,
                          std::span<const std::uint8_t> data) {
  if (endpoint == 0) return control(number, setup, data);
  if (direction == 1) {
    in_.push_back({number, length, {}});
    return on_in();
  }
  on_out({number, length, {data.begin(), data.end()}});
}

void UsbipPort::unlinked(std::uint32_t number, std::uint32_t unlink) {
  bool found = false;
  for (std::deque<Transfer>* queue : {&in_, &held_out_})
    found = std::erase_if(*queue, [&](const Transfer& t) { return t.number == unlink; }) > 0 || found;
  std::array<std::uint8_t, kHeader> header{};
  put(header, 0, kUnlinkReply);
  put(header, 4, number);
  put(header, 20, static_cast<std::uint32_t>(found ? -ECONNRESET : 0));
  send(header);
}

// --- endpoint 0 -------------------------------------------------------------------------------------------

void UsbipPort::control(std::uint32_t number, std::span<const std::uint8_t> setup,
                        std::span<const std::uint8_t> data) {
  const bool in = (setup[0] & 0x80U) != 0;
  std::optional<Bytes> answer = answer_control(setup, data);
  if (!answer) return reply(number, -EPIPE, 0, {});
  const std::size_t wanted = setup[6] + 256U * setup[7];
  if (in && answer->size() > wanted) answer->resize(wanted);
  reply(number, 0, static_cast<std::uint32_t>(in ? answer->size() : data.size()), *answer);
}

/// Answers the standard requests of USB 2.0, section 9.4, and HID 1.11, section 7. Empty: the answer is a
/// stall.
std::optional<UsbipPort::Bytes> UsbipPort::answer_control(std::span<const std::uint8_t> setup,
                                                          std::span<const std::uint8_t> data) {
  constexpr unsigned get_status = 0, clear_feature = 1, get_descriptor = 6, get_configuration = 8,
                     get_interface = 10, set_report = 9;
  const unsigned type = setup[0], request = setup[1], value = setup[2] + 256U * setup[3];
  if ((type == 0x80 || type == 0x81) && request == get_descriptor)
    return descriptor(value >> 8U, value & 0xFFU);
  if ((type & 0xE0U) == 0x80 && request == get_status) return Bytes{0, 0};
  if (type == 0x80 && request == get_configuration) return Bytes{1};
  if (type == 0x81 && request == get_interface) return Bytes{0};
  if (type == 0x02 && request == clear_feature) {
    on_clear_halt();
    return Bytes{};
  }
  if (type == 0x21 && request == set_report) on_set_report(data);
  if (type == 0x40 && !on_vendor_request(setup[1], static_cast<std::uint16_t>(value))) return std::nullopt;
  if ((type & 0x80U) == 0) return Bytes{};
  return std::nullopt;
}

std::optional<UsbipPort::Bytes> UsbipPort::descriptor(unsigned type, unsigned index) const {
  const auto text = [](const std::string& s) {
    Bytes bytes{static_cast<std::uint8_t>(2 + 2 * s.size()), 3};
    for (const char c : s) bytes.insert(bytes.end(), {static_cast<std::uint8_t>(c), 0});
    return bytes;
  };
  const unsigned v = identity_.vendor, p = identity_.product;
  switch (type) {
    case 1:
      return Bytes{18,
                   1,
                   0x00,
                   0x02,
                   0,
                   0,
                   0,
                   64,
                   low(v),
                   high(v),
                   low(p),
                   high(p),
                   0x00,
                   0x01,
                   1,
                   2,
                   static_cast<std::uint8_t>(identity_.serial.empty() ? 0 : 3),
                   1};
    case 2:
      return configuration();
    case 3:
      if (index == 0) return Bytes{4, 3, 0x09, 0x04};
      if (index > 3) return std::nullopt;
      return text(index == 1 ? "wrenchd" : index == 2 ? shape_.product : identity_.serial);
    case 6:
      return Bytes{10, 6, 0x00, 0x02, 0, 0, 0, 64, 1, 0};
    case 0x22:
      return shape_.report_descriptor;
    default:
      return std::nullopt;
  }
}

UsbipPort::Bytes UsbipPort::configuration() const {
  const bool hid = !shape_.report_descriptor.empty();
  const auto report_bytes = static_cast<unsigned>(shape_.report_descriptor.size());
  const std::uint8_t endpoints = shape_.out != 0 ? 2 : 1;
  const std::uint8_t kind = hid ? 3 : 2;  // interrupt, or bulk
  const std::uint8_t interval = hid ? 1 : 0;
  Bytes all{9, 2, 0, 0, 1, 1, 0, 0x80, 50};
  const auto add = [&all](const Bytes& part) { all.insert(all.end(), part.begin(), part.end()); };
  add({9, 4, 0, 0, endpoints, static_cast<std::uint8_t>(hid ? 3 : 0xFF), 0, 0, 0});
  if (hid) add({9, 0x21, 0x11, 1, 0, 1, 0x22, low(report_bytes), high(report_bytes)});
  add({7, 5, shape_.in, kind, shape_.in_bytes, 0, interval});
  if (shape_.out != 0) add({7, 5, shape_.out, kind, shape_.out_bytes, 0, interval});
  all[2] = static_cast<std::uint8_t>(all.size());
  return all;
}

// --- the wire ---------------------------------------------------------------------------------------------

void UsbipPort::reply(std::uint32_t number, std::int32_t status, std::uint32_t length,
                      std::span<const std::uint8_t> in) {
  std::array<std::uint8_t, kHeader + 1024> buffer{};
  const std::span<std::uint8_t> message = std::span(buffer).first(kHeader + in.size());
  put(message, 0, kSubmitReply);
  put(message, 4, number);
  put(message, 20, static_cast<std::uint32_t>(status));
  put(message, 24, length);
  std::copy(in.begin(), in.end(), message.begin() + kHeader);
  send(message);
}

void UsbipPort::send(std::span<const std::uint8_t> bytes) const {
  ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);  // recv() detects a closed connection
}

}  // namespace wrenchd::test
