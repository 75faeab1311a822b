// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/devices/usb/mock_device.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <condition_variable>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <utility>

#include <fcntl.h>
#include <linux/hidraw.h>
#include <linux/usbdevice_fs.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <termios.h>
#include <umockdev.h>
#include <unistd.h>

#include "tests/support/sample_descriptors.hpp"

namespace wrenchd::test {
namespace {

namespace fs = std::filesystem;

using Answer = std::pair<int, int>;  ///< result of the ioctl, and errno if it is -1

/// GLib class that answers all ioctls.
class IoctlHandler {
 public:
  virtual ~IoctlHandler() = default;
  virtual Answer ioctl(unsigned long request, UMockdevIoctlData* argument) = 0;
};

struct Ioctl {
  UMockdevIoctlBase parent;
  IoctlHandler* handler;
};
struct IoctlClass {
  UMockdevIoctlBaseClass parent;
};

gboolean on_ioctl(UMockdevIoctlBase* base, UMockdevIoctlClient* client) {
  IoctlHandler* const handler = reinterpret_cast<Ioctl*>(base)->handler;
  const auto [result, error] =
      handler->ioctl(umockdev_ioctl_client_get_request(client), umockdev_ioctl_client_get_arg(client));
  umockdev_ioctl_client_complete(client, result, error);
  return TRUE;
}

void init_class(void* type, void*) {
  reinterpret_cast<UMockdevIoctlBaseClass*>(type)->handle_ioctl = on_ioctl;
}

GType ioctl_type() {
  static const GType type = [] {
    GTypeInfo info{};
    info.class_size = sizeof(IoctlClass);
    info.class_init = init_class;
    info.instance_size = sizeof(Ioctl);
    return g_type_register_static(umockdev_ioctl_base_get_type(), "WrenchdIoctl", &info, GTypeFlags{});
  }();
  return type;
}

void attach(UMockdevTestbed* testbed, const std::string& node, IoctlHandler* handler) {
  auto* const ioctl = static_cast<Ioctl*>(g_object_new(ioctl_type(), nullptr));
  ioctl->handler = handler;
  GError* error = nullptr;
  if (umockdev_testbed_attach_ioctl(testbed, node.c_str(), &ioctl->parent, &error) == FALSE)
    throw std::runtime_error("umockdev: " + std::string(error->message));
}

/// Returns `length` bytes of an ioctl's argument; valid until the ioctl ends.
std::uint8_t* bytes_at(UMockdevIoctlData* argument, std::size_t offset, std::size_t length) {
  UMockdevIoctlData* const data = umockdev_ioctl_data_resolve(argument, offset, length, nullptr);
  if (data == nullptr) throw std::runtime_error("umockdev: an ioctl without its argument");
  return data->data;
}

std::string node_in(UMockdevTestbed* testbed, const std::string& node) {
  gchar* const root = umockdev_testbed_get_root_dir(testbed);
  std::string path = root + node;
  g_free(root);
  fs::create_directories(fs::path(path).parent_path());
  fs::remove(path);
  return path;
}

std::string add(UMockdevTestbed* testbed, const char* subsystem, const std::string& name,
                const std::string& parent, const std::vector<std::string>& attributes,
                const std::vector<std::string>& properties) {
  const auto list = [](const std::vector<std::string>& strings) {
    std::vector<gchar*> pointers;
    for (const std::string& s : strings) pointers.push_back(const_cast<gchar*>(s.c_str()));
    pointers.push_back(nullptr);
    return pointers;
  };
  std::vector<gchar*> a = list(attributes), p = list(properties);
  gchar* const path = umockdev_testbed_add_devicev(
      testbed, subsystem, name.c_str(), parent.empty() ? nullptr : parent.c_str(), a.data(), p.data());
  if (path == nullptr) throw std::runtime_error("umockdev does not take the device " + name);
  std::string result = path;
  g_free(path);
  return result;
}

/// Removes a device and its children. umockdev leaves the links of the children, which are errors when the
/// children are added again.
void remove(UMockdevTestbed* testbed, const std::string& path, std::vector<std::string> of) {
  umockdev_testbed_remove_device(testbed, path.c_str());
  gchar* const root = umockdev_testbed_get_root_dir(testbed);
  const fs::path sys = fs::path(root) / "sys", nodes = fs::path(root) / "dev" / ".node";
  g_free(root);
  std::error_code absent;
  for (std::string& node : of) std::replace(node.begin(), node.end(), '/', '_');
  for (const auto& entry : fs::directory_iterator(nodes, absent))
    if (std::any_of(of.begin(), of.end(), [&](const std::string& node) {
          return node.ends_with(entry.path().filename().string());
        }))
      fs::remove(entry.path());
  for (const char* const kind : {"bus", "class", "dev"}) {
    std::error_code none;
    std::vector<fs::path> dead;
    for (const auto& entry : fs::recursive_directory_iterator(sys / kind, none))
      if (entry.is_symlink() && !fs::exists(entry.path(), none)) dead.push_back(entry.path());
    for (const fs::path& link : dead) fs::remove(link);
  }
}

std::string three(int n) {
  std::array<char, 16> digits{};
  std::snprintf(digits.data(), digits.size(), "%03d", n);
  return digits.data();
}

std::string usb_node_of(const MockIdentity& identity) {
  return "/dev/bus/usb/" + identity.place.substr(0, identity.place.find('-')).insert(0, "00") + "/" +
         three(identity.number + 2);
}

std::string add_usb(UMockdevTestbed* testbed, const MockIdentity& id) {
  return add(testbed, "usb", id.place, "",
             {"idVendor",
              id.vendor,
              "idProduct",
              id.product,
              "manufacturer",
              "wrenchd",
              "product",
              "mock device",
              "serial",
              id.serial,
              "speed",
              "480",
              "bcdDevice",
              "0100",
              "busnum",
              id.place.substr(0, id.place.find('-')),
              "devnum",
              std::to_string(id.number + 2),
              "bConfigurationValue",
              "1",
              "bNumConfigurations",
              "1"},
             {"DEVTYPE", "usb_device", "PRODUCT", id.vendor + "/" + id.product + "/100", "BUSNUM",
              three(std::atoi(id.place.c_str())), "DEVNUM", three(id.number + 2), "DEVNAME", usb_node_of(id),
              "MAJOR", "189", "MINOR", std::to_string(id.number + 1)});
}

std::string add_interface(UMockdevTestbed* testbed, const MockIdentity& id, const std::string& usb) {
  return add(testbed, "usb", id.place + ":1.0", usb,
             {"bInterfaceNumber", "00", "bInterfaceClass", id.hid ? "03" : "ff"},
             {"DEVTYPE", "usb_interface"});
}

}  // namespace

// --- machine ----------------------------------------------------------------------------------------------

MockMachine::MockMachine() : testbed_(umockdev_testbed_new()) {
  if (umockdev_in_mock_environment() == TRUE) return;
  g_object_unref(testbed_);
  throw std::runtime_error("run this under umockdev-wrapper, as ctest does");
}

MockMachine::~MockMachine() {
  g_object_unref(testbed_);
}

Bytes report_descriptor(bool numbered) {
  if (numbered) return reference_descriptor();
  return {0x06, 0x00, 0xFF, 0x09, 0x01, 0xA1, 0x01, 0x15, 0x00, 0x26, 0xFF, 0x00, 0x75, 0x08,
          0x09, 0x02, 0x95, 0x40, 0x81, 0x02, 0x09, 0x03, 0x95, 0x20, 0x91, 0x02, 0xC0};
}

// --- hidraw -----------------------------------------------------------------------------------------------

/// The hidraw ioctls that hidapi uses.
struct MockHidraw::Ioctls final : IoctlHandler {
  explicit Ioctls(Bytes of) : descriptor(std::move(of)) {}

  Answer ioctl(unsigned long request, UMockdevIoctlData* argument) override {
    if (request == HIDIOCGRDESCSIZE) {
      const int size = static_cast<int>(descriptor.size());
      std::memcpy(bytes_at(argument, 0, sizeof size), &size, sizeof size);
      return {0, 0};
    }
    if (request == HIDIOCGRDESC) {
      std::copy(descriptor.begin(), descriptor.end(),
                bytes_at(argument, 0, sizeof(hidraw_report_descriptor)) + sizeof(__u32));
      return {0, 0};
    }
    return {-1, ENOTTY};
  }

  Bytes descriptor;
};

MockHidraw::MockHidraw(MockMachine& machine, MockIdentity identity)
    : machine_(machine),
      identity_(std::move(identity)),
      ioctls_(std::make_unique<Ioctls>(report_descriptor(identity_.numbered_reports))) {
  UMockdevTestbed* const testbed = machine_.testbed();
  const std::string number = std::to_string(identity_.number);
  // Before the device is listed: a program that opens the node while umockdev's socket is bound but does not
  // listen yet is ended by umockdev's preloaded library.
  attach(testbed, node(), ioctls_.get());
  usb_path_ = add_usb(testbed, identity_);
  const std::string interface = add_interface(testbed, identity_, usb_path_);
  const std::string hid_name = "0003:" + identity_.vendor + ":" + identity_.product + ".000" + number;
  const std::string hid =
      add(testbed, "hid", hid_name, interface, {},
          {"HID_ID", "0003:0000" + identity_.vendor + ":0000" + identity_.product, "HID_NAME", "mock device",
           "HID_PHYS", "usb-" + identity_.place + "/input0", "HID_UNIQ", identity_.serial});
  umockdev_testbed_set_attribute_binary(testbed, hid.c_str(), "report_descriptor", ioctls_->descriptor.data(),
                                        static_cast<int>(ioctls_->descriptor.size()));
  hidraw_path_ = add(testbed, "hidraw", "hidraw" + number, hid, {"dev", "243:" + number},
                     {"DEVNAME", node(), "MAJOR", "243", "MINOR", number});
  umockdev_testbed_set_attribute_link(testbed, hidraw_path_.c_str(), "device", ("../../" + hid_name).c_str());

  master_ = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
  if (master_ < 0 || grantpt(master_) != 0 || unlockpt(master_) != 0)
    throw std::runtime_error("no pseudo terminal");
  const std::string slave = ptsname(master_);
  slave_ = open(slave.c_str(), O_RDWR | O_NOCTTY);
  termios raw{};
  tcgetattr(slave_, &raw);
  cfmakeraw(&raw);
  tcsetattr(slave_, TCSANOW, &raw);
  fs::create_symlink(slave, node_in(testbed, node()));
}

MockHidraw::~MockHidraw() {
  unplug();
}

std::string MockHidraw::node() const {
  return "/dev/hidraw" + std::to_string(identity_.number);
}

void MockHidraw::send(const Bytes& report) {
  if (write(master_, report.data(), report.size()) != static_cast<ssize_t>(report.size()))
    throw std::runtime_error("the pseudo terminal is full");
}

bool MockHidraw::report_waits() const {
  pollfd waiting{slave_, POLLIN, 0};  // poll() also delivers pending bytes to the node
  return poll(&waiting, 1, 0) > 0 && (waiting.revents & POLLIN) != 0;
}

Bytes MockHidraw::receive(std::size_t length) {
  Bytes bytes(length);
  for (std::size_t done = 0; done < length;) {
    pollfd ready{master_, POLLIN, 0};
    poll(&ready, 1, -1);
    const ssize_t n = read(master_, bytes.data() + done, length - done);
    if (n > 0) done += static_cast<std::size_t>(n);
  }
  return bytes;
}

bool MockHidraw::anything_received() const {
  pollfd ready{master_, POLLIN, 0};
  return poll(&ready, 1, 0) > 0 && (ready.revents & POLLIN) != 0;
}

void MockHidraw::unplug() {
  if (master_ < 0) return;
  close(slave_);
  close(master_);
  master_ = -1;
  UMockdevTestbed* const testbed = machine_.testbed();
  umockdev_testbed_uevent(testbed, hidraw_path_.c_str(), "remove");
  umockdev_testbed_uevent(testbed, usb_path_.c_str(), "remove");
  umockdev_testbed_detach_ioctl(testbed, node().c_str(), nullptr);
  remove(testbed, usb_path_, {node(), usb_node_of(identity_)});
}

// --- usbfs ------------------------------------------------------------------------------------------------

/// The usbfs ioctls that libusb uses. A FIFO reports finished transfers to poll(): it is full, and has room
/// only while a finished transfer waits for its reap ioctl.
struct MockUsb::Ioctls final : IoctlHandler {
  struct Urb {
    UMockdevIoctlData* urb = nullptr;
    UMockdevIoctlData* buffer = nullptr;
    gulong address = 0;

    usbdevfs_urb& head() const { return *reinterpret_cast<usbdevfs_urb*>(urb->data); }
  };

  Answer ioctl(unsigned long request, UMockdevIoctlData* argument) override {
    const std::lock_guard lock(mutex);
    if (gone && request != USBDEVFS_REAPURBNDELAY) return {-1, ENODEV};
    switch (request) {
      case USBDEVFS_GET_CAPABILITIES: {
        const std::uint32_t capabilities = USBDEVFS_CAP_BULK_CONTINUATION | USBDEVFS_CAP_NO_PACKET_SIZE_LIM |
                                           USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
        std::memcpy(bytes_at(argument, 0, 4), &capabilities, 4);
        return {0, 0};
      }
      case USBDEVFS_DISCONNECT_CLAIM:
        claimed = true;
        kernel_driver = false;
        return {0, 0};
      case USBDEVFS_RELEASEINTERFACE:
        claimed = false;
        return {0, 0};
      case USBDEVFS_IOCTL: {
        usbdevfs_ioctl inner{};
        std::memcpy(&inner, bytes_at(argument, 0, sizeof inner), sizeof inner);
        if (static_cast<unsigned>(inner.ioctl_code) != USBDEVFS_CONNECT) return {-1, ENOTTY};
        kernel_driver = true;
        return {1, 0};
      }
      case USBDEVFS_CLEAR_HALT:
        halted = false;
        ++halts_cleared;
        return {0, 0};
      case USBDEVFS_SUBMITURB:
        return submit(argument);
      case USBDEVFS_DISCARDURB:
        return discard(*reinterpret_cast<gulong*>(argument->data));
      case USBDEVFS_REAPURBNDELAY:
        return reap(argument);
      default:
        return {-1, ENOTTY};
    }
  }

  Answer submit(UMockdevIoctlData* argument) {
    const gulong address = *reinterpret_cast<gulong*>(argument->data);
    UMockdevIoctlData* const urb = umockdev_ioctl_data_resolve(argument, 0, sizeof(usbdevfs_urb), nullptr);
    const auto& head = *reinterpret_cast<usbdevfs_urb*>(urb->data);
    const auto length = static_cast<std::size_t>(head.buffer_length);
    UMockdevIoctlData* const buffer =
        length == 0 ? nullptr
                    : umockdev_ioctl_data_resolve(urb, offsetof(usbdevfs_urb, buffer), length, nullptr);
    const Urb taken{umockdev_ioctl_data_ref(urb),
                    buffer == nullptr ? nullptr : umockdev_ioctl_data_ref(buffer), address};
    if (head.type == USBDEVFS_URB_TYPE_CONTROL && taken.buffer->data[0] == 0x21) {
      out.push_back(taken);
      drain();
    } else if (head.type == USBDEVFS_URB_TYPE_CONTROL) {
      const int n = control(taken.buffer->data);
      finish(taken, n < 0 ? n : 0, std::max(n, 0));
    } else if (head.endpoint == 0x81) {
      in.push_back(taken);
      feed();
    } else {
      out.push_back(taken);
      drain();
    }
    return {0, 0};
  }

  /// Answers requests for the strings and the report descriptor; libusb requests no other descriptors.
  int control(std::uint8_t* setup) const {
    if (setup[0] == 0x81 && setup[1] == 6 && setup[3] == 0x22) {
      std::copy(descriptor.begin(), descriptor.end(), setup + 8);
      return static_cast<int>(descriptor.size());
    }
    if (setup[0] != 0x80 || setup[1] != 6 || setup[3] != 3) return -EPIPE;
    Bytes text{4, 3, 0x09, 0x04};
    if (setup[2] != 0) {
      const std::string s = setup[2] == 1 ? "wrenchd" : setup[2] == 2 ? "mock device" : serial;
      text = {static_cast<std::uint8_t>(2 + 2 * s.size()), 3};
      for (const char c : s) text.insert(text.end(), {static_cast<std::uint8_t>(c), 0});
    }
    std::copy(text.begin(), text.end(), setup + 8);
    return static_cast<int>(text.size());
  }

  void feed() {
    while (halted && !in.empty()) {
      finish(in.front(), -EPIPE, 0);
      in.pop_front();
    }
    while (!in.empty() && !reports.empty()) {
      const Bytes& report = reports.front();
      std::copy(report.begin(), report.end(), in.front().buffer->data);
      finish(in.front(), 0, static_cast<int>(report.size()));
      in.pop_front();
      reports.pop_front();
    }
  }

  void drain() {
    for (; !blocked && !out.empty(); out.pop_front()) {
      const std::uint8_t* data = out.front().buffer->data;
      int length = out.front().head().buffer_length;
      if (out.front().head().type == USBDEVFS_URB_TYPE_CONTROL) {
        if (data[1] != 9) throw std::runtime_error("a request that is not SET_REPORT");
        set_report = {data[2] + 256 * data[3], data[4] + 256 * data[5]};
        data += 8;
        length -= 8;
      }
      received.emplace_back(data, data + length);
      finish(out.front(), 0, length);
      changed.notify_all();
    }
  }

  Answer discard(gulong address) {
    for (std::deque<Urb>* const queue : {&in, &out}) {
      const auto found =
          std::find_if(queue->begin(), queue->end(), [&](const Urb& u) { return u.address == address; });
      if (found == queue->end()) continue;
      finish(*found, -ENOENT, 0);
      queue->erase(found);
      return {0, 0};
    }
    return {-1, EINVAL};
  }

  Answer reap(UMockdevIoctlData* argument) {
    if (finished.empty()) return {-1, gone ? ENODEV : EAGAIN};
    const Urb urb = finished.front();
    finished.pop_front();
    if (finished.empty() && !gone) fill();
    UMockdevIoctlData* const pointer = umockdev_ioctl_data_resolve(argument, 0, sizeof(gulong), nullptr);
    umockdev_ioctl_data_set_ptr(pointer, 0, urb.urb);
    return {0, 0};
  }

  void finish(const Urb& urb, int status, int length) {
    urb.head().status = status;
    urb.head().actual_length = length;
    finished.push_back(urb);
    make_room();
  }

  void fill() const {
    const std::array<std::uint8_t, 4096> zeros{};
    while (write(fifo, zeros.data(), zeros.size()) > 0) {
    }
  }
  void make_room() const {
    std::array<std::uint8_t, 4096> bytes{};
    [[maybe_unused]] const ssize_t n = read(fifo, bytes.data(), bytes.size());
  }

  mutable std::mutex mutex;
  std::condition_variable changed;
  int fifo = -1;
  std::string serial;
  Bytes descriptor;
  std::deque<Urb> in, out, finished;
  std::deque<Bytes> reports, received;
  std::pair<int, int> set_report{-1, -1};
  bool halted = false, blocked = false, gone = false, claimed = false, kernel_driver = true;
  int halts_cleared = 0;
};

MockUsb::MockUsb(MockMachine& machine, MockIdentity identity)
    : machine_(machine), identity_(std::move(identity)), ioctls_(std::make_unique<Ioctls>()) {
  UMockdevTestbed* const testbed = machine_.testbed();
  ioctls_->serial = identity_.serial;
  ioctls_->descriptor = report_descriptor(identity_.numbered_reports);
  attach(testbed, usb_node_of(identity_), ioctls_.get());  // before the device is listed, as for hidraw
  usb_path_ = add_usb(testbed, identity_);
  interface_path_ = add_interface(testbed, identity_, usb_path_);
  const auto id = [](const std::string& hex) { return std::stoul(hex, nullptr, 16); };
  const auto low = [](unsigned long v) { return static_cast<std::uint8_t>(v & 0xFFU); };
  const auto high = [](unsigned long v) { return static_cast<std::uint8_t>(v >> 8U); };
  const unsigned long v = id(identity_.vendor), p = id(identity_.product);
  Bytes descriptors{18, 1, 0x00, 0x02, 0, 0, 0, 64, low(v), high(v), low(p), high(p), 0, 1, 1, 2, 3, 1};
  const Bytes hid{9, 0x21, 0x11, 1, 0, 1, 0x22, 31, 0};
  const std::uint8_t type = identity_.hid ? 3 : 2;  // interrupt, bulk
  Bytes endpoints{7, 5, 0x81, type, 64, 0, 1};
  if (identity_.out_endpoint) endpoints.insert(endpoints.end(), {7, 5, 0x01, type, 32, 0, 1});
  Bytes configuration{9, 2, 0, 0, 1, 1, 0, 0x80, 50};
  const std::uint8_t number = identity_.out_endpoint ? 2 : 1;
  const std::uint8_t kind = identity_.hid ? 3 : 0xFF;
  configuration.insert(configuration.end(), {9, 4, 0, 0, number, kind, 0, 0, 0});
  if (identity_.hid) configuration.insert(configuration.end(), hid.begin(), hid.end());
  configuration.insert(configuration.end(), endpoints.begin(), endpoints.end());
  configuration[2] = static_cast<std::uint8_t>(configuration.size());
  descriptors.insert(descriptors.end(), configuration.begin(), configuration.end());
  umockdev_testbed_set_attribute_binary(testbed, usb_path_.c_str(), "descriptors", descriptors.data(),
                                        static_cast<int>(descriptors.size()));

  const std::string node = node_in(testbed, usb_node_of(identity_));
  if (mkfifo(node.c_str(), 0600) != 0) throw std::runtime_error("no FIFO " + node);
  ioctls_->fifo = open(node.c_str(), O_RDWR | O_NONBLOCK);
  fcntl(ioctls_->fifo, F_SETPIPE_SZ, 4096);
  ioctls_->fill();
}

MockUsb::~MockUsb() {
  if (!ioctls_->gone) {
    umockdev_testbed_detach_ioctl(machine_.testbed(), usb_node_of(identity_).c_str(), nullptr);
    remove(machine_.testbed(), usb_path_, {usb_node_of(identity_)});
  }
  close(ioctls_->fifo);
}

void MockUsb::send(const Bytes& report) {
  const std::lock_guard lock(ioctls_->mutex);
  ioctls_->reports.push_back(report);
  ioctls_->feed();
}

void MockUsb::stall() {
  const std::lock_guard lock(ioctls_->mutex);
  ioctls_->halted = true;
  ioctls_->feed();
}

Bytes MockUsb::receive() {
  std::unique_lock lock(ioctls_->mutex);
  ioctls_->changed.wait(lock, [this] { return !ioctls_->received.empty(); });
  Bytes report = ioctls_->received.front();
  ioctls_->received.pop_front();
  return report;
}

void MockUsb::set_blocked(bool blocked) {
  const std::lock_guard lock(ioctls_->mutex);
  ioctls_->blocked = blocked;
  ioctls_->drain();
}

void MockUsb::unplug() {
  {
    const std::lock_guard lock(ioctls_->mutex);
    ioctls_->gone = true;
    for (std::deque<Ioctls::Urb>* const queue : {&ioctls_->in, &ioctls_->out}) {
      for (const Ioctls::Urb& urb : *queue) ioctls_->finish(urb, -ENODEV, 0);
      queue->clear();
    }
    ioctls_->make_room();
  }
  umockdev_testbed_uevent(machine_.testbed(), usb_path_.c_str(), "remove");
  remove(machine_.testbed(), usb_path_, {usb_node_of(identity_)});
}

std::pair<int, int> MockUsb::set_report() const {
  const std::lock_guard lock(ioctls_->mutex);
  return ioctls_->set_report;
}

int MockUsb::halts_cleared() const {
  const std::lock_guard lock(ioctls_->mutex);
  return ioctls_->halts_cleared;
}

int MockUsb::in_flight() const {
  const std::lock_guard lock(ioctls_->mutex);
  return static_cast<int>(ioctls_->in.size());
}

bool MockUsb::claimed() const {
  const std::lock_guard lock(ioctls_->mutex);
  return ioctls_->claimed;
}

bool MockUsb::kernel_driver() const {
  const std::lock_guard lock(ioctls_->mutex);
  return ioctls_->kernel_driver;
}

}  // namespace wrenchd::test
