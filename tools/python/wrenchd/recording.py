# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings as data: the HDF5 files of `wrenchd --record` and of `wrenchctl record`, in numpy and pandas.

    recording = wrenchd.Recording("run.h5")
    ticks = recording.frame()          # pandas.DataFrame, one column a component: "F_out.fx"
    ticks.attrs["units"]["F_out.fx"]   # "N"
    recording.contacts(), recording.events(), recording.markers(), recording.resample(100)

The module needs h5py; frame(), contacts(), events(), markers() and resample() also need pandas. The file describes its own
columns, so this module has no list of them. A column that the file describes wrongly is an error, with its place.
"""

import json
import os

import numpy as np

from .errors import WrenchdError

FORMAT = "9"  # recording format that this module reads, as daemon/recording/recording_file.cpp writes it

# Names of the components of an array field, by its unit. Other arrays are numbered.
_POSE = (("px", "m"), ("py", "m"), ("pz", "m"), ("qx", "1"), ("qy", "1"), ("qz", "1"), ("qw", "1"))
_BODIES = 8  # free bodies that a scene may have
_COMPONENTS = {
    "m m m, qx qy qz qw": _POSE,
    "m m m, qx qy qz qw, of each body": tuple((f"body{body}.{name}", unit) for body in range(_BODIES) for name, unit in _POSE),
    "N x3, N.m x3": (("fx", "N"), ("fy", "N"), ("fz", "N"), ("tx", "N.m"), ("ty", "N.m"), ("tz", "N.m")),
    "m/s x3, rad/s x3": (("vx", "m/s"), ("vy", "m/s"), ("vz", "m/s"), ("wx", "rad/s"), ("wy", "rad/s"), ("wz", "rad/s")),
    "m x3, rad x3": (("x", "m"), ("y", "m"), ("z", "m"), ("rx", "rad"), ("ry", "rad"), ("rz", "rad")),
    "ns x5: read projection wrench limits write": tuple((s, "ns") for s in ("read", "projection", "wrench", "limits", "write")),
    "m x3": (("x", "m"), ("y", "m"), ("z", "m")),
    "1 x3": (("x", "1"), ("y", "1"), ("z", "1")),
}
_QUATERNION = ("qx", "qy", "qz", "qw")
_FROM_ZERO = "from 0: "
_BITS = "bits from the lowest: "


class RecordingError(WrenchdError):
    """A recording cannot be read. The message names the file, the reason and the remedy."""


def _import(name, package, what):
    try:
        return __import__(name)
    except ImportError as error:
        raise ImportError(f"{what} needs {name} ({error}); install Debian's {package}, or run 'pip install {name}'") from error


class Field:
    """A column of a table: what it means.

    table: "ticks", "contacts" or "events". name, type ("f64", "u8", "text", ...), count: number of components; unit,
    frame, doc: texts; values: names of the values from 0, or of the bits from the lowest; bits: True if they are bits.
    components: (name, unit) of each component, one without a name if count is 1.
    """

    def __init__(self, table, name, kind, count, unit, frame, doc, values):
        self.table, self.name, self.type, self.count = table, name, kind, count
        self.unit, self.frame, self.doc = unit, frame, doc
        self.bits = values.startswith(_BITS)
        text = values.removeprefix(_BITS).removeprefix(_FROM_ZERO)
        self.values = text.split(", ") if text else []

    @property
    def components(self):
        if self.count == 1:
            return [("", self.unit)]
        named = _COMPONENTS.get(self.unit, ())
        if len(named) == self.count:
            return list(named)
        return [(str(i), self.unit) for i in range(self.count)]

    @property
    def columns(self):
        """(column, unit) of each component: [("F_out.fx", "N"), ...]."""
        return [(self.name + ("." + name if name else ""), unit) for name, unit in self.components]

    def __repr__(self):
        return f"<{self.table}.{self.name} [{self.unit}] {self.doc}>"


def _text(value):
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


class Recording:
    """A recording in memory.

    file: path, or an open binary file as Client.open_recording() returns it. Reads everything, and closes the file.
    Raises RecordingError, with the place and the remedy, if the file is not a recording of the format that this module
    reads, or if it is damaged.

    ticks: numpy structured array, one row per tick. contact_rows: the same for contacts. fields: Field by table and
    name, as recording.fields["ticks"]["F_out"]. settings, scene, profile: texts of the configuration of the run.
    config: all texts by name. attributes: of the file, such as "rate_Hz" and "started_utc".
    """

    def __init__(self, file):
        h5py = _import("h5py", "python3-h5py", "wrenchd.Recording")
        self.name = os.fspath(file) if isinstance(file, (str, os.PathLike)) else getattr(file, "name", "recording")
        try:
            with h5py.File(file, "r") as opened:
                self._read(opened)
        except RecordingError:
            raise
        except FileNotFoundError as error:
            raise RecordingError(f"{self.name}: does not exist; name a recording of wrenchd") from error
        except BlockingIOError as error:
            raise RecordingError(f"{self.name}: is still being written; end it with 'wrenchctl record stop'") from error
        except (OSError, KeyError, ValueError, RuntimeError, TypeError) as error:
            raise RecordingError(f"{self.name}: is damaged, or not a recording of wrenchd ({error}); use a complete copy") from error

    def _reject(self, why):
        raise RecordingError(f"{self.name}: {why}")

    def _read(self, file):
        version = _text(file.attrs.get("wrenchd_version", "of an unknown version"))
        found = _text(file.attrs.get("format", ""))
        if not found and "ticks" not in file:
            self._reject("has no table 'ticks'; name a recording of wrenchd")
        if found != FORMAT:
            self._reject(f"was written by wrenchd {version} in recording format {found or 'before 6'}, and this wrenchd reads format "
                         f"{FORMAT}; replay or export it with the version that wrote it")
        self.attributes = {name: _text(value) if isinstance(value, (bytes, str)) else value.item()
                           for name, value in file.attrs.items()}
        self.fields = {}
        for row in file["fields"][:]:
            field = Field(*(_text(row[key]) for key in ("table", "name", "type")), int(row["count"]),
                          *(_text(row[key]) for key in ("unit", "frame", "doc", "values")))
            self.fields.setdefault(field.table, {})[field.name] = field
        ticks, contacts, events = (self._table(file, name) for name in ("ticks", "contacts", "events"))
        # A process that dies leaves rows that were allocated and not written. They read as zeros.
        written = (ticks["now_ns"] != 0) | (ticks["tick"] != 0)
        last = int(np.flatnonzero(written)[-1]) + 1 if written.any() else 0
        self.ticks = ticks[:last]
        self.contact_rows = contacts
        self._events = events[events["name"] != b""]
        self.config = {name: _text(file["config"][name][()]) for name in file["config"]}
        self.settings, self.scene, self.profile = (self.config.get(k, "") for k in ("settings", "scene", "profile"))

    def _table(self, file, name):
        fields = self.fields.get(name, {})
        data = file[name]
        if data.dtype.names is None or data.ndim != 1 or not fields:
            self._reject(f"table '{name}' has no columns; name a recording of wrenchd")
        for field in fields.values():
            if field.name not in data.dtype.names:
                self._reject(f"column '{field.name}' of table '{name}' is missing; the file was changed, take it as it was recorded")
            shape = data.dtype[field.name].shape
            if shape != (() if field.count == 1 else (field.count,)):
                self._reject(f"column '{field.name}' of table '{name}' has the shape {shape}, and /fields states {field.count} "
                             "components; the file was changed, take it as it was recorded")
        return data[:]

    # Tables

    @property
    def time_s(self):
        """Time of each tick since the first tick, [s], float64 of shape (N,). wrenchctl export computes the same."""
        return 1e-9 * (self.ticks["now_ns"] - self.ticks["now_ns"][:1]).astype(np.float64)

    def frame(self, columns=None, conditions=True):
        """Returns the ticks as a pandas.DataFrame with the index time_s.

        columns: names of fields, as ["F_out", "state"]; default: all. Each component of an array has a column
        ("F_out.fx"). Enumerations are categories. conditions: adds the column "marker" with the label of the newest
        marker, and a column for each condition, which holds until a marker changes it; only if the recording has
        markers. frame.attrs["units"], ["frames"] and ["docs"] have unit, frame and meaning by column.
        """
        frame = self._frame("ticks", self.ticks, columns)
        frame.index = _import("pandas", "python3-pandas", "frame()").Index(self.time_s, name="time_s")
        if conditions:
            for name, values in self._conditions(self.ticks["now_ns"]).items():
                frame[name] = values
                frame.attrs["units"][name] = "condition"
        return frame

    def contacts(self, columns=None):
        """Returns the contacts as a pandas.DataFrame, one row per contact, with the columns time_s and tick of its tick.
        A tick lists at most 16 contacts."""
        pandas = _import("pandas", "python3-pandas", "contacts()")
        first, count = (self.ticks[name].astype(np.int64) for name in ("first_contact", "contact_count"))
        inside = (first >= 0) & (count >= 0) & (first + count <= len(self.contact_rows))
        count = np.where(inside, count, 0)
        row = np.repeat(np.arange(len(self.ticks)), count)
        at = np.repeat(first - (np.cumsum(count) - count), count) + np.arange(int(count.sum()))
        frame = self._frame("contacts", self.contact_rows[at], columns)
        frame.insert(0, "time_s", self.time_s[row])
        frame.insert(1, "tick", self.ticks["tick"][row])
        frame.attrs["units"].update(time_s="s", tick="1")
        frame.index = pandas.RangeIndex(len(frame))
        return frame

    def events(self):
        """Returns events and markers as a pandas.DataFrame: time_s (since the first tick), time_ns, tick (-1 if no tick was
        stored at that time), severity, name, text, value, conditions (dict)."""
        frame = self._frame("events", self._events, None)
        start = self.ticks["now_ns"][0] if len(self.ticks) else 0
        frame.insert(0, "time_s", 1e-9 * (self._events["time_ns"] - start).astype(np.float64))
        frame.attrs["units"]["time_s"] = "s"
        frame["conditions"] = self._parsed_conditions(self._events)
        return frame

    def markers(self):
        """Returns the markers as a pandas.DataFrame: time_s, tick, label, and a column for each condition."""
        events = self.events()
        frame = events[events["name"] == "marker"][["time_s", "tick", "text"]].rename(columns={"text": "label"})
        conditions = events.loc[frame.index, "conditions"]
        for name in self._condition_names():
            frame[name] = [given.get(name) for given in conditions]
        return frame.reset_index(drop=True)

    def resample(self, rate_Hz, columns=None):
        """Returns frame(columns) at this rate, from the first tick to the last. [1/s]

        Numbers of type f64 are interpolated linearly between the two ticks around each time; quaternions are then
        normalised, with signs that make neighbours agree. A component that is NaN in one of the two ticks is NaN.
        Everything else (counters, enumerations, flags, conditions) has the value of the tick before.
        """
        pandas = _import("pandas", "python3-pandas", "resample()")
        if not (np.isfinite(rate_Hz) and rate_Hz > 0.0):
            raise ValueError(f"resample: the rate must be above 0 Hz, not {rate_Hz}")
        frame = self.frame(columns)
        if frame.empty:
            return frame
        time_s = self.time_s
        at = np.arange(int(np.floor(time_s[-1] * rate_Hz * (1.0 + 1e-12))) + 1) / rate_Hz
        before = np.clip(np.searchsorted(time_s, at, side="right") - 1, 0, len(time_s) - 1)
        result = frame.iloc[before].copy()
        result.index = pandas.Index(at, name="time_s")
        for field in self.fields["ticks"].values():
            if field.type != "f64" or field.columns[0][0] not in frame.columns:
                continue
            names = [name for name, _ in field.columns]
            values = np.column_stack([frame[name].to_numpy() for name in names])
            result[names] = _interpolated(time_s, values, at, before, [c for c, _ in field.components])
        result.attrs = frame.attrs
        return result

    # Parts of the above

    def _frame(self, table, rows, columns):
        pandas = _import("pandas", "python3-pandas", "Recording." + ("frame()" if table == "ticks" else table + "()"))
        fields = self.fields[table]
        for name in columns or ():
            if name not in fields:
                raise KeyError(f"the recording has no column '{name}' in {table}; it has {', '.join(fields)}")
        data, attrs = {}, {"units": {}, "frames": {}, "docs": {}}
        for field in (fields[name] for name in columns or fields):
            values = rows[field.name]
            for i, (column, unit) in enumerate(field.columns):
                data[column] = self._column(pandas, field, values if field.count == 1 else values[:, i])
                attrs["units"][column] = unit
                attrs["docs"][column] = field.doc
                if field.frame:
                    attrs["frames"][column] = field.frame
        frame = pandas.DataFrame(data)
        frame.attrs = attrs
        return frame

    @staticmethod
    def _column(pandas, field, values):
        if field.type == "text":
            return [_text(value) for value in values]
        if field.values and not field.bits:
            names = list(field.values)
            beyond = sorted({int(v) for v in np.unique(values) if v >= len(names)})  # a value without a name keeps its number
            codes = np.where(values < len(names), values, 0).astype(np.int64)
            for k, number in enumerate(beyond):
                codes[values == number] = len(names) + k
            return pandas.Categorical.from_codes(codes, categories=names + [str(number) for number in beyond])
        return values

    def _parsed_conditions(self, events):
        parsed = []
        for value in events["conditions"]:
            try:
                given = json.loads(value) if value else {}
            except ValueError as error:
                raise RecordingError(f"{self.name}: the conditions of a marker are not JSON ({error}); the file was changed") from error
            parsed.append(given if isinstance(given, dict) else {})
        return parsed

    def _markers(self):
        rows = self._events[self._events["name"] == b"marker"]
        rows = rows[np.argsort(rows["time_ns"], kind="stable")]
        return rows, self._parsed_conditions(rows)

    def _condition_names(self):
        names = {}
        for given in self._markers()[1]:
            names.update(dict.fromkeys(given))
        return list(names)

    def _conditions(self, now_ns):
        """Label of the newest marker and value of each condition at these times, by column."""
        rows, conditions = self._markers()
        if not len(rows):
            return {}
        newest = np.searchsorted(rows["time_ns"], now_ns, side="right")  # 0: before the first marker
        labels = [None, *(_text(text) for text in rows["text"])]
        columns = {"marker": np.array(labels, dtype=object)[newest]}
        for name in self._condition_names():
            held, value = [None], None
            for given in conditions:
                value = given.get(name, value)
                held.append(value)
            numeric = all(v is None or isinstance(v, (int, float)) for v in held)
            values = np.array([np.nan if v is None else v for v in held], np.float64) if numeric else np.array(held, object)
            columns[name if name not in self.fields["ticks"] and name != "marker" else "condition." + name] = values[newest]
        return columns


def _interpolated(time_s, values, at, before, components):
    """Linear interpolation of the rows of `values`, (N, k), at the times `at`; quaternions are normalised."""
    after = np.minimum(before + 1, len(time_s) - 1)
    span = time_s[after] - time_s[before]
    weight = np.divide(at - time_s[before], span, out=np.zeros_like(at), where=span > 0.0)[:, None]
    low, high = values[before], values[after].copy()
    quaternions = {}
    for i, name in enumerate(components):
        body, _, last = name.rpartition(".")
        if last in _QUATERNION:
            quaternions.setdefault(body, []).append(i)
    for quaternion in quaternions.values():
        flipped = np.sum(low[:, quaternion] * high[:, quaternion], axis=1) < 0.0
        high[np.ix_(flipped, quaternion)] *= -1.0
    with np.errstate(invalid="ignore"):
        result = np.where(weight == 0.0, low, (1.0 - weight) * low + weight * high)
        for quaternion in quaternions.values():
            norm = np.linalg.norm(result[:, quaternion], axis=1)
            between = (weight[:, 0] != 0.0) & (norm > 0.0)
            result[np.ix_(between, quaternion)] /= norm[between][:, None]
    return result
