// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/system/usbip_device.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
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

#include "devices/latest_writer.hpp"
#include "devices/reference_layout.hpp"
#include "devices/wake_up.hpp"

namespace wrenchd::test {
namespace {

const std::string kController = "/sys/devices/platform/vhci_hcd.0/";

// USB/IP, Documentation/usb/usbip_protocol.rst of the kernel. Every message begins with 48 bytes of
// big-endian words: command, number, device, direction, endpoint; then, at byte 20, what belongs to the
// command.
constexpr std::size_t kHeader = 48;
constexpr std::uint32_t kSubmit = 1, kUnlink = 2, kSubmitReply = 3, kUnlinkReply = 4;
constexpr int kHighSpeed = 3;

std::uint32_t word(std::span<const std::uint8_t> bytes, std::size_t at) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, 4);
  return ntohl(value);
}

void put(std::span<std::uint8_t> bytes, std::size_t at, std::uint32_t value) {
  value = htonl(value);
  std::memcpy(bytes.data() + at, &value, 4);
}

/// The report descriptor of devices/README.md.
constexpr std::array<std::uint8_t, 31> kReportDescriptor{
    0x06, 0x00, 0xFF, 0x09, 0x01, 0xA1, 0x01, 0x15, 0x00, 0x26, 0xFF, 0x00, 0x75, 0x08, 0x85, 0x01,
    0x09, 0x02, 0x95, 0x3F, 0x81, 0x02, 0x85, 0x02, 0x09, 0x03, 0x95, 0x1F, 0x91, 0x02, 0xC0};

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

SimulationSettings ideal() {
  SimulationSettings settings;
  settings.position_quantum_m = 0.0;
  settings.rotation_quantum_rad = 0.0;
  return settings;
}

/// Counts of the force in x that name a pose.
constexpr double kAnswerStep_N = 1e-6;

}  // namespace

/// To and fro: 1 um with each report, so the handle is never too fast, whatever the rate.
double UsbipDevice::position_m(std::uint64_t sequence) noexcept {
  const std::uint64_t phase = sequence & 0xFFFFU;
  return 1e-6 * static_cast<double>(phase < 0x8000U ? phase : 0x10000U - phase);
}

Wrench UsbipDevice::answer_to(std::uint64_t sequence) noexcept {
  Wrench F;
  F.force_N.x() = kAnswerStep_N * static_cast<double>(sequence & 0xFFFFU);
  return F;
}

UsbipDevice::UsbipDevice(Identity identity, double rate_Hz, int priority)
    : identity_(std::move(identity)),
      rate_Hz_(rate_Hz),
      priority_(priority),
      profile_(reference_profile()),
      firmware_(profile_, ideal(), from_seconds(1.0 / rate_Hz)) {
  turn_arounds_.reserve(65536);
}

UsbipDevice::~UsbipDevice() {
  unplug();
}

// --- the plug ---------------------------------------------------------------------------------------------

void UsbipDevice::plug(int port) {
  std::array<int, 2> pair{};
  if (socketpair(AF_UNIX, SOCK_STREAM, 0, pair.data()) != 0) throw std::runtime_error("no socket pair");
  // The controller needs a while to get over what was in the port before.
  bool attached = false;
  for (int i = 0; i < 1000 && !attached; ++i) {
    if (i > 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    // port, socket, device (bus 1, address 1 of the far side), speed
    std::ofstream attach(kController + "attach");
    attach << port << ' ' << pair[1] << ' ' << 0x10001 << ' ' << kHighSpeed << std::flush;
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
  powered_ = std::chrono::steady_clock::now();
  thread_ = std::thread([this] { run(); });
  raise_priority(thread_, priority_);
}

void UsbipDevice::unplug() {
  if (port_ < 0) return;
  std::ofstream(kController + "detach") << port_ << std::flush;
  pulled_ = true;
  shutdown(socket_, SHUT_RDWR);
  thread_.join();
  ::close(socket_);
  port_ = -1;
}

void UsbipDevice::set(Trouble trouble) {
  const std::lock_guard lock(mutex_);
  trouble_ = trouble;
  halted_ = trouble == Trouble::stalled_once || trouble == Trouble::stalled;
  if (trouble != Trouble::deaf) take_held_commands();
  flush();
}

DeviceRecord UsbipDevice::record() const {
  const std::lock_guard lock(mutex_);
  DeviceRecord record = record_;
  record.motors_on = firmware_.motors_on();
  record.watchdog_tripped = firmware_.watchdog_tripped();
  return record;
}

std::vector<Duration> UsbipDevice::turn_arounds() const {
  const std::lock_guard lock(mutex_);
  return turn_arounds_;
}

// --- the device's thread ----------------------------------------------------------------------------------

void UsbipDevice::run() {
  const Duration period = from_seconds(1.0 / rate_Hz_);
  TimePoint next = std::chrono::steady_clock::now() + period;
  bool connected = true;
  while (connected && !pulled_) {
    const short ready = wait_for_file(socket_, POLLIN, next);
    const TimePoint now = std::chrono::steady_clock::now();
    const std::lock_guard lock(mutex_);
    if (now >= next) {
      const auto ticks = static_cast<std::uint64_t>((now - next) / period) + 1;
      tick(ticks, now);
      next += static_cast<std::int64_t>(ticks) * period;
    }
    if (ready != 0) serve_host(connected);
  }
}

void UsbipDevice::serve_host(bool& connected) {
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

/// Serves the first message in the bytes. Returns its length, or 0 where it is not complete yet.
std::size_t UsbipDevice::serve(std::span<const std::uint8_t> bytes) {
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

void UsbipDevice::submitted(std::uint32_t number, std::uint32_t direction, std::uint32_t endpoint,
                            std::uint32_t length, std::span<const std::uint8_t> setup,
                            std::span<const std::uint8_t> data) {
  if (endpoint == 0) return control(number, setup, data);
  if (direction == 1) {
    in_.push_back({number, length, {}});
    return flush();
  }
  if (trouble_ == Trouble::deaf) {
    held_out_.push_back({number, length, {data.begin(), data.end()}});
    return;
  }
  reply(number, 0, length, {});
  take_command(data);
}

void UsbipDevice::unlinked(std::uint32_t number, std::uint32_t unlink) {
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

void UsbipDevice::control(std::uint32_t number, std::span<const std::uint8_t> setup,
                          std::span<const std::uint8_t> data) {
  const bool in = (setup[0] & 0x80U) != 0;
  std::optional<Bytes> answer = answer_control(setup, data);
  if (!answer) return reply(number, -EPIPE, 0, {});
  const std::size_t wanted = setup[6] + 256U * setup[7];
  if (in && answer->size() > wanted) answer->resize(wanted);
  reply(number, 0, static_cast<std::uint32_t>(in ? answer->size() : data.size()), *answer);
}

/// USB 2.0, section 9.4, and HID 1.11, section 7: what a host asks of a device like this. Nothing where the
/// answer is a stall.
std::optional<UsbipDevice::Bytes> UsbipDevice::answer_control(std::span<const std::uint8_t> setup,
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
    halted_ = trouble_ == Trouble::stalled;
    ++record_.halts_cleared;
    return Bytes{};
  }
  if (type == 0x21 && request == set_report) take_command(data);
  if ((type & 0x80U) == 0) return Bytes{};
  return std::nullopt;
}

std::optional<UsbipDevice::Bytes> UsbipDevice::descriptor(unsigned type, unsigned index) const {
  const auto text = [](const std::string& s) {
    Bytes bytes{static_cast<std::uint8_t>(2 + 2 * s.size()), 3};
    for (const char c : s) bytes.insert(bytes.end(), {static_cast<std::uint8_t>(c), 0});
    return bytes;
  };
  const unsigned v = identity_.vendor, p = identity_.product;
  switch (type) {
    case 1:
      return Bytes{18, 1, 0x00, 0x02, 0, 0, 0, 64, low(v), high(v), low(p), high(p), 0x00, 0x01, 1, 2, 3, 1};
    case 2:
      return Bytes{9,  2,    41,   0,  1,  1, 0,    0x80,
                   50,  // configuration
                   9,  4,    0,    0,  2,  3, 0,    0,
                   0,  // HID interface
                   9,  0x21, 0x11, 1,  0,  1, 0x22, kReportDescriptor.size(),
                   0,  // HID
                   7,  5,    0x81, 3,  64, 0, 1,    7,
                   5,  0x01, 3,    32, 0,  1};  // interrupt IN, OUT
    case 3:
      if (index == 0) return Bytes{4, 3, 0x09, 0x04};
      if (index > 3) return std::nullopt;
      return text(index == 1 ? "wrenchd" : index == 2 ? "reference device" : identity_.serial);
    case 6:
      return Bytes{10, 6, 0x00, 0x02, 0, 0, 0, 64, 1, 0};
    case 0x22:
      return Bytes(kReportDescriptor.begin(), kReportDescriptor.end());
    default:
      return std::nullopt;
  }
}

// --- the firmware -----------------------------------------------------------------------------------------

void UsbipDevice::tick(std::uint64_t ticks, TimePoint now) {
  record_.late_ticks += ticks - 1;
  firmware_.miss_reports(static_cast<std::uint32_t>(ticks - 1));
  firmware_.motors(now);  // the watchdog
  PoseReport report = firmware_.report(now - powered_);
  report.X_BH = {};
  report.X_BH.translation_m.x() = position_m(report.sequence);
  ++record_.made;

  if (trouble_ != Trouble::frozen || newest_.bytes.empty()) {
    newest_.sequence = static_cast<std::uint32_t>(report.sequence);
    newest_.bytes.resize(profile_.pose_report.length);
    encode(profile_.pose_report, report, newest_.bytes);
  }
  outbox_.clear();  // newest only
  if (trouble_ == Trouble::silent) return;
  if (in_.empty()) ++record_.unprepared;
  outbox_.push_back(newest_);
  if (trouble_ == Trouble::duplicates) outbox_.push_back(newest_);
  if (trouble_ == Trouble::short_reports) outbox_.back().bytes.resize(newest_.bytes.size() / 2);
  if (trouble_ == Trouble::garbled) outbox_.back().bytes[20] ^= 0x10U;
  flush();
}

/// Answers transfers with reports, as long as there are both. A halted endpoint answers with a stall.
void UsbipDevice::flush() {
  while (halted_ && !in_.empty()) {
    reply(in_.front().number, -EPIPE, 0, {});
    in_.pop_front();
  }
  while (!in_.empty() && !outbox_.empty()) {
    const Outgoing& out = outbox_.front();
    sent_at_[out.sequence % sent_at_.size()] = std::chrono::steady_clock::now();
    const auto length = std::min<std::size_t>(out.bytes.size(), in_.front().length);
    reply(in_.front().number, 0, static_cast<std::uint32_t>(length), std::span(out.bytes).first(length));
    ++record_.sent;
    in_.pop_front();
    outbox_.pop_front();
  }
}

void UsbipDevice::take_command(std::span<const std::uint8_t> data) {
  const TimePoint now = std::chrono::steady_clock::now();
  ++record_.out_reports;
  const auto [outcome, report] = decode(profile_.wrench_report, data);
  if (outcome == Decoding::ok) record_.last = report;
  if (!firmware_.take_command(now, data)) {
    ++record_.refused;
    return;
  }
  ++record_.commands;
  if (!report.enable) return;
  const auto answered = static_cast<std::size_t>(std::llround(report.F.force_N.x() / kAnswerStep_N));
  const Duration passed = now - sent_at_[answered % sent_at_.size()];
  ++record_.answers;
  if (turn_arounds_.size() < turn_arounds_.capacity()) turn_arounds_.push_back(passed);
}

void UsbipDevice::take_held_commands() {
  for (; !held_out_.empty(); held_out_.pop_front()) {
    reply(held_out_.front().number, 0, held_out_.front().length, {});
    take_command(held_out_.front().data);
  }
}

// --- the wire ---------------------------------------------------------------------------------------------

void UsbipDevice::reply(std::uint32_t number, std::int32_t status, std::uint32_t length,
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

void UsbipDevice::send(std::span<const std::uint8_t> bytes) const {
  ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);  // one that is cut off is seen by recv()
}

}  // namespace wrenchd::test
