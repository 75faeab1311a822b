// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/conformance/device_session.hpp"

#include <algorithm>
#include <array>

namespace wrenchd {
namespace {

/// Zero commands of a release, so that the loss of some has no effect.
constexpr int kReleaseCommands = 5;
/// Reports in one read: a device that sends without pause must not hold the session.
constexpr int kMaxReportsPerRead = 64;

}  // namespace

DeviceSession::DeviceSession(const DeviceProfile& profile, ReportLink& link, Clock& clock,
                             std::function<bool()> cancelled)
    : profile_(profile), link_(link), clock_(clock), cancelled_(std::move(cancelled)) {
  link_.open();
  std::array<std::uint8_t, kMaxReportBytes> buffer;
  for (int i = 0; i < kMaxReportsPerRead; ++i)
    if (link_.read(clock_.now(), buffer).status != LinkStatus::ok) break;
}

DeviceSession::~DeviceSession() {
  release();
  link_.close();
}

void DeviceSession::listen(Duration time) {
  const TimePoint end = clock_.now() + time;
  while (clock_.now() < end) {
    if (cancelled_ && cancelled_()) throw SessionCancelled();
    receive(std::min(end, clock_.now() + kCommandPeriod));
  }
}

void DeviceSession::receive(TimePoint until) {
  do {
    link_.wait_readable(until);
    std::array<std::uint8_t, kMaxReportBytes> buffer;
    for (int i = 0; i < kMaxReportsPerRead; ++i) {
      const LinkRead read = link_.read(clock_.now(), buffer);
      if (read.status == LinkStatus::disconnected)
        throw std::runtime_error("the device was disconnected; connect it and start again");
      if (read.status != LinkStatus::ok) break;
      take(read, std::span(buffer).first(std::min(read.length, buffer.size())));
    }
  } while (clock_.now() < until);
}

void DeviceSession::take(const LinkRead& read, std::span<const std::uint8_t> bytes) {
  ReceivedReport& report = reports_.emplace_back();
  report.arrived = read.arrived;
  report.bytes.assign(bytes.begin(), bytes.end());
  report.bytes.resize(read.length);  // a report that does not fit keeps its length
  const auto decoded = decode(profile_.pose_report, report.bytes);
  report.outcome = decoded.outcome;
  report.content = decoded.report;
  if (decoded.outcome != Decoding::ok) return;
  const auto ticks = static_cast<std::int32_t>(static_cast<std::uint32_t>(decoded.report.device_time) -
                                               static_cast<std::uint32_t>(raw_time_));
  if (time_known_) device_time_s_ += ticks * profile_.pose_report.device_time.step;
  time_known_ = true;
  raw_time_ = decoded.report.device_time;
  report.device_time_s = device_time_s_;
}

void DeviceSession::drive(Duration time, bool enable, double hold_s, const Wrench& F) {
  for (const TimePoint end = clock_.now() + time; clock_.now() < end;) send(enable, hold_s, F);
}

void DeviceSession::send(bool enable, double hold_s, const Wrench& F) {
  set_sequence(sequence_ + 1);
  commands_.push_back({clock_.now(), sequence_});
  send_bytes(encoded(sequence_, enable, hold_s, F));
}

void DeviceSession::send_bytes(std::span<const std::uint8_t> bytes) {
  write(bytes);
  listen(kCommandPeriod);
}

void DeviceSession::write(std::span<const std::uint8_t> bytes) {
  driven_ = true;
  if (link_.write(clock_.now(), bytes) != LinkStatus::ok) ++refused_;
}

std::vector<std::uint8_t> DeviceSession::encoded(std::uint64_t sequence, bool enable, double hold_s,
                                                 const Wrench& F) const {
  WrenchReport report;
  report.sequence = sequence & 0xFFFFU;
  report.enable = enable;
  report.hold_time_s = hold_s;
  report.F = F;
  std::vector<std::uint8_t> bytes(profile_.wrench_report.length);
  encode(profile_.wrench_report, report, bytes);
  return bytes;
}

void DeviceSession::release() noexcept {
  if (!driven_) return;
  driven_ = false;
  std::array<std::uint8_t, kMaxReportBytes> bytes;
  for (int i = 0; i < kReleaseCommands; ++i) {
    WrenchReport zero;
    set_sequence(sequence_ + 1);
    zero.sequence = sequence_;
    const std::size_t length = encode(profile_.wrench_report, zero, bytes);
    link_.write(clock_.now(), std::span(bytes).first(length));
    clock_.sleep_until(clock_.now() + kCommandPeriod);
  }
}

const ReceivedReport* DeviceSession::newest() const noexcept {
  const auto found = std::find_if(reports_.rbegin(), reports_.rend(),
                                  [](const ReceivedReport& r) { return r.outcome == Decoding::ok; });
  return found == reports_.rend() ? nullptr : &*found;
}

}  // namespace wrenchd
