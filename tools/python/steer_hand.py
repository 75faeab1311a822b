#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
import math
import time

import wrenchd

with wrenchd.Client() as client, client.lease(), client.open_state() as state:
    client.arm()
    for i in range(400):  # eight seconds: two circles of the simulated hand, pressed onto the table
        angle, height_m = math.pi * i / 100, 0.065 if i < 100 else 0.020
        client.move_hand([0.03 * math.cos(angle), 0.03 * math.sin(angle), height_m])
        time.sleep(0.02)
        if i % 50 == 49:
            tick = state.latest()
            print(tick.state, "at", tick.X_WQ[:3], "m, force", tick.F_out[:3], "N")
