"""The verb that shows an output root and a farm in a browser. Effects: serves HTTP."""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from getpass import getuser
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from pbrs_farm.commands.arguments import Verb, echo, store_of, warn
from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.installation import install_command
from pbrs_farm.store.secret import Secret

if TYPE_CHECKING:
    from pbrs_farm.board.live_farm import LiveFarm
    from pbrs_farm.board.options import BoardOptions


def add_verbs(verb: Verb) -> None:
    """Add board."""
    verb("board", _board)


def _board(args: argparse.Namespace) -> None:
    from pbrs_farm.board.board_state import new_board
    from pbrs_farm.board.options import BoardOptions
    from pbrs_farm.board.serve import bound_socket, default_cache, server_of
    from pbrs_farm.board.sessions import new_token

    # Refuse a wrong root before opening a port.
    root = args.root or os.environ.get("PBRS_STORE", "")
    if not root:
        raise BadInput("board", "", "nothing to show", hint="pbrs-farm board OUT, or PBRS_STORE")
    store = store_of(root)
    token = _token(args.token_file) if args.token_file else new_token()
    # Bind first: with port 0 the actual port is known only then.
    listening = bound_socket(args.host, args.port)
    options = BoardOptions(
        cache=args.cache or default_cache(),
        host=args.host,
        port=listening.getsockname()[1],
        token=token,
        is_readonly=args.readonly,
        allowed_hosts=tuple(args.allow_host),
        price_per_slot_hour=args.price,
        currency=args.currency,
    )
    board = new_board(store, options, _farm(store.url))
    _say(options, token, is_own_token=args.token_file is None)
    server_of(board).run(sockets=[listening])


def _farm(store_url: str) -> LiveFarm | None:
    """The farm that the environment names, if any."""
    if not (os.environ.get("PBRS_REDIS_URL") or os.environ.get("PBRS_REDIS_URL_FILE")):
        return None
    if find_spec("redis") is None:
        raise MachineFailed("PBRS_REDIS_URL needs redis", hint=install_command("workers"))
    from pbrs_farm.board.live_farm import LiveFarm
    from workers.client.farm_client import Farm
    from workers.config import config_from_environment

    return LiveFarm(Farm(replace(config_from_environment(), store_url=store_url)))


def _say(options: BoardOptions, token: Secret, *, is_own_token: bool) -> None:
    host = f"[{options.host}]" if ":" in options.host else options.host
    echo(f"http://{host}:{options.port}/")
    # SSH_CONNECTION: address and port of the client, then those of this machine
    connection = os.environ.get("SSH_CONNECTION", "").split()
    if options.is_private and len(connection) == 4:
        tunnel = f"ssh -L {options.port}:{host}:{options.port} {getuser()}@{connection[2]}"
        echo(f"from your machine: {tunnel}, then http://127.0.0.1:{options.port}/ there")
    if is_own_token and not (options.is_readonly and options.is_private):
        echo(f"token: {token.reveal()}")
    if not options.is_private:
        warn(f"other machines can reach {options.host}: put a proxy with TLS in front of the board")


def _token(path: Path) -> Secret:
    """The token in a file; BadInput if it cannot be read or is too short."""
    from pbrs_farm.regular_files import fault_of, read_regular, text_from_bytes

    try:
        text = text_from_bytes(read_regular(path, 4096)).strip()
    except OSError as error:
        raise BadInput(path, "", fault_of(error)) from None
    except UnicodeDecodeError:
        raise BadInput(path, "", "is not text") from None
    if len(text) < 16:
        raise BadInput(path, "", "expected a token of 16 characters or more")
    return Secret(text)
