"""A view's page and the files it loads. Effects: reads the index and the store, makes pictures.

Every file is found by the view's ids in the index and by a layer's name in core/layers.py: no part
of an address becomes a part of a path otherwise.
"""

from __future__ import annotations

import gzip
import json
import math
from typing import Any, Final

import numpy as np
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse

from pbrs_farm.board.index.queries import ListedView
from pbrs_farm.board.pages.lists import asked_view, board_of
from pbrs_farm.board.pages.recipe_words import recipe_words
from pbrs_farm.board.pages.rendering import page
from pbrs_farm.board.pages.words import OF_A_VIEW, listed
from pbrs_farm.board.pictures import PLANES, packet, shown_png, thumbnail_jpeg
from pbrs_farm.board.root_reader import MAX_PICTURE_BYTES, RootReader
from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput, PbrsError
from pbrs_farm.core.layers import LAYER, LAYERS
from pbrs_farm.formats.layer_file import layer_from_bytes
from pbrs_farm.gallery.label_colours import instance_colours
from pbrs_farm.store.object_store import content_type

FOREVER: Final = "private, max-age=31536000, immutable"  # of an address that holds a version
_STEPS: Final = ("truth", "opengl_dl", "opengl_il", "light", "develop", "view")


def view(request: Request) -> Response:
    """GET /homes/HOUSE/views/VIEW: a view with all its layers."""
    found = asked_view(request)
    board = board_of(request)
    facts = board.reader.json_object(keys.view_key(found.house, found.id, "view.json"))
    # Light is no picture: it is shown by relighting.
    layers = [
        {"name": x.name, "title": x.shown_title, "label": x.is_label, "unit": x.unit}
        for x in LAYERS
        if found.has(x.name) and x.shown_as
    ]
    before, after = board.queries.neighbours(found.house, found.id)
    return page(
        request,
        "view.html",
        view=found,
        home=board.queries.home(found.house),
        layers=layers,
        first=found.shown_layer() or "",
        instances=_instances(facts),
        facts=_camera_facts(facts),
        recipe=recipe_words(board.reader),
        seconds=_seconds(board.reader, found),
        files=_stored_file_rows(board.reader, found),
        before=before,
        after=after,
        words=_words(facts),
        packed=json.dumps({"layers": layers, "instances": _packed_instances(facts)}),
    )


def thumb(request: Request) -> Response:
    """GET .../thumb/LAYER.jpg: a layer small, made once.

    404 for a layer that the view does not have. May be kept for ever, as the address has the
    version of the house's files.
    """
    found, layer = asked_view(request), _asked_layer(request)

    def make() -> bytes:
        return thumbnail_jpeg(layer, *_stored(board_of(request).reader, found, layer))

    return _picture_response(request, found, ("thumb", layer), "jpg", make)


def shown(request: Request) -> Response:
    """GET .../shown/LAYER.png: a layer at its full size, labels as colours.

    A photograph is sent as it is stored; labels become colours once and are kept. 404 for a layer
    that the view does not have.
    """
    found, layer = asked_view(request), _asked_layer(request)

    def make() -> bytes:
        return shown_png(layer, *_stored(board_of(request).reader, found, layer))

    # A photograph is its own file.
    if LAYER[layer].is_photo:
        data, _key = _stored(board_of(request).reader, found, layer)
        return Response(data, media_type="image/png", headers={"Cache-Control": FOREVER})
    return _picture_response(request, found, ("shown", layer), "png", make)


def file(request: Request) -> Response:
    """GET .../file/LAYER: the stored file of a layer, to be saved.

    Sent piece by piece, so a large file needs no memory; 404 above the board's limit for files.
    """
    found, layer = asked_view(request), _asked_layer(request)
    board = board_of(request)
    key = keys.view_key(found.house, found.id, LAYER[layer].file)
    try:
        n_bytes, pieces = board.reader.pieces(key, board.options.limits.file_bytes)
    except PbrsError:
        raise HTTPException(404, "This file is not in the root any more.") from None
    name = f"{found.house}-{found.id}-{LAYER[layer].file.replace('/', '-')}"
    headers = {**_saved_as(name), "Content-Length": str(n_bytes)}
    return StreamingResponse(pieces, media_type=content_type(name), headers=headers)


def view_json(request: Request) -> Response:
    """GET .../view.json: the view's own description, to be saved."""
    found = asked_view(request)
    key = keys.view_key(found.house, found.id, "view.json")
    data = board_of(request).reader.get_or_none(key)
    if data is None:
        raise HTTPException(404, "This view has no view.json yet.")
    return download(data, f"{found.house}-{found.id}-view.json")


def pixels(request: Request) -> Response:
    """GET .../pixels: the labels of every pixel (board/pictures.py).

    A layer that is damaged is left out, and the page then says nothing of it. Packed with gzip.
    """
    found = asked_view(request)
    arrays: dict[str, Any] = {}
    for layer, *_ in PLANES:
        if found.has(layer):
            try:
                data, key = _stored(board_of(request).reader, found, layer)
                arrays[layer] = layer_from_bytes(layer, data, key)
            except (PbrsError, HTTPException):
                continue  # damaged: the probe says nothing of it
    return gzip_response(packet(arrays))


def gzip_response(data: bytes, cache: str = FOREVER) -> Response:
    """Bytes that a script reads, packed on the way."""
    headers = {"Content-Encoding": "gzip", "Cache-Control": cache}
    return Response(gzip.compress(data, 1, mtime=0), headers=headers)


def download(data: bytes, name: str) -> Response:
    """Bytes that a browser saves under a name and never shows."""
    return Response(data, media_type=content_type(name), headers=_saved_as(name))


def _saved_as(name: str) -> dict[str, str]:
    # A key's segments hold no quote and no line end; what is not ASCII is not ours.
    ascii_name = name.encode("ascii", "replace").decode().replace('"', "_")
    return {"Content-Disposition": f'attachment; filename="{ascii_name}"'}


def _asked_layer(request: Request) -> str:
    layer = str(request.path_params["layer"])
    if layer not in LAYER:
        raise HTTPException(404, "There is no such layer.")
    return layer


def _stored(reader: RootReader, found: ListedView, layer: str) -> tuple[bytes, str]:
    """A layer's bytes and their key; 404 where the view has none."""
    key = keys.view_key(found.house, found.id, LAYER[layer].file)
    data = reader.get_or_none(key, MAX_PICTURE_BYTES)
    if data is None:
        raise HTTPException(404, "This view has no such layer.")
    return data, key


def _picture_response(
    request: Request, found: ListedView, what: tuple[str, ...], ending: str, make: Any
) -> Response:
    words = (*what, found.house, found.id, found.version)
    try:
        data = board_of(request).pictures.get(words, ending, make)
    except (BadInput, ValueError, IndexError):
        raise HTTPException(422, "This layer cannot be read.") from None
    kind = "image/jpeg" if ending == "jpg" else "image/png"
    return Response(data, media_type=kind, headers={"Cache-Control": FOREVER})


def _instances(facts: dict[str, Any]) -> list[dict[str, Any]]:
    """The rows of a view.json's instances that have what the page shows, the largest first."""
    # A stranger's view.json may hold anything: rows without id or box are left out.
    rows = facts.get("instances")
    good = [r for r in rows if isinstance(r, dict)] if isinstance(rows, list) else []
    kept = [r for r in good if isinstance(r.get("id"), int) and _is_box(r.get("box2d"))]
    return sorted(
        (
            {
                "id": r["id"],
                "name": str(r.get("name", "")),
                "class": str(r.get("class", "")),
                "share": _number(r.get("fraction")),
                "visible": _number(r.get("visible_fraction")),
                "truncated": bool(r.get("truncated")),
                "box": r["box2d"],
            }
            for r in kept
        ),
        key=lambda r: -r["share"],
    )


def _packed_instances(facts: dict[str, Any]) -> list[list[Any]]:
    """Of each instance what the page's script needs: id, name, class, box, colour."""
    rows = _instances(facts)
    ids = np.array([[r["id"] for r in rows]], np.int64) if rows else np.zeros((1, 0), np.int64)
    # Ids of a stranger's view.json may be any number: only those of an instance layer have colours.
    ids = np.where((ids < 0) | (ids > 65535), 0, ids)
    colours = instance_colours(ids)[0].tolist() if rows else []
    return [
        [r["id"], r["name"], r["class"], r["box"], c] for r, c in zip(rows, colours, strict=True)
    ]


def _is_box(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 4 and all(isinstance(x, int) for x in value)


def _number(value: Any) -> float:
    is_number = isinstance(value, int | float) and math.isfinite(value)
    return float(value) if is_number else 0.0


def _camera_facts(facts: dict[str, Any]) -> list[tuple[str, str]]:
    """What is worth reading of a view.json, as name and text."""
    rows = [(name, facts.get(name)) for name in ("room", "sector", "origin", "score")]
    # What light was made with stands below its mode; views of OpenGL alone have none.
    size = f"{facts.get('width_px')} x {facts.get('height_px')} px"
    light = _object(_object(facts, "modes"), "light")
    lux, noise = _object(light, "floor_lux"), _object(light, "noise")
    rows += [
        ("size", size if "width_px" in facts else None),
        ("integrator", light.get("integrator")),
        ("samples a pixel", light.get("spp")),
        ("noise", _rounded(noise.get("sum"))),
        ("floor, lamps", _with_unit(lux.get("indoor"), "lx")),
        ("floor, daylight", _with_unit(lux.get("outdoor"), "lx")),
        ("seed", light.get("seed")),
        ("recipe's digest", facts.get("recipe")),
    ]
    return [(name, str(value)) for name, value in rows if value not in (None, "")]


def _words(facts: dict[str, Any]) -> list[tuple[str, str]]:
    """What the words of a view's page mean, of those that it shows."""
    named = {name for name, _text in _camera_facts(facts)}
    if _instances(facts):
        named |= {"share", "visible", "cut"}
    return listed(named, OF_A_VIEW)


def _object(holder: dict[str, Any], name: str) -> dict[str, Any]:
    value = holder.get(name)
    return value if isinstance(value, dict) else {}


def _rounded(value: Any) -> str | None:
    return f"{_number(value):.3f}" if value is not None else None


def _with_unit(value: Any, unit: str) -> str | None:
    return f"{_number(value):.0f} {unit}" if value is not None else None


def _seconds(reader: RootReader, found: ListedView) -> list[tuple[str, float, str]]:
    """(step, seconds, worker) of the view's steps that are done."""
    # A step that is not done, or whose marker is damaged, has no row.
    rows = []
    for step in _STEPS:
        marker = reader.json_object(keys.marker_key(found.house, step, found.id))
        if marker:
            rows.append((step, _number(marker.get("seconds")), str(marker.get("worker", ""))))
    return rows


def _stored_file_rows(reader: RootReader, found: ListedView) -> list[tuple[str, str, int]]:
    """(layer, file, bytes) of what can be saved."""
    sizes = (
        (x.name, x.file, reader.size(keys.view_key(found.house, found.id, x.file)))
        for x in LAYERS
        if found.has(x.name)
    )
    return [(name, file, n) for name, file, n in sizes if n is not None]
