// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/links/usb_link.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <boost/lockfree/spsc_queue.hpp>
#include <libusb-1.0/libusb.h>
#include <poll.h>

#include "devices/links/ftdi_serial.hpp"
#include "devices/links/latest_writer.hpp"
#include "devices/links/packet_queue.hpp"
#include "devices/links/wake_up.hpp"
#include "devices/report_descriptor.hpp"

namespace wrenchd {
namespace {

/// IN transfers in flight. At 8 kHz the link's thread may be 1 ms late before a frame is missed.
constexpr std::size_t kTransfersInFlight = 8;
/// Capacity of the ring between the link's thread and the servo thread, as in hidraw.
constexpr std::size_t kRing = 64;
/// Time between an endpoint error and the next attempt, so that a permanently failing device does not occupy
/// a processor.
constexpr Duration kRetryAfter = std::chrono::milliseconds(5);

std::runtime_error open_failure(const UsbDevice& device, const std::string& doing, int error) {
  if (error == LIBUSB_ERROR_ACCESS || error == LIBUSB_ERROR_NO_DEVICE || error == LIBUSB_ERROR_BUSY) {
    const int number = error == LIBUSB_ERROR_ACCESS ? EACCES : error == LIBUSB_ERROR_BUSY ? EBUSY : ENODEV;
    return std::runtime_error(open_error(device, device.usb_node, number));
  }
  return std::runtime_error(describe(device) + ": " + doing + ": " + libusb_strerror(error) +
                            "; unplug the device and connect it again");
}

std::runtime_error other_device(const UsbDevice& found, const UsbDevice& expected) {
  const bool only_descriptor = describe(found) == describe(expected);
  return std::runtime_error("in " + expected.port_path + " is " + describe(found) +
                            (only_descriptor ? " with another report descriptor" : "") + ", not " +
                            describe(expected) + ": nothing was written to it; search for the device again");
}

/// Returns bus and ports in the format of the kernel: "3-1.2".
std::string port_path_of(libusb_device* device) {
  std::array<std::uint8_t, 8> ports{};
  const int n = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
  std::string port_path = std::to_string(libusb_get_bus_number(device));
  for (int i = 0; i < n; ++i)
    port_path += (i == 0 ? "-" : ".") + std::to_string(ports[static_cast<std::size_t>(i)]);
  return port_path;
}

/// After unplugging, the kernel sets POLLHUP at once, but returns an error only after its own cleanup. This
/// cleanup needs a normal thread, which a real-time thread that polls without pause keeps from running.
bool has_hung_up(const pollfd& file) noexcept {
  return (file.revents & (POLLHUP | POLLERR)) != 0;
}

struct Endpoint {
  std::uint8_t address = 0;
  std::uint8_t type = LIBUSB_TRANSFER_TYPE_INTERRUPT;
  std::size_t packet_bytes = 0;
};

/// Returns the first interrupt endpoint of this direction, else the first bulk endpoint. `address`: only this
/// endpoint; 0: any.
std::optional<Endpoint> find_endpoint(const libusb_interface_descriptor& setting, std::uint8_t direction,
                                      std::uint8_t address) {
  for (const std::uint8_t type : {LIBUSB_TRANSFER_TYPE_INTERRUPT, LIBUSB_TRANSFER_TYPE_BULK})
    for (int i = 0; i < setting.bNumEndpoints; ++i) {
      const libusb_endpoint_descriptor& e = setting.endpoint[i];
      if ((e.bmAttributes & LIBUSB_TRANSFER_TYPE_MASK) == type &&
          (e.bEndpointAddress & LIBUSB_ENDPOINT_DIR_MASK) == direction &&
          (address == 0 || e.bEndpointAddress == address))
        return Endpoint{e.bEndpointAddress, type, static_cast<std::size_t>(e.wMaxPacketSize & 0x7FFU)};
    }
  return std::nullopt;
}

}  // namespace

/// State of all libusb calls. A normal thread constructs and destroys it; the link's own thread runs it.
struct UsbLink::TransferThread {
  TransferThread(const UsbDevice& device, const LinkSettings& settings);
  ~TransferThread();
  TransferThread(const TransferThread&) = delete;
  TransferThread& operator=(const TransferThread&) = delete;

  /// One IN transfer and its buffer.
  struct In {
    TransferThread* engine = nullptr;
    libusb_transfer* transfer = nullptr;
    std::vector<std::uint8_t> bytes;
    bool in_flight = false;
  };

  void find_and_open(const UsbDevice& device);
  void check_identity(const UsbDevice& device) const;
  void find_endpoints(const UsbDevice& device, const LinkSettings& settings);
  void claim(const UsbDevice& device);
  void check_report_descriptor(const UsbDevice& device) const;
  void start_serial(const UsbDevice& device, const LinkSettings& settings);
  void prepare_in(const LinkSettings& settings);
  void prepare_out();
  void release() noexcept;

  void run() noexcept;
  void collect_fds();
  void sleep() noexcept;
  bool in_flight() const noexcept;
  void submit(In& in) noexcept;
  void receive_packet(const libusb_transfer& transfer) noexcept;
  void receive_report(std::span<const std::uint8_t> bytes) noexcept;
  void retry_failed() noexcept;
  void write_newest() noexcept;
  void write_request() noexcept;
  void cancel_overdue() noexcept;
  bool finish() noexcept;
  void mark_disconnected() noexcept;

  static void LIBUSB_CALL on_in(libusb_transfer* transfer);
  static void LIBUSB_CALL on_out(libusb_transfer* transfer);

  libusb_context* context = nullptr;
  libusb_device_handle* handle = nullptr;
  int interface = 0;
  bool numbered_reports;
  bool is_hid = false;
  bool claimed = false;
  bool priority_granted = true;
  Endpoint in_endpoint;
  std::optional<Endpoint> out_endpoint;

  // Shared by both threads.
  boost::lockfree::spsc_queue<Packet, boost::lockfree::capacity<kRing>> ring;
  WriteSlot slot;
  WakeUp readable;  ///< a report waits, or the device is disconnected
  WakeUp writable;  ///< a command waits, or the link is closing
  std::atomic<bool> disconnected{false};
  std::atomic<bool> closing{false};
  std::atomic<std::uint64_t> dropped{0}, stalls{0}, errors{0};

  // Used by the link's thread only.
  std::array<In, kTransfersInFlight> in_transfers;
  std::size_t prefix_bytes;
  bool is_byte_stream;  ///< the packets form a byte stream that the framer separates into reports
  StreamFramer framer;
  HostWatchdog host_watchdog;
  libusb_transfer* out = nullptr;
  Packet out_packet;
  std::array<std::uint8_t, LIBUSB_CONTROL_SETUP_SIZE + kMaxReportBytes> out_request{};
  bool out_in_flight = false, out_cancelled = false;
  TimePoint out_deadline{};  ///< time at which a pending OUT transfer is cancelled
  bool in_halted = false, out_halted = false;
  bool in_failed = false;
  TimePoint next_retry{};  ///< earliest time of the next attempt
  Duration write_deadline;
  Duration close_within;
  std::optional<TimePoint> close_deadline;
  bool cancelling = false;  ///< all transfers are cancelled and no new one is submitted
  std::vector<pollfd> poll_fds;

  std::thread thread;
};

// --- opening ----------------------------------------------------------------------------------------------

UsbLink::TransferThread::TransferThread(const UsbDevice& device, const LinkSettings& settings)
    : interface(std::max(device.interface, 0)),
      numbered_reports(device.numbered_reports),
      slot(settings.write_deadline),
      prefix_bytes(settings.prefix_bytes),
      is_byte_stream(settings.frame.length > 0),
      framer(settings.frame),
      host_watchdog(settings.host_watchdog),
      write_deadline(settings.write_deadline),
      close_within(settings.close_timeout) {
  try {
    if (const int error = libusb_init(&context); error != 0) throw open_failure(device, "libusb", error);
    find_and_open(device);
    check_identity(device);
    find_endpoints(device, settings);
    claim(device);
    check_report_descriptor(device);
    start_serial(device, settings);
    prepare_in(settings);
    prepare_out();
    collect_fds();
    thread = std::thread([this] { run(); });
    priority_granted = raise_priority(thread, settings.priority);
  } catch (...) {
    release();
    throw;
  }
}

void UsbLink::TransferThread::find_and_open(const UsbDevice& device) {
  libusb_device** list = nullptr;
  const ssize_t n = libusb_get_device_list(context, &list);
  if (n < 0) throw open_failure(device, "list of devices", static_cast<int>(n));
  int error = LIBUSB_ERROR_NO_DEVICE;
  for (ssize_t i = 0; i < n; ++i)
    if (port_path_of(list[i]) == device.port_path) error = libusb_open(list[i], &handle);
  libusb_free_device_list(list, 1);
  if (error != 0) throw open_failure(device, "open", error);
}

void UsbLink::TransferThread::check_identity(const UsbDevice& device) const {
  libusb_device_descriptor descriptor{};
  libusb_get_device_descriptor(libusb_get_device(handle), &descriptor);
  UsbDevice found = device;
  found.vendor = descriptor.idVendor;
  found.product = descriptor.idProduct;
  if (found.is_same_device(device) && !device.serial.empty()) {
    std::array<unsigned char, 256> text{};
    const int n = libusb_get_string_descriptor_ascii(handle, descriptor.iSerialNumber, text.data(),
                                                     static_cast<int>(text.size()));
    found.serial = without_control_characters({text.begin(), text.begin() + std::max(n, 0)});
  }
  if (!found.is_same_device(device)) throw other_device(found, device);
}

/// The kernel answers requests to an interface only when it is claimed.
void UsbLink::TransferThread::check_report_descriptor(const UsbDevice& device) const {
  constexpr std::uint8_t kFromInterface = 0x81, kGetDescriptor = 6;
  constexpr std::uint16_t kReportDescriptor = 0x2200;
  constexpr unsigned kTimeout_ms = 1000;
  if (!is_hid || device.report_descriptor.empty()) return;
  UsbDevice found = device;
  found.report_descriptor.resize(kMaxDescriptorBytes);
  const int n =
      libusb_control_transfer(handle, kFromInterface, kGetDescriptor, kReportDescriptor,
                              static_cast<std::uint16_t>(interface), found.report_descriptor.data(),
                              static_cast<std::uint16_t>(found.report_descriptor.size()), kTimeout_ms);
  if (n < 0) throw open_failure(device, "report descriptor", n);
  found.report_descriptor.resize(static_cast<std::size_t>(n));
  if (!found.is_same_device(device)) throw other_device(found, device);
}

void UsbLink::TransferThread::find_endpoints(const UsbDevice& device, const LinkSettings& settings) {
  libusb_config_descriptor* configuration = nullptr;
  if (const int error = libusb_get_active_config_descriptor(libusb_get_device(handle), &configuration);
      error != 0)
    throw open_failure(device, "configuration", error);
  std::optional<Endpoint> in;
  for (int i = 0; i < configuration->bNumInterfaces; ++i) {
    const libusb_interface& candidate = configuration->interface[i];
    if (candidate.num_altsetting < 1 || candidate.altsetting[0].bInterfaceNumber != interface) continue;
    is_hid = candidate.altsetting[0].bInterfaceClass == LIBUSB_CLASS_HID;
    in = find_endpoint(candidate.altsetting[0], LIBUSB_ENDPOINT_IN, settings.in_endpoint);
    out_endpoint = find_endpoint(candidate.altsetting[0], LIBUSB_ENDPOINT_OUT, settings.out_endpoint);
  }
  libusb_free_config_descriptor(configuration);
  if (!in || in->packet_bytes == 0)
    throw std::runtime_error(
        describe(device) + " has no interrupt or bulk IN endpoint to read from; is it the right interface?");
  in_endpoint = *in;
}

void UsbLink::TransferThread::claim(const UsbDevice& device) {
  libusb_set_auto_detach_kernel_driver(handle, 1);
  if (const int error = libusb_claim_interface(handle, interface); error != 0)
    throw open_failure(device, "claim of the interface", error);
  claimed = true;
}

void UsbLink::TransferThread::start_serial(const UsbDevice& device, const LinkSettings& settings) {
  if (!settings.start_serial) return;
  if (!out_endpoint)
    throw std::runtime_error(describe(device) + " has no OUT endpoint, so it is no serial chip");
  FtdiSerial chip(handle, in_endpoint.address, out_endpoint->address, in_endpoint.packet_bytes);
  settings.start_serial(chip);
}

/// A transfer has the length of the longest report, rounded up to whole packets. A shorter packet ends the
/// transfer; a longer report would merge with the next one.
void UsbLink::TransferThread::prepare_in(const LinkSettings& settings) {
  const std::size_t packet = in_endpoint.packet_bytes;
  const std::size_t longest = std::max(settings.max_report_bytes, packet);
  const std::size_t bytes = (longest + packet - 1) / packet * packet;
  for (In& in : in_transfers) {
    in.engine = this;
    in.bytes.resize(bytes);
    in.transfer = libusb_alloc_transfer(0);
    if (in.transfer == nullptr) throw std::bad_alloc();
    libusb_fill_interrupt_transfer(in.transfer, handle, in_endpoint.address, in.bytes.data(),
                                   static_cast<int>(bytes), on_in, &in, 0);
    in.transfer->type = in_endpoint.type;
  }
}

/// A HID device without an OUT endpoint receives its reports as SET_REPORT requests (HID 1.11 section 7.2.2).
/// They are slower and sufficient for rare commands.
void UsbLink::TransferThread::prepare_out() {
  if (!out_endpoint && !is_hid) return;
  out = libusb_alloc_transfer(0);
  if (out == nullptr) throw std::bad_alloc();
  if (out_endpoint) {
    libusb_fill_interrupt_transfer(out, handle, out_endpoint->address, out_packet.bytes.data(), 0, on_out,
                                   this, 0);
    out->type = out_endpoint->type;
  } else {
    libusb_fill_control_transfer(out, handle, out_request.data(), on_out, this, 0);
  }
}

/// Builds the request with the report in out_packet.
void UsbLink::TransferThread::write_request() noexcept {
  constexpr std::uint8_t kToInterface = 0x21, kSetReport = 9;
  constexpr unsigned kOutput = 2;
  const unsigned id = numbered_reports ? out_packet.bytes[0] : 0;
  libusb_fill_control_setup(
      out_request.data(), kToInterface, kSetReport, static_cast<std::uint16_t>(kOutput << 8U | id),
      static_cast<std::uint16_t>(interface), static_cast<std::uint16_t>(out_packet.length));
  std::copy_n(out_packet.bytes.begin(), out_packet.length, out_request.begin() + LIBUSB_CONTROL_SETUP_SIZE);
}

UsbLink::TransferThread::~TransferThread() {
  closing.store(true, std::memory_order_release);
  writable.wake();
  thread.join();
  release();
}

void UsbLink::TransferThread::release() noexcept {
  for (In& in : in_transfers) libusb_free_transfer(in.transfer);
  libusb_free_transfer(out);
  if (claimed) libusb_release_interface(handle, interface);  // the kernel driver is attached again
  if (handle != nullptr) libusb_close(handle);
  if (context != nullptr) libusb_exit(context);
}

// --- the link's thread ------------------------------------------------------------------------------------

void UsbLink::TransferThread::run() noexcept {
  for (In& in : in_transfers) submit(in);
  while (!finish()) {
    sleep();
    retry_failed();
    cancel_overdue();
    write_newest();
  }
}

/// Collects the file descriptors for ppoll: first the wake-up of the servo thread, then those of libusb. They
/// do not change while the device is open.
void UsbLink::TransferThread::collect_fds() {
  poll_fds.push_back({writable.fd(), POLLIN, 0});
  const libusb_pollfd** const of_libusb = libusb_get_pollfds(context);
  for (const libusb_pollfd** file = of_libusb; file != nullptr && *file != nullptr; ++file)
    poll_fds.push_back({(*file)->fd, (*file)->events, 0});
  libusb_free_pollfds(of_libusb);
}

/// Sleeps until libusb has an event, a command waits, or a deadline passes.
void UsbLink::TransferThread::sleep() noexcept {
  constexpr Duration kMaxSleep = std::chrono::milliseconds(100);  // upper bound of the sleep, as a fallback
  constexpr Duration kPollInterval = std::chrono::milliseconds(2);
  const TimePoint now = std::chrono::steady_clock::now();
  Duration wait = kMaxSleep;
  if (in_failed || in_halted || out_halted) wait = std::min<Duration>(wait, next_retry - now);
  if (out_in_flight && !out_cancelled) wait = std::min<Duration>(wait, out_deadline - now);
  if (close_deadline) wait = std::min<Duration>(wait, *close_deadline - now);
  if (host_watchdog.due() != TimePoint::max()) wait = std::min<Duration>(wait, host_watchdog.due() - now);
  wait = std::max(wait, Duration::zero());
  timespec timeout{};
  timeout.tv_nsec = wait.count();
  // After disconnection libusb's descriptors are always ready, so they are polled only at intervals.
  const bool is_disconnected = disconnected.load(std::memory_order_relaxed);
  if (is_disconnected) timeout.tv_nsec = std::min<long>(timeout.tv_nsec, Duration(kPollInterval).count());
  const int ready = ppoll(poll_fds.data(), is_disconnected ? 1 : poll_fds.size(), &timeout, nullptr);
  const bool written = ready > 0 && poll_fds[0].revents != 0;
  if (written) writable.wait();
  if (ready > 0 && !is_disconnected && std::any_of(poll_fds.begin() + 1, poll_fds.end(), has_hung_up))
    mark_disconnected();
  if (ready == (written ? 1 : 0) && ready > 0) return;
  timeval no_wait{0, 0};
  libusb_handle_events_timeout_completed(context, &no_wait, nullptr);
}

bool UsbLink::TransferThread::in_flight() const noexcept {
  return out_in_flight ||
         std::any_of(in_transfers.begin(), in_transfers.end(), [](const In& in) { return in.in_flight; });
}

void UsbLink::TransferThread::submit(In& in) noexcept {
  if (cancelling || disconnected.load(std::memory_order_relaxed)) return;
  const int error = libusb_submit_transfer(in.transfer);
  in.in_flight = error == 0;
  if (error == LIBUSB_ERROR_NO_DEVICE) mark_disconnected();
  if (error != 0) in_failed = true;
}

void UsbLink::TransferThread::on_in(libusb_transfer* transfer) {
  In& in = *static_cast<In*>(transfer->user_data);
  TransferThread& engine = *in.engine;
  in.in_flight = false;
  switch (transfer->status) {
    case LIBUSB_TRANSFER_COMPLETED:
      engine.receive_packet(*transfer);
      engine.submit(in);
      return;
    case LIBUSB_TRANSFER_CANCELLED:
      return;
    case LIBUSB_TRANSFER_NO_DEVICE:
      engine.mark_disconnected();
      return;
    case LIBUSB_TRANSFER_STALL:
      engine.in_halted = true;
      break;
    default:
      engine.errors.fetch_add(1, std::memory_order_relaxed);
  }
  engine.in_failed = true;
}

void UsbLink::TransferThread::receive_packet(const libusb_transfer& transfer) noexcept {
  if (transfer.actual_length <= static_cast<int>(prefix_bytes)) return;
  const auto bytes =
      std::span<const std::uint8_t>(transfer.buffer, static_cast<std::size_t>(transfer.actual_length))
          .subspan(prefix_bytes);
  if (is_byte_stream)
    framer.feed(bytes, [this](auto report) { receive_report(report); });
  else
    receive_report(bytes);
}

void UsbLink::TransferThread::receive_report(std::span<const std::uint8_t> bytes) noexcept {
  Packet packet;
  packet.length = bytes.size();
  std::copy_n(bytes.begin(), std::min(packet.length, packet.bytes.size()), packet.bytes.begin());
  packet.arrives = std::chrono::steady_clock::now();
  if (!ring.push(packet)) dropped.fetch_add(1, std::memory_order_relaxed);
  readable.wake();
}

/// Clears halted endpoints and submits failed transfers again: the first time at once, then at most every
/// kRetryAfter.
void UsbLink::TransferThread::retry_failed() noexcept {
  const TimePoint now = std::chrono::steady_clock::now();
  if (cancelling || !(in_failed || out_halted) || now < next_retry) return;
  next_retry = now + kRetryAfter;
  for (bool* const halted : {&in_halted, &out_halted}) {
    if (!*halted) continue;
    *halted = false;
    stalls.fetch_add(1, std::memory_order_relaxed);
    const std::uint8_t address = halted == &in_halted ? in_endpoint.address : out_endpoint->address;
    if (libusb_clear_halt(handle, address) == LIBUSB_ERROR_NO_DEVICE) mark_disconnected();
  }
  in_failed = false;
  for (In& in : in_transfers)
    if (!in.in_flight) submit(in);
}

void UsbLink::TransferThread::write_newest() noexcept {
  if (out == nullptr || out_in_flight || out_halted || cancelling ||
      disconnected.load(std::memory_order_relaxed))
    return;
  const bool has_report = slot.take(out_packet);
  const TimePoint now = std::chrono::steady_clock::now();
  if (has_report) host_watchdog.feed(now, out_packet);
  if (!has_report && !host_watchdog.send_zero(now, out_packet)) return;
  out->length = static_cast<int>(out_packet.length);
  if (!out_endpoint) {
    write_request();
    out->length += LIBUSB_CONTROL_SETUP_SIZE;
  }
  const int error = libusb_submit_transfer(out);
  out_in_flight = error == 0;
  out_cancelled = false;
  out_deadline = now + write_deadline;
  if (error == LIBUSB_ERROR_NO_DEVICE) mark_disconnected();
  if (error != 0)
    slot.complete(error == LIBUSB_ERROR_NO_DEVICE ? LinkStatus::disconnected : LinkStatus::not_ready);
}

/// Cancels an OUT transfer that the device does not accept; the newest command replaces it. The timeouts of
/// libusb would do the same at the cost of two more system calls per command.
void UsbLink::TransferThread::cancel_overdue() noexcept {
  if (!out_in_flight || out_cancelled || std::chrono::steady_clock::now() < out_deadline) return;
  libusb_cancel_transfer(out);
  out_cancelled = true;
}

void UsbLink::TransferThread::on_out(libusb_transfer* transfer) {
  TransferThread& engine = *static_cast<TransferThread*>(transfer->user_data);
  engine.out_in_flight = false;
  const bool completed = transfer->status == LIBUSB_TRANSFER_COMPLETED &&
                         transfer->actual_length == static_cast<int>(engine.out_packet.length);
  if (transfer->status == LIBUSB_TRANSFER_NO_DEVICE) engine.mark_disconnected();
  if (transfer->status == LIBUSB_TRANSFER_STALL)
    engine.out_halted = engine.out_endpoint.has_value();  // a rejected request does not halt the endpoint
  engine.slot.complete(completed                                       ? LinkStatus::ok
                       : transfer->status == LIBUSB_TRANSFER_NO_DEVICE ? LinkStatus::disconnected
                                                                       : LinkStatus::not_ready);
}

/// Closes in two steps: writes the waiting command within close_timeout, then cancels all transfers. Returns
/// true when no transfer is left.
bool UsbLink::TransferThread::finish() noexcept {
  if (!closing.load(std::memory_order_acquire)) return false;
  const TimePoint now = std::chrono::steady_clock::now();
  if (!cancelling) {
    if (!close_deadline) close_deadline = now + close_within;
    write_newest();
    if (out_in_flight && now < *close_deadline) return false;
    cancelling = true;
    if (out_in_flight) libusb_cancel_transfer(out);
    for (In& in : in_transfers)
      if (in.in_flight) libusb_cancel_transfer(in.transfer);
    close_deadline.reset();
  }
  return !in_flight();
}

void UsbLink::TransferThread::mark_disconnected() noexcept {
  disconnected.store(true, std::memory_order_release);
  readable.wake();
}

// --- the servo thread -------------------------------------------------------------------------------------

UsbLink::UsbLink(UsbDevice device, LinkSettings settings)
    : device_(std::move(device)), settings_(std::move(settings)), declared_(device_.report_descriptor) {}

UsbLink::~UsbLink() {
  close();
}

void UsbLink::open() {
  close();
  if (device_.port_path.empty()) throw std::runtime_error(describe(device_) + " is not on USB; use hidraw");
  transfers_ = std::make_unique<TransferThread>(device_, settings_);
}

LinkRead UsbLink::read(TimePoint now, std::span<std::uint8_t> buffer) noexcept {
  if (!transfers_ || transfers_->disconnected.load(std::memory_order_acquire))
    return {LinkStatus::disconnected, 0, now};
  Packet packet;
  if (!transfers_->ring.pop(packet)) return {LinkStatus::not_ready, 0, now};
  std::copy_n(packet.bytes.begin(), std::min({packet.length, packet.bytes.size(), buffer.size()}),
              buffer.begin());
  return {LinkStatus::ok, packet.length, packet.arrives};
}

LinkStatus UsbLink::write(TimePoint now, std::span<const std::uint8_t> report) noexcept {
  if (!transfers_ || transfers_->disconnected.load(std::memory_order_relaxed))
    return LinkStatus::disconnected;
  if (transfers_->out == nullptr) return LinkStatus::not_ready;
  const LinkStatus status = transfers_->slot.submit(now, report);
  if (status != LinkStatus::disconnected) transfers_->writable.wake();
  return status;
}

void UsbLink::wait_readable(TimePoint deadline) noexcept {
  while (transfers_ && !transfers_->disconnected.load(std::memory_order_acquire) &&
         transfers_->ring.read_available() == 0) {
    if (wait_for_fd(transfers_->readable.fd(), POLLIN, deadline) == 0) return;
    transfers_->readable.wait();  // consumed before the ring is checked again, so that no wake-up is lost
  }
}

void UsbLink::close() noexcept {
  transfers_.reset();
}

UsbLinkCounts UsbLink::counts() const noexcept {
  if (!transfers_) return {};
  return {transfers_->dropped.load(std::memory_order_relaxed),
          transfers_->stalls.load(std::memory_order_relaxed),
          transfers_->errors.load(std::memory_order_relaxed)};
}

bool UsbLink::priority_granted() const noexcept {
  return !transfers_ || transfers_->priority_granted;
}

const WriteSlot* UsbLink::slot() const noexcept {
  return transfers_ ? &transfers_->slot : nullptr;
}

}  // namespace wrenchd
