"""Serves a board over HTTP until it is told to end. Effects: opens a port, writes to stderr."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import uvicorn

from pbrs_farm.board.app import application
from pbrs_farm.board.board_state import Board
from pbrs_farm.core.errors import BadInput

_BACKLOG = 256


class _Server(uvicorn.Server):
    """A server that tells the board's streams to end before it waits for them."""

    def __init__(self, board: Board, config: uvicorn.Config) -> None:
        super().__init__(config)
        self._board = board

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._board.ending.set()
        await super().shutdown(sockets)


def server_of(board: Board) -> uvicorn.Server:
    """The server of a board; `run` or `serve` it. It believes no forwarded address."""
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
            limit_concurrency=256,
            timeout_keep_alive=15,
            timeout_graceful_shutdown=5,
            h11_max_incomplete_event_size=32_768,
        ),
    )


def bound_socket(host: str, port: int) -> socket.socket:
    """A socket that listens there; BadInput when the port is taken or the address not ours."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((host.strip("[]"), port))
    except OSError as error:
        listening.close()
        text = f"cannot listen there: {error.strerror}"
        raise BadInput(f"{host}:{port}", "", text, hint="--port another") from None
    listening.listen(_BACKLOG)
    return listening


def default_cache() -> Path:
    """$XDG_CACHE_HOME/pbrs_farm/board, or below ~/.cache."""
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "pbrs_farm" / "board"
