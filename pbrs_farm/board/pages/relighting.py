"""Relighting of a view in the browser. Effects: reads the store, makes layers."""

from __future__ import annotations

import shlex
from typing import Final

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from pbrs_farm.board.index.queries import ListedView
from pbrs_farm.board.pages.light_packet import light_packet_in_process
from pbrs_farm.board.pages.lists import asked_view, board_of
from pbrs_farm.board.pages.rendering import page
from pbrs_farm.board.pages.viewing import FOREVER
from pbrs_farm.board.root_reader import RootReader
from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput, PbrsError
from pbrs_farm.formats.radiance_exr import FILE as RADIANCE_EXR
from pbrs_farm.store.folder import FolderStore

_MAX_BYTES: Final = 512 * 2**20  # maximum size of radiance.exr


def relight(request: Request) -> Response:
    """GET .../relight: the page with its sliders."""
    entry = asked_view(request)
    if not entry.has("radiance"):
        raise HTTPException(404, "This view has no light stored: radiance.exr is missing.")
    board = board_of(request)
    facts = board.reader.json_object(keys.view_key(entry.house, entry.id, "view.json"))
    modes = facts.get("modes")
    develop = modes.get("develop") if isinstance(modes, dict) else None
    is_denoised = isinstance(develop, dict) and develop.get("denoised") is not False
    return page(
        request,
        "relight.html",
        view=entry,
        home=board.queries.home(entry.house),
        is_denoised=is_denoised,
        command=f"pbrs-farm relight {shlex.quote(view_folder(board.reader, entry))}",
    )


def light(request: Request) -> Response:
    """GET .../light?denoise=1: the packet of pages/light_packet.py."""
    entry = asked_view(request)
    board = board_of(request)
    denoise = request.query_params.get("denoise") != "0"

    def make() -> bytes:
        reader, house, view = board.reader, entry.house, entry.id
        return light_packet_in_process(
            reader.get(keys.view_key(house, view, RADIANCE_EXR), _MAX_BYTES),
            reader.get(keys.view_key(house, view, "view.json")),
            reader.get(keys.RECIPE),
            denoise=denoise,
        )

    words = ("light", entry.house, entry.id, entry.version, str(denoise))
    try:
        data = board.pictures.get(words, "light", make)
    except BadInput as error:
        raise HTTPException(422, str(error)) from None
    except PbrsError:
        raise HTTPException(404, "This view's light cannot be read.") from None
    return Response(data, headers={"Cache-Control": FOREVER})


def view_folder(reader: RootReader, entry: ListedView) -> str:
    """The view's folder in commands: a path, or a URL."""
    store = reader.store
    root = str(store.root) if isinstance(store, FolderStore) else store.url.rstrip("/")
    return f"{root}/{keys.view_key(entry.house, entry.id)}".rstrip("/")
