# SPDX-License-Identifier: GPL-3.0-or-later
"""The daemon's state at the rate of its servo loop, from shared memory that this package maps read-only.

The memory is a ring of records, each with a guard: 2 i + 1 while the daemon writes record i, 2 i + 2 when it is complete.
If the guard is the same before and after a copy, then the copy is consistent. This requires ordered loads, which x86
guarantees. On other processors the interpreter executes thousands of instructions and a lock in between, which orders
the loads in practice.
"""

import fcntl
import mmap
import os
import struct
import sys
import threading
import time

from .errors import Disconnected, ProtocolError, WrenchdError

_VERSION = 2
_F_GET_SEALS = 1034
_F_SEAL_SHRINK = 2
_CONNECTION_CHECK_S = 0.05  # how often a reader that waits asks whether the daemon is there still
_TYPES = {"u8": "B", "u16": "H", "u32": "I", "u64": "Q", "i64": "q", "f64": "d"}


class _Field:
    def __init__(self, described, room):
        self.name = described["name"]
        self.unit = described["unit"]
        self.doc = described["doc"]
        self.count = described["count"]
        self.offset = described["offset"]
        if described["type"] not in _TYPES:
            raise ProtocolError(f"field '{self.name}' of the state has an unknown type; use the package of the "
                                "daemon's version")
        self.code = _TYPES[described["type"]]
        self.values = described.get("values")
        self.bits = described.get("bits")
        self.format = struct.Struct(f"<{self.count}{self.code}")
        if self.offset < 0 or self.offset + self.format.size > room:
            raise ProtocolError(f"field '{self.name}' of the state lies outside of its record")

    def raw(self, record, base=0):
        numbers = self.format.unpack_from(record, base + self.offset)
        return numbers if self.count > 1 else numbers[0]

    def value(self, record, base=0):
        number = self.raw(record, base)
        if self.values:
            return self.values[number] if number < len(self.values) else str(number)
        if self.bits is not None:
            return [self.bits[i] if i < len(self.bits) else f"bit {i}" for i in range(64) if number >> i & 1]
        return bool(number) if self.unit == "bool" else number


class _Layout:
    def __init__(self, described):
        try:
            if described["version"] != _VERSION:
                raise ProtocolError(f"the state's layout has version {described['version']}, but this package "
                                    f"requires version {_VERSION}; use the package of the daemon's version")
            if described["byte_order"] != sys.byteorder or sys.byteorder != "little":
                raise ProtocolError("only little-endian machines are supported")
            self.bytes = described["bytes"]
            self.header_bytes = described["header_bytes"]
            self.written_word = described["written_offset"] // 8
            self.slots = described["slots"]
            self.slot_bytes = described["slot_bytes"]
            self.record_offset = described["record_offset"]
            self.record_bytes = described["record_bytes"]
            self.rate_Hz = described["rate_Hz"]
            if self.slots < 1 or self.header_bytes + self.slots * self.slot_bytes > self.bytes:
                raise ProtocolError("the sizes in the state's layout contradict each other")
            self.fields = {f["name"]: _Field(f, self.record_bytes) for f in described["fields"]}
            contacts = described["contacts"]
            self.contacts_offset = contacts["offset"]
            self.contact_bytes = contacts["bytes"]
            self.max_contacts = contacts["max_count"]
            if self.contacts_offset + self.max_contacts * self.contact_bytes > self.record_bytes:
                raise ProtocolError("the contacts lie outside of the record")
            self.contact_fields = {f["name"]: _Field(f, self.contact_bytes) for f in contacts["fields"]}
        except (KeyError, TypeError) as error:
            raise ProtocolError(f"the state's layout has an unknown format ({error!r}); use the package of the daemon's "
                                "version") from error

    def dtype(self):
        import numpy

        def of(fields, size, extra=()):
            named = [(f.name, (f.code if f.count == 1 else (f.code, (f.count,))), f.offset) for f in fields.values()]
            named += extra
            return numpy.dtype({"names": [n for n, _, _ in named], "formats": [t for _, t, _ in named],
                                "offsets": [o for _, _, o in named], "itemsize": size})

        contact = of(self.contact_fields, self.contact_bytes)
        return of(self.fields, self.record_bytes, [("contact_list", (contact, (self.max_contacts,)), self.contacts_offset)])


class _Names:
    """Caches the names of obstacles by rendering, because a tick may belong to an earlier rendering."""

    _CAPACITY = 8

    def __init__(self, described, ask):
        self._ask = ask
        self._known = {}
        self._keep(described)

    def of(self, rendering, number):
        if rendering > max(self._known):
            try:
                self._keep(self._ask())
            except WrenchdError:
                pass  # the daemon is gone or busy; the obstacle number identifies the obstacle instead
        names = self._known.get(rendering, ())
        return names[number] if number < len(names) else f"obstacle {number}"

    def _keep(self, described):
        try:
            self._known[described["rendering_id"]] = described["obstacles"]
        except (KeyError, TypeError) as error:
            raise ProtocolError(f"the names of obstacles have an unknown format ({error!r}); use the package of the "
                                "daemon's version") from error
        while len(self._known) > self._CAPACITY:
            del self._known[min(self._known)]


class Contact:
    """A contact that constrains the proxy. Attributes: point_W_m, normal_W, load_fraction, multiplier_kg_m, and the names
    obstacle, tool_feature, obstacle_feature. After a change of the scene the first access requests the obstacle names
    from the daemon."""

    def __init__(self, layout, names, record, base):
        for name in ("point_W_m", "normal_W", "load_fraction", "multiplier_kg_m"):
            setattr(self, name, layout.contact_fields[name].value(record, base))
        self.kind = layout.contact_fields["contact_kind"].value(record, base)
        self.obstacle_number = layout.contact_fields["obstacle"].value(record, base)
        self.obstacle = names.of(layout.fields["rendering_id"].value(record), self.obstacle_number)
        self.tool_feature = self._feature(layout, record, base, "tool")
        self.obstacle_feature = self._feature(layout, record, base, "obstacle")

    @staticmethod
    def _feature(layout, record, base, body):
        def of(name):
            return layout.contact_fields[body + name].value(record, base)

        kind = of("_feature_kind")
        if kind in ("plane", "none"):
            return kind
        return f"{kind} {of('_first')}-{of('_second')}" if "edge" in kind else f"{kind} {of('_first')}"

    def __str__(self):
        return f"{self.tool_feature} on {self.obstacle} {self.obstacle_feature}"

    def __repr__(self):
        return f"<{self}, {100 * self.load_fraction:.0f} %>"


class Tick:
    """One tick of the servo loop. Every field of State.describe() is an attribute: a number or a tuple of numbers; the name
    of a state, a fault or another enumerated value; a list of names for bits. contact_list: the contacts in descending
    order of their load. tick["state"] is the number itself."""

    __slots__ = ("_layout", "_names", "_record")

    def __init__(self, layout, names, record):
        self._layout = layout
        self._names = names
        self._record = record

    def __getattr__(self, name):
        try:
            field = self._layout.fields[name]
        except KeyError:
            raise AttributeError(f"a tick has no field '{name}'; State.describe() lists them") from None
        return field.value(self._record)

    def __getitem__(self, name):
        return self._layout.fields[name].raw(self._record)

    def __dir__(self):
        return [*super().__dir__(), *self._layout.fields]

    @property
    def contact_list(self):
        layout = self._layout
        count = min(self.contact_count, layout.max_contacts)
        return [Contact(layout, self._names, self._record, layout.contacts_offset + i * layout.contact_bytes) for i in range(count)]

    def __repr__(self):
        return f"<tick {self.tick}: {self.state}>"


class State:
    """Reads the ticks. The daemon does not wait for readers: a slow reader misses ticks, and `missed` counts them.
    Client.open_state() creates the object. Each thread needs its own object."""

    def __init__(self, layout, descriptor, is_connected=lambda: True, request_names=lambda: {}):
        try:
            self._layout = _Layout(layout)
            self._names = _Names(layout, request_names)
            seals = fcntl.fcntl(descriptor, _F_GET_SEALS)
            if not seals & _F_SEAL_SHRINK or os.fstat(descriptor).st_size < self._layout.bytes:
                raise ProtocolError("the state's memory is not sealed, or too small")
            self._memory = mmap.mmap(descriptor, self._layout.bytes, mmap.MAP_SHARED, mmap.PROT_READ)
        finally:
            os.close(descriptor)
        self._words = memoryview(self._memory).cast("Q")  # reads a word with one load, not byte by byte
        self._in_order = threading.Lock()
        self._is_connected = is_connected
        self._next_check = 0.0
        self._next = self._written()
        self.missed = 0  # ticks that the daemon overwrote before next() read them

    def close(self):
        self._words.release()
        self._memory.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    @property
    def rate_Hz(self):
        """Configured rate of the servo loop."""
        return self._layout.rate_Hz

    @property
    def unread(self):
        """Number of ticks that next() has not read yet."""
        return self._written() - self._next

    def describe(self):
        """Returns the fields of a tick: {name: (unit, meaning)}."""
        return {field.name: (field.unit, field.doc) for field in self._layout.fields.values()}

    def latest(self):
        """Returns the newest tick, independent of next(). None if there is no tick yet."""
        while True:
            written = self._written()
            if written == 0:
                return None
            record = self._copy(written - 1)
            if record is not None:
                return Tick(self._layout, self._names, record)

    def next(self, timeout_s=1.0):
        """Waits for the next tick. Returns None if none came in time. If the daemon has overwritten ticks, continues
        with newer ones, and `missed` grows. Raises Disconnected if the daemon is gone."""
        record = self._next_record(timeout_s)
        return None if record is None else Tick(self._layout, self._names, record)

    def ticks(self, count=None):
        """Yields the next `count` ticks; without `count`, until the daemon is gone, which raises Disconnected."""
        taken = 0
        while count is None or taken < count:
            tick = self.next()
            if tick is not None:
                taken += 1
                yield tick

    def array(self, count):
        """Returns the next `count` ticks as a numpy structured array with one column per field: array["F_out"] is count x 6."""
        import numpy

        out = numpy.empty(count, self._layout.dtype())
        rows = out.view(numpy.uint8).reshape(count, self._layout.record_bytes)
        taken = 0
        while taken < count:
            record = self._next_record(1.0)
            if record is not None:
                rows[taken] = numpy.frombuffer(record, numpy.uint8)
                taken += 1
        return out

    def _written(self):
        return self._words[self._layout.written_word]

    def _copy(self, i):
        layout = self._layout
        at = layout.header_bytes + i % layout.slots * layout.slot_bytes
        if self._words[at // 8] != 2 * i + 2:
            return None
        with self._in_order:
            begin = at + layout.record_offset
            record = self._memory[begin:begin + layout.record_bytes]
        return record if self._words[at // 8] == 2 * i + 2 else None

    def _next_record(self, timeout_s):
        end = time.monotonic() + timeout_s
        while True:
            while self._written() > self._next:
                record = self._copy(self._next)
                if record is not None:
                    self._next += 1
                    return record
                # Overrun: continues in the middle of the available ticks, so that the next overrun is not immediate.
                skipped = self._written() - self._next - self._layout.slots // 2
                self.missed += max(skipped, 0)
                self._next += max(skipped, 0)
            now = time.monotonic()
            # Before the end is tested: a caller that never waits detects the loss too.
            if now >= self._next_check:
                self._next_check = now + _CONNECTION_CHECK_S
                if not self._is_connected() and self._written() == self._next:
                    raise Disconnected("the daemon is gone; connect again when wrenchd is running")
            if now >= end:
                return None
            time.sleep(0.25 / self._layout.rate_Hz)
