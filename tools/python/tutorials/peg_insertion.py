#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Insertion of a peg, with a plot of the wrench.

A square peg of 19.8 mm goes into a square hole of 20 mm, commanded 1 mm beside the axis and tilted by 2 degrees, as a hand
does. The proxy finds the way in; the wrench says what the hand feels. Writes peg_insertion.svg.
"""
import matplotlib
import numpy as np
import wrenchd

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

STIFFNESS_N_PER_M = 600.0
RATE_HZ = 1000.0


def box(size_m, centre_m, name):
    x, y, z = np.array(size_m) / 2
    vertices = np.array([[sx * x, sy * y, sz * z] for sx in (-1, 1) for sy in (-1, 1) for sz in (-1, 1)]) + centre_m
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return wrenchd.Body(wrenchd.Mesh(vertices, faces, name=name), name=name)


# Four walls around a hole of 20 mm, 40 mm deep; the mouth is at z = 0.
walls = [box([0.02, 0.06, 0.04], [side * 0.02, 0.0, -0.02], f"wall {'-+'[side > 0]}x") for side in (-1, 1)]
walls += [box([0.06, 0.02, 0.04], [0.0, side * 0.02, -0.02], f"wall {'-+'[side > 0]}y") for side in (-1, 1)]
peg = box([0.0198, 0.0198, 0.05], [0.0, 0.0, 0.0], "peg").meshes[0]
scene = wrenchd.Scene(tool=wrenchd.Body(peg, mass=0.2), obstacles=walls, k_p=STIFFNESS_N_PER_M)

steps = 3000
tilt_rad = np.radians(2.0)
path = np.zeros((steps, 7))
path[:, 0] = np.linspace(0.0, 0.001, steps)                    # drifts 1 mm to the side
path[:, 2] = 0.030 - 0.050 * np.linspace(0.0, 1.0, steps)      # goes down by 50 mm
path[:, 4] = np.sin(tilt_rad / 2 * np.linspace(0.0, 1.0, steps))
path[:, 6] = np.sqrt(1.0 - path[:, 4] ** 2)
answers = scene.follow(path, rate_Hz=RATE_HZ)

time_s = np.arange(steps) / RATE_HZ
figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(7, 5))
above.plot(time_s, answers.wrench[:, :3], label=["x", "y", "z"])
above.set_ylabel("force on the peg [N]")
above.legend(loc="upper left")
below.plot(time_s, 1e3 * answers.wrench[:, 3:], label=["x", "y", "z"])
below.set_ylabel("torque about its centre [mN m]")
below.set_xlabel("time [s]")
figure.savefig("peg_insertion.svg")

inside = path[:, 2] - 0.025 < 0.0  # the lower face of the peg is below the mouth
print(f"in contact in {np.mean(answers.contact_count[inside] > 0):.0%} of the time in the hole; largest force "
      f"{np.linalg.norm(answers.wrench[:, :3], axis=1).max():.2f} N, largest torque "
      f"{1e3 * np.linalg.norm(answers.wrench[:, 3:], axis=1).max():.1f} mN m")

# The proxy is never in the walls, and it stays within the clearance of the hole: 0.1 mm and the rotation that this allows.
assert not scene.overlaps(answers.pose[::100]).any()
assert np.abs(answers.pose[inside, 0]).max() < 0.5e-3 < path[:, 0].max()
