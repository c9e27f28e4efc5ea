"""Limits of connections: number and time until a request. Effects: closes connections.

The header of a request must be complete within a deadline. If an address or the board has too many
connections, the one without a request for the longest time is closed.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterable
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from pbrs_farm.board.options import BoardLimits, is_loopback


def connection_class(limits: BoardLimits) -> type[asyncio.Protocol]:
    """uvicorn's connection with these limits; a class, since uvicorn passes no arguments."""

    class Connection(_Bounded):
        pass

    Connection.limits = limits
    return Connection


class _Bounded(H11Protocol):
    """A connection with a deadline."""

    limits = BoardLimits()

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._since = time.monotonic()
        self._deadline: asyncio.TimerHandle | None = None  # of the next header

    @property
    def address(self) -> str:
        """Address of the client."""
        return self.client[0] if self.client else ""

    @property
    def is_asking(self) -> bool:
        """True during a request."""
        return self.cycle is not None and not self.cycle.response_complete

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._await_header()
        same = [c for c in self.connections if c.address == self.address]  # type: ignore[union-attr]
        if len(same) > self.limits.connections_per_address:
            self._make_room(same)
        # Probes of this machine have no limit.
        elif len(self.connections) > self.limits.connections and not is_loopback(self.address):
            self._make_room(self.connections)

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self.conn.their_state is h11.IDLE:
            self._await_header()
        else:
            self._end_deadline()

    def connection_lost(self, exc: Exception | None) -> None:
        self._end_deadline()
        super().connection_lost(exc)

    def _await_header(self) -> None:
        if self._deadline is None:
            self._deadline = self.loop.call_later(self.limits.receive_s, self.transport.abort)

    def _end_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _make_room(self, among: Iterable[Any]) -> None:
        """Close the connection idle for the longest time, or else this one."""
        idle = [c for c in among if c is not self and not c.is_asking]
        ended = min(idle, key=lambda c: c._since, default=self)
        # Its transport ends in the next round of the loop, but it counts no more.
        self.connections.discard(ended)
        ended.transport.abort()
