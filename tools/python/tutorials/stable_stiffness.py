#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which stiffness is stable for my device? A sweep, with a map as the picture.

wrenchd runs in virtual time for each stiffness and each delay of the device. Where the self-test finds the stiffness above the
passive bound, wrenchd scales it down; the map shows what is left. Writes stable_stiffness.csv and stable_stiffness.svg.
Usage: stable_stiffness.py wrenchd.toml
"""
import sys

import matplotlib
import numpy as np
import wrenchd

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

STIFFNESS = "wrench.stiffness.linear_N_per_m"
DELAY = "simulation.command_delay_s"


def main():
    grid = {"wrench.law": ["pid"], STIFFNESS: [200, 600, 1200, 2400], DELAY: [2e-4, 1e-3, 4e-3]}
    run = wrenchd.DaemonRun(sys.argv[1], seconds=2.0)
    table = wrenchd.sweep(run, grid, out="stable_stiffness.csv", engine=2)

    stable = np.array([row[STIFFNESS] * row["stiffness_scale"] for row in table.rows]).reshape(len(grid[STIFFNESS]), len(grid[DELAY]))
    figure, axes = plt.subplots(figsize=(6, 4))
    image = axes.imshow(stable, origin="lower", aspect="auto")
    axes.set_xticks(range(len(grid[DELAY])), [f"{1e3 * d:g}" for d in grid[DELAY]])
    axes.set_yticks(range(len(grid[STIFFNESS])), grid[STIFFNESS])
    axes.set_xlabel("delay from the host to the motors [ms]")
    axes.set_ylabel("stiffness in the configuration [N/m]")
    for (i, j), value in np.ndenumerate(stable):
        axes.text(j, i, f"{value:.0f}", ha="center", va="center", color="white")
    figure.colorbar(image, label="stiffness that the hand feels [N/m]")
    figure.savefig("stable_stiffness.svg")
    print("stable for each delay:", {f"{1e3 * d:g} ms": f"{stable[:, j].max():.0f} N/m" for j, d in enumerate(grid[DELAY])})

    assert all("error" not in row for row in table.rows)
    assert (np.diff(stable.max(axis=0)) <= 1e-9).all(), "a longer delay permits no higher stiffness"
    assert stable[-1, -1] < grid[STIFFNESS][-1], "the highest stiffness at the longest delay is scaled down"


if __name__ == "__main__":  # the processes of the sweep import this file
    main()
