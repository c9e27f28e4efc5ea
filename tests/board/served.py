"""A served board on a free port of this machine, in a thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx

from pbrs_farm.board.board_state import new_board
from pbrs_farm.board.live_farm import LiveFarm
from pbrs_farm.board.options import BoardOptions
from pbrs_farm.board.serve import bound_socket, server_of
from pbrs_farm.store import store_from_url
from pbrs_farm.store.secret import Secret

TOKEN = "a token that nobody guesses"


@contextmanager
def served(
    root: str, cache: Path, farm: LiveFarm | None = None, **options: Any
) -> Iterator[httpx.Client]:
    """A client of the board of a root, after the board has read all of it.

    options: of BoardOptions; host is the board's configured host, it listens on 127.0.0.1.
    """
    listening = bound_socket("127.0.0.1", 0)
    port = listening.getsockname()[1]
    chosen = replace(BoardOptions(cache=cache, port=port, token=Secret(TOKEN)), **options)
    board = new_board(store_from_url(root), chosen, farm)
    board.refresher.refresh()
    server = server_of(board)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]}, daemon=True)
    thread.start()
    try:
        while not server.started:
            time.sleep(0.005)
        with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=20) as client:
            yield client
    finally:
        server.should_exit = True
        thread.join(timeout=10)


def log_in(client: httpx.Client, token: str = TOKEN) -> httpx.Response:
    """Show the token; the client keeps the cookie."""
    return client.post("/login", data={"token": token})
