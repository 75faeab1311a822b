// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/live_view.hpp"

#include <cstdio>

#include <unistd.h>

#include "daemon/servo/servo_loop.hpp"

namespace wrenchd {
namespace {

/// Samples between two lines where standard output is no terminal.
constexpr int kSamplesPerLine = 5;

}  // namespace

LiveView::LiveView(bool shown, const DeviceProfile& profile)
    : shown_(shown), terminal_(isatty(STDOUT_FILENO) != 0) {
  if (!profile.has_output) totals_.shown = ShownWrench::on_tool;
}

void LiveView::sample(ServoLoop& loop) {
  TickRecord record;
  if (!loop.telemetry().latest_record().read(record)) return;
  add_sample(totals_, record);
  if (!shown_ || (!terminal_ && totals_.samples % kSamplesPerLine != 0)) return;
  std::fputs(terminal_ ? "\r\x1b[K" : "", stdout);
  std::fputs(live_line(record, loop.telemetry().timing(), totals_.shown).c_str(), stdout);
  std::fputs(terminal_ ? "" : "\n", stdout);
  std::fflush(stdout);
}

void LiveView::close(const ServoLoop& loop, double seconds) {
  if (!shown_) return;
  totals_.seconds = seconds;
  std::fputs(terminal_ ? "\n" : "", stdout);
  std::fputs(summary(totals_, loop.telemetry().timing()).c_str(), stdout);
  std::fflush(stdout);
}

}  // namespace wrenchd
