// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/links/reconnecting_link.hpp"

#include <utility>

#include "devices/links/hidraw_link.hpp"
#include "devices/links/usb_link.hpp"

namespace wrenchd {

PluggedLink::PluggedLink(DeviceProfile profile, std::string serial, LinkSettings settings)
    : profile_(std::move(profile)),
      wanted_{profile_.name, std::move(serial), {}},
      settings_(std::move(settings)) {}

void PluggedLink::open() {
  close();
  const std::vector<UsbDevice> plugged = list_usb_devices();
  const DeviceChoice choice = choose_device(plugged, {&profile_, 1}, wanted_);
  if (!choice.pick)
    throw DeviceNotFound("no device of profile " + profile_.name +
                             (wanted_.serial.empty() ? "" : " with serial number " + wanted_.serial) +
                             " is plugged in",
                         seen_instead(plugged, choice));
  const UsbDevice& device = plugged[choice.pick->device];
  std::unique_ptr<ReportLink> link;
  if (profile_.transport == Transport::libusb)
    link = std::make_unique<UsbLink>(device, settings_);
  else
    link = std::make_unique<HidrawLink>(device, settings_);
  link->open();
  link_ = std::move(link);
  wanted_.before = device;
}

LinkRead PluggedLink::read(TimePoint now, std::span<std::uint8_t> buffer) noexcept {
  return link_ ? link_->read(now, buffer) : LinkRead{LinkStatus::gone, 0, now};
}

LinkStatus PluggedLink::write(TimePoint now, std::span<const std::uint8_t> report) noexcept {
  return link_ ? link_->write(now, report) : LinkStatus::gone;
}

void PluggedLink::wait_readable(TimePoint deadline) noexcept {
  if (link_) link_->wait_readable(deadline);
}

void PluggedLink::close() noexcept {
  link_.reset();
}

std::vector<std::string> seen_instead(std::span<const UsbDevice> plugged, const DeviceChoice& choice) {
  std::vector<std::string> seen;
  for (std::size_t i = 0; i < plugged.size(); ++i)
    if (!choice.why_not[i].empty()) seen.push_back(describe(plugged[i]) + ": " + choice.why_not[i]);
  return seen;
}

}  // namespace wrenchd
