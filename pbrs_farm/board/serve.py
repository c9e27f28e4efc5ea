"""Serves a board over HTTP until a signal ends it. Effects: opens a port, writes to stderr."""

from __future__ import annotations

import os
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Final

import anyio.to_thread
import uvicorn
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from pbrs_farm.board.board_state import Board
from pbrs_farm.board.connections import connection_class
from pbrs_farm.board.guard import Guard
from pbrs_farm.board.pages import farming, house_scene, lists, login, relighting, viewing
from pbrs_farm.board.pages.rendering import page
from pbrs_farm.core.errors import BadInput, PbrsError

_THREADS: Final = 8  # each with a connection to the index
_VIEW: Final = "/homes/{house}/views/{view}"
_BACKLOG = 256


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
