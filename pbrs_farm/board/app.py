"""The board as an ASGI application: its routes behind the guard. Effects: those of its routes."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final

import anyio.to_thread
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from pbrs_farm.board.board_state import Board
from pbrs_farm.board.pages import entering, farming, house_scene, lists, relighting, viewing
from pbrs_farm.board.pages.rendering import page
from pbrs_farm.board.security.guard import Guard
from pbrs_farm.core.errors import BadInput, PbrsError

_THREADS: Final = 8  # that answer at once: each holds a connection to the index
_VIEW: Final = "/homes/{house}/views/{view}"


def application(board: Board) -> ASGIApp:
    """The application of a board; it starts and ends the board's threads with itself."""

    @asynccontextmanager
    async def lifespan(_app: Starlette) -> AsyncIterator[None]:
        anyio.to_thread.current_default_thread_limiter().total_tokens = _THREADS
        board.start()
        try:
            yield
        finally:
            board.end()

    app = Starlette(
        routes=_routes(),
        exception_handlers={HTTPException: _not_found, PbrsError: _failed, Exception: _broken},
        lifespan=lifespan,
    )
    app.state.board = board
    # Outside of everything, so that answers to errors carry its headers, too.
    return Guard(app, board.options, board.sessions)


def _routes() -> list[Route]:
    return [
        Route("/", lists.homes),
        Route("/views", lists.views),
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
        Route("/login", entering.login),
        Route("/login", entering.log_in, methods=["POST"]),
        Route("/logout", entering.log_out, methods=["POST"]),
        Route("/static/{name}", entering.asset),
        Route("/health", entering.health),
    ]


def _not_found(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    return page(request, "told.html", error.status_code, text=error.detail)


def _failed(request: Request, error: Exception) -> Response:
    status = 404 if isinstance(error, BadInput) else 502
    return page(request, "told.html", status, text=str(error))


def _broken(_request: Request, _error: Exception) -> Response:
    # The traceback is in the log; a browser is told nothing of it.
    return PlainTextResponse("the board failed at this: its log says why\n", 500)
