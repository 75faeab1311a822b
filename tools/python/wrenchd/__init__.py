# SPDX-License-Identifier: GPL-3.0-or-later
"""The haptic servo daemon wrenchd in Python: a client of the daemon, and its contact engine as a library.

The client reads the daemon's state at the rate of its servo loop, and sends requests. It needs only the standard library;
if numpy is installed, State.array() returns numpy arrays.

    client = wrenchd.Client()
    print(client.status()["state"])
    for tick in client.open_state().ticks(1000):
        print(tick.tick, tick.F_out, tick.contact_list)

The engine computes penetration depth, clearance and contacts of meshes without a daemon (wrenchd.engine). It needs numpy.

    scene = wrenchd.Scene(tool=wrenchd.Mesh.load("peg.stl", scale=1e-3), obstacles=[wrenchd.HalfSpace()])
    print(scene.project([0, 0, 0.01, 0, 0, 0, 1]).energy)

Recordings are data for numpy and pandas (wrenchd.recording):

    print(wrenchd.Recording("run.h5").frame()["F_out.fz"].max())

Sweeps run a function or the daemon for every point of a grid (wrenchd.sweeps).
"""

from typing import TYPE_CHECKING, Any

from .client import Client, Lease, default_sockets
from .errors import Disconnected, NoDaemon, ProtocolError, Rejected, Timeout, WrenchdError
from .state import Contact, State, Tick

if TYPE_CHECKING:
    from .recording import Recording, RecordingError
    from .sweeps import DaemonRun, SweepError, SweepTable, sweep
    from .engine import Body, HalfSpace, Mesh, MeshError, MeshReport, Projection, Projections, Scene

_SWEEPS = ("DaemonRun", "SweepError", "SweepTable", "sweep")
_RECORDING = ("Recording", "RecordingError")
_ENGINE = ("Body", "HalfSpace", "Mesh", "MeshError", "MeshReport", "Projection", "Projections", "Scene")

__all__ = [
    "Body", "Client", "Contact", "DaemonRun", "Disconnected", "HalfSpace", "Lease", "Mesh", "MeshError", "MeshReport", "NoDaemon",
    "Projection", "Projections", "ProtocolError", "Recording", "RecordingError", "Rejected", "Scene", "State",
    "SweepError", "SweepTable", "Tick", "Timeout", "WrenchdError", "default_sockets", "sweep",
]


def __getattr__(name: str) -> Any:
    """Loads the engine and recordings when they are first used, so that the client works without numpy and without the
    extension."""
    if name in _SWEEPS:
        from . import sweeps
        return getattr(sweeps, name)
    if name in _RECORDING:
        try:
            from . import recording
        except ImportError as error:
            raise ImportError(f"wrenchd.{name} needs numpy ({error}); install Debian's python3-numpy") from error
        return getattr(recording, name)
    if name not in _ENGINE:
        raise AttributeError(f"module 'wrenchd' has no attribute {name!r}")
    try:
        from . import engine
    except ImportError as error:
        raise ImportError(f"wrenchd.{name} needs numpy and the compiled engine ({error}); install python3-wrenchd, or run "
                          "'pip install ./tools/python' in a virtual environment") from error
    return getattr(engine, name)
