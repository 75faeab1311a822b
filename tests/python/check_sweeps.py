# SPDX-License-Identifier: GPL-3.0-or-later
"""Sweeps: every engine gives the same bytes, and a sweep survives the death of its workers and of its client.

Usage: check_sweeps.py BIN_DIRECTORY WORK_DIRECTORY [--seed N]
"""
import os
import random
import signal
import subprocess
import sys
import time
import unittest
from pathlib import Path

import wrenchd
from wrenchd.sweeps import SweepError, grid_points

BIN, WORK = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
SEED = int(sys.argv[sys.argv.index("--seed") + 1]) if "--seed" in sys.argv else random.SystemRandom().randrange(2**32)
SOURCE = Path(__file__).resolve().parent.parent.parent
GRID = {"a": [1, 2.5, "x,y"], "b": list(range(20)), "seed": [3, 4]}
# The module that the workers import. `pause_s` is long enough for kills, and does not change the result.
MODULE = """
import hashlib, os, time
def digest(point):
    time.sleep(float(os.environ.get("PAUSE_S", "0")))
    if point["b"] == 7:
        raise ValueError("seven, as asked")
    number = int(hashlib.sha256(repr(sorted(point.items())).encode()).hexdigest()[:13], 16)
    return {"number": number / 7, "even": number % 2 == 0, "b": "result", "list": [1, point["a"]]}
"""
CLIENT = """
import sys, wrenchd, points
if __name__ == "__main__":
    engine = int(sys.argv[2]) if sys.argv[2].isdigit() else sys.argv[2]
    wrenchd.sweep(points.digest, {grid!r}, sys.argv[1], engine=engine, progress=False)
"""


def children(pid):
    """Process ids of all descendants."""
    found = []
    try:
        for task in Path(f"/proc/{pid}/task").iterdir():
            for child in (task / "children").read_text().split():
                found += [int(child), *children(int(child))]
    except (FileNotFoundError, ProcessLookupError):
        pass
    return found


def is_worker(pid):
    """True for a process that runs points, in contrast to helpers of multiprocessing."""
    try:
        words = Path(f"/proc/{pid}/cmdline").read_bytes()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return b"resource_tracker" not in words


class Sweeps(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        WORK.mkdir(parents=True, exist_ok=True)
        for file in WORK.glob("*"):
            file.unlink() if file.is_file() else None
        (WORK / "points.py").write_text(MODULE)
        (WORK / "client.py").write_text(CLIENT.format(grid=GRID))
        sys.path.insert(0, str(WORK))
        os.environ["PYTHONPATH"] = f"{WORK}:{os.environ.get('PYTHONPATH', '')}"
        os.environ["PATH"] = f"{BIN}:{os.environ['PATH']}"
        import points
        cls.function = staticmethod(points.digest)
        cls.expected = cls.sweep_bytes("serial.csv", "serial")

    @classmethod
    def sweep_bytes(cls, name, engine):
        (WORK / name).unlink(missing_ok=True)
        table = wrenchd.sweep(cls.function, GRID, WORK / name, engine=engine, progress=False)
        assert len(table) == 120
        return (WORK / name).read_bytes()

    def test_the_table_has_the_grid_and_the_results(self):
        table = wrenchd.sweep(self.function, GRID, WORK / "table.csv")
        self.assertEqual(list(table.rows[0]), ["run", "a", "b", "seed", "number", "even", "result.b", "list"])
        self.assertEqual(table.rows[14]["error"], "ValueError: seven, as asked")
        self.assertEqual([row["run"] for row in table.rows], list(range(120)))
        frame = table.frame()
        self.assertEqual(frame.loc[119, "a"], "x,y")
        self.assertEqual(self.expected.count(b"\n"), 121)
        self.assertEqual(list(WORK.glob("table.csv.journal*")), [])

    def test_two_processes_give_the_bytes_of_the_serial_sweep(self):
        self.assertEqual(self.sweep_bytes("two.csv", 2), self.expected)

    def test_dask_gives_the_bytes_of_the_serial_sweep(self):
        self.assertEqual(self.sweep_bytes("dask.csv", "dask"), self.expected)

    def test_dask_rejects_a_program_that_its_workers_would_repeat(self):
        program = WORK / "unguarded.py"
        program.write_text("import points, wrenchd\n"
                           f"wrenchd.sweep(points.digest, {GRID!r}, {str(WORK / 'unguarded.csv')!r}, engine='dask')\n")
        ended = subprocess.run([sys.executable, program], capture_output=True, text=True, timeout=60)
        self.assertNotEqual(ended.returncode, 0)
        self.assertIn('put its call under if __name__ == "__main__":', ended.stderr)
        self.assertFalse((WORK / "unguarded.csv").exists())

    def test_kills_at_random_instants(self):
        for engine, kills in (("2", 6), ("dask", 2)):
            with self.subTest(engine=engine, seed=SEED):
                self.kill_and_continue(engine, kills, random.Random(SEED))

    def kill_and_continue(self, engine, kills, chance):
        """Kills workers, then the client, at random instants, and starts the client again until the table is there."""
        out = WORK / f"killed-{engine}.csv"
        environment = {**os.environ, "PAUSE_S": "0.03"}
        clients = killed = 0
        while not out.exists():
            clients += 1
            self.assertLess(clients, 30, "the sweep does not come to an end")
            client = subprocess.Popen([sys.executable, WORK / "client.py", out, engine], env=environment,
                                      stderr=subprocess.PIPE, text=True)
            while client.poll() is None and killed < kills:
                journal = WORK / (out.name + ".journal")
                before = journal.stat().st_size if journal.exists() else 0
                end = time.monotonic() + 60
                while client.poll() is None and time.monotonic() < end and (not journal.exists() or journal.stat().st_size <= before + 100):
                    time.sleep(0.01)  # until this client has finished a run: otherwise start-up is all that is killed
                time.sleep(chance.uniform(0.0, 0.1))
                workers = [pid for pid in children(client.pid) if is_worker(pid)]
                victim = client.pid if killed % 2 == 1 or not workers else chance.choice(workers)
                try:
                    os.kill(victim, signal.SIGKILL)
                    killed += 1
                except ProcessLookupError:
                    pass
                if victim == client.pid:
                    client.wait(timeout=60)
            _, said = client.communicate(timeout=120)
            if client.returncode not in (0, -signal.SIGKILL):
                self.assertIn("continue", said)  # a message that says so, not a traceback of something else
        self.assertEqual(killed, kills)
        self.assertEqual(out.read_bytes(), self.expected)

    def test_a_torn_line_of_the_journal_is_run_again(self):
        def stop_at_50(point, count=[0]):
            count[0] += 1
            if count[0] == 50:
                raise KeyboardInterrupt
            return self.function(point)

        stop_at_50.__module__, stop_at_50.__qualname__ = "points", "digest"
        with self.assertRaises(KeyboardInterrupt):
            wrenchd.sweep(stop_at_50, GRID, WORK / "torn.csv")
        journal = WORK / "torn.csv.journal"
        self.assertEqual(len(journal.read_bytes().splitlines()), 50)  # the identity and 49 runs
        journal.write_bytes(journal.read_bytes()[:-9])
        again = []
        def counted(point):
            again.append(point)
            return self.function(point)
        counted.__module__, counted.__qualname__ = "points", "digest"
        wrenchd.sweep(counted, GRID, WORK / "torn.csv")
        self.assertEqual(len(again), 120 - 48)
        self.assertEqual((WORK / "torn.csv").read_bytes(), self.expected)

    def test_parts_as_of_an_array_of_jobs(self):
        out = WORK / "parts.csv"
        for k in (2, 0):
            self.assertIsNone(wrenchd.sweep(self.function, GRID, out, part=(k, 3)))
        self.assertEqual(len(wrenchd.sweep(self.function, GRID, out)), 120)  # runs the missing part too
        self.assertEqual(out.read_bytes(), self.expected)
        self.assertEqual(list(WORK.glob("parts.csv.*")), [])

    def test_errors_have_place_and_remedy(self):
        for grid, message in [({}, "there is no point"), ({"a": []}, "'a' has no values"), ({"a": "xy"}, "'a' must be a list")]:
            with self.assertRaisesRegex(SweepError, message):
                grid_points(grid)
        with self.assertRaisesRegex(SweepError, "engine: 'fast' is none"):
            wrenchd.sweep(self.function, GRID, WORK / "x.csv", engine="fast")
        with self.assertRaisesRegex(SweepError, "belongs to a sweep with another grid"):
            (WORK / "x.csv.journal").write_text('{"sweep": "of another"}\n')
            wrenchd.sweep(self.function, GRID, WORK / "x.csv")
        (WORK / "x.csv.journal").unlink()
        with self.assertRaisesRegex(SweepError, "2/2 is no part"):
            wrenchd.sweep(self.function, GRID, WORK / "x.csv", part=(2, 2))
        self.assertFalse((WORK / "x.csv").exists())

    # the daemon

    SWEEP = """
out = "stability.csv"
engine = "serial"
[run]
config = "%s/config/wrenchd.toml"
seconds = 3.0
[grid]
wrench.law = ["law"]
wrench.stiffness.linear_N_per_m = [200, 600]
simulation.command_delay_s = [0.0002, 0.004]
"""

    def write(self, text):
        (WORK / "sweep.toml").write_text(text)
        return WORK / "sweep.toml"

    def ctl(self, *arguments):
        environment = {k: v for k, v in os.environ.items() if k != "PATH"} | {"PATH": "/usr/bin:/bin"}
        return subprocess.run([BIN / "wrenchctl", "sweep", *map(str, arguments)], env=environment, capture_output=True, text=True, check=False)

    def test_wrenchctl_sweeps_the_daemon(self):
        # wrench.law has one value that wrenchd does not know, so every row says why it was rejected.
        file = self.write(self.SWEEP % SOURCE)
        done = self.ctl(file)
        self.assertEqual((done.returncode, done.stdout), (0, f"{WORK}/stability.csv: 4 runs\n"), done.stderr)
        table = (WORK / "stability.csv").read_text()
        self.assertIn("wrench.law", table)
        self.assertEqual(table.count("SweepError: wrenchd: "), 4, table)

        file = self.write(self.SWEEP.replace('"law"', '"pid"') % SOURCE)
        bytes_of = {}
        for engine in ("serial", "2"):
            done = self.ctl(file, "--engine", engine)
            self.assertEqual(done.returncode, 0, done.stderr)
            bytes_of[engine] = (WORK / "stability.csv").read_bytes()
        self.assertEqual(bytes_of["serial"], bytes_of["2"])
        import pandas
        frame = pandas.read_csv(WORK / "stability.csv")
        self.assertEqual(list(frame["wrench.stiffness.linear_N_per_m"]), [200, 200, 600, 600])
        self.assertTrue((frame["exit_code"] == 0).all() and (frame["max_force_N"] > 0.2).all())
        self.assertEqual(frame["max_force_N"].nunique(), 4)  # each point has its own result
        for k in (0, 1):
            self.assertEqual(self.ctl(file, "--part", f"{k}/2").returncode, 0)
        self.assertEqual(self.ctl(file).returncode, 0)
        self.assertEqual((WORK / "stability.csv").read_bytes(), bytes_of["serial"])

    def test_wrong_sweep_files_are_rejected_with_the_place(self):
        good = self.SWEEP % SOURCE
        for text, message in [(good + "x = 1\n[grit]\n", "'grit' is no key"), (good.replace("seconds", "second"), "'run.second' is no key"),
                              (good.replace('"stability.csv"', "3"), "'out' has a wrong type"), (good.replace("[200, 600]", "[]"), "has no values"),
                              (good.replace("config/wrenchd", "config/nothing"), "cannot be read"), (good.replace("[grid]", "[grid"), "sweep.toml")]:
            done = self.ctl(self.write(text))
            self.assertEqual(done.returncode, 1, text)
            self.assertIn(message, done.stderr)
            self.assertNotIn("Traceback", done.stderr)
        self.assertEqual(self.ctl(self.write(good), "--part", "3").returncode, 1)


if __name__ == "__main__":
    print("seed", SEED)
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
