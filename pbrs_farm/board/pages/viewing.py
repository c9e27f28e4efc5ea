"""A view's page and its files, with the root's recipe in words of the command line. Effects: reads the index and the store, makes pictures.

Files are looked up by ids in the index and names in core/layers.py; no other part of an address
becomes part of a path.
"""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse

from pbrs_farm.board.index.house_rows import finite
from pbrs_farm.board.index.queries import ListedView
from pbrs_farm.board.pages.lists import asked_view, board_of
from pbrs_farm.board.pages.rendering import page
from pbrs_farm.board.pages.words import OF_A_VIEW, listed
from pbrs_farm.board.pictures import PLANES, packet, shown_png, thumbnail_jpeg
from pbrs_farm.board.root_reader import MAX_PICTURE_BYTES, RootReader
from pbrs_farm.core import keys
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.errors import BadInput, BadRecipe, PbrsError
from pbrs_farm.core.layers import LAYER, LAYERS
from pbrs_farm.core.recipe import RECIPE_NAMES, differences, recipe_from_json, recipe_from_name
from pbrs_farm.formats.layer_file import layer_from_bytes
from pbrs_farm.gallery.label_colours import instance_colours
from pbrs_farm.store.object_store import content_type

FOREVER: Final = "private, max-age=31536000, immutable"  # for addresses with a version
_STEPS: Final = ("truth", "opengl_dl", "opengl_il", "light", "develop", "view")
_MOST_BYTES: Final = 2**20


def view(request: Request) -> Response:
    """GET /homes/HOUSE/views/VIEW: a view with all its layers."""
    entry = asked_view(request)
    board = board_of(request)
    facts = board.reader.json_object(keys.view_key(entry.house, entry.id, "view.json"))
    # Light is shown on the page Relight only.
    layers = [
        {"name": x.name, "title": x.shown_title, "label": x.is_label, "unit": x.unit}
        for x in LAYERS
        if entry.has(x.name) and x.shown_as
    ]
    before, after = board.queries.neighbours(entry.house, entry.id)
    return page(
        request,
        "view.html",
        view=entry,
        home=board.queries.home(entry.house),
        layers=layers,
        first=entry.shown_layer() or "",
        instances=_instances(facts),
        facts=_camera_facts(facts),
        camera=_camera_expression(facts),
        recipe=recipe_words(board.reader),
        seconds=_seconds(board.reader, entry),
        files=_stored_file_rows(board.reader, entry),
        before=before,
        after=after,
        words=_words(facts),
        packed=json.dumps({"layers": layers, "instances": _packed_instances(facts)}),
    )


def thumb(request: Request) -> Response:
    """GET .../thumb/LAYER.jpg: thumbnail of a layer, cached; 404 without the layer."""
    return _picture_response(request, "thumb", "jpg", thumbnail_jpeg)


def shown(request: Request) -> Response:
    """GET .../shown/LAYER.png: a layer at full size, labels as colours; 404 without the layer."""
    layer = _asked_layer(request)
    if LAYER[layer].is_photo:
        data, _key = _stored(board_of(request).reader, asked_view(request), layer)
        return Response(data, media_type="image/png", headers={"Cache-Control": FOREVER})
    return _picture_response(request, "shown", "png", shown_png)


def file(request: Request) -> Response:
    """GET .../file/LAYER: download of the file of a layer; 404 above the board's limit."""
    entry, layer = asked_view(request), _asked_layer(request)
    board = board_of(request)
    key = keys.view_key(entry.house, entry.id, LAYER[layer].file)
    try:
        n_bytes, pieces = board.reader.pieces(key, board.options.limits.file_bytes)
    except PbrsError:
        raise HTTPException(404, "This file is not in the root any more.") from None
    name = f"{entry.house}-{entry.id}-{LAYER[layer].file.replace('/', '-')}"
    headers = {**_saved_as(name), "Content-Length": str(n_bytes)}
    return StreamingResponse(pieces, media_type=content_type(name), headers=headers)


def view_json(request: Request) -> Response:
    """GET .../view.json: download of the view's description."""
    entry = asked_view(request)
    key = keys.view_key(entry.house, entry.id, "view.json")
    data = board_of(request).reader.get_or_none(key)
    if data is None:
        raise HTTPException(404, "This view has no view.json yet.")
    name = f"{entry.house}-{entry.id}-view.json"
    return Response(data, media_type=content_type(name), headers=_saved_as(name))


def pixels(request: Request) -> Response:
    """GET .../pixels: the labels of every pixel (board/pictures.py), without damaged layers."""
    entry = asked_view(request)
    arrays: dict[str, Any] = {}
    for layer, *_ in PLANES:
        if entry.has(layer):
            try:
                data, key = _stored(board_of(request).reader, entry, layer)
                arrays[layer] = layer_from_bytes(layer, data, key)
            except (PbrsError, HTTPException):
                continue
    headers = {"Content-Encoding": "gzip", "Cache-Control": FOREVER}
    return Response(gzip.compress(packet(arrays), 1, mtime=0), headers=headers)


def _saved_as(name: str) -> dict[str, str]:
    # Segments of keys have neither quotes nor line ends.
    ascii_name = name.encode("ascii", "replace").decode().replace('"', "_")
    return {"Content-Disposition": f'attachment; filename="{ascii_name}"'}


def _asked_layer(request: Request) -> str:
    layer = str(request.path_params["layer"])
    if layer not in LAYER:
        raise HTTPException(404, "There is no such layer.")
    return layer


def _stored(reader: RootReader, entry: ListedView, layer: str) -> tuple[bytes, str]:
    """Bytes of a layer and their key; 404 without the layer."""
    key = keys.view_key(entry.house, entry.id, LAYER[layer].file)
    data = reader.get_or_none(key, MAX_PICTURE_BYTES)
    if data is None:
        raise HTTPException(404, "This view has no such layer.")
    return data, key


def _picture_response(
    request: Request, kind: str, ending: str, draw: Callable[[str, bytes, str], bytes]
) -> Response:
    """A cached picture of the requested layer; draw: layer, bytes and key -> picture."""
    entry, layer = asked_view(request), _asked_layer(request)
    board, words = board_of(request), (kind, layer, entry.house, entry.id, entry.version)
    try:
        data = board.pictures.get(
            words, ending, lambda: draw(layer, *_stored(board.reader, entry, layer))
        )
    except (BadInput, ValueError, IndexError):
        raise HTTPException(422, "This layer cannot be read.") from None
    media_type = "image/jpeg" if ending == "jpg" else "image/png"
    return Response(data, media_type=media_type, headers={"Cache-Control": FOREVER})


def _instances(facts: dict[str, Any]) -> list[dict[str, Any]]:
    """Instances of a view.json, largest first, without damaged rows."""
    rows = facts.get("instances")
    dicts = [r for r in rows if isinstance(r, dict)] if isinstance(rows, list) else []
    valid = [r for r in dicts if isinstance(r.get("id"), int) and _is_box(r.get("box2d"))]
    return sorted(
        (
            {
                "id": r["id"],
                "name": str(r.get("name", "")),
                "class": str(r.get("class", "")),
                "share": finite(r.get("fraction")),
                "visible": finite(r.get("visible_fraction")),
                "truncated": bool(r.get("truncated")),
                "box": r["box2d"],
            }
            for r in valid
        ),
        key=lambda r: -r["share"],
    )


def _packed_instances(facts: dict[str, Any]) -> list[list[Any]]:
    """Id, name, class, box and colour of each instance, for the page's script."""
    rows = _instances(facts)
    ids = np.array([[r["id"] for r in rows]], np.int64) if rows else np.zeros((1, 0), np.int64)
    # Ids outside of the range of an instance layer have no colour.
    ids = np.where((ids < 0) | (ids > 65535), 0, ids)
    colours = instance_colours(ids)[0].tolist() if rows else []
    return [
        [r["id"], r["name"], r["class"], r["box"], c] for r, c in zip(rows, colours, strict=True)
    ]


def _is_box(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 4 and all(isinstance(x, int) for x in value)


def _camera_facts(facts: dict[str, Any]) -> list[tuple[str, str]]:
    """(name, text) of the facts in a view.json for the page."""
    rows = [(name, facts.get(name)) for name in ("room", "sector", "origin", "score")]
    size = f"{facts.get('width_px')} x {facts.get('height_px')} px"
    light = _object(_object(facts, "modes"), "light")
    lux, noise = _object(light, "floor_lux"), _object(light, "noise")
    rows += [
        ("size", size if "width_px" in facts else None),
        ("integrator", light.get("integrator")),
        ("samples per pixel", light.get("spp")),
        ("noise", _rounded(noise.get("sum"))),
        ("floor, lamps", _with_unit(lux.get("indoor"), "lx")),
        ("floor, daylight", _with_unit(lux.get("outdoor"), "lx")),
        ("seed", light.get("seed")),
        ("recipe digest", facts.get("recipe")),
    ]
    return [(name, str(value)) for name, value in rows if value not in (None, "")]


def _camera_expression(facts: dict[str, Any]) -> str:
    """Python that makes the view's camera; "" for other lenses than a pin-hole and for damaged facts."""
    if "lens" in facts:
        return ""
    size: Any = facts.get("width_px"), facts.get("height_px")
    try:
        pose, k = (np.asarray(facts.get(x), np.float64) for x in ("world_from_camera_opencv", "K"))
        Camera.from_opencv(pose, k, size=size)
    except (PbrsError, TypeError, ValueError):
        return ""
    return f"pf.Camera.from_opencv({pose.tolist()}, K={k.tolist()}, size={size})"


def _words(facts: dict[str, Any]) -> list[tuple[str, str]]:
    """Glossary of a view's page."""
    named = {name for name, _text in _camera_facts(facts)}
    if _instances(facts):
        named |= {"share", "visible", "cropped"}
    return listed(named, OF_A_VIEW)


def _object(holder: dict[str, Any], name: str) -> dict[str, Any]:
    value = holder.get(name)
    return value if isinstance(value, dict) else {}


def _rounded(value: Any) -> str | None:
    return f"{finite(value):.3f}" if value is not None else None


def _with_unit(value: Any, unit: str) -> str | None:
    return f"{finite(value):.0f} {unit}" if value is not None else None


def _seconds(reader: RootReader, entry: ListedView) -> list[tuple[str, float, str]]:
    """(step, seconds, worker) of the view's finished steps."""
    rows = []
    for step in _STEPS:
        marker = reader.json_object(keys.marker_key(entry.house, step, entry.id))
        if marker:
            rows.append((step, finite(marker.get("seconds")), str(marker.get("worker", ""))))
    return rows


def _stored_file_rows(reader: RootReader, entry: ListedView) -> list[tuple[str, str, int]]:
    """(layer, file, bytes) of the downloads."""
    sizes = (
        (x.name, x.file, reader.size(keys.view_key(entry.house, entry.id, x.file)))
        for x in LAYERS
        if entry.has(x.name)
    )
    return [(name, file, n) for name, file, n in sizes if n is not None]


@dataclass(frozen=True)
class RecipeWords:
    """Values of --recipe and --set: a preset and every different field, "light.spp=16"."""

    preset: str
    settings: tuple[str, ...]


def recipe_words(reader: RootReader) -> RecipeWords | None:
    """The root's recipe as a preset and settings; None without a recipe of this version.

    The preset with the fewest different fields, and of several the one with the recipe's name.
    """
    data = reader.get_or_none(keys.RECIPE, _MOST_BYTES)
    if data is None:
        return None
    try:
        recipe = recipe_from_json(data, keys.RECIPE)
    except BadRecipe:
        return None
    changes = {name: differences(recipe_from_name(name), recipe) for name in RECIPE_NAMES}
    preset = min(changes, key=lambda name: (len(changes[name]), name != recipe.name))
    return RecipeWords(preset, tuple(_setting(line) for line in changes[preset]))


def _setting(difference: str) -> str:
    """ "light.spp: 64 -> 16" as "light.spp=16"."""
    path, _, values = difference.partition(": ")
    return f"{path}={values.rpartition(' -> ')[2]}"
