# SPDX-License-Identifier: GPL-3.0-or-later
"""Sweeps: a function, or a run of the daemon in virtual time, for every point of a grid.

    run = wrenchd.DaemonRun("config/wrenchd.toml", seconds=4)
    table = wrenchd.sweep(run, {"wrench.stiffness.linear_N_per_m": [200, 600, 1200],
                                "simulation.command_delay_s": [2e-4, 2e-3]}, out="stability.csv", engine=2)
    table.frame()     # pandas.DataFrame: the grid and the results of each run

engine: "serial"; a number of processes; "dask" for a cluster on this machine; or the address of a Dask scheduler
("tcp://host:8786"). All engines give the same bytes. A journal beside the table has each finished run, so the same call
continues a sweep that was interrupted or killed. A run whose process dies is repeated.

`wrenchctl sweep FILE.toml` runs a sweep of the daemon without a program; parts of it suit an array of Slurm jobs.
"""

import argparse
import contextlib
import csv
import ctypes
import fcntl
import hashlib
import io
import itertools
import json
import math
import multiprocessing
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from .errors import WrenchdError

_ATTEMPTS = 4  # processes that may die on one run before the sweep stops
_PR_SET_PDEATHSIG = 1


class SweepError(WrenchdError):
    """A sweep cannot start or continue. The message names the place and the remedy."""


# --- the grid -------------------------------------------------------------------------------------------------------------


def grid_points(grid):
    """Returns the points of a grid, one dict each. grid: dict of lists (every combination, the last name varies fastest), or
    a list of dicts. Raises SweepError if it is empty or a list is."""
    if isinstance(grid, dict):
        for name, values in grid.items():
            if isinstance(values, (str, bytes, dict)) or not hasattr(values, "__len__"):
                raise SweepError(f"grid: '{name}' must be a list of values, as [1, 2]")
            if len(values) == 0:
                raise SweepError(f"grid: '{name}' has no values; give at least one")
        points = [dict(zip(grid, values)) for values in itertools.product(*grid.values())] if grid else []
    else:
        points = [dict(point) for point in grid]
    if not points:
        raise SweepError("grid: there is no point; give at least one value")
    return [{name: _plain(value) for name, value in point.items()} for point in points]


def _plain(value):
    """Returns the value as JSON has it: numpy's numbers become Python's."""
    if hasattr(value, "item") and getattr(value, "ndim", 0) == 0:
        value = value.item()
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    return str(value)


def _checked(function, point):
    """Runs one point. An exception of the function becomes the column "error" of its row. OSError and MemoryError, such as a
    full disk, end the sweep, which continues later."""
    try:
        result = function(dict(point))
    except (OSError, MemoryError):
        raise  # of the machine, not of the point
    except Exception as error:  # noqa: BLE001: one bad point must not end the sweep
        return {"error": f"{type(error).__name__}: {error}"}
    if not isinstance(result, dict):
        result = {"result": result}
    return {str(name): _plain(value) for name, value in result.items()}


# --- the journal ----------------------------------------------------------------------------------------------------------


class _Journal:
    """Finished runs, one JSON line each, after a line with the identity of the sweep. Safe against a kill at any instant: a
    torn last line is dropped. While a process writes the journal, it holds a lock."""

    def __init__(self, file, identity):
        self.file, self.identity = Path(file), identity
        self._out = None

    @staticmethod
    def read(file, identity):
        """Returns the results by run in a journal, and the length of its complete lines."""
        done, length = {}, 0
        for number, line in enumerate(Path(file).read_bytes().splitlines(keepends=True)):
            try:
                row = json.loads(line) if line.endswith(b"\n") else None
            except ValueError:
                row = None
            if not isinstance(row, dict):
                break
            if number == 0 and row.get("sweep") != identity:
                raise SweepError(f"{file}: belongs to a sweep with another grid, function or configuration; remove it, or name "
                                 "another table")
            if number > 0:
                done[row["run"]] = row["result"]
            length += len(line)
        return done, length

    def open(self):
        self._out = open(self.file, "ab")
        try:
            fcntl.flock(self._out, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._out.close()
            raise SweepError(f"{self.file}: another process runs this sweep; wait for it, or end it") from None
        done, length = self.read(self.file, self.identity)
        self._out.truncate(length)
        self._out.seek(0, os.SEEK_END)
        if length == 0:
            self._write({"sweep": self.identity})
        return done

    @staticmethod
    def check_unlocked(file):
        """Raises SweepError if a process writes this journal."""
        with open(file, "rb") as other:
            try:
                fcntl.flock(other, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except OSError:
                raise SweepError(f"{file}: another process still runs this part; wait for it, or end it") from None

    def add(self, run, result):
        self._write({"run": run, "result": result})

    def _write(self, row):
        self._out.write(json.dumps(row).encode() + b"\n")
        self._out.flush()
        os.fsync(self._out.fileno())

    def close(self):
        if self._out is not None:
            self._out.close()


# --- engines --------------------------------------------------------------------------------------------------------------


def _run_serial(function, points, todo, finished):
    for run in todo:
        finished(run, _checked(function, points[run]))


def _die_with_parent():
    """A worker must not outlive a client that was killed."""
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the client ends the workers


def _run_processes(function, points, todo, finished, count):
    from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
    from concurrent.futures.process import BrokenProcessPool

    waiting, deaths = list(reversed(todo)), dict.fromkeys(todo, 0)
    while waiting:
        running = {}
        pool = ProcessPoolExecutor(count, initializer=_die_with_parent)
        try:
            while waiting or running:
                while waiting and len(running) < count:
                    running[pool.submit(_checked, function, points[waiting[-1]])] = waiting[-1]
                    waiting.pop()
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    result = future.result()
                    finished(running.pop(future), result)
        except BrokenProcessPool:
            # A worker died. Its pool does not say which run it had, so every run under way is repeated.
            for future, run in list(running.items()):
                if future.done() and future.exception() is None:
                    finished(run, future.result())
                    continue
                deaths[run] += 1
                if deaths[run] >= _ATTEMPTS:
                    raise SweepError(f"run {run} {points[run]}: {_ATTEMPTS} processes died while it ran; see the system's log for "
                                     "the reason, such as too little memory") from None
                waiting.append(run)
            waiting.sort(reverse=True)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


_NEEDS_GUARD = ('the workers of engine "dask" import the program that calls sweep(); put its call under '
                'if __name__ == "__main__":')


def _nothing():
    pass


def _require_guard():
    """Raises SweepError if a process that imports the main program begins the sweep again. Dask would start such workers
    without end."""
    trial = multiprocessing.get_context("spawn").Process(target=_nothing)
    trial.start()
    trial.join()
    if trial.exitcode != 0:
        raise SweepError(_NEEDS_GUARD)


def _run_dask(function, points, todo, finished, address, count):
    try:
        import distributed
    except ImportError as error:
        raise ImportError(f"a sweep on Dask needs distributed ({error}); install Debian's python3-distributed") from error
    with contextlib.ExitStack() as stack:
        if address is None:
            _require_guard()
            cluster = distributed.LocalCluster(n_workers=count, threads_per_worker=1, processes=True, dashboard_address=None,
                                               silence_logs=50)
            address = stack.enter_context(cluster)
        client = stack.enter_context(distributed.Client(address, set_as_default=False))
        futures = {client.submit(_checked, function, points[run], pure=False): run for run in todo}
        for future in distributed.as_completed(futures, loop=client.loop):
            run = futures[future]
            error = future.exception()
            if error is not None:
                raise SweepError(f"run {run} {points[run]}: {type(error).__name__}: {error}; the same command continues the sweep")
            finished(run, future.result())
            future.release()


# --- sweep ----------------------------------------------------------------------------------------------------------------


class SweepTable:
    """The result of a sweep. file: the CSV file; rows: one dict for each run, in the order of the grid: run, the point, the
    results."""

    def __init__(self, file, rows):
        self.file, self.rows = Path(file), rows

    def frame(self):
        """Returns the table as a pandas.DataFrame with the index `run`."""
        try:
            import pandas
        except ImportError as error:
            raise ImportError(f"frame() needs pandas ({error}); install Debian's python3-pandas") from error
        return pandas.DataFrame(self.rows).set_index("run")

    def __len__(self):
        return len(self.rows)


class _Progress:
    def __init__(self, total, done, shown):
        self.total, self.done, self.shown = total, done, shown
        self.begun, self.at_start, self.last = time.monotonic(), done, 0.0

    def step(self):
        self.done += 1
        now = time.monotonic()
        if self.shown and (now - self.last > 0.1 or self.done == self.total):
            self.last = now
            self.show(now)

    def show(self, now):
        per_s = (self.done - self.at_start) / max(now - self.begun, 1e-9)
        left_s = int((self.total - self.done) / per_s) if per_s > 0 else 0
        bar = "#" * (30 * self.done // self.total)
        sys.stderr.write(f"\r[{bar:<30}] {self.done}/{self.total}  {per_s:.1f} runs/s  {left_s // 60}:{left_s % 60:02} left ")
        sys.stderr.flush()

    def end(self):
        if self.shown and self.last > 0.0:
            sys.stderr.write("\n")


def _identity(function, points):
    """A digest of what determines the table: the points, and what the function says of itself."""
    identity = getattr(function, "identity", None)
    what = identity() if callable(identity) else f"{getattr(function, '__module__', '')}.{getattr(function, '__qualname__', type(function).__name__)}"
    return hashlib.sha256(json.dumps([what, points], sort_keys=True).encode()).hexdigest()


def _csv_cell(value):
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value)
    return json.dumps(value) if isinstance(value, (dict, list)) else str(value)


def _write_table(file, rows):
    columns = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(columns)
    for row in rows:
        table.writerow([_csv_cell(row.get(name)) for name in columns])
    part = Path(f"{file}.{os.getpid()}.part")
    with open(part, "w", encoding="utf-8") as out:
        out.write(text.getvalue())
        out.flush()
        os.fsync(out.fileno())
    os.replace(part, file)


def sweep(function, grid, out, engine="serial", part=None, progress=None, workers=2):
    """Runs function(point) for every point of the grid, and writes the table `out` (CSV). Returns SweepTable.

    function: takes a dict and returns a dict of numbers and texts, or one value. It must be importable by the workers
    (a function of a module, or DaemonRun), and must return the same for the same point; a seed is a name of the grid like
    any other. An exception becomes the column `error` of its row.
    grid: dict of lists, or list of dicts (grid_points()).
    engine: "serial", a number of processes, "dask" (a cluster of `workers` processes on this machine; a program then calls
    sweep() under if __name__ == "__main__":), or the address of a Dask scheduler.
    part: (k, n) runs only every n-th run, from run k on, with a journal of its own, and returns None; a call without
    `part` afterwards reads all journals, runs what is missing, and writes the table.
    progress: shows a bar on standard error; default: if that is a terminal.

    Raises SweepError. If the call is interrupted, or the process is killed, the same call continues from its journal. The
    journals are removed when the table is written.
    """
    # True in a process that is about to import the main program: a worker of Dask must not begin a sweep of its own.
    if engine == "dask" and getattr(multiprocessing.current_process(), "_inheriting", False):
        raise SweepError(_NEEDS_GUARD)
    points = grid_points(grid)
    out = Path(out)
    identity = _identity(function, points)
    if part is not None:
        k, n = part
        if not (isinstance(k, int) and isinstance(n, int) and 0 <= k < n):
            raise SweepError(f"part: {k}/{n} is no part; the first of n parts is 0/n, the last is n-1/n")
    journal = _Journal(f"{out}.journal" + (f".{part[0]}-of-{part[1]}" if part else ""), identity)
    done = journal.open()
    try:
        others = [file for file in sorted(out.parent.glob(f"{out.name}.journal*")) if file != journal.file]
        for other in others:
            if part is None:
                _Journal.check_unlocked(other)
            done = {**_Journal.read(other, identity)[0], **done}
        todo = [run for run in range(len(points)) if run not in done and (part is None or run % part[1] == part[0])]
        bar = _Progress(len(todo) + len(done), len(done), sys.stderr.isatty() if progress is None else progress)

        def finished(run, result):
            if run in done:
                return
            journal.add(run, result)
            done[run] = result
            bar.step()

        try:
            _run(engine, function, points, todo, finished, workers)
        except (OSError, MemoryError) as error:
            raise SweepError(f"a run failed, {len(done)} of {len(points)} are done: {type(error).__name__}: {error}; the same command "
                             "continues the sweep") from error
        finally:
            bar.end()
        if part is not None:
            return None
        rows = [{"run": run, **points[run], **{_free(name, points[run]): v for name, v in done[run].items()}} for run in range(len(points))]
        _write_table(out, rows)
        for file in (journal.file, *others):
            file.unlink(missing_ok=True)
        return SweepTable(out, rows)
    finally:
        journal.close()


def _free(name, point):
    """A result must not hide the value of the grid that has the same name."""
    return f"result.{name}" if name in point or name == "run" else name


def _run(engine, function, points, todo, finished, workers):
    if not todo:
        return
    if engine == "serial":
        _run_serial(function, points, todo, finished)
    elif isinstance(engine, int) and not isinstance(engine, bool) and engine >= 1:
        _run_processes(function, points, todo, finished, engine)
    elif engine == "dask":
        _run_dask(function, points, todo, finished, None, workers)
    elif isinstance(engine, str) and "://" in engine:
        _run_dask(function, points, todo, finished, engine, workers)
    else:
        raise SweepError(f"engine: '{engine}' is none; use serial, a number of processes, dask, or the address of a Dask scheduler")


# --- runs of the daemon ---------------------------------------------------------------------------------------------------


def measures(recording):
    """Returns what a sweep of the daemon tells of a run: a dict of numbers and texts that depend on the configuration only."""
    import numpy as np

    ticks = recording.ticks
    names = {name: recording.fields["ticks"][name].values for name in ("state", "state_cause")}
    if not len(ticks):
        return {"ticks": 0}
    force = np.linalg.norm(ticks["F_out"][:, :3], axis=1)
    torque = np.linalg.norm(ticks["F_out"][:, 3:], axis=1)
    active = ticks["state"] == names["state"].index("active")
    depth = np.linalg.norm(ticks["eps"][:, :3], axis=1)
    caused = ticks["state_cause"][ticks["state_cause"] != 0]
    last = int(caused[-1]) if len(caused) else 0
    step = np.diff(force, prepend=force[:1])
    turned = np.sign(step[1:]) * np.sign(step[:-1]) < 0
    return {
        "ticks": len(ticks),
        "active_share": float(active.mean()),
        "contact_share": float((ticks["contacts"] > 0).mean()),
        "max_force_N": float(force.max()),
        "max_torque_Nm": float(torque.max()),
        "max_depth_m": float(np.nanmax(depth)) if np.isfinite(depth).any() else math.nan,
        "stiffness_scale": float(ticks["stiffness_scale"][active].min()) if active.any() else math.nan,
        "injected_J": float(ticks["injected_J"].max()),
        # Ripple: mean change of the force between ticks where the change turns round. It grows with an oscillation.
        "ripple_N": float(np.abs(step[1:])[turned].mean()) if turned.any() else 0.0,
        "last_fault": names["state_cause"][last] if last < len(names["state_cause"]) else str(last),
    }


class DaemonRun:
    """A function for sweep(): runs wrenchd in virtual time with the simulated device, and returns measures() of its recording.

    config: wrenchd.toml on which the points are based. Names of a point are settings, as "wrench.stiffness.linear_N_per_m",
    "scene", "device.profile", "simulation.hand_script" or "simulation.command_delay_s"; files are relative to `config`.
    seconds: virtual time of a run. measure: a function of a module that takes a Recording and returns a dict, instead of
    measures(). program: wrenchd, searched in PATH. A run that wrenchd rejects is a row with the column `error`.
    """

    _FILES = ("scene", "simulation.hand_script", "simulation.playback")

    def __init__(self, config, seconds=5.0, measure=measures, program="wrenchd"):
        import tomllib  # since Python 3.11

        self.config = Path(config).resolve()
        self.seconds, self.measure, self.program = float(seconds), measure, program
        self._found_program()
        try:
            self.text = self.config.read_text(encoding="utf-8")
            self.settings = tomllib.loads(self.text)
        except OSError as error:
            raise SweepError(f"{config}: cannot be read ({error.strerror}); name a wrenchd.toml") from error
        except tomllib.TOMLDecodeError as error:
            raise SweepError(f"{config}: {error}") from error

    def identity(self):
        return {"config": self.text, "seconds": self.seconds, "measure": f"{self.measure.__module__}.{self.measure.__qualname__}"}

    def __call__(self, point):
        from .recording import Recording

        program = self._found_program()
        with tempfile.TemporaryDirectory(prefix="wrenchd-sweep-") as directory:
            file, recording = Path(directory) / "run.toml", Path(directory) / "run.h5"
            file.write_text(to_toml(self._settings_of(point)), encoding="utf-8")
            done = subprocess.run([program, "--config", file, "--virtual-time", "--seconds", repr(self.seconds), "--arm", "--control",
                                   "none", "--record", recording], capture_output=True, text=True, check=False)
            if done.returncode not in (0, 3):
                said = [line for line in done.stderr.splitlines() if line.startswith("wrenchd: ")] or done.stderr.splitlines()[-1:]
                raise SweepError(" ".join(said).replace(directory + os.sep, "") or f"wrenchd ended with {done.returncode}")
            return {"exit_code": done.returncode, **self.measure(Recording(recording))}

    def _found_program(self):
        found = shutil.which(self.program)
        if found is None:
            raise SweepError(f"{self.program}: there is no such program in PATH; install wrenchd, or name it with program=")
        return found

    def _settings_of(self, point):
        settings = json.loads(json.dumps(self.settings))
        for name, value in point.items():
            table, keys = settings, name.split(".")
            for key in keys[:-1]:
                table = table.setdefault(key, {})
                if not isinstance(table, dict):
                    raise SweepError(f"grid: '{name}' is no setting, because '{key}' is a value")
            table[keys[-1]] = value
        # The run has its own directory, so relative files of the configuration get its directory.
        for name in self._FILES:
            table, key = settings, name
            if "." in name:
                table, key = settings.get(name.split(".")[0], {}), name.split(".")[1]
            if table.get(key) and (self.config.parent / table[key]).exists():
                table[key] = str(self.config.parent / table[key])
        return settings


def to_toml(tables):
    """Returns nested dicts of texts, numbers, booleans and lists as TOML."""

    def value(x):
        if isinstance(x, dict):
            return "{ " + ", ".join(f"{json.dumps(k)} = {value(v)}" for k, v in x.items()) + " }"
        if isinstance(x, list):
            return "[" + ", ".join(map(value, x)) + "]"
        if isinstance(x, bool):
            return "true" if x else "false"
        if isinstance(x, float):
            return repr(x) if math.isfinite(x) else ("nan" if math.isnan(x) else ("inf" if x > 0 else "-inf"))
        return str(x) if isinstance(x, int) else json.dumps(str(x), ensure_ascii=False)

    lines = [f"{json.dumps(k)} = {value(v)}" for k, v in tables.items() if not isinstance(v, dict)]
    for name, table in tables.items():
        if isinstance(table, dict):
            lines += ["", f"[{json.dumps(name)}]", *(f"{json.dumps(k)} = {value(v)}" for k, v in table.items())]
    return "\n".join(lines) + "\n"


# --- wrenchctl sweep ------------------------------------------------------------------------------------------------------


def load_sweep(file):
    """Reads a sweep of the daemon from a TOML file. Returns (function, grid, out, engine). Raises SweepError with file and key.

    out: table to write; engine: see sweep(), default serial; [run]: config, seconds; [grid]: lists of values by setting.
    Files are relative to the file.
    """
    import tomllib

    file = Path(file)
    try:
        parsed = tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise SweepError(f"{file}: cannot be read ({error.strerror}); name a sweep file") from error
    except tomllib.TOMLDecodeError as error:
        raise SweepError(f"{file}: {error}") from error
    known = {"": {"out": str, "engine": (str, int), "run": dict, "grid": dict}, "run": {"config": str, "seconds": (int, float)}}
    for place, keys in known.items():
        for key, found in (parsed if not place else parsed.get(place, {})).items():
            name = f"{place}.{key}".lstrip(".")
            if key not in keys:
                raise SweepError(f"{file}: '{name}' is no key of a sweep; the keys are {', '.join(keys)}")
            if not isinstance(found, keys[key]) or isinstance(found, bool):
                raise SweepError(f"{file}: '{name}' has a wrong type: {found!r}")
    for key in ("out", "grid", "run"):
        if key not in parsed:
            raise SweepError(f"{file}: '{key}' is missing; see the guide of tools, Sweeps")
    if "config" not in parsed["run"]:
        raise SweepError(f"{file}: 'run.config' is missing; name a wrenchd.toml")
    grid = {}

    def flatten(table, prefix):
        for key, found in table.items():
            if isinstance(found, dict):
                flatten(found, f"{prefix}{key}.")
            else:
                grid[prefix + key] = found

    flatten(parsed["grid"], "")
    try:
        grid_points(grid)
    except SweepError as error:
        raise SweepError(f"{file}: {error}") from error
    function = DaemonRun(file.parent / parsed["run"]["config"], parsed["run"].get("seconds", 5.0))
    return function, grid, file.parent / parsed["out"], parsed.get("engine", "serial")


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="wrenchctl sweep", description="Runs wrenchd in virtual time for every point of a grid.")
    parser.add_argument("file", help="TOML file: out, engine, [run] and [grid]")
    parser.add_argument("--engine", help="replaces the engine of the file: serial, a number of processes, dask, or tcp://HOST:PORT")
    parser.add_argument("--part", help="K/N: only every N-th run from run K on, as in an array of Slurm jobs")
    options = parser.parse_args(arguments)
    try:
        function, grid, out, engine = load_sweep(options.file)
        if options.engine:
            engine = int(options.engine) if options.engine.isdigit() else options.engine
        part = None
        if options.part:
            match = re.fullmatch(r"(\d+)/(\d+)", options.part)
            if not match:
                raise SweepError(f"--part {options.part}: expected K/N, as 0/8")
            part = int(match[1]), int(match[2])
        table = sweep(function, grid, out, engine, part)
    except (WrenchdError, ImportError) as error:
        print(f"wrenchctl: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\nwrenchctl: interrupted; the same command continues the sweep", file=sys.stderr)
        return 130
    print(f"part {options.part} is done; the command without --part writes the table" if table is None else f"{out}: {len(table)} runs")
    return 0


if __name__ == "__main__":
    sys.exit(main())
