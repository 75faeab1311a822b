#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Penetration depth of two meshes in ten lines.

Two cubes overlap. The penetration depth is the least motion, in the metric of the kinetic energy, that separates them. Give two
mesh files to try your own: two_meshes.py tool.stl obstacle.stl SCALE, where SCALE is metres per mesh unit.
"""
import sys

import numpy as np
import wrenchd


def cube(side_m, name):
    h = side_m / 2
    vertices = np.array([[x, y, z] for x in (-h, h) for y in (-h, h) for z in (-h, h)])
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return wrenchd.Mesh(vertices, faces, name=name)


if len(sys.argv) == 4:
    tool, obstacle = (wrenchd.Mesh.load(file, scale=float(sys.argv[3])) for file in sys.argv[1:3])
else:
    tool, obstacle = cube(0.02, "tool"), cube(0.10, "obstacle")

scene = wrenchd.Scene(tool=wrenchd.Body(tool, mass=0.2), obstacles=[obstacle])
pose = [0.0, 0.0, 0.055, 0.0, 0.0, 0.0, 1.0]  # x, y, z [m], quaternion x, y, z, w: the tool is 5 mm deep
answer = scene.project(pose)
print(f"overlap: {scene.overlaps(pose)}; {answer.status}; energy {answer.energy:.3g} kg m^2")
print(f"the tool must move by {1e3 * np.linalg.norm(answer.eps[:3]):.3f} mm and rotate by {np.degrees(np.linalg.norm(answer.eps[3:])):.3f} deg")
for contact in answer.contacts:
    print(f"  {contact.tool_feature} on {contact.obstacle_feature} of {contact.obstacle}, {100 * contact.load_fraction:.0f} % of the load")

if len(sys.argv) == 1:  # 5 mm straight up: T = (m / 2) d^2 times 2, Eq. (8)
    assert np.allclose(answer.eps, [0, 0, 0.005, 0, 0, 0], atol=1e-9) and np.isclose(answer.energy, 0.2 * 0.005**2)
