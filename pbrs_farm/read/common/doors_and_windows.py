"""A leaf or a pane for each hole of sources that only have holes, built to the hole's size; no effects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import DOOR, WINDOW
from pbrs_farm.core.house import Box, Item, ItemKind, Material, MaterialKind, Opening, Surface
from pbrs_farm.geometry.solids import box, box_quads, quads_surface
from pbrs_farm.read.common.material_library import PANE_OPACITY, MaterialLibrary

Style = Literal["swing", "double", "sliding", "folding"]

_REACH_M: Final = 0.02  # how far a cutter reaches out of either face of the wall
_LINING_M: Final = 0.008  # how far a frame reaches out of either face of the wall
_FRAME_M: Final = 0.05  # width of a frame's posts
_LEAF_M: Final = 0.04  # thickness
_RAIL_M: Final = 0.1  # width of the wood around a door's glass
_PANE_M: Final = 0.004
_SASH_M: Final = 0.06  # depth of a window's sash
_WIDE_WINDOW_M: Final = 1.0  # from which a window has a post in its middle
_WIDE_DOOR_M: Final = 1.25  # from which a door has two leaves
_HANDLE_Y: Final = 1.02

_MATERIALS: Final = {
    "frame": Material("frame", diffuse=(0.92, 0.92, 0.9)),
    "leaf": Material("leaf", diffuse=(0.86, 0.82, 0.76), specular=(0.1, 0.1, 0.1), shininess=30.0),
    "handle": Material(
        "handle", diffuse=(0.5, 0.5, 0.51), specular=(0.6, 0.6, 0.6), shininess=80.0
    ),
    "pane": Material("pane", MaterialKind.PANE, diffuse=(0.9, 0.95, 0.95), opacity=PANE_OPACITY),
}
_Boxes = dict[str, list[tuple[tuple[float, float, float], tuple[float, float, float]]]]


@dataclass(frozen=True, slots=True, eq=False)
class Hole:
    """A hole in a wall and the style of its door or window.

    axes: (3, 3) unit columns along the wall, up, across it, right-handed. For a viewer looking along
    -z, x is to the right: a hinge is right if it is at +x.
    """

    id: str
    kind: Literal["door", "window", "open"]
    centre: F64  # (3,) of the hole, in the wall's middle plane, metres, world
    size: tuple[float, float, float]  # width, height, depth of the wall
    axes: F64
    name: str = ""
    source_class: str = ""
    style: Style = "swing"
    is_glazed: bool = False
    is_hinged_right: bool = False


def opening_of(hole: Hole, level_id: str, *, is_cut: bool = False) -> Opening:
    """The opening that repair cuts for a hole, through its depth, unless the walls have it already."""
    half = np.array(hole.size) / 2
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
    return Opening(
        id=f"{hole.id}_hole",
        level_id=level_id,
        item_id=None if hole.kind == "open" else hole.id,
        is_window=hole.kind == "window",
        cutter=box("cutter", hole.centre, half + np.array([0, 0, _REACH_M]), 0, axes=hole.axes),
        quad=hole.centre + (corners * half) @ hole.axes.T,
        normal=hole.axes[:, 2],
        is_cut=is_cut,
    )


def fill_hole(
    hole: Hole, library: MaterialLibrary, level_id: str, room_id: str | None
) -> Item | None:
    """Build the door or window for a hole, tagged `made`; None if the hole stays open."""
    if hole.kind == "open":
        return None
    is_window = hole.kind == "window"
    boxes = _window_boxes(hole) if is_window else _door(hole)
    surfaces = tuple(
        _boxes_surface(name, some, hole, library) for name, some in boxes.items() if some
    )
    half = np.array(hole.size) / 2 + [0, 0, _LINING_M]
    return Item(
        id=hole.id,
        name=hole.name or hole.kind,
        kind=ItemKind.WINDOW if is_window else ItemKind.DOOR,
        level_id=level_id,
        surfaces=surfaces,
        nyu40=WINDOW if is_window else DOOR,
        source_class=hole.source_class or hole.kind,
        room_id=room_id,
        box=Box(hole.centre, half, hole.axes),
        tags=("made",),
    )


def _boxes_surface(
    name: str,
    boxes: list[tuple[tuple[float, float, float], tuple[float, float, float]]],
    hole: Hole,
    library: MaterialLibrary,
) -> Surface:
    quads = []
    for low, high in boxes:
        a, b = np.array(low), np.array(high)
        quads.append(box_quads((a + b) / 2, (b - a) / 2))
    world = np.concatenate(quads) @ hole.axes.T + hole.centre
    return quads_surface(name, world, library.index(_MATERIALS[name]))


def _lining(hole: Hole) -> tuple[float, float, float, float]:
    """Half width and height of the hole, the width of its posts, half the depth of its frame."""
    width, height, depth = hole.size
    return width / 2, height / 2, min(_FRAME_M, width / 6, height / 6), depth / 2 + _LINING_M


def _door(hole: Hole) -> _Boxes:
    w, h, post, d = _lining(hole)
    boxes: _Boxes = {
        "frame": [
            ((-w, -h, -d), (-w + post, h, d)),
            ((w - post, -h, -d), (w, h, d)),
            ((-w + post, h - post, -d), (w - post, h, d)),
        ],
        "leaf": [],
        "handle": [],
        "pane": [],
    }
    left, right, top = -w + post, w - post, h - post
    n = {"swing": 1, "double": 2, "sliding": 2, "folding": 4}[hole.style]
    if hole.style == "swing" and 2 * w > _WIDE_DOOR_M:
        n = 2
    edges = np.linspace(left, right, n + 1)
    for k in range(n):
        # Sliding leaves run in two tracks and overlap slightly; others share one plane.
        slides = hole.style == "sliding"
        track = (0.5 - k % 2) * (_LEAF_M + 0.004) if slides else 0.0
        lap = 0.03 if slides else -0.0015
        low = edges[k] - (lap if k else -0.002)
        high = edges[k + 1] + (lap if k < n - 1 else -0.002)
        _add_door_leaf(
            boxes, (float(low), float(high)), (-h + 0.006, top - 0.003), track, hole.is_glazed
        )
        hinged_right = hole.is_hinged_right if n == 1 else k % 2 == 1
        handle_x = low + 0.07 if hinged_right else high - 0.07
        _handle(boxes, float(handle_x), -h + min(_HANDLE_Y, h), track)
    return boxes


def _add_door_leaf(
    boxes: _Boxes, x: tuple[float, float], y: tuple[float, float], z: float, is_glazed: bool
) -> None:
    t = _LEAF_M / 2
    (x0, x1), (y0, y1) = x, y
    rail = min(_RAIL_M, (x1 - x0) / 4, (y1 - y0) / 4)
    if not is_glazed:
        boxes["leaf"].append(((x0, y0, z - t), (x1, y1, z + t)))
        return
    boxes["leaf"] += [
        ((x0, y0, z - t), (x0 + rail, y1, z + t)),
        ((x1 - rail, y0, z - t), (x1, y1, z + t)),
        ((x0 + rail, y0, z - t), (x1 - rail, y0 + rail, z + t)),
        ((x0 + rail, y1 - rail, z - t), (x1 - rail, y1, z + t)),
    ]
    glass = _PANE_M / 2
    boxes["pane"].append(((x0 + rail, y0 + rail, z - glass), (x1 - rail, y1 - rail, z + glass)))


def _handle(boxes: _Boxes, x: float, y: float, z: float) -> None:
    for side in (-1, 1):
        near, far = z + side * (_LEAF_M / 2 + 0.001), z + side * (_LEAF_M / 2 + 0.05)
        boxes["handle"].append(
            ((x - 0.01, y - 0.01, min(near, far)), (x + 0.01, y + 0.01, max(near, far)))
        )


def _window_boxes(hole: Hole) -> _Boxes:
    w, h, post, _ = _lining(hole)
    d = min(_SASH_M / 2, hole.size[2] / 2 + _LINING_M)
    frame = [
        ((-w, -h, -d), (-w + post, h, d)),
        ((w - post, -h, -d), (w, h, d)),
        ((-w + post, h - post, -d), (w - post, h, d)),
        ((-w + post, -h, -d), (w - post, -h + post, d)),
    ]
    n = max(int(2 * w // _WIDE_WINDOW_M), 0) + 1
    edges = np.linspace(-w + post, w - post, n + 1)
    half = min(post, 0.05) / 2
    frame += [
        ((float(x) - half, -h + post, -d * 0.7), (float(x) + half, h - post, d * 0.7))
        for x in edges[1:-1]
    ]
    glass = _PANE_M / 2
    panes = [
        (
            (float(edges[k]) + (half if k else 0.0), -h + post, -glass),
            (float(edges[k + 1]) - (half if k < n - 1 else 0.0), h - post, glass),
        )
        for k in range(n)
    ]
    return {"frame": frame, "pane": panes}


def merge_holes(holes: list[Hole]) -> list[Hole]:
    """Each hole once, in order: two rooms often name one; the first keeps its id, with the depth of both."""
    merged: list[Hole] = []
    for hole in holes:
        same = next((k for k, twin in enumerate(merged) if _is_same(twin, hole)), None)
        if same is None:
            merged.append(hole)
            continue
        twin = merged[same]
        across = twin.axes[:, 2]
        z = float((hole.centre - twin.centre) @ across)
        ends = [-twin.size[2] / 2, twin.size[2] / 2, z - hole.size[2] / 2, z + hole.size[2] / 2]
        depth, middle = max(ends) - min(ends), (max(ends) + min(ends)) / 2
        merged[same] = replace(
            twin, centre=twin.centre + middle * across, size=(*twin.size[:2], depth)
        )
    return merged


def _is_same(a: Hole, b: Hole) -> bool:
    if abs(a.axes[:, 2] @ b.axes[:, 2]) < 0.99:
        return False
    along, up, across = a.axes.T
    way = b.centre - a.centre
    near = (a.size[2] + b.size[2]) / 2 + 0.3
    return (
        abs(float(way @ across)) < near
        and abs(float(way @ along)) < min(a.size[0], b.size[0]) / 2
        and abs(float(way @ up)) < min(a.size[1], b.size[1]) / 2
    )
