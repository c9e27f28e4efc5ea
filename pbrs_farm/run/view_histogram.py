"""The view step's histogram.json, from the pictures that the view has. Effects: reads the store."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import Note
from pbrs_farm.core.layers import LAYER
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.recipe import HistogramFields
from pbrs_farm.formats.layer_file import layer_from_bytes
from pbrs_farm.selection import scene_quality, view_record
from pbrs_farm.selection.quality import ViewPlace
from pbrs_farm.store.object_store import Store

_MISSING_TEXTURE: Final = frozenset({"missing-texture", "unreadable-texture"})


def view_histogram(
    store: Store,
    place: ViewPlace,
    modes: Iterable[Mode],
    view_json: Mapping[str, Any],
    notes: Iterable[Note],
    settings: HistogramFields,
) -> bytes:
    """Bytes of histogram.json of one view (formats.histogram_json.ViewRecord).

    place: "house", "view", "room" and "room_type" (the room's name). modes: those rendered.
    view_json: its "instances" and, where light was
    traced, "noise" of the sum of both groups anywhere below "modes". notes: of the house.
    Raises BadInput when a picture cannot be read.
    """

    def picture(layer: str) -> Any:
        key = keys.view_key(place["house"], place["view"], LAYER[layer].file)
        return layer_from_bytes(layer, store.get(key), key)

    depth = picture("depth")
    if depth.ndim != 2 or depth.dtype != np.uint16:
        raise BadInput(keys.view_key(place["house"], place["view"], "depth.png"), "", "no depth")
    # Measure what depth and labels tell of the view.
    scene = scene_quality(
        depth,
        view_json.get("instances", ()),
        settings,
        noise=_noise(view_json),
        missing_textures=sum(note.kind in _MISSING_TEXTURE for note in notes),
    )
    pictures = {mode: picture(mode.value) for mode in sorted(set(modes))}
    return view_record(place, pictures, depth, scene, settings).json_bytes()


def _noise(view_json: Mapping[str, Any]) -> float | None:
    light = (view_json.get("modes") or {}).get("light") or {}
    # Path tracing has a number per light group and of their sum.
    noise = light.get("noise")
    if isinstance(noise, Mapping):
        noise = noise.get("sum")
    return float(noise) if isinstance(noise, int | float) else None
