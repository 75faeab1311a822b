# SPDX-License-Identifier: GPL-3.0-or-later
"""A recording in pandas, CSV, MAT-file and MCAP has the numbers of the HDF5 file, to the last bit.

Usage: check_exports.py BIN_DIRECTORY WORK_DIRECTORY [READ_MCAP]. READ_MCAP: a command that reads MCAP with @mcap/core;
without it the part of MCAP ends with exit code 77 after everything else has passed.
"""
import csv
import json
import math
import subprocess
import sys
import unittest
import warnings
from pathlib import Path

import h5py
import numpy as np
import scipy.io

import wrenchd
from wrenchd.recording import RecordingError

BIN, WORK = Path(sys.argv[1]), Path(sys.argv[2])
READ_MCAP = sys.argv[3:]
RUN = WORK / "run.h5"
MARKERS = [(0.5, "trial 1", {"stiffness": 1500, "surface": "rubber, soft"}), (2.25, 'trial "2"', {"stiffness": 2000.5}),
           (4.0, "trial 3 – über", {"load": -1})]


def run(*arguments):
    done = subprocess.run([str(a) for a in arguments], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise AssertionError(f"{arguments} ended with {done.returncode}: {done.stderr}")
    return done.stdout


def add_markers(file):
    """Adds rows to /events as the daemon writes them for record.mark, which needs a daemon in wall time."""
    events, now = file["events"], file["ticks"]["now_ns"]
    for t, label, conditions in MARKERS:
        events.resize(len(events) + 1, 0)
        row = np.zeros(1, events.dtype)[0]
        row["time_ns"] = now[0] + int(t * 1e9)
        row["tick"] = file["ticks"]["tick"][np.searchsorted(now, row["time_ns"], side="right") - 1]
        row["name"], row["text"], row["conditions"], row["value"] = "marker", label.encode(), json.dumps(conditions), np.nan
        events[-1] = row


def record():
    RUN.unlink(missing_ok=True)
    run(BIN / "wrenchd", "--virtual-time", "--seconds", "5", "--arm", "--record", RUN, "--control", "none")
    with h5py.File(RUN, "r+") as file:
        add_markers(file)


def same(a, b):
    """True for equal bits, apart from the sign and payload of NaN."""
    a, b = np.asarray(a), np.asarray(b)
    if a.dtype.kind == "f":
        return a.dtype == b.dtype and np.array_equal(a, b, equal_nan=True) and np.array_equal(np.signbit(a[a == 0]), np.signbit(b[b == 0]))
    return np.array_equal(a, b)


class Exports(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        record()
        with h5py.File(RUN) as file:
            cls.ticks, cls.contacts, cls.events = file["ticks"][:], file["contacts"][:], file["events"][:]
            cls.attrs = dict(file.attrs)
            cls.tick_attrs = dict(file["ticks"].attrs)
        cls.recording = wrenchd.Recording(RUN)
        cls.time_s = 1e-9 * (cls.ticks["now_ns"] - cls.ticks["now_ns"][0]).astype(float)
        cls.assert_rich(cls)

    def assert_rich(self):
        """The run must contain what the comparison is about."""
        states = set(self.ticks["state"])
        assert len(states) >= 4 and len(self.contacts) > 1000 and len(self.events) > 8, (states, len(self.contacts), len(self.events))
        assert np.isnan(self.ticks["X_WQ"]).any() and np.abs(self.ticks["F_out"]).max() > 0.5

    # pandas

    def test_pandas_has_the_numbers_units_and_names(self):
        frame = self.recording.frame()
        self.assertTrue(same(frame.index, self.time_s))
        compared = 0
        for name in self.ticks.dtype.names:
            field = self.recording.fields["ticks"][name]
            values = self.ticks[name].reshape(len(self.ticks), -1)
            for i, (column, unit) in enumerate(field.columns):
                self.assertEqual(frame.attrs["units"][column], unit)
                if field.values and not field.bits:
                    self.assertEqual(frame[column].dtype.name, "category")
                    self.assertTrue(same([field.values.index(v) for v in frame[column]], values[:, i]), column)
                else:
                    self.assertEqual(frame[column].dtype, values.dtype, column)
                    self.assertTrue(same(frame[column].to_numpy(), values[:, i]), column)
                compared += 1
        self.assertEqual(compared + 1 + 3, len(frame.columns))
        self.assertEqual(frame.attrs["units"]["F_out.tx"], "N.m")
        self.assertEqual(frame.attrs["frames"]["X_WP.px"], "tool body T in world W")
        self.assertEqual(list(self.recording.frame(["F_out"], conditions=False).columns),
                         ["F_out." + c for c in ("fx", "fy", "fz", "tx", "ty", "tz")])
        with self.assertRaisesRegex(KeyError, "no column 'F_oot'"):
            self.recording.frame(["F_oot"])

    def test_conditions_hold_until_a_marker_changes_them(self):
        frame = self.recording.frame(["state"])
        for t, marker, stiffness, surface, load in [(0.4, None, math.nan, None, math.nan), (0.5, "trial 1", 1500.0, "rubber, soft", math.nan),
                                                    (2.3, 'trial "2"', 2000.5, "rubber, soft", math.nan),
                                                    (4.5, "trial 3 – über", 2000.5, "rubber, soft", -1.0)]:
            row = frame.iloc[np.searchsorted(frame.index, t - 1e-9)]
            self.assertEqual((row["marker"], row["surface"]), (marker, surface))
            np.testing.assert_equal((row["stiffness"], row["load"]), (stiffness, load))
        markers = self.recording.markers()
        self.assertEqual(list(markers["label"]), [label for _, label, _ in MARKERS])
        np.testing.assert_allclose(markers["time_s"], [t for t, _, _ in MARKERS], atol=1e-9)

    def test_contacts_belong_to_their_ticks(self):
        frame = self.recording.contacts()
        self.assertEqual(len(frame), int(self.ticks["contact_count"].sum()))
        at = 0
        for tick in self.ticks[self.ticks["contact_count"] > 0]:
            count = int(tick["contact_count"])
            first = int(tick["first_contact"])
            rows = self.contacts[first:first + count]
            part = frame.iloc[at:at + count]
            self.assertTrue((part["tick"] == tick["tick"]).all())
            if at < 3000:
                self.assertTrue(same(part[["normal_W.x", "normal_W.y", "normal_W.z"]].to_numpy(), rows["normal_W"]))
                self.assertTrue(same(part["load_fraction"].to_numpy(), rows["load_fraction"]))
            at += count
        self.assertIn("vertex on face", set(frame["contact_kind"]))

    def test_events_name_the_tick_in_which_they_happened(self):
        events = self.recording.events()
        self.assertEqual(len(events), len(self.events))
        active = events[events["text"] == "state: active"].iloc[0]
        row = np.flatnonzero(self.ticks["tick"] == active["tick"])[0]
        self.assertEqual(self.ticks["now_ns"][row], active["time_ns"])
        names = self.recording.fields["ticks"]["state"].values
        self.assertEqual(names[self.ticks["state"][row]], "active")
        self.assertNotEqual(names[self.ticks["state"][row - 1]], "active")
        self.assertEqual(set(events["severity"]) - {"info", "warning"}, set())
        self.assertEqual(events["conditions"].iloc[-1], {"load": -1})

    def test_resample(self):
        slow = self.recording.resample(100, ["F_out", "X_WP", "X_WQ", "state", "tick"])
        rate = round(float(self.attrs["rate_Hz"]))
        self.assertEqual(len(slow), int(100 * self.time_s[-1] + 1e-9) + 1)
        every = self.recording.frame(["F_out", "X_WP", "X_WQ", "state", "tick"]).iloc[::rate // 100].iloc[:len(slow)]
        np.testing.assert_allclose(slow["F_out.fz"], every["F_out.fz"], atol=1e-9)
        self.assertTrue((slow["state"].to_numpy() == every["state"].to_numpy()).all())
        fast = self.recording.resample(2 * rate, ["F_out", "X_WP", "X_WQ", "tick"])
        between, force = fast["F_out.fz"].to_numpy()[1:-1:2], self.ticks["F_out"][:, 2]
        np.testing.assert_allclose(between, 0.5 * (force[:-1] + force[1:])[:len(between)], atol=1e-6)
        quaternions = fast[["X_WP.qx", "X_WP.qy", "X_WP.qz", "X_WP.qw"]].to_numpy()
        np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1.0, atol=1e-12)
        self.assertTrue(fast["X_WQ.px"].isna().any())
        with self.assertRaisesRegex(ValueError, "rate"):
            self.recording.resample(0)

    def test_files_that_are_no_recordings_are_rejected_with_the_remedy(self):
        with self.assertRaisesRegex(RecordingError, "does not exist"):
            wrenchd.Recording(WORK / "nothing.h5")
        (WORK / "text.h5").write_text("no HDF5")
        with self.assertRaisesRegex(RecordingError, "not a recording of wrenchd"):
            wrenchd.Recording(WORK / "text.h5")
        for change, message in [(lambda f: f.attrs.modify("format", "8"), "in recording format 8, and this wrenchd reads format 9"),
                                (lambda f: f.__delitem__("events"), "damaged"),
                                (lambda f: f["fields"].__setitem__(0, (b"ticks", b"nonsense", b"u64", 1, b"1", b"", b"", b"")),
                                 "column 'nonsense' of table 'ticks' is missing"),
                                (lambda f: f["events"].__setitem__(-1, _with(f["events"][-1], conditions=b"{")), "not JSON")]:
            copy = WORK / "changed.h5"
            copy.write_bytes(RUN.read_bytes())
            with h5py.File(copy, "r+") as file:
                change(file)
            with self.assertRaisesRegex(RecordingError, message):
                wrenchd.Recording(copy).frame()
        cut = WORK / "cut.h5"
        cut.write_bytes(RUN.read_bytes()[:-5000])
        with self.assertRaisesRegex(RecordingError, "complete copy"):
            wrenchd.Recording(cut)

    # files of wrenchctl export

    def test_csv(self):
        run(BIN / "wrenchctl", "export", RUN, "-o", WORK / "run.csv", "--columns", "state,F_out,rendering_checksum")
        with (WORK / "run.csv").open(newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(len(rows), len(self.ticks))
        self.assertTrue(same([float(r["F_out.fz [N]"]) for r in rows], self.ticks["F_out"][:, 2]))
        self.assertEqual([int(r["rendering_checksum [1]"]) for r in rows], [int(x) for x in self.ticks["rendering_checksum"]])
        frame = self.recording.frame(["state"])
        self.assertEqual([r["marker"] or None for r in rows], list(frame["marker"]))
        self.assertEqual([r["surface"] or None for r in rows], list(frame["surface"]))
        self.assertTrue(same([float(r["stiffness"] or "nan") for r in rows], frame["stiffness"]))

    def test_mat(self):
        run(BIN / "wrenchctl", "export", RUN, "-o", WORK / "run.mat")
        mat = scipy.io.loadmat(WORK / "run.mat", squeeze_me=False)
        self.assertTrue(same(mat["time_s"][:, 0], self.time_s))
        for name in self.ticks.dtype.names[:-2]:
            values = self.ticks[name].reshape(len(self.ticks), -1)
            self.assertEqual(mat[name].dtype, values.dtype, name)
            self.assertTrue(same(mat[name], values), name)
        plain = scipy.io.loadmat(WORK / "run.mat", squeeze_me=True, simplify_cells=True)
        self.assertEqual(plain["units"]["F_out"], self.tick_attrs["F_out.unit"])
        self.assertTrue(plain["meaning"]["X_WP"].startswith(self.tick_attrs["X_WP.doc"]))
        self.assertEqual(", ".join(plain["names"]["state"]), self.tick_attrs["state.values"].removeprefix("from 0: "))
        contacts = self.recording.contacts()
        self.assertTrue(same(plain["contact_rows"]["normal_W"], contacts[["normal_W.x", "normal_W.y", "normal_W.z"]].to_numpy()))
        rows = plain["contact_rows"]["row"].astype(int) - 1
        self.assertTrue(same(plain["tick"][rows], contacts["tick"]))
        events = self.recording.events()
        self.assertEqual(list(plain["events"]["text"]), list(events["text"]))
        self.assertTrue(same(plain["events"]["time_s"], events["time_s"]))
        self.assertTrue(same(plain["events"]["value"], events["value"]))
        self.assertEqual([json.loads(c) if len(c) else {} for c in plain["events"]["conditions"]], list(events["conditions"]))

    def test_part_of_a_recording_as_mat(self):
        run(BIN / "wrenchctl", "export", RUN, "-o", WORK / "part.mat", "--columns", "F_out", "--from", "2", "--every", "10")
        mat = scipy.io.loadmat(WORK / "part.mat")
        rows = np.flatnonzero(self.time_s >= 2 - 1e-9)[::10]
        self.assertTrue(same(mat["F_out"], self.ticks["F_out"][rows]))
        self.assertNotIn("X_WP", mat)

    @unittest.skipUnless(READ_MCAP, "without node")
    def test_mcap(self):
        run(BIN / "wrenchctl", "export", RUN, "-o", WORK / "run.mcap")
        head, *lines = run(*READ_MCAP, WORK / "run.mcap").splitlines()
        head = json.loads(head)
        self.assertGreater(head["chunks"], 3)
        self.assertEqual(head["topics"], {"/ticks": "wrenchd.Tick", "/tf": "foxglove.FrameTransform", "/pose/commanded": "foxglove.PoseInFrame",
                                          "/pose/proxy": "foxglove.PoseInFrame", "/wrench/out": "wrenchd.Wrench",
                                          "/wrench/body": "wrenchd.Wrench", "/events": "foxglove.Log", "/conditions": "wrenchd.Conditions"})
        topics = {}
        for line in lines:
            topic, time_ns, data = line.split("\t", 2)
            topics.setdefault(topic, []).append((int(time_ns), json.loads(data)))
        offset = int(self.attrs["started_unix_ns"]) - int(self.attrs["started_ns"])
        self.assertEqual([t for t, _ in topics["/ticks"]], [int(n) + offset for n in self.ticks["now_ns"]])
        for time_ns, data in topics["/ticks"][:10] + topics["/tf"][:10] + topics["/events"]:
            self.assertEqual(time_ns, data["timestamp"]["sec"] * 10**9 + data["timestamp"]["nsec"])
        properties = head["schemas"]["wrenchd.Tick"]["properties"]
        for name in self.ticks.dtype.names[:-2]:
            field = self.recording.fields["ticks"][name]
            values = self.ticks[name].reshape(len(self.ticks), -1)
            got = [data[name] for _, data in topics["/ticks"]]
            self.assertIn(name, properties)
            for i, (component, _) in enumerate(field.components):
                column = [one[component] for one in got] if field.count > 1 else got
                if field.values and not field.bits:
                    column = [field.values.index(one) for one in column]
                if values.dtype.kind == "f":
                    finite = np.isfinite(values[:, i])
                    self.assertTrue(same([one is not None for one in column], finite), name)
                    column = np.array([math.nan if one is None else one for one in column], float)
                    self.assertTrue(same(column[finite], values[:, i][finite]), name)
                else:
                    self.assertEqual(column, [int(v) for v in values[:, i]], name)
        proxy = [data for _, data in topics["/tf"] if data["child_frame_id"] == "tool_proxy"]
        valid = np.isfinite(self.ticks["X_WQ"]).all(axis=1)
        numbers = [[d["translation"][k] for k in "xyz"] + [d["rotation"][k] for k in "xyzw"] for d in proxy]
        self.assertTrue(same(numbers, self.ticks["X_WQ"][valid]))
        numbers = [[d["pose"]["position"][k] for k in "xyz"] + [d["pose"]["orientation"][k] for k in "xyzw"]
                   for _, d in topics["/pose/commanded"]]
        self.assertTrue(same(numbers, self.ticks["X_WP"]))
        numbers = [[d["force"][k] for k in "xyz"] + [d["torque"][k] for k in "xyz"] for _, d in topics["/wrench/out"]]
        self.assertTrue(same(numbers, self.ticks["F_out"]))
        self.assertEqual([data["message"] for _, data in topics["/events"]],
                         list(self.recording.events().sort_values("time_ns", kind="stable")["text"]))
        self.assertEqual(topics["/conditions"][2][1] | {"timestamp": None},
                         {"timestamp": None, "marker": "trial 3 – über", "stiffness": 2000.5, "surface": "rubber, soft", "load": -1})


def _with(row, **changes):
    row = row.copy()
    for name, value in changes.items():
        row[name] = value
    return row


if __name__ == "__main__":
    warnings.simplefilter("error")
    WORK.mkdir(parents=True, exist_ok=True)
    result = unittest.main(argv=sys.argv[:1], exit=False).result
    if not result.wasSuccessful():
        sys.exit(1)
    if not READ_MCAP:
        print("no node: MCAP was not read")
        sys.exit(77)
