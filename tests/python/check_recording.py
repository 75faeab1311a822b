# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks a recording with h5py alone, without wrenchd's package. Usage: check_recording.py FILE"""
import datetime
import hashlib
import sys

import h5py
import numpy as np

UNITS = {
    "X_WP": "m m m, qx qy qz qw",
    "F_out": "N x3, N.m x3",
    "energy_in_J": "J",
    "now_ns": "ns",
    "V_BH": "m/s x3, rad/s x3",
    "eps": "m x3, rad x3",
    "device_time_s": "s",
}


def check(what, good):
    if not good:
        sys.exit("failed: " + what)


with h5py.File(sys.argv[1], "r") as file:
    ticks, contacts, events = file["ticks"], file["contacts"], file["events"]
    for name, unit in UNITS.items():
        check(name + " has its unit", ticks.attrs[name + ".unit"] == unit)
    for table in (ticks, contacts, events):
        for name in table.dtype.names:
            check(name + " has a unit", len(table.attrs[name + ".unit"]) > 0)
            check(name + " has a meaning", len(table.attrs[name + ".doc"]) > 0)
    check("the frame of F_T", ticks.attrs["F_T.frame"] == "axes of T, about its centre of mass")
    names = ticks.attrs["state.values"].removeprefix("from 0: ").split(", ")
    check("states have names", names[5] == "active")

    fields = file["fields"]
    check("one row per column", len(fields) == sum(len(t.dtype.names) for t in (ticks, contacts, events)))
    rows = {(row["table"].decode(), row["name"].decode()): row for row in fields}
    check("the table of fields has units", rows[("ticks", "F_out")]["unit"].decode() == UNITS["F_out"])
    check("the table of fields has counts", rows[("ticks", "F_out")]["count"] == 6)

    # The columns are numbers.
    force = ticks["F_out"]
    check("F_out has six numbers per tick", force.shape == (len(ticks), 6))
    state = ticks["state"]
    check("the loop was active", np.any(state == names.index("active")))
    check("the force exceeded 0.5 N", np.max(force[:, 2]) > 0.5)
    check("no tick is missing", np.all(np.diff(ticks["tick"].astype(np.int64)) <= 1))
    check("times increase", np.all(np.diff(ticks["now_ns"]) >= 0))
    rate = 1e9 / np.median(np.diff(ticks["now_ns"]))
    check("the rate attribute matches the ticks", abs(rate - file.attrs["rate_Hz"]) < 0.02 * rate)

    # The contacts of a tick are rows of the other table. Their normals have unit length, and their load fractions sum
    # to 1.
    some = np.flatnonzero(ticks["contact_count"] > 0)
    check("the tool was in contact", len(some) > 100)
    for row in ticks[some[:: max(len(some) // 50, 1)]]:
        of_tick = contacts[row["first_contact"] : row["first_contact"] + row["contact_count"]]
        check("the number of contacts matches", len(of_tick) == min(row["contacts"], 16))
        check("unit normals", np.allclose(np.linalg.norm(of_tick["normal_W"], axis=1), 1.0))
        load = np.sum(of_tick["load_fraction"])
        check("load fractions sum to 1", load == 0.0 or abs(load - 1.0) < 1e-6)

    # The events of the loop name the tick in which they happened.
    changes = events[:][events["name"] == b"state"]
    of_ticks = state[:]
    entered = {names[number] for number in of_ticks[1:][np.diff(of_ticks.astype(int)) != 0]}
    check("changes of the state are events", {b"state: " + name.encode() for name in entered} <= set(changes["text"]))
    for row in changes[changes["tick"] >= 0]:
        at = np.flatnonzero(ticks["tick"] == row["tick"])
        check("an event has the tick of its time", len(at) and row["time_ns"] == ticks["now_ns"][at[0]])

    # The configuration of the run.
    check("the settings", "[servo]" in file["config/settings"][()].decode())
    check("the scene", "[tool]" in file["config/scene"][()].decode())
    check("the profile", "name" in file["config/profile"][()].decode())
    mesh = file["meshes/tool"]
    check("the tool is embedded", mesh.attrs["embedded"] == 1)
    check("the mesh matches its SHA-256", hashlib.sha256(bytes(mesh[:])).hexdigest() == mesh.attrs["sha256"])
    for name in ("format", "wrenchd_version", "kernel", "realtime", "clock"):
        check(name + " has a value", len(file.attrs[name]) > 0)

    # UTC of a tick.
    started = datetime.datetime.fromisoformat(file.attrs["started_utc"].replace("Z", "+00:00"))
    check("both start times agree", abs(started.timestamp() - 1e-9 * file.attrs["started_unix_ns"]) < 1e-5)
    if file.attrs["clock"] == "CLOCK_MONOTONIC":
        first = 1e-9 * (file.attrs["started_unix_ns"] + ticks["now_ns"][0] - file.attrs["started_ns"])
        check("the recording started within the last 600 s", 0 <= datetime.datetime.now().timestamp() - first < 600)
    print(len(ticks), "ticks,", len(contacts), "contacts")
