# SPDX-License-Identifier: GPL-3.0-or-later
"""Client of the haptic servo daemon wrenchd: reads its state at the rate of its servo loop, and sends requests.

    client = wrenchd.Client()
    print(client.status()["state"])
    for tick in client.open_state().ticks(1000):
        print(tick.tick, tick.F_out, tick.contact_list)

Requires only the standard library. If numpy is installed, State.array() returns numpy arrays.
"""

from .client import Client, Lease, default_sockets
from .errors import Disconnected, NoDaemon, ProtocolError, Rejected, Timeout, WrenchdError
from .state import Contact, State, Tick

__all__ = [
    "Client", "Contact", "Disconnected", "Lease", "NoDaemon", "ProtocolError", "Rejected", "State", "Tick", "Timeout",
    "WrenchdError", "default_sockets",
]
