"""A TCP proxy on loopback whose connections can be made half-open: alive to both ends, and silent."""

from __future__ import annotations

import contextlib
import socket
import threading
from types import TracebackType


class StallingProxy:
    """Forwards connections to a port of this machine; `stall` silences the open ones."""

    def __init__(self, port: int) -> None:
        self._to = port
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._stalls_new = False
        self._pairs: list[tuple[socket.socket, socket.socket, threading.Event]] = []

    @property
    def url(self) -> str:
        return f"redis://127.0.0.1:{self._listener.getsockname()[1]}/0"

    @property
    def n_connections(self) -> int:
        """Number of connections ever accepted."""
        return len(self._pairs)

    def __enter__(self) -> StallingProxy:
        threading.Thread(target=self._accept, daemon=True).start()
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:  # fmt: skip
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for near, far, _is_stalled in self._pairs:
            near.close()
            far.close()

    def stall(self, *, also_new: bool = False) -> None:
        """Let no byte through on any open connection. also_new: nor on later ones."""
        self._stalls_new = also_new
        for _near, _far, is_stalled in self._pairs:
            is_stalled.set()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _address = self._listener.accept()
                far, is_stalled = (
                    socket.create_connection(("127.0.0.1", self._to)),
                    threading.Event(),
                )
                if self._stalls_new:
                    is_stalled.set()
                self._pairs.append((near, far, is_stalled))
                for a, b in ((near, far), (far, near)):
                    threading.Thread(target=_forward, args=(a, b, is_stalled), daemon=True).start()


def _forward(a: socket.socket, b: socket.socket, is_stalled: threading.Event) -> None:
    with contextlib.suppress(OSError):
        while data := a.recv(65536):
            if not is_stalled.is_set():
                b.sendall(data)
        # The end of a connection is silent as well.
        if not is_stalled.is_set():
            b.shutdown(socket.SHUT_WR)
