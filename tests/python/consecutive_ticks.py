# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads 1,000 consecutive ticks while two other processes load the machine. Exits with 1 if a tick is missing.
Usage: consecutive_ticks.py [COUNT]"""

import subprocess
import sys
import time

import wrenchd

wanted = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2)]
try:
    time.sleep(0.2)  # until both run
    with wrenchd.Client() as client, client.open_state() as state:
        farthest_behind = 0
        numbers = []
        start = time.monotonic()
        for tick in state.ticks(wanted):
            numbers.append(tick.tick)
            farthest_behind = max(farthest_behind, state.unread)
        seconds = time.monotonic() - start
        assert all(process.poll() is None for process in busy)
    gaps = sum(after != before + 1 for before, after in zip(numbers, numbers[1:]))
    print(f"{len(numbers)} ticks in {seconds:.2f} s, {gaps} gaps, {state.missed} missed, "
          f"at most {farthest_behind} behind")
    sys.exit(1 if gaps or state.missed or len(numbers) != wanted else 0)
finally:
    for process in busy:
        process.kill()
        process.wait()
