// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/links/reconnecting_link.hpp"

#include <utility>

#include "devices/links/hidraw_link.hpp"
#include "devices/links/usb_link.hpp"

namespace wrenchd {

ReconnectingLink::ReconnectingLink(DeviceProfile profile, std::string serial, LinkSettings settings,
                                   std::string usb_port)
    : profile_(std::move(profile)),
      criteria_{profile_.name, std::move(serial), std::move(usb_port), {}},
      settings_(std::move(settings)) {}

void ReconnectingLink::open() {
  close();
  const std::vector<UsbDevice> connected = list_usb_devices();
  const DeviceChoice choice = choose_device(connected, {&profile_, 1}, criteria_);
  if (!choice.selection)
    throw DeviceNotFound("no device of profile " + profile_.name +
                             (criteria_.serial.empty() ? "" : " with serial number " + criteria_.serial) +
                             (criteria_.usb_port.empty() ? "" : " in USB port " + criteria_.usb_port) +
                             " is connected",
                         describe_rejected(connected, choice));
  const UsbDevice& device = connected[choice.selection->device];
  std::unique_ptr<ReportLink> link;
  if (profile_.transport == Transport::libusb)
    link = std::make_unique<UsbLink>(device, settings_);
  else
    link = std::make_unique<HidrawLink>(device, settings_);
  link->open();
  link_ = std::move(link);
  criteria_.previous = device;
}

LinkRead ReconnectingLink::read(TimePoint now, std::span<std::uint8_t> buffer) noexcept {
  return link_ ? link_->read(now, buffer) : LinkRead{LinkStatus::disconnected, 0, now};
}

LinkStatus ReconnectingLink::write(TimePoint now, std::span<const std::uint8_t> report) noexcept {
  return link_ ? link_->write(now, report) : LinkStatus::disconnected;
}

void ReconnectingLink::wait_readable(TimePoint deadline) noexcept {
  if (link_) link_->wait_readable(deadline);
}

void ReconnectingLink::close() noexcept {
  link_.reset();
}

std::vector<std::string> describe_rejected(std::span<const UsbDevice> connected, const DeviceChoice& choice) {
  std::vector<std::string> rejected;
  for (std::size_t i = 0; i < connected.size(); ++i)
    if (!choice.rejections[i].empty())
      rejected.push_back(describe(connected[i]) + ": " + choice.rejections[i]);
  return rejected;
}

}  // namespace wrenchd
