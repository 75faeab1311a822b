// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/live_view.hpp"

#include <utility>

#include "daemon/servo/servo_loop.hpp"
#include "daemon/wait_text.hpp"

namespace wrenchd {
namespace {

/// Samples between two lines where the text goes to no terminal.
constexpr int kSamplesPerLine = 5;

}  // namespace

LiveView::LiveView(Print print, bool terminal, const DeviceProfile& profile, const std::string& hand)
    : print_(std::move(print)),
      terminal_(terminal),
      shown_(profile.has_output ? ShownWrench::sent : ShownWrench::on_tool),
      prefix_(hand.empty() ? "" : hand + ": ") {}

void LiveView::sample(ServoLoop& loop) {
  TickRecord record;
  if (!print_ || !loop.telemetry().latest_record().read(record)) return;
  if (terminal_ && !prefix_.empty()) return;
  if (!terminal_ && ++samples_ % kSamplesPerLine != 0) return;
  const std::string line = prefix_ + live_line(record, loop.telemetry().timing(), shown_,
                                               wait_text(loop.telemetry().wait_reason()));
  print_(terminal_ ? "\r\x1b[K" + line : line + "\n");
}

void LiveView::close(const ServoLoop& loop, double seconds) {
  if (!print_) return;
  print_((terminal_ ? "\n" : "") + prefix_ +
         summary(loop.telemetry().totals(), loop.telemetry().timing(), seconds, shown_));
}

}  // namespace wrenchd
