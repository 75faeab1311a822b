# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures whether the machine gives programs a rate of 1 kHz, by the rule of machine_load.hpp."""
import time

PERIOD_S = 1e-3
LATE_S = 2e-3
BUSY_SHARE = 0.003
INSTANTS = 1000


def busy_text():
    """Returns "machine too busy to judge: ..." with the measured figures, or None if the machine gives the rate. Takes 1 s.

    Instants that pass before a late wake-up count as late too, because a program with this rate misses each of them."""
    late, worst_s = 0, 0.0
    due = time.monotonic()
    for _ in range(INSTANTS):
        due += PERIOD_S
        time.sleep(max(0.0, due - time.monotonic()))
        late_s = time.monotonic() - due
        late += late_s > LATE_S
        worst_s = max(worst_s, late_s)
    if late <= BUSY_SHARE * INSTANTS:
        return None
    return (f"machine too busy to judge: {100 * late / INSTANTS:.1f} % of {INSTANTS} wake-ups came more than "
            f"{1e3 * LATE_S:.0f} ms late, the worst {1e3 * worst_s:.1f} ms")
