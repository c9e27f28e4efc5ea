"""A view under other light, in the browser. Effects: reads the store, has layers made and kept."""

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

_MAX_BYTES: Final = 512 * 2**20  # of a radiance.exr


def relight(request: Request) -> Response:
    """GET .../relight: the page with its sliders."""
    found = asked_view(request)
    if not found.has("radiance"):
        raise HTTPException(404, "This view has no light stored: radiance.exr is missing.")
    board = board_of(request)
    facts = board.reader.json_object(keys.view_key(found.house, found.id, "view.json"))
    modes = facts.get("modes")
    develop = modes.get("develop") if isinstance(modes, dict) else None
    is_denoised = isinstance(develop, dict) and develop.get("denoised") is not False
    return page(
        request,
        "relight.html",
        view=found,
        home=board.queries.home(found.house),
        is_denoised=is_denoised,
        command=f"pbrs-farm relight {shlex.quote(view_folder(board.reader, found))}",
    )


def light(request: Request) -> Response:
    """GET .../light?denoise=1: the packet of pages/relighting.py."""
    found = asked_view(request)
    board = board_of(request)
    denoise = request.query_params.get("denoise") != "0"

    def make() -> bytes:
        reader, house, view = board.reader, found.house, found.id
        return light_packet_in_process(
            reader.get(keys.view_key(house, view, RADIANCE_EXR), _MAX_BYTES),
            reader.get(keys.view_key(house, view, "view.json")),
            reader.get(keys.RECIPE),
            denoise=denoise,
        )

    words = ("light", found.house, found.id, found.version, str(denoise))
    try:
        data = board.pictures.get(words, "light", make)
    except BadInput as error:
        raise HTTPException(422, str(error)) from None
    except PbrsError:
        raise HTTPException(404, "This view's light cannot be read.") from None
    return Response(data, headers={"Cache-Control": FOREVER})


def view_folder(reader: RootReader, found: ListedView) -> str:
    """The view's folder as a command names it: a path, or the URL of a root that is no folder."""
    store = reader.store
    root = str(store.root) if isinstance(store, FolderStore) else store.url.rstrip("/")
    return f"{root}/{keys.view_key(found.house, found.id)}".rstrip("/")
