"""Serves a board over HTTP until a signal ends it. Effects: opens a port, writes to stderr."""

from __future__ import annotations

import asyncio
import os
import socket
import time
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, Final

import anyio.to_thread
import h11
import uvicorn
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from pbrs_farm.board.board_state import Board
from pbrs_farm.board.guard import Guard
from pbrs_farm.board.options import BoardLimits, is_loopback
from pbrs_farm.board.pages import farming, house_scene, lists, login, relighting, viewing
from pbrs_farm.board.pages.rendering import page
from pbrs_farm.core.errors import BadInput, PbrsError

_THREADS: Final = 8  # each with a connection to the index
_VIEW: Final = "/homes/{house}/views/{view}"
_BACKLOG = 256


def connection_class(limits: BoardLimits) -> type[asyncio.Protocol]:
    """uvicorn's connection with these limits; a class, since uvicorn passes no arguments."""

    class Connection(_Bounded):
        pass

    Connection.limits = limits
    return Connection


class _Bounded(H11Protocol):
    """A connection with a deadline for the header of each request.

    If an address or the board has too many connections, the one without a request for the longest time is closed.
    """

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


def application(board: Board) -> ASGIApp:
    """The ASGI application of a board, which starts and ends the board's threads.

    All requests pass the guard. `server_of` sets limits of connections.
    """

    @asynccontextmanager
    async def lifespan(_app: Starlette) -> AsyncIterator[None]:
        anyio.to_thread.current_default_thread_limiter().total_tokens = _THREADS
        board.refresher.start()
        try:
            yield
        finally:
            board.refresher.end()

    app = Starlette(
        routes=_routes(),
        exception_handlers={HTTPException: _not_found, PbrsError: _failed, Exception: _broken},
        lifespan=lifespan,
    )
    app.state.board = board
    # The outermost layer, so that errors have its headers too.
    return Guard(app, board.options, board.sessions)


def _routes() -> list[Route]:
    return [
        Route("/", lists.homes),
        Route("/views", lists.views),
        Route("/contents", lists.contents),
        Route("/progress", lists.progress),
        Route("/homes/{house}", lists.home),
        Route("/homes/{house}/house.glb", house_scene.house_glb),
        Route("/homes/{house}/scene.json", house_scene.scene),
        Route("/homes/{house}/candidates.json", house_scene.candidates),
        Route(_VIEW, viewing.view),
        Route(f"{_VIEW}/thumb/{{layer}}.jpg", viewing.thumb),
        Route(f"{_VIEW}/shown/{{layer}}.png", viewing.shown),
        Route(f"{_VIEW}/file/{{layer}}", viewing.file),
        Route(f"{_VIEW}/view.json", viewing.view_json),
        Route(f"{_VIEW}/pixels", viewing.pixels),
        Route(f"{_VIEW}/relight", relighting.relight),
        Route(f"{_VIEW}/light", relighting.light),
        Route("/farm", farming.farm),
        Route("/farm/events", farming.events),
        Route("/farm/confirm", farming.confirm),
        Route("/farm/do", farming.steer, methods=["POST"]),
        Route("/farm/jobs/{job}", farming.job),
        Route("/farm/jobs/{job}/log", farming.log),
        Route("/login", login.login),
        Route("/login", login.log_in, methods=["POST"]),
        Route("/logout", login.log_out, methods=["POST"]),
        Route("/static/{name}", login.asset),
        Route("/health", login.health),
    ]


def _not_found(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    # Link to the home of a missing view.
    house = request.path_params.get("house", "") if "view" in request.path_params else ""
    home = house if request.app.state.board.queries.home(house) else ""
    return page(request, "message.html", error.status_code, text=error.detail, home=home)


def _failed(request: Request, error: Exception) -> Response:
    status = 404 if isinstance(error, BadInput) else 502
    return page(request, "message.html", status, text=str(error), home="")


def _broken(_request: Request, _error: Exception) -> Response:
    # The traceback goes to the log only.
    return PlainTextResponse("internal error: see the log of the board\n", 500)


class _Server(uvicorn.Server):
    """A server that ends the board's streams at its shutdown."""

    def __init__(self, board: Board, config: uvicorn.Config) -> None:
        super().__init__(config)
        self._board = board

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._board.ending.set()
        await super().shutdown(sockets)


def server_of(board: Board) -> uvicorn.Server:
    """The server of a board, without log of access and without trust in forwarded addresses."""
    return _Server(
        board,
        uvicorn.Config(
            application(board),
            host=board.options.host,
            port=board.options.port,
            log_level="warning",
            access_log=False,
            server_header=False,
            proxy_headers=False,
            http=connection_class(board.options.limits),
            timeout_keep_alive=15,
            timeout_graceful_shutdown=5,
            h11_max_incomplete_event_size=32_768,
        ),
    )


def bound_socket(host: str, port: int) -> socket.socket:
    """A listening socket; port 0 = any free port. BadInput if the address is not available."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((host.strip("[]"), port))
    except (OSError, OverflowError) as error:
        listening.close()
        reason = getattr(error, "strerror", "") or "a port is a number in 0..65535"
        text = f"cannot listen there: {reason}"
        raise BadInput(f"{host}:{port}", "", text, hint="use another --port") from None
    listening.listen(_BACKLOG)
    return listening


def default_cache() -> Path:
    """$XDG_CACHE_HOME/pbrs_farm/board, or below ~/.cache."""
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "pbrs_farm" / "board"
