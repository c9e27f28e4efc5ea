"""Files of the 3D page of a home: scene, cameras, the sampler's candidates. Effects: reads the store."""

from __future__ import annotations

from typing import Any, Final

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from pbrs_farm.board.index.queries import ListedView
from pbrs_farm.board.pages.lists import asked_home, board_of
from pbrs_farm.board.pages.rendering import thumb_url, view_url
from pbrs_farm.board.pages.tried_viewpoints import candidates_in_process
from pbrs_farm.board.pages.viewing import FOREVER
from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.shown_text import shown

_MAX_GLB_BYTES: Final = 400 * 2**20


def house_glb(request: Request) -> Response:
    """GET /homes/HOUSE/house.glb: the stored scene."""
    home = asked_home(request)
    key = keys.house_key(home.id, "house.glb")
    data = board_of(request).reader.get_or_none(key, _MAX_GLB_BYTES)
    if data is None:
        raise HTTPException(404, "This home has no house.glb, or a too large one.")
    return Response(data, media_type="model/gltf-binary", headers={"Cache-Control": FOREVER})


def scene(request: Request) -> Response:
    """GET /homes/HOUSE/scene.json: rooms, cameras with pictures, numbers of refusals.

    Stored files are not trusted: damaged rows are omitted.
    """
    home = asked_home(request)
    board = board_of(request)
    house = board.reader.json_object(keys.house_key(home.id, "house.json"))
    cameras = board.reader.json_object(keys.house_key(home.id, "cameras.json"))
    stored = {view.id: view for view in board.queries.views_of(home.id)}
    report = cameras.get("report")
    refused = report.get("refused") if isinstance(report, dict) else None
    return JSONResponse(
        {
            "rooms": [_room(r) for r in _dicts(house.get("rooms")) if "id" in r],
            "cameras": [c for c in map(_camera_row(stored), _dicts(cameras.get("views"))) if c],
            "refused": {
                shown(name): n
                for name, n in (refused.items() if isinstance(refused, dict) else ())
                if isinstance(n, int)
            },
        }
    )


def candidates(request: Request) -> Response:
    """GET /homes/HOUSE/candidates.json: all tried viewpoints (pages/tried_viewpoints.py).

    Cached until the home's files change. 422 with the reason if they cannot be sampled again.
    """
    home = asked_home(request)
    board = board_of(request)
    version = board.index.fingerprints().get(home.id, "")

    def make() -> bytes:
        return candidates_in_process(board.reader.url, home.id)

    try:
        data = board.pictures.get(("candidates", home.id, version), "json", make)
    except BadInput as error:
        raise HTTPException(422, str(error)) from None
    return Response(data, media_type="application/json", headers={"Cache-Control": "no-cache"})


def _dicts(value: Any) -> list[dict[str, Any]]:
    return [x for x in value if isinstance(x, dict)] if isinstance(value, list) else []


def _room(row: dict[str, Any]) -> dict[str, str]:
    return {"id": str(row["id"]), "name": shown(row.get("name") or f"Room {row['id']}")}


def _camera_row(stored: dict[str, ListedView]) -> Any:
    """Function from a row of cameras.json to the page's row, None for a damaged one."""

    def drawn(row: dict[str, Any]) -> dict[str, Any] | None:
        try:
            i = row["intrinsics"]
            pose = [float(x) for line in row["world_from_camera_opengl"] for x in line]
            size = [float(i[name]) for name in ("width_px", "height_px", "fx", "fy")]
        except (KeyError, TypeError, ValueError):
            return None
        if len(pose) != 16 or not all(x > 0 for x in size):
            return None
        view = stored.get(str(row.get("id", "")))
        layer = view.shown_layer() if view else ""
        return {
            "id": shown(row.get("id", "")),
            "room": str(row.get("room", "")),
            "pose": pose,
            "size": size,
            "url": view_url(view.house, view.id) if view else "",
            "thumb": thumb_url(view, layer) if view and layer else "",
        }

    return drawn
