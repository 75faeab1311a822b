#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
import wrenchd

with wrenchd.Client() as client:
    print("wrenchd is", client.status()["state"])
    with client.open_state() as state:  # every tick, through shared memory
        for tick in state.ticks(1000):
            if tick.tick % 100 == 0:
                force = ["%+.2f" % f for f in tick.F_out[:3]]
                print(tick.tick, tick.state, *force, "N |", ", ".join(map(str, tick.contact_list)))
        print("ticks missed:", state.missed)
