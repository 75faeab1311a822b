# SPDX-License-Identifier: GPL-3.0-or-later
"""Exceptions of the client. Their messages contain the remedy."""


class WrenchdError(Exception):
    """Any of these."""


class NoDaemon(WrenchdError):
    """No daemon accepts connections at the socket."""


class Disconnected(WrenchdError):
    """The connection has ended."""


class Timeout(WrenchdError):
    """No response in time."""


class ProtocolError(WrenchdError):
    """The received data has an unknown format."""


class Rejected(WrenchdError):
    """The daemon rejected the request; the text is the daemon's message. code: JSON-RPC 2.0, or a code below."""

    PERMISSION_DENIED = -32001
    INVALID_STATE = -32002
    LEASE_HELD = -32003
    REJECTED = -32004

    def __init__(self, code, message, data=None):
        super().__init__(message)
        self.code = code
        self.data = data
