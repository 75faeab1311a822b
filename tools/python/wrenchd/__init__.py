# SPDX-License-Identifier: GPL-3.0-or-later
"""Talks to wrenchd, the haptic servo daemon: reads its state at the rate of its servo loop, and sends it work.

    client = wrenchd.Client()
    print(client.status()["state"])
    for tick in client.open_state().ticks(1000):
        print(tick.tick, tick.F_out, tick.contact_list)

The standard library is all it needs; State.array() gives numpy arrays where numpy is installed.
"""

from .client import Client, Lease, default_sockets
from .errors import Gone, NoDaemon, ProtocolError, Refused, Timeout, WrenchdError
from .state import Contact, State, Tick

__all__ = [
    "Client", "Contact", "Gone", "Lease", "NoDaemon", "ProtocolError", "Refused", "State", "Tick", "Timeout",
    "WrenchdError", "default_sockets",
]
