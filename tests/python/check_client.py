# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks the Python package against a daemon at WRENCHD_SOCKET. The daemon ticks, has a cube in the hand above a table,
and gives every client all permissions."""

import gc
import math
import os
import socket
import tempfile
import threading
import time
import unittest

import wrenchd


def soon(done):
    """Waits up to 30 s for done() to return True. Returns whether it did."""
    end = time.monotonic() + 30
    while time.monotonic() < end:
        if done():
            return True
        time.sleep(0.01)
    return False


def keep_arming(client):
    """Arms, also after a fault: a busy machine may make the loop late, which is a fault."""
    state = client.status()["state"]
    if state == "fault":
        client.acknowledge()
    if state == "disarmed":
        try:
            client.arm()
        except wrenchd.Rejected as rejected:  # the machine is so busy that a heartbeat came too late
            assert rejected.code == wrenchd.Rejected.INVALID_STATE, rejected
            client.call("lease.acquire")


def becomes_disarmed(client):
    """Disarms and acknowledges. Returns True if the loop is disarmed."""
    client.disarm()
    if client.status()["state"] in ("fault", "stopped"):
        client.acknowledge()
    return client.status()["state"] == "disarmed"


class ScriptedDaemon(threading.Thread):
    """A daemon that sends one scripted response for each request, then closes the connection."""

    def __init__(self, *responses):
        super().__init__(daemon=True)
        self.directory = tempfile.TemporaryDirectory()
        self.path = os.path.join(self.directory.name, "control.sock")
        self.responses = responses
        self.listening = socket.socket(socket.AF_UNIX)
        self.listening.bind(self.path)
        self.listening.listen()
        self.start()

    def run(self):
        peer, _ = self.listening.accept()
        for response in self.responses:
            peer.recv(65536)
            for i in range(0, len(response), 5):
                peer.sendall(response[i:i + 5])
        peer.close()


class Commands(unittest.TestCase):
    def setUp(self):
        self.client = wrenchd.Client()
        self.addCleanup(self.client.close)
        self.assertTrue(soon(lambda: becomes_disarmed(self.client)))

    def test_lease_arm_and_stop(self):
        with self.assertRaises(wrenchd.Rejected) as rejected:
            self.client.arm()
        self.assertEqual(rejected.exception.code, wrenchd.Rejected.INVALID_STATE)
        with self.client.lease():
            with wrenchd.Client() as other, self.assertRaises(wrenchd.Rejected) as rejected:
                other.lease()
            self.assertEqual(rejected.exception.code, wrenchd.Rejected.LEASE_HELD)

            def active():
                keep_arming(self.client)
                return self.client.status()["state"] == "active"

            self.assertTrue(soon(active))
            with self.client.open_state() as state:
                self.assertTrue(soon(lambda: len(state.latest().contact_list) == 4))
                tick = state.latest()
            self.client.stop()
            self.assertTrue(soon(lambda: self.client.status()["state"] in ("stopped", "fault")))
        self.assertTrue(soon(lambda: becomes_disarmed(self.client)))
        if tick.contact_list:
            self.assertAlmostEqual(sum(contact.load_fraction for contact in tick.contact_list), 1.0)

    def test_arms_and_waits(self):
        with self.assertRaises(wrenchd.Rejected):
            self.client.arm(within_s=5)  # no lease
        with self.client.lease():
            try:
                self.client.arm(within_s=10)
            except wrenchd.WrenchdError as error:  # a busy machine delays the loop
                self.assertRegex(str(error), "^the loop (did not become|is not) active.*: .")
            else:
                self.assertIn(self.client.status()["state"], ("active", "fault"))
            self.client.stop()
            with self.assertRaises(wrenchd.Rejected):
                self.client.arm(within_s=5)
        self.assertTrue(soon(lambda: becomes_disarmed(self.client)))

    def test_moves_the_hand(self):
        with self.client.open_state() as state:
            self.client.move_hand([0.1, 0.0, 0.1], expires_s=30)
            self.assertTrue(soon(lambda: abs(state.latest().X_BH[0] - 0.1) < 2e-3))
            self.client.move_hand([0.0, 0.0, 0.065], [0, 0, 0.1], 0.05)
            self.assertTrue(soon(lambda: abs(state.latest().X_BH[0]) < 0.05))

    def test_a_lease_ends_with_its_connection(self):
        dying = wrenchd.Client()
        dying.lease()
        dying.close()

        def free():
            try:
                self.client.lease().release()
                return True
            except wrenchd.Rejected:
                return False

        self.assertTrue(soon(free))

    def test_rejections_have_a_message(self):
        with self.assertRaisesRegex(wrenchd.Rejected, "dance"):
            self.client.call("dance")
        self.assertIn("state", self.client.status())

    def test_events(self):
        self.assertIn("state", self.client.subscribe("device"))
        self.assertIsNone(self.client.event(0.01))
        self.client.unsubscribe()


class StateReading(unittest.TestCase):
    def setUp(self):
        self.client = wrenchd.Client()
        self.addCleanup(self.client.close)
        self.state = self.client.open_state()
        self.addCleanup(self.state.close)

    def test_ticks_have_all_described_fields(self):
        described = self.state.describe()
        self.assertIn("X_WQ", described)
        tick = self.state.next()
        for name, (unit, meaning) in described.items():
            with self.subTest(name):
                self.assertTrue(unit and meaning)
                value = getattr(tick, name)
                if unit == "bool":
                    self.assertIsInstance(value, bool)
                if unit == "enum":
                    self.assertIsInstance(value, str)
        self.assertEqual(len(tick.F_out), 6)
        self.assertEqual(len(tick.X_WP), 7)
        self.assertAlmostEqual(math.hypot(*tick.X_WP[3:]), 1.0)
        self.assertIsInstance(tick["state"], int)
        self.assertIsInstance(tick.faults, list)
        with self.assertRaisesRegex(AttributeError, "describe"):
            tick.no_such_field

    def test_latest_is_not_older_than_next(self):
        tick = self.state.next()
        self.assertGreaterEqual(self.state.latest().tick, tick.tick)

    def test_a_slow_reader_gets_the_number_of_missed_records(self):
        first = self.state.next().tick
        written = self.state._written
        slots = self.state._layout.slots
        self.assertTrue(soon(lambda: self.state.unread > slots + 10))
        second = self.state.next().tick
        self.assertEqual(second - first, self.state.missed + 1)
        self.assertGreater(self.state.missed, slots // 2)
        self.assertLess(self.state.unread, slots)
        self.assertGreater(written(), slots)

    def test_a_record_that_is_overwritten_during_the_copy_is_rejected(self):
        state = self.state
        memory, words, copies = state._memory, state._words, []

        class Memory:
            def __getitem__(self, where):
                copies.append(where)
                return memory[where]

        class Words:
            def __getitem__(self, word):
                return words[word] + len(copies)

        newest = state._written() - 1
        self.assertIsNotNone(state._copy(newest))
        state._memory, state._words = Memory(), Words()
        copied = state._copy(newest)
        state._memory, state._words = memory, words
        self.assertEqual(len(copies), 1)
        self.assertIsNone(copied)

    def test_contacts_name_features_and_obstacle(self):
        def in_contact():
            return bool(self.state.latest().contact_list)

        self.assertTrue(soon(in_contact))
        for tick in self.state.ticks(5000):
            if tick.contact_list:
                break
        contact = tick.contact_list[0]
        self.assertEqual(contact.obstacle, "table")
        self.assertRegex(str(contact), r"^hull vertex \d+ on table plane$")
        self.assertEqual(contact.normal_W, (0.0, 0.0, 1.0))
        self.assertLess(abs(contact.point_W_m[2]), 1e-6)

    def test_arrays_are_the_same_ticks(self):
        try:
            import numpy
        except ImportError:
            self.skipTest("numpy is not installed")
        array = self.state.array(200)
        self.assertTrue((numpy.diff(array["tick"].astype(numpy.int64)) == 1).all())
        self.assertEqual(array["F_out"].shape, (200, 6))
        self.assertEqual(array["contact_list"]["point_W_m"].shape, (200, 16, 3))
        numpy.testing.assert_allclose(numpy.linalg.norm(array["X_WP"][:, 3:], axis=1), 1.0)


class ObstacleNames(unittest.TestCase):
    def test_each_rendering_has_its_own_names_requested_once(self):
        responses = [{"rendering_id": 4, "obstacles": ["bolt"]}, wrenchd.Disconnected("gone"),
                     {"rendering_id": 7, "obstacles": []}]
        requested = []

        def request():
            requested.append(responses.pop(0))
            if isinstance(requested[-1], Exception):
                raise requested[-1]
            return requested[-1]

        names = wrenchd.state._Names({"rendering_id": 3, "obstacles": ["table", "nut"]}, request)
        self.assertEqual(names.of(3, 1), "nut")
        self.assertEqual(requested, [])
        self.assertEqual([names.of(4, 0), names.of(4, 1), names.of(3, 0)], ["bolt", "obstacle 1", "table"])
        self.assertEqual(len(requested), 1)
        self.assertEqual([names.of(5, 0), names.of(7, 0), names.of(6, 0)], ["obstacle 0"] * 3)
        self.assertEqual(responses, [])
        with self.assertRaises(wrenchd.ProtocolError):
            wrenchd.state._Names({"rendering_id": 3}, request)


class Failures(unittest.TestCase):
    def test_no_daemon(self):
        with self.assertRaisesRegex(wrenchd.NoDaemon, "/nowhere/s: No such file.*start it"):
            wrenchd.Client("/nowhere/s")

    def test_a_daemon_that_ends_is_an_error_without_a_wait(self):
        client = wrenchd.Client(ScriptedDaemon(b'{"jsonrpc":"2.0","id":1,"result":{"state":"disarmed"}}\n').path)
        self.assertEqual(client.status(), {"state": "disarmed"})
        for _ in range(3):
            with self.assertRaises(wrenchd.Disconnected):
                client.status()
        with self.assertRaises(wrenchd.Disconnected):
            client.event()
        self.assertFalse(client.is_connected())

    def test_half_a_line_is_not_a_response(self):
        client = wrenchd.Client(ScriptedDaemon(b'{"jsonrpc":"2.0","id":1,"res').path, 1.0)
        with self.assertRaises((wrenchd.Disconnected, wrenchd.Timeout)):
            client.status()

    def test_a_daemon_that_does_not_respond(self):
        client = wrenchd.Client(ScriptedDaemon(b"", b"").path, 0.1)
        with self.assertRaises(wrenchd.Timeout):
            client.status()

    def test_an_invalid_response(self):
        client = wrenchd.Client(ScriptedDaemon(b"[1]\n").path)
        with self.assertRaises(wrenchd.ProtocolError):
            client.status()

    def test_events_between_responses_are_kept(self):
        event = b'{"jsonrpc":"2.0","method":"event","params":{"name":"fault","sequence":%d}}\n'
        client = wrenchd.Client(ScriptedDaemon(event % 1 + event % 2 + b'{"jsonrpc":"2.0","id":1,"result":{}}\n').path)
        client.status()
        self.assertEqual([client.event()["sequence"], client.event()["sequence"]], [1, 2])

    def test_memory_that_is_not_sealed_is_rejected(self):
        with wrenchd.Client() as client:
            layout = client.call("state.open")["layout"]
        unsealed = os.memfd_create("unsealed", os.MFD_ALLOW_SEALING)
        os.ftruncate(unsealed, layout["bytes"])
        with self.assertRaisesRegex(wrenchd.ProtocolError, "not sealed"):
            wrenchd.State(layout, unsealed)
        with self.assertRaises(wrenchd.ProtocolError):
            wrenchd.State({**layout, "version": 99}, os.memfd_create("x"))

    def test_no_descriptor_leaks(self):
        def count():
            gc.collect()
            return len(os.listdir("/proc/self/fd"))

        before = count()
        for _ in range(10):
            with wrenchd.Client() as client:
                client.call("state.open")  # the client closes this descriptor
                client.status()
                with client.open_state() as state:
                    state.next()
        self.assertLessEqual(count(), before)  # descriptors of the previous test may close only now


if __name__ == "__main__":
    unittest.main()
