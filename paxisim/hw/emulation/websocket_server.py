"""WebSocketServer: the server's end of an address that hosts connect to. Same interface as `PseudoTerminal`."""

from __future__ import annotations

import contextlib
import errno
import queue
import select
import threading
from typing import TYPE_CHECKING

from paxisim.errors import MissingExtraError, PortAccessError

if TYPE_CHECKING:
    from websockets.sync.server import Server, ServerConnection

HOST = "127.0.0.1"
MAX_QUEUED = 64
"""Maximum number of texts queued for a slow host."""
_CLOSE_TIMEOUT = 1.0


class WebSocketServer:
    """A server that welcomes each host and then sends every line written to it to all hosts, as one text per line.

    Attributes:
        name: The server's address, which a host opens like any port.
    """

    def __init__(self, welcome: bytes, first: int, tries: int = 1000) -> None:
        """Start listening, on this machine only.

        Args:
            welcome: The line that each host gets first.
            first: Port to listen on; if another program uses it, the next free port is taken.
            tries: Number of ports to try.

        Raises:
            PortAccessError: None of the ports is free, or the system refuses to listen.
            MissingExtraError: websockets is not installed.
        """
        self._welcome, self._line = welcome, b""
        self._queues: dict[ServerConnection, queue.Queue[str | None]] = {}
        self._server, self._number = self._listen(first, tries)
        self.name = f"ws://{HOST}:{self._number}"
        threading.Thread(target=self._server.serve_forever, name="websocket server", daemon=True).start()

    def reopened(self) -> WebSocketServer:
        """Return a new server at the same address, after `close`."""
        return WebSocketServer(self._welcome, self._number, tries=1)

    @property
    def is_open(self) -> bool:
        """Whether a host is connected."""
        return bool(self._queues)

    def wait(self, seconds: float, wake: int, blocked: bool) -> None:
        """Wait until `wake` becomes readable or the time is up; messages from hosts are ignored."""
        poll = select.poll()
        poll.register(wake, select.POLLIN)
        poll.poll(1e3 * (min(seconds, 1e-3) if blocked else seconds))

    def read(self) -> bytes:
        """Return an empty string: messages from hosts are discarded."""
        return b""

    def write(self, data: bytes) -> int:
        """Send all complete lines and return the number of bytes accepted: 0 while the queue of every host is full."""
        hosts = list(self._queues.values())
        if hosts and all(host.full() for host in hosts):
            return 0
        *lines, self._line = (self._line + data).split(b"\n")
        for line in lines:
            for host in hosts:
                with contextlib.suppress(queue.Full):  # a slow host misses lines that the others get
                    host.put_nowait(line.decode(errors="replace"))
        return len(data)

    def close(self) -> None:
        """Disconnect the hosts and stop listening."""
        self._server.shutdown()
        for connection in list(self._queues):  # older versions of websockets leave these open
            connection.close()

    def _listen(self, first: int, tries: int) -> tuple[Server, int]:
        try:
            from websockets.sync.server import serve
        except ImportError as error:
            raise MissingExtraError("websockets", "websocket", "emulating a WebSocket server") from error
        for number in range(first, first + tries):
            try:
                return serve(self._host, HOST, number, close_timeout=_CLOSE_TIMEOUT), number
            except OSError as error:
                if error.errno != errno.EADDRINUSE:
                    raise PortAccessError(f"cannot listen on {HOST}:{number}: {error}") from error
        raise PortAccessError(f"no port from {first} to {first + tries - 1} on {HOST} is free to listen on")

    def _host(self, connection: ServerConnection) -> None:
        """Serve one host, in its own thread, until it disconnects."""
        from websockets.exceptions import ConnectionClosed

        lines: queue.Queue[str | None] = queue.Queue(MAX_QUEUED)
        sender = threading.Thread(target=_send, args=(connection, lines), daemon=True)
        with contextlib.suppress(ConnectionClosed):
            connection.send(self._welcome.decode().strip())
            self._queues[connection] = lines
            sender.start()
            while True:
                connection.recv()
        self._queues.pop(connection, None)
        with contextlib.suppress(queue.Full):  # if full, the sender is busy and will hit the closed connection
            lines.put_nowait(None)


def _send(connection: ServerConnection, lines: queue.Queue[str | None]) -> None:
    from websockets.exceptions import ConnectionClosed

    with contextlib.suppress(ConnectionClosed):
        while (line := lines.get()) is not None:
            connection.send(line)
