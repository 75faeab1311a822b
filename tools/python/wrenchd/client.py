# SPDX-License-Identifier: GPL-3.0-or-later
"""The control socket: JSON-RPC 2.0, one object a line."""

import collections
import json
import os
import select
import socket
import threading
import time

from .errors import Gone, NoDaemon, ProtocolError, Refused, Timeout
from .state import State

_LONGEST_LINE = 16 << 20
_MOST_EVENTS = 10_000  # that nobody takes; then the oldest go
_BEATS_IN_TIME = 4  # in the time that the daemon waits for one


def default_sockets():
    """Where the daemon's socket is looked for, in this order."""
    if os.environ.get("WRENCHD_SOCKET"):
        return [os.environ["WRENCHD_SOCKET"]]
    places = ["/run/wrenchd/control.sock"]
    if os.environ.get("XDG_RUNTIME_DIR"):
        places.append(os.path.join(os.environ["XDG_RUNTIME_DIR"], "wrenchd", "control.sock"))
    return places


def _connected(places):
    tried = []
    for place in places:
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            connection.connect(place)
            return connection
        except OSError as error:
            connection.close()
            hint = " (are you in the group that may connect?)" if isinstance(error, PermissionError) else ""
            tried.append(f"{place}: {error.strerror or error}{hint}")
    raise NoDaemon(f"no wrenchd responds ({'; '.join(tried)}); start it, or name its socket in WRENCHD_SOCKET")


class Client:
    """A connection to wrenchd. Every call waits for its answer; any thread may call, and calls take turns.

    socket: path of the daemon's; otherwise the first of default_sockets() that answers.
    answer_within_s: how long a call waits before it raises Timeout.
    """

    def __init__(self, socket=None, answer_within_s=5.0):
        self._socket = _connected([os.fspath(socket)] if socket else default_sockets())
        self._socket.setblocking(False)
        self._answer_within_s = answer_within_s
        self._reading = threading.RLock()
        self._writing = threading.Lock()
        self._received = bytearray()
        self._looked_at = 0
        self._descriptor = None
        self._last_id = 0
        self._events = collections.deque(maxlen=_MOST_EVENTS)

    def close(self):
        """Ends the connection, and with it the lease: the daemon fades the force out."""
        self._drop_descriptor()
        self._socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    # What can be asked for

    def call(self, method, **params):
        """Any method that describe() lists. Returns its result."""
        return self._call(method, params)[0]

    def describe(self):
        return self.call("describe")

    def status(self):
        return self.call("status")

    def devices(self):
        return self.call("devices")

    def reload(self):
        return self.call("reload")

    def arm(self):
        """Only with the lease."""
        return self.call("arm")

    def disarm(self):
        return self.call("disarm")

    def stop(self):
        """Emergency stop; anybody may."""
        return self.call("stop")

    def acknowledge(self):
        return self.call("acknowledge")

    def reinitialize_proxy(self):
        return self.call("reinitialize_proxy")

    def heartbeat(self):
        """Says that the program lives. Lease does so by itself."""
        self._send({"jsonrpc": "2.0", "method": "lease.heartbeat", "params": {}})

    def lease(self):
        """The right to arm, which one client has at a time: `with client.lease(): client.arm(); ...`."""
        return Lease(self)

    def open_state(self):
        """The state of every tick, through shared memory."""
        answer, descriptor = self._call("state.open", {}, True)
        if descriptor is None or "layout" not in answer:
            raise ProtocolError("wrenchd sent no shared memory; see its log")
        return State(answer["layout"], descriptor, self.is_there, lambda: self.call("state.obstacles"))

    def open_recording(self, name):
        """A recording of the daemon's (call("record.list")), as a file to read: h5py.File(client.open_recording(...))."""
        _, descriptor = self._call("record.open", {"name": name}, True)
        if descriptor is None:
            raise ProtocolError("wrenchd handed no recording over; see its log")
        return os.fdopen(descriptor, "rb")

    # Events

    def subscribe(self, *names):
        """Events of these names from now on, or of all. Returns status() at that moment, as a snapshot."""
        return self.call("subscribe", **({"events": list(names)} if names else {}))

    def unsubscribe(self):
        return self.call("unsubscribe")

    def event(self, timeout_s=1.0):
        """The next event, a dict with sequence, time_ns, name and level; None where none came in time."""
        end = time.monotonic() + timeout_s
        with self._reading:
            while not self._events:
                line = self._read_line(end)
                if line is None:
                    return None
                self._keep_event(self._parsed(line))
            return self._events.popleft()

    def events(self):
        """All events from now on, until the connection ends, which raises Gone."""
        while True:
            event = self.event()
            if event is not None:
                yield event

    # The line

    def is_there(self):
        """Whether the daemon's end of the connection is open."""
        if self._socket.fileno() < 0:
            return False
        poll = select.poll()
        poll.register(self._socket, select.POLLRDHUP)
        return not poll.poll(0)

    def _call(self, method, params, wants_descriptor=False):
        end = time.monotonic() + self._answer_within_s
        with self._reading:
            self._drop_descriptor()
            self._last_id += 1
            request_id = self._last_id
            self._send({"jsonrpc": "2.0", "id": request_id, "method": method, "params": params})
            while True:
                line = self._read_line(end)
                if line is None:
                    raise Timeout(f"wrenchd did not answer '{method}' within {self._answer_within_s} s; see its log")
                message = self._parsed(line)
                if "method" in message:
                    self._keep_event(message)
                    continue
                if message.get("id") not in (request_id, None):
                    continue  # of a call that was given up
                if "error" in message:
                    error = message["error"]
                    raise Refused(error.get("code"), error.get("message", f"{method} was refused"), error.get("data"))
                descriptor = None
                if wants_descriptor:
                    descriptor, self._descriptor = self._descriptor, None
                return message.get("result", {}), descriptor

    @staticmethod
    def _parsed(line):
        try:
            message = json.loads(line)
        except ValueError:
            message = None
        if not isinstance(message, dict):
            raise ProtocolError(f"what answers is not wrenchd: {bytes(line[:80])!r}")
        return message

    def _keep_event(self, message):
        if isinstance(message.get("params"), dict):
            self._events.append(message["params"])

    def _wait(self, what, end):
        poll = select.poll()
        poll.register(self._socket, what)
        return bool(poll.poll(max(0.0, end - time.monotonic()) * 1e3))

    def _read_line(self, end):
        while True:
            at = self._received.find(b"\n", self._looked_at)
            if at >= 0:
                line = bytes(self._received[:at])
                del self._received[:at + 1]
                self._looked_at = 0
                return line
            self._looked_at = len(self._received)
            if self._looked_at > _LONGEST_LINE:
                raise Gone("wrenchd sent a line without end; connect again")
            if not self._wait(select.POLLIN, end):
                return None
            self._receive()

    def _receive(self):
        try:
            data, descriptors, _, _ = socket.recv_fds(self._socket, 65536, 1)
        except BlockingIOError:
            return
        except OSError as error:
            raise Gone(f"wrenchd ended the connection ({error}); connect again when wrenchd is running") from error
        if descriptors:
            self._drop_descriptor()
            self._descriptor = descriptors[0]
        if not data:
            raise Gone("wrenchd ended the connection; connect again when wrenchd is running")
        self._received += data

    def _drop_descriptor(self):
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def _send(self, request):
        line = memoryview(json.dumps(request, allow_nan=False).encode() + b"\n")
        end = time.monotonic() + self._answer_within_s
        with self._writing:
            while line:
                try:
                    line = line[self._socket.send(line, socket.MSG_NOSIGNAL):]
                except BlockingIOError:
                    if not self._wait(select.POLLOUT, end):
                        raise Gone("wrenchd takes no more requests; connect again") from None
                except OSError as error:
                    raise Gone(f"wrenchd ended the connection ({error}); connect again when wrenchd is running") from error


class Lease:
    """The right to arm. While it is held a thread says that the program lives; where the program ends or loses
    its connection, the daemon fades the force out. A program that may hang while it lives should do that itself:
    client.call("lease.acquire"), and client.heartbeat() in time."""

    def __init__(self, client):
        self._client = client
        self._ended = threading.Event()
        within_s = client.call("lease.acquire").get("heartbeat_timeout_s", 0.1)
        self._thread = threading.Thread(target=self._beat, args=(within_s / _BEATS_IN_TIME,), daemon=True)
        self._thread.start()

    def give(self):
        """Gives the right back. One that was lost meanwhile, because a beat came too late, is nobody's fault here:
        arm() says so to whoever still wants it."""
        if self._ended.is_set():
            return
        self._ended.set()
        self._thread.join()
        try:
            self._client.call("lease.release")
        except Refused as refused:
            if refused.code not in (Refused.NOT_NOW, Refused.TAKEN):
                raise

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        try:
            self.give()
        except Gone:
            if kind is None:
                raise

    def _beat(self, every_s):
        while True:
            try:
                self._client.heartbeat()
            except Gone:
                return  # whoever calls next hears of it
            if self._ended.wait(every_s):
                return
