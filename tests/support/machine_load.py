# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures whether the machine gives programs a rate of 1 kHz, by the rule of machine_load.hpp.

As a program it measures until it is ended, and prints a line for every 1000 instants: how many wake-ups were late, and the worst
lateness in milliseconds."""
import subprocess
import sys
import threading
import time

PERIOD_S = 1e-3
LATE_S = 2e-3
BUSY_SHARE = 0.003
INSTANTS = 1000
WINDOW = 10  # lines: a busy machine delays a loop in some seconds and not in others


class MachineLoad:
    """Measures from its creation to end(), in a process of its own."""

    def __init__(self):
        self.lines = []
        self.process = subprocess.Popen([sys.executable, __file__], stdout=subprocess.PIPE, text=True)
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        for line in self.process.stdout:
            late, worst_ms = line.split()
            self.lines.append((int(late), float(worst_ms)))

    def end(self):
        self.process.kill()
        self.process.wait()

    def instant(self):
        """Returns the number of the present line, for busy_text()."""
        return len(self.lines)

    def busy_text(self, since=0):
        """Returns "machine too busy to judge: ..." with the figures of the busiest ten seconds since this line, or None if the
        machine gave the rate or was not measured. May wait for the end of the present line."""
        lines = len(self.lines)
        while len(self.lines) == lines and self.process.poll() is None:
            time.sleep(0.01)
        seen = self.lines[since:]
        if not seen:  # the measurement has failed, which excuses no failure
            return None
        windows = [seen[i:i + WINDOW] for i in range(max(1, len(seen) - WINDOW + 1))]
        busiest = max(windows, key=lambda window: sum(late for late, _ in window))
        late, instants = sum(late for late, _ in busiest), INSTANTS * len(busiest)
        if late <= BUSY_SHARE * instants:
            return None
        return (f"machine too busy to judge: {100 * late / instants:.1f} % of {instants} wake-ups came more than "
                f"{1e3 * LATE_S:.0f} ms late, the worst {max(worst_ms for _, worst_ms in busiest):.1f} ms")


def measure():
    """Instants that pass before a late wake-up count as late too, because a program with this rate misses each of them."""
    due = time.monotonic()
    while True:
        late, worst_s = 0, 0.0
        for _ in range(INSTANTS):
            due += PERIOD_S
            time.sleep(max(0.0, due - time.monotonic()))
            late_s = time.monotonic() - due
            late += late_s > LATE_S
            worst_s = max(worst_s, late_s)
        print(late, 1e3 * worst_s, flush=True)


if __name__ == "__main__":
    measure()
