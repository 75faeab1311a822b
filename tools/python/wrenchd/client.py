# SPDX-License-Identifier: GPL-3.0-or-later
"""The control socket: JSON-RPC 2.0, one object per line."""

import collections
import json
import os
import select
import socket
import threading
import time

from .errors import Disconnected, NoDaemon, ProtocolError, Rejected, Timeout
from .state import State

_MAX_LINE = 16 << 20
_MAX_EVENTS = 10_000  # maximum number of stored events; above it the oldest is dropped
_HEARTBEATS_PER_TIMEOUT = 4  # heartbeats within the daemon's timeout


def default_sockets():
    """Returns the paths at which clients search the daemon's socket, in this order."""
    if os.environ.get("WRENCHD_SOCKET"):
        return [os.environ["WRENCHD_SOCKET"]]
    paths = ["/run/wrenchd/control.sock"]
    if os.environ.get("XDG_RUNTIME_DIR"):
        paths.append(os.path.join(os.environ["XDG_RUNTIME_DIR"], "wrenchd", "control.sock"))
    return paths


def _connected(paths):
    tried = []
    for path in paths:
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            connection.connect(path)
            return connection
        except OSError as error:
            connection.close()
            hint = " (join the group that may connect)" if isinstance(error, PermissionError) else ""
            tried.append(f"{path}: {error.strerror or error}{hint}")
    raise NoDaemon(f"no wrenchd responds ({'; '.join(tried)}); start it, or name its socket in WRENCHD_SOCKET")


class Client:
    """A connection to wrenchd. Every call waits for its response. Thread-safe: calls run one after the other.

    socket: path of the daemon's socket; by default the first of default_sockets() that accepts a connection.
    answer_within_s: time after which a call raises Timeout.
    """

    def __init__(self, socket=None, answer_within_s=5.0):
        self._socket = _connected([os.fspath(socket)] if socket else default_sockets())
        self._socket.setblocking(False)
        self._answer_within_s = answer_within_s
        self._reading = threading.RLock()
        self._writing = threading.Lock()
        self._received = bytearray()
        self._scanned = 0
        self._descriptor = None
        self._last_id = 0
        self._events = collections.deque(maxlen=_MAX_EVENTS)

    def close(self):
        """Closes the connection and thereby ends the lease: the daemon fades the force out."""
        self._drop_descriptor()
        self._socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    # Methods

    def call(self, method, **params):
        """Calls any method that describe() lists. Returns its result. Raises WrenchdError."""
        return self._call(method, params)[0]

    def describe(self):
        return self.call("describe")

    def status(self):
        return self.call("status")

    def devices(self):
        return self.call("devices")

    def reload(self):
        return self.call("reload")

    def arm(self, within_s=None):
        """Arms the loop. Requires the lease. With within_s it returns when the loop is active; if the force of another program
        still fades, it arms after that. Raises Rejected if a fault prevents arming, and Timeout with the reason after within_s."""
        if within_s is None:
            return self.call("arm")
        ends_s = time.monotonic() + within_s
        answer = None
        while True:
            status = self.status()
            reason = status.get("no_force") or status["state"]
            if answer is None and status["state"] != "releasing":
                answer = self.call("arm")
            elif answer is not None and status["state"] == "active":
                return answer
            elif answer is not None and status["state"] in ("fault", "stopped"):
                raise Rejected(Rejected.INVALID_STATE, f"the loop did not become active: {reason}")
            if time.monotonic() > ends_s:
                raise Timeout(f"the loop is not active after {within_s} s: {reason}")
            time.sleep(0.01)

    def disarm(self):
        return self.call("disarm")

    def stop(self):
        """Emergency stop. Requires no lease."""
        return self.call("stop")

    def acknowledge(self):
        return self.call("acknowledge")

    def reinitialize_proxy(self):
        return self.call("reinitialize_proxy")

    def grasp(self):
        """Makes the tool hold the free body that it touches, or the first one that it will touch."""
        return self.call("grasp")

    def let_go(self):
        """Makes the tool let go of the body that it holds. The force of its weight fades out within 150 ms."""
        return self.call("let_go")

    def heartbeat(self):
        """Sends a heartbeat. A Lease sends its own."""
        self._send({"jsonrpc": "2.0", "method": "lease.heartbeat", "params": {}})

    def lease(self):
        """Acquires the lease, which is the right to arm; one client holds it: `with client.lease(): client.arm(); ...`."""
        return Lease(self)

    def open_state(self):
        """Opens the shared memory with the state of every tick."""
        answer, descriptor = self._call("state.open", {}, True)
        if descriptor is None or "layout" not in answer:
            raise ProtocolError("wrenchd sent no shared memory; see its log")
        return State(answer["layout"], descriptor, self.is_connected, lambda: self.call("state.obstacles"))

    def open_recording(self, name):
        """Opens a recording in call("record.list") as a file: h5py.File(client.open_recording(name))."""
        _, descriptor = self._call("record.open", {"name": name}, True)
        if descriptor is None:
            raise ProtocolError("wrenchd sent no recording; see its log")
        return os.fdopen(descriptor, "rb")

    def mark(self, label, **conditions):
        """Sets a marker in the running recording, with conditions (numbers or texts) that hold until the next marker changes
        them: client.mark("trial 3", stiffness=2000). Returns file and time_ns. Raises Rejected if no recording runs."""
        return self.call("record.mark", label=label, **({"conditions": conditions} if conditions else {}))

    def move_hand(self, position_m, rotation_vector_rad=(0.0, 0.0, 0.0), expires_s=0.5):
        """Moves the hand of a simulated device to a pose in the device base, at the speed of a person. Call it again before it
        expires; afterwards the hand returns to its path. Raises Rejected for a device that a person moves."""
        return self.call("hand.set", position_m=[float(x) for x in position_m],
                         rotation_vector_rad=[float(x) for x in rotation_vector_rad], expires_s=expires_s)

    def set_wrench(self, force_N, torque_Nm=(0.0, 0.0, 0.0), energy_J=0.0, expires_s=0.1):
        """Acts on the hand: force and torque about the handle point, in axes of the world. energy_J: that the wrench may give
        to the hand from now on, beside what the hand gave to it. Call it again before it expires; then the wrench fades out
        within 50 ms. Raises Rejected if a value exceeds its limit, or if another program acts on the hand."""
        return self.call("wrench.set", force_N=[float(x) for x in force_N], torque_Nm=[float(x) for x in torque_Nm],
                         energy_J=energy_J, expires_s=expires_s)

    # Events

    def subscribe(self, *names):
        """Subscribes to events with these names, or to all events. Returns status() at that moment."""
        return self.call("subscribe", **({"events": list(names)} if names else {}))

    def unsubscribe(self):
        return self.call("unsubscribe")

    def event(self, timeout_s=1.0):
        """Returns the next event, a dict with sequence, time_ns, name and level; None if none came in time."""
        end = time.monotonic() + timeout_s
        with self._reading:
            while not self._events:
                line = self._read_line(end)
                if line is None:
                    return None
                self._queue_event(self._parsed(line))
            return self._events.popleft()

    def events(self):
        """Yields all events until the connection ends, which raises Disconnected."""
        while True:
            event = self.event()
            if event is not None:
                yield event

    # Transport

    def is_connected(self):
        """Returns True if the daemon's end of the connection is open."""
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
                    raise Timeout(f"wrenchd did not respond to '{method}' within {self._answer_within_s} s; see its log")
                message = self._parsed(line)
                if "method" in message:
                    self._queue_event(message)
                    continue
                if message.get("id") not in (request_id, None):
                    continue  # response to a call that timed out
                if "error" in message:
                    error = message["error"]
                    raise Rejected(error.get("code"), error.get("message", f"{method} was rejected"), error.get("data"))
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
            raise ProtocolError(f"the response is not wrenchd's: {bytes(line[:80])!r}")
        return message

    def _queue_event(self, message):
        if isinstance(message.get("params"), dict):
            self._events.append(message["params"])

    def _wait(self, what, end):
        poll = select.poll()
        poll.register(self._socket, what)
        return bool(poll.poll(max(0.0, end - time.monotonic()) * 1e3))

    def _read_line(self, end):
        while True:
            at = self._received.find(b"\n", self._scanned)
            if at >= 0:
                line = bytes(self._received[:at])
                del self._received[:at + 1]
                self._scanned = 0
                return line
            self._scanned = len(self._received)
            if self._scanned > _MAX_LINE:
                raise Disconnected("wrenchd sent an overlong line; connect again")
            if not self._wait(select.POLLIN, end):
                return None
            self._receive()

    def _receive(self):
        try:
            data, descriptors, _, _ = socket.recv_fds(self._socket, 65536, 1)
        except BlockingIOError:
            return
        except OSError as error:
            raise Disconnected(f"wrenchd ended the connection ({error}); connect again when wrenchd is running") from error
        if descriptors:
            self._drop_descriptor()
            self._descriptor = descriptors[0]
        if not data:
            raise Disconnected("wrenchd ended the connection; connect again when wrenchd is running")
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
                        raise Disconnected("wrenchd takes no more requests; connect again") from None
                except OSError as error:
                    raise Disconnected(f"wrenchd ended the connection ({error}); connect again when wrenchd is running") from error


class Lease:
    """The right to arm. A thread sends heartbeats while the lease is held. If the program ends or loses its connection,
    the daemon fades the force out. A program that may hang should not use that thread: client.call("lease.acquire"),
    and call client.heartbeat() in time."""

    def __init__(self, client):
        self._client = client
        self._ended = threading.Event()
        within_s = client.call("lease.acquire").get("heartbeat_timeout_s", 0.1)
        self._thread = threading.Thread(target=self._send_heartbeats, args=(within_s / _HEARTBEATS_PER_TIMEOUT,), daemon=True)
        self._thread.start()

    def release(self):
        """Releases the lease. A lease that was lost before, because a heartbeat was late, is no error here; arm() reports
        the loss."""
        if self._ended.is_set():
            return
        self._ended.set()
        self._thread.join()
        try:
            self._client.call("lease.release")
        except Rejected as rejected:
            if rejected.code not in (Rejected.INVALID_STATE, Rejected.LEASE_HELD):
                raise

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        try:
            self.release()
        except Disconnected:
            if kind is None:
                raise

    def _send_heartbeats(self, interval_s):
        while True:
            try:
                self._client.heartbeat()
            except Disconnected:
                return  # the next call reports the error
            if self._ended.wait(interval_s):
                return
