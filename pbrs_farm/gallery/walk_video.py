"""Sequences of frames as mp4 films, with and without labels, in memory while coded. Reads pictures."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.layers import LAYER
from pbrs_farm.export.chosen_view import PICTURES
from pbrs_farm.formats.film_mp4 import film, film_pace
from pbrs_farm.formats.layer_file import layer_from_bytes
from pbrs_farm.formats.output_folder import ViewEntry
from pbrs_farm.gallery import label_colours as colours
from pbrs_farm.regular_files import read_regular

_LABELS: Final = ("depth", "normal", "semantic", "instance", "flow_forward")


def sequences_of(views: Sequence[ViewEntry]) -> dict[str, list[ViewEntry]]:
    """House id -> its frames in order, of a rig's first camera, finished ones only."""
    walks: dict[str, list[ViewEntry]] = {}
    for view in views:
        if view.facts.get("frame") is not None and not view.shot.eye:
            walks.setdefault(view.house.id, []).append(view)
    return {
        house: sorted(walk, key=lambda v: int(v.facts["frame"])) for house, walk in walks.items()
    }


def films_of(frames: Sequence[ViewEntry]) -> dict[str, bytes]:
    """ "picture", "labels" (beside it) -> mp4 of frames; BadInput for a missing picture, MachineFailed."""
    fps = _fps(frames)
    picture = _mode(frames[0])
    depth_m = _depth_range(frames)
    return {
        "picture": film((_photo(f, picture) for f in frames), fps),
        "labels": film((_beside(f, picture, depth_m) for f in frames), fps),
    }


def _fps(frames: Sequence[ViewEntry]) -> Fraction:
    first, last = (
        (int(f.facts["frame"]), float(f.facts["time_s"])) for f in (frames[0], frames[-1])
    )
    return film_pace(first, last)


def _mode(frame: ViewEntry) -> str:
    for mode in PICTURES:
        if frame.file(f"{mode}.png") is not None:
            return str(mode)
    raise BadInput(
        frame.folder, "", "has no picture to film", hint="pbrs-farm run --modes opengl_il"
    )


def _frame_layer(frame: ViewEntry, name: str) -> Any:
    path = frame.file(LAYER[name].file)
    if path is None:
        return None
    return layer_from_bytes(name, read_regular(path), str(path))


def _photo(frame: ViewEntry, mode: str) -> Srgb8Image:
    rgb = _frame_layer(frame, mode)
    if rgb is None:
        raise BadInput(frame.folder, f"{mode}.png", "is missing", hint="finish the run first")
    return np.asarray(rgb[..., :3], np.uint8)


def _depth_range(frames: Sequence[ViewEntry]) -> tuple[float, float]:
    """Near and far end of the depth scale for the whole film, to avoid flicker."""
    ranges = []
    for frame in frames[:: max(len(frames) // 10, 1)]:
        depth = _frame_layer(frame, "depth")
        if depth is not None:
            ranges.append(colours.depth_range_m(depth))
    return min((r[0] for r in ranges), default=0.0), max((r[1] for r in ranges), default=1.0)


def _beside(frame: ViewEntry, mode: str, depth_m: tuple[float, float]) -> Srgb8Image:
    """The picture and its labels as tiles, three a row."""
    picture = _photo(frame, mode)
    tiles = [picture]
    for name in _LABELS:
        stored = _frame_layer(frame, name)
        tiles.append(
            np.full_like(picture, 255) if stored is None else _shown(name, stored, depth_m)
        )
    rows = [np.concatenate(tiles[k : k + 3], axis=1) for k in range(0, len(tiles), 3)]
    return np.concatenate(rows, axis=0)


def _shown(name: str, stored: Any, depth_m: tuple[float, float]) -> Srgb8Image:
    # Use one scale for the whole film, to avoid flicker.
    if LAYER[name].shown_as == "depth":
        return colours.depth_colours(stored, *depth_m)
    if LAYER[name].shown_as == "flow":
        return colours.flow_colours(stored, 0.02 * stored.shape[1])
    return colours.shown_colours(LAYER[name], stored)
