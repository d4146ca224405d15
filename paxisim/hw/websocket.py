"""WebSocket transport: texts of a server as lines of bytes."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

from paxisim.errors import InvalidValueError, MissingExtraError, PortNotFoundError, ProtocolError

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

OPEN_TIMEOUT = 5.0
"""Seconds in which the server must take the connection."""
LONGEST = 2**18
"""Bytes of a text at most; a server that sends a longer one is left."""
WAITING = 256
"""Texts kept for a program that is late; the others wait in the system, and then in the server."""
EMPTYING = 8
"""Reads of up to `WAITING` texts in which a server's backlog must end, so that one that never pauses blocks nothing."""


class WebSocketTransport:
    """A `paxisim.hw.transport.Transport` on which each text is a line; made by `open_websocket`.

    Attributes:
        port: The server's address.
    """

    def __init__(self, port: str, connection: ClientConnection, stack: ExitStack) -> None:
        """Take over an open connection, and the stack whose end closes it."""
        self.port = port
        self._connection, self._stack = connection, stack

    def read(self, timeout: float) -> bytes:
        """See `Transport.read`. A line break inside a text, which JSON allows between its parts, becomes a space."""
        from websockets.exceptions import ConnectionClosed

        texts: list[bytes] = []
        try:
            while len(texts) < WAITING:
                text = self._connection.recv(timeout=0.0 if texts else max(timeout, 0.0), decode=False)
                texts.append(text.replace(b"\r", b" ").replace(b"\n", b" ") + b"\n")
        except TimeoutError:
            pass
        except ConnectionClosed as error:
            if not texts:  # else the next call says so
                raise PortNotFoundError(f"{self.port} went away: {error}") from error
        return b"".join(texts)

    def write(self, data: bytes) -> None:
        """See `Transport.write`."""
        from websockets.exceptions import ConnectionClosed

        try:
            self._connection.send(data, text=True)
        except ConnectionClosed as error:
            raise PortNotFoundError(f"{self.port} went away: {error}") from error

    def discard_input(self) -> None:
        """See `Transport.discard_input`."""
        for _ in range(EMPTYING):
            if not self.read(0.0):
                return

    def close(self) -> None:
        """See `Transport.close`."""
        self._stack.close()

    def __repr__(self) -> str:
        """The address."""
        return f"<WebSocketTransport {self.port}>"


def open_websocket(port: str, baud: int) -> WebSocketTransport:
    """Connect to a server.

    Args:
        port: Its address, such as ``ws://127.0.0.1:5000``.
        baud: Of no use here; see `paxisim.hw.transport.open_transport`.

    Raises:
        InvalidValueError: The address is no WebSocket's.
        PortNotFoundError: Nothing takes the connection.
        ProtocolError: What takes it is no WebSocket server.
        MissingExtraError: websockets is not installed.
    """
    try:
        from websockets.exceptions import InvalidHandshake, InvalidURI
        from websockets.sync.client import connect
    except ImportError as error:
        raise MissingExtraError("websockets", "websocket", "opening a sensor behind a WebSocket server") from error
    if not port.startswith(("ws://", "wss://")):
        raise InvalidValueError(
            f"a sensor of this profile is read from a WebSocket server, with an address such as ws://127.0.0.1:5000, "
            f"got {port!r}"
        )
    stack = ExitStack()
    try:
        # the server is on this machine or in this robot's network, where no proxy leads to
        options = {"proxy": None, "open_timeout": OPEN_TIMEOUT, "max_size": LONGEST, "max_queue": WAITING}
        connection = stack.enter_context(connect(port, **options))
    except InvalidURI as error:
        raise InvalidValueError(f"{port!r} is no address of a WebSocket server, as ws://127.0.0.1:5000 is") from error
    except TimeoutError as error:
        raise PortNotFoundError(f"{port} did not answer within {OPEN_TIMEOUT:g} s: {_IS_IT_RUNNING}") from error
    except OSError as error:
        raise PortNotFoundError(f"cannot connect to {port}: {error.strerror or error}; {_IS_IT_RUNNING}") from error
    except InvalidHandshake as error:
        raise ProtocolError(f"what answers at {port} is no WebSocket server: {error}") from error
    return WebSocketTransport(port, connection, stack)


_IS_IT_RUNNING = "does the sensor's server run, and at this address?"
