#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""My recording in pandas.

Which state took how long, the largest force in each, when contacts began, and the force over the depth. Writes
recording_in_pandas.svg. Usage: recording_in_pandas.py run.h5 (wrenchd --record run.h5 makes one)
"""
import sys

import matplotlib
import numpy as np
import wrenchd

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

recording = wrenchd.Recording(sys.argv[1])
ticks = recording.frame(["state", "contacts", "F_out", "eps", "X_WP"])
units = ticks.attrs["units"]

period_s = np.median(np.diff(ticks.index))
ticks["force_N"] = np.linalg.norm(ticks[["F_out.fx", "F_out.fy", "F_out.fz"]], axis=1)
states = ticks.groupby("state", observed=True)["force_N"].agg(time_s=lambda f: len(f) * period_s, largest_N="max")
print(states)

touching = ticks["contacts"] > 0
begins = ticks.index[touching & ~touching.shift(fill_value=False)]
print(f"{len(begins)} contacts begin, the first at {begins[0]:.3f} s" if len(begins) else "no contact")
print(recording.events()[["time_s", "severity", "text"]].head())

active = ticks[touching & (ticks["state"] == "active")]
depth_mm = 1e3 * np.linalg.norm(active.filter(like="eps.").to_numpy()[:, :3], axis=1)
figure, axes = plt.subplots(figsize=(6, 4))
axes.plot(depth_mm, active["force_N"], ".", markersize=2)
axes.set_xlabel("displacement from the tool to its proxy [mm]")
axes.set_ylabel(f"force on the hand [{units['F_out.fz']}]")
figure.savefig("recording_in_pandas.svg")

assert units["F_out.fz"] == "N" and states.loc["active", "largest_N"] > 0.0 and len(begins) > 0
assert np.corrcoef(depth_mm, active["force_N"])[0, 1] > 0.5  # deeper is stronger
