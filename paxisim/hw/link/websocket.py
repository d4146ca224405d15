"""WebSocket transport: text messages of a server as lines of bytes."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, NoReturn

from paxisim.errors import InvalidValueError, MissingExtraError, PortNotFoundError, ProtocolError

if TYPE_CHECKING:
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import ClientConnection

OPEN_TIMEOUT = 5.0
"""Maximum time (s) for the server to accept the connection."""
CLOSE_TIMEOUT = 1.0
"""Maximum time (s) that closing waits for the server's answer."""
MAX_MESSAGE_BYTES = 2**18
"""Maximum size of a message in bytes; a longer one ends the connection."""
MAX_WAITING = 256
"""Maximum number of messages buffered for a slow program; others wait in the system, then in the server."""
MAX_DRAIN_READS = 8
"""Maximum number of reads, of up to `MAX_WAITING` messages each, to drain a backlog; a server that never pauses thus
does not block."""

_TOO_BIG = 1009  # close code for a message that is too big


class WebSocketTransport:
    """A `paxisim.hw.link.transport.Transport` on which each message is a line, created by `open_websocket`.

    Attributes:
        port: Address of the server.
    """

    def __init__(self, port: str, connection: ClientConnection, stack: ExitStack) -> None:
        """Take over an open connection and the exit stack that closes it."""
        self.port = port
        self._connection, self._stack = connection, stack
        self._was_too_big = False

    def read(self, timeout: float) -> bytes:
        """See `Transport.read`. A line break inside a message, which JSON allows between tokens, becomes a space."""
        from websockets.exceptions import ConnectionClosed

        texts: list[bytes] = []
        try:
            while len(texts) < MAX_WAITING:
                text = self._connection.recv(timeout=0.0 if texts else max(timeout, 0.0), decode=False)
                texts.append(text.replace(b"\r", b" ").replace(b"\n", b" ") + b"\n")
        except TimeoutError:
            pass
        except ConnectionClosed as error:
            if not texts:  # otherwise the next call raises
                self._raise_closed(error)
        return b"".join(texts)

    def _raise_closed(self, error: ConnectionClosed) -> NoReturn:
        if error.sent is not None and error.sent.code == _TOO_BIG and not self._was_too_big:
            self._was_too_big = True  # the next call says that the port went away, so that it is opened again
            raise ProtocolError(
                f"{self.port} sent a message of more than {MAX_MESSAGE_BYTES} bytes, which is no reading"
            ) from error
        raise PortNotFoundError(f"{self.port} went away: {error}") from error

    def write(self, data: bytes) -> None:
        """See `Transport.write`."""
        from websockets.exceptions import ConnectionClosed

        try:
            self._connection.send(data, text=True)
        except ConnectionClosed as error:
            raise PortNotFoundError(f"{self.port} went away: {error}") from error

    def discard_input(self) -> None:
        """See `Transport.discard_input`."""
        for _ in range(MAX_DRAIN_READS):
            if not self.read(0.0):
                return

    def close(self) -> None:
        """See `Transport.close`."""
        self._stack.close()

    def __repr__(self) -> str:
        """Return the address."""
        return f"<WebSocketTransport {self.port}>"


def open_websocket(port: str, baud: int) -> WebSocketTransport:
    """Connect to a server.

    Args:
        port: Address of the server, such as ``ws://127.0.0.1:5000``.
        baud: Unused; present for the same signature as `paxisim.hw.link.transport.open_transport`.

    Raises:
        InvalidValueError: The address is not a WebSocket address.
        PortNotFoundError: Nothing accepts the connection.
        ProtocolError: The server is not a WebSocket server.
        MissingExtraError: websockets is not installed.
    """
    try:
        from websockets.exceptions import InvalidHandshake, InvalidURI
        from websockets.sync.client import connect
    except ImportError as error:
        raise MissingExtraError("websockets", "websocket", "opening a sensor behind a WebSocket server") from error
    if not port.startswith(("ws://", "wss://")):
        raise InvalidValueError(
            f"this profile needs the address of a WebSocket server, such as ws://127.0.0.1:5000, got {port!r}"
        )
    stack = ExitStack()
    try:
        # the server is on this machine or in the robot's network, which no proxy reaches
        options = {"proxy": None, "open_timeout": OPEN_TIMEOUT, "close_timeout": CLOSE_TIMEOUT}
        options |= {"max_size": MAX_MESSAGE_BYTES, "max_queue": MAX_WAITING}
        connection = stack.enter_context(connect(port, **options))
    except InvalidURI as error:
        raise InvalidValueError(
            f"{port!r} is not the address of a WebSocket server, such as ws://127.0.0.1:5000"
        ) from error
    except TimeoutError as error:
        raise PortNotFoundError(f"{port} did not answer within {OPEN_TIMEOUT:g} s: {_IS_IT_RUNNING}") from error
    except OSError as error:
        raise PortNotFoundError(f"cannot connect to {port}: {error.strerror or error}; {_IS_IT_RUNNING}") from error
    except InvalidHandshake as error:
        raise ProtocolError(f"the server at {port} is not a WebSocket server: {error}") from error
    return WebSocketTransport(port, connection, stack)


_IS_IT_RUNNING = "is the sensor's server running, and at this address?"
