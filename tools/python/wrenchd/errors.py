# SPDX-License-Identifier: GPL-3.0-or-later
"""Why something could not be done. Each says in a sentence what to do."""


class WrenchdError(Exception):
    """Any of these."""


class NoDaemon(WrenchdError):
    """Nobody answers at the socket."""


class Gone(WrenchdError):
    """The connection ended."""


class Timeout(WrenchdError):
    """No answer in time."""


class ProtocolError(WrenchdError):
    """What came is not what this package understands."""


class Refused(WrenchdError):
    """The daemon said no, in its own words. code: of JSON-RPC 2.0, or one of these."""

    NOT_ALLOWED = -32001
    NOT_NOW = -32002
    TAKEN = -32003
    REFUSED_INPUT = -32004

    def __init__(self, code, message, data=None):
        super().__init__(message)
        self.code = code
        self.data = data
