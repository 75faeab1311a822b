#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine in Python: equal to wrenchctl solve bit for bit, gradients by finite differences, analytic clearances, errors.

Usage: check_engine.py BIN, the directory with wrenchctl; PYTHONPATH names the package.
"""

import pickle
import subprocess
import sys
import tempfile
import threading
import unittest
from pathlib import Path

import numpy as np

import wrenchd

BIN = Path(sys.argv.pop()) if len(sys.argv) > 1 else Path("build/release/bin")
FACES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def box(half, name="box", scale=1.0):
    return wrenchd.Mesh([[x, y, z] for x in (-half, half) for y in (-half, half) for z in (-half, half)], FACES,
                        scale=scale, name=name)


def random_poses(count, spread, seed):
    random = np.random.default_rng(seed)
    q = random.normal(size=(count, 4))
    return np.concatenate([random.uniform(-spread, spread, (count, 3)), q / np.linalg.norm(q, axis=1, keepdims=True)], axis=1)


def as_matrix(pose):
    x, y, z, w = pose[3:]
    matrix = np.eye(4)
    matrix[:3, :3] = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                      [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                      [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    matrix[:3, 3] = pose[:3]
    return matrix


def moved(pose, twist, centre):
    """p exp(twist) for a small twist [v; w] of the body frame at the centre of mass, which lies at `centre` in M."""
    angle = np.linalg.norm(twist[3:])
    axis = twist[3:] / angle if angle > 0 else np.array([1.0, 0.0, 0.0])
    step = as_matrix(np.concatenate([np.zeros(3), axis * np.sin(angle / 2), [np.cos(angle / 2)]]))
    step[:3, 3] = twist[:3]
    if angle > 0.0:
        hat = np.cross(np.eye(3), -axis)
        step[:3, 3] = (np.eye(3) * np.sin(angle) / angle + (1 - np.cos(angle)) / angle * hat
                       + (1 - np.sin(angle) / angle) * np.outer(axis, axis)) @ twist[:3]
    to_body = np.eye(4)
    to_body[:3, 3] = centre
    return as_matrix(pose) @ to_body @ step @ np.linalg.inv(to_body)


class SameAsWrenchctl(unittest.TestCase):
    """The scenes are files for wrenchctl and objects here; every number must be equal."""

    def compare(self, tool_kind, obstacle_kind, triangles, spread):
        with tempfile.TemporaryDirectory() as directory:
            files = {}
            for role, kind in (("tool", tool_kind), ("obstacle", obstacle_kind)):
                files[role] = Path(directory, f"{role}.off")
                subprocess.run([BIN / "wrenchctl", "mesh", "--make", kind, "--triangles", str(triangles), "-o", files[role]],
                               check=True)
            scene_file, poses_file = Path(directory, "scene.toml"), Path(directory, "poses.csv")
            scene_file.write_text(f'[tool]\nmesh = "{files["tool"]}"\nmass = 0.3\n[[obstacle]]\nname = "one"\n'
                                  f'mesh = "{files["obstacle"]}"\nposition_m = [0.01, 0.02, -0.03]\n'
                                  '[[obstacle]]\nname = "plane"\nhalf_space = { normal = [0.0, 0.1, 1.0], offset = -0.06 }\n')
            table = random_poses(20, spread, 4)
            poses_file.write_text("px,py,pz,qx,qy,qz,qw\n"
                                  + "".join(",".join(repr(float(x)) for x in row) + "\n" for row in table))
            scene = wrenchd.Scene(
                wrenchd.Body(wrenchd.Mesh.load(files["tool"]), mass=0.3),
                [wrenchd.Body(wrenchd.Mesh.load(files["obstacle"]), name="one", pose=[0.01, 0.02, -0.03, 0, 0, 0, 1]),
                 wrenchd.HalfSpace([0.0, 0.1, 1.0], -0.06)])
            for more, answer in ((["--proxy"], scene.follow(table)), ([], scene.project(table))):
                out = subprocess.run([BIN / "wrenchctl", "solve", scene_file, "--poses", poses_file, *more],
                                     stdout=subprocess.PIPE, check=False, text=True).stdout.splitlines()
                rows = [dict(zip(out[0].split(","), row.split(","))) for row in out[1:]]
                self.assertEqual(len(rows), len(table))
                for i, row in enumerate(rows):
                    pose = [float(row[c]) for c in ("px", "py", "pz", "qx", "qy", "qz", "qw")]
                    wrench = [float(row[f"body_{c}"]) for c in ("fx", "fy", "fz", "tx", "ty", "tz")]
                    np.testing.assert_array_equal(answer.pose[i], pose)
                    np.testing.assert_array_equal(answer.energy[i], float(row["energy"]))
                    np.testing.assert_array_equal(answer.wrench[i], wrench)
                    self.assertEqual(answer.contact_count[i], int(row["contacts"]))
                self.assertGreater(np.nanmax(answer.energy), 0.0)

    def test_convex_bodies(self):
        self.compare("sphere", "sphere", 320, 0.03)

    def test_bodies_of_any_shape(self):
        self.compare("bumpy", "bumpy", 1000, 0.03)


class Answers(unittest.TestCase):
    def setUp(self):
        self.scene = wrenchd.Scene(wrenchd.Body(box(0.01), mass=0.2), [box(0.05, "block")])

    def test_gradient_is_that_of_the_energy(self):
        centre = self.scene.tool_properties["centre_of_mass"]
        checked = 0
        for pose in random_poses(30, 0.005, 7) + np.array([0, 0, 0.055, 0, 0, 0, 0]):
            answer = self.scene.project(pose)
            if answer.is_free:
                continue
            step, difference = 1e-6, np.zeros(6)
            for k in range(6):
                twist = np.zeros(6)
                twist[k] = step
                plus, minus = (self.scene.project(moved(pose, sign * twist, centre)).energy for sign in (1, -1))
                difference[k] = (plus - minus) / (2 * step)
            scale = np.linalg.norm(answer.gradient[:3])
            np.testing.assert_allclose(difference[:3], answer.gradient[:3], atol=1e-5 * scale)
            np.testing.assert_allclose(difference[3:], answer.gradient[3:], atol=1e-5 * scale * 0.01)
            checked += 1
        self.assertGreater(checked, 10)

    def test_energy_of_a_face_is_mass_times_depth_squared(self):
        self.assertAlmostEqual(self.scene.project([0, 0, 0.055, 0, 0, 0, 1]).energy, 0.2 * 0.005**2, delta=1e-15)

    def test_clearance_is_the_distance(self):
        for pose, distance in (([0, 0, 0.07, 0, 0, 0, 1], 0.01),            # face and face
                               ([0.07, 0.07, 0, 0, 0, 0, 1], 0.01 * 2**0.5),  # edge and edge
                               ([0.07, 0.07, 0.07, 0, 0, 0, 1], 0.01 * 3**0.5),  # corner and corner
                               ([0, 0, 0.055, 0, 0, 0, 1], 0.0)):
            self.assertAlmostEqual(self.scene.clearance(pose), distance, delta=1e-12)
        self.assertEqual(wrenchd.Scene(box(0.01)).clearance([0, 0, 0, 0, 0, 0, 1]), np.inf)
        plane = wrenchd.Scene(box(0.01), [wrenchd.HalfSpace([0, 0, 2], 0.1)])  # z < 0.05
        self.assertAlmostEqual(plane.clearance([0, 0, 0.08, 0, 0, 0, 1]), 0.02, delta=1e-12)

    def test_overlap_agrees_with_clearance_and_with_energy(self):
        table = random_poses(300, 0.08, 11)
        overlaps, clearance, energy = (self.scene.overlaps(table), self.scene.clearance(table),
                                       self.scene.project(table).energy)
        np.testing.assert_array_equal(overlaps, clearance == 0.0)
        np.testing.assert_array_equal(overlaps, energy > 0.0)
        self.assertTrue(overlaps.any() and not overlaps.all())

    def test_shapes(self):
        pose = [0, 0, 0.055, 0, 0, 0, 1]
        one, matrix = self.scene.project(pose), self.scene.project(as_matrix(np.array(pose, dtype=float)))
        self.assertEqual(one.energy, matrix.energy)
        many = self.scene.project([pose, pose])
        self.assertEqual((many.pose.shape, many.eps.shape, many.energy.shape, len(many)), ((2, 7), (2, 6), (2,), 2))
        self.assertEqual(many[1].energy, one.energy)
        self.assertEqual({c.obstacle for c in one.contacts}, {"obstacle 1"})
        self.assertEqual(len(self.scene.follow(np.zeros((0, 7)))), 0)

    def test_matrices_are_read_as_quaternions(self):
        table = random_poses(50, 0.06, 13)
        matrices = np.array([as_matrix(pose) for pose in table])
        np.testing.assert_allclose(self.scene.clearance(matrices), self.scene.clearance(table), atol=1e-13)

    def test_pickle(self):
        copy = pickle.loads(pickle.dumps(self.scene))
        table = random_poses(20, 0.05, 3)
        np.testing.assert_array_equal(copy.project(table).energy, self.scene.project(table).energy)
        answers = self.scene.project(table)
        kept = pickle.loads(pickle.dumps(answers))
        self.assertEqual([len(a.contacts) for a in kept], [len(a.contacts) for a in answers])
        np.testing.assert_array_equal(kept[3].contacts[0].point, answers[3].contacts[0].point)
        self.assertEqual(len(kept[-1].contacts), len(answers[19].contacts))
        mesh = pickle.loads(pickle.dumps(box(0.01, "named", 2.0)))
        self.assertEqual((mesh.name, mesh.scale, len(mesh.faces)), ("named", 2.0, 6))

    def test_threads_share_a_scene(self):
        table = random_poses(200, 0.05, 5)
        expected, seen = self.scene.project(table).energy, [None] * 4

        def work(i):
            seen[i] = self.scene.project(table).energy

        threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for one in seen:
            np.testing.assert_array_equal(one, expected)

    def test_moving_obstacle(self):
        scene = wrenchd.Scene(box(0.01), [wrenchd.Body(box(0.01), pose=[0.05, 0, 0, 0, 0, 0, 1],
                                                       linear_velocity=[-0.1, 0, 0])])
        self.assertAlmostEqual(scene.clearance([0, 0, 0, 0, 0, 0, 1], time=0.2), 0.01, delta=1e-12)
        path = scene.follow(np.tile([0, 0, 0, 0, 0, 0, 1.0], (400, 1)), rate_Hz=1000)
        self.assertAlmostEqual(path.pose[-1, 0], 0.05 - 0.0399 - 0.02, delta=2e-6)


class Errors(unittest.TestCase):
    def reject(self, parts, call, kind=ValueError):
        with self.assertRaises(kind) as caught:
            call()
        for part in parts:
            self.assertIn(part, str(caught.exception))

    def test_meshes(self):
        open_box = wrenchd.Mesh(box(0.01).vertices, FACES[:5], name="lidless")
        self.assertFalse(open_box.report().usable)
        self.assertTrue(open_box.report("surface").usable)
        self.reject(["lidless", "solid", 'kind = "surface"'], lambda: wrenchd.Scene(open_box), wrenchd.MeshError)
        self.reject(["lidless"], open_box.repaired, wrenchd.MeshError)
        self.assertEqual(len(wrenchd.Scene(wrenchd.Body(open_box, kind="surface")).remarks), 2)
        self.reject(["nowhere.stl"], lambda: wrenchd.Mesh.load("/nowhere.stl"), wrenchd.MeshError)
        self.reject(["broken", "9"], lambda: wrenchd.Scene(wrenchd.Mesh(box(0.01).vertices, [[0, 1, 9]], name="broken")),
                    wrenchd.MeshError)
        self.reject(["broken"], lambda: wrenchd.Scene(wrenchd.Mesh(box(0.01).vertices, [[0, 1, -1]], name="broken")),
                    wrenchd.MeshError)
        self.reject(["(n, 3)"], lambda: wrenchd.Mesh([[1, 2]], FACES))
        self.reject(["whole numbers"], lambda: wrenchd.Mesh([[1, 2, 3]], np.array([[0.5, 1, 2]])))
        self.reject(["scale"], lambda: box(0.01, scale=-1.0))

    def test_bodies(self):
        self.reject(["mass", "-1"], lambda: wrenchd.Scene(wrenchd.Body(box(0.01), mass=-1)))
        self.reject(["no body has it"],
                    lambda: wrenchd.Scene(wrenchd.Body(box(0.01), inertia="given", inertia_tensor=np.diag([1, 1, 3]))))
        self.reject(["expected a Mesh"], lambda: wrenchd.Scene(wrenchd.Body("peg.stl")), TypeError)
        self.reject(["inertia: one of", "rubber"], lambda: wrenchd.Scene(wrenchd.Body(box(0.01), inertia="rubber")))
        self.reject(["kind", "jelly"], lambda: wrenchd.Scene(wrenchd.Body(box(0.01), kind="jelly")))
        self.reject(["normal"], lambda: wrenchd.Scene(box(0.01), [wrenchd.HalfSpace([0, 0, 0])]))

    def test_poses(self):
        scene = wrenchd.Scene(box(0.01))
        self.reject(["(N, 7)", "(3,)"], lambda: scene.project([1, 2, 3]))
        self.reject(["pose 1", "unit length"], lambda: scene.project([[0, 0, 0, 0, 0, 0, 1], [0, 0, 0, 0, 0, 0, 2]]))
        self.reject(["pose 0", "not finite"], lambda: scene.project([np.nan, 0, 0, 0, 0, 0, 1]))
        self.reject(["no rotation"], lambda: scene.project(2 * np.eye(4)))
        self.reject(["method: one of", "best"], lambda: wrenchd.Scene(box(0.01), method="best"))


class Types(unittest.TestCase):
    def test_mypy_accepts_the_package(self):
        try:
            import mypy.api
        except ImportError:
            self.skipTest("mypy is not installed")
        package = Path(wrenchd.__file__).parent
        with tempfile.TemporaryDirectory() as cache:
            out, _, status = mypy.api.run(["--cache-dir", cache, "--strict-optional", str(package / "engine.py"),
                                           str(package / "__init__.py")])
        self.assertEqual(status, 0, out)


if __name__ == "__main__":
    unittest.main(verbosity=2)
