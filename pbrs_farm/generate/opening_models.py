"""Generated doors and windows, for homes whose catalogue has none of the right size; no effects.

A shape fills the opening: metres, its base centred at the origin, x along the wall, its front (the
room a door swings into) towards +z. A home has one design of doors and one of windows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from pbrs_farm.core.catalogue import Shape
from pbrs_farm.core.house import Material, MaterialKind, Surface
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.generate.floor_plan import OpeningKind, PlanOpening
from pbrs_farm.geometry.solids import Triple, boxes_surface

_FRAME_M: Final = 0.06  # breadth of a frame's posts
_LEAF_M: Final = 0.04  # thickness of a door's leaf
_PANEL_M: Final = 0.006  # protrusion of a panel, metres
_GAP_M: Final = 0.003  # around a leaf
_STOP_M: Final = 0.015  # how far the stop behind a leaf reaches into the opening
_STOP_DEPTH_M: Final = 0.012
_THRESHOLD_M: Final = 0.02
_SASH_M: Final = 0.05  # breadth of a sash's bars
_SASH_DEPTH_M: Final = 0.03  # from its middle to either face
_BAR_M: Final = 0.022  # width of the bars across a pane
_PANE_M: Final = 0.006
_WIDEST_SASH_M: Final = 0.95
_WIDE_OPEN_RAD: Final = np.pi / 2
_HANDLE_M: Final = 1.05  # above the floor

LEAVES: Final = ("four", "flat", "two", "six", "one", "boards", "three", "five")
"""Designs of a door's leaf, by its panels."""

HANDLES: Final = ("lever", "knob", "plate", "bar", "rose", "pull")
"""Of doors, catches of windows alike; a rose has a keyhole below its lever, a pull a bow on a plate."""

# fmt: off
SASHES: Final = (
    "plain", "rail", "grid", "transom", "halves", "slim", "cross", "lattice", "thirds", "mullion",
    "small_top", "sash_grid",
)
# fmt: on
"""Designs of windows: no bars across a pane, one, a grid, a light on top, two above each other, thin bars,
a cross, a fine grid, two bars, an upright one, panes in the light on top, a grid in the upper half."""

_GRIDS: Final = {
    "rail": (0.65, 9.0),
    "grid": (0.42, 0.36),
    "cross": (0.6, 0.45),
    "lattice": (0.3, 0.26),
    "thirds": (0.45, 9.0),
    "mullion": (9.0, 0.4),
}
"""Height and width of the panes of a sash, about, metres: larger sashes have more."""

_KICKED: Final = frozenset({"grid", "cross", "thirds", "small_top", "sash_grid", "rail"})
"""Designs whose French windows have a panel of wood below."""
_KICK_M: Final = 0.45  # its height with the bar above it

_Box = tuple[Triple, Triple]  # low and high corner


@dataclass(frozen=True, slots=True)
class OpeningDesign:
    """Design of a home's doors and windows."""

    leaf: str = LEAVES[0]  # of doors between rooms
    entrance: str = LEAVES[0]
    handle: str = HANDLES[0]
    sash: str = SASHES[0]
    colour: Triple = (0.93, 0.92, 0.90)  # sRGB of their wood
    has_vents: bool = False  # slotted strips at the heads of windows


def drawn_design(
    rng: np.random.Generator,
    colour: Triple,
    leaves: Sequence[str] = LEAVES,
    sashes: Sequence[str] = SASHES,
) -> OpeningDesign:
    """A home's design; all are equally common."""
    leaf, entrance, handle, sash = (
        choices[int(rng.integers(len(choices)))] for choices in (leaves, leaves, HANDLES, sashes)
    )
    return OpeningDesign(leaf, entrance, handle, sash, colour, bool(rng.random() < 0.3))


def opening_model(opening: PlanOpening, wall_m: float, design: OpeningDesign) -> Shape:
    """The door or window of an opening; its frame is 2 cm deeper than the wall, to show on both sides."""
    paint = Material("joinery", diffuse=design.colour, specular=(0.3, 0.3, 0.3), shininess=40.0)
    metal = Material("handle", diffuse=(0.2, 0.2, 0.2), specular=(0.7, 0.7, 0.7), shininess=60.0)
    glass = Material("pane", kind=MaterialKind.PANE, diffuse=(0.9, 0.95, 0.95), opacity=0.2)
    # The frame is 2 cm deeper than the wall, so that it shows on both sides.
    w, h, d = opening.width, opening.height, wall_m + 0.02
    frame = _frame_boxes(w, h, d, has_sill=opening.sill > 0)
    if opening.kind is OpeningKind.PASSAGE:
        return Shape((boxes_surface("frame", frame, 0),), (paint,))
    if opening.sill > 0 and design.has_vents:
        frame.append(((-0.17, h - 0.04, d / 2), (0.17, h - 0.02, d / 2 + 0.012)))
    if opening.kind in (OpeningKind.DOOR, OpeningKind.ENTRANCE):
        kind = design.leaf if opening.kind is OpeningKind.DOOR else design.entrance
        frame += _stops(w, h, d, has_threshold=opening.kind is OpeningKind.ENTRANCE)
        leaf = _door_leaf_boxes(w, h, d, kind)
        handles = _handles(w, d, opening.hinge_at_start, design.handle)
        # It hangs at the front of its leaf, which swings into the room.
        side = -1.0 if opening.hinge_at_start else 1.0
        hinge = (side * (w / 2 - _FRAME_M - _GAP_M), 0.0, d / 2 - 0.005)
        hung = Joint("leaf 1", JointKind.REVOLUTE, hinge, (0.0, side, 0.0), _WIDE_OPEN_RAD)
        moving = [boxes_surface("leaf", leaf, 0), boxes_surface("handle", handles, 1)]
        return _with_joints([boxes_surface("frame", frame, 0)], [(hung, moving)], (paint, metal))
    hung_sashes = []
    is_french = opening.kind is OpeningKind.FRENCH_WINDOW
    for k, (x, bars, panes, catches) in enumerate(_sashes(w, h, design, is_french=is_french)):
        # Its catch is at the right of even sashes, the hinges at the other end, in front.
        is_left = k % 2 == 0
        hinge = (x[0] if is_left else x[1], 0.0, _SASH_DEPTH_M)
        axis = (0.0, -1.0 if is_left else 1.0, 0.0)
        hung = Joint(f"sash {k + 1}", JointKind.REVOLUTE, hinge, axis, _WIDE_OPEN_RAD)
        boxes = [("bars", bars, 0), ("pane", panes, 1), ("catch", catches, 2)]
        hung_sashes.append((hung, [boxes_surface(*row) for row in boxes]))
    return _with_joints([boxes_surface("frame", frame, 0)], hung_sashes, (paint, glass, metal))


def _with_joints(
    body: Sequence[Surface],
    hung: Sequence[tuple[Joint, Sequence[Surface]]],
    materials: tuple[Material, ...],
) -> Shape:
    """A shape of a static body and the parts that each joint moves."""
    surfaces = list(body)
    for joint, moving in hung:
        surfaces += [replace(s, part=joint.part) for s in moving]
    return Shape(tuple(surfaces), materials, joints=tuple(joint for joint, _moving in hung))


def _frame_boxes(w: float, h: float, d: float, *, has_sill: bool) -> list[_Box]:
    # Two posts, the head between them, a sill below a window.
    x, z, t = w / 2, d / 2, _FRAME_M
    boxes: list[_Box] = [
        ((-x, 0.0, -z), (-x + t, h, z)),
        ((x - t, 0.0, -z), (x, h, z)),
        ((-x + t, h - t, -z), (x - t, h, z)),
    ]
    if has_sill:
        boxes.append(((-x + t, 0.0, -z), (x - t, t * 0.7, z)))
    return boxes


def _stops(w: float, h: float, d: float, *, has_threshold: bool) -> list[_Box]:
    """Strips that a leaf shuts against, so that no light comes round it; below, a threshold."""
    x, top, s = w / 2 - _FRAME_M, h - _FRAME_M, _STOP_M
    front = d / 2 - 0.005 - _LEAF_M - 0.0005
    back = front - _STOP_DEPTH_M
    boxes: list[_Box] = [
        ((-x, 0.0, back), (-x + s, top, front)),
        ((x - s, 0.0, back), (x, top, front)),
        ((-x + s, top - s, back), (x - s, top, front)),
    ]
    if has_threshold:
        boxes.append(((-x + s, 0.0, back), (x - s, _THRESHOLD_M, front)))
    return boxes


def _door_leaf_boxes(w: float, h: float, d: float, kind: str) -> list[_Box]:
    """A door's leaf, flush with the room it swings into; panels protrude on both sides."""
    x, front = w / 2 - _FRAME_M - _GAP_M, d / 2 - 0.005
    back, top = front - _LEAF_M, h - _FRAME_M - _GAP_M
    boxes: list[_Box] = [((-x, 0.006, back), (x, top, front))]
    for left, low, right, high in _panels(x, top, kind):
        boxes.append(((left, low, front), (right, high, front + _PANEL_M)))
        boxes.append(((left, low, back - _PANEL_M), (right, high, back)))
    return boxes


def _panels(x: float, top: float, kind: str) -> list[tuple[float, float, float, float]]:
    """(left, low, right, high) of the panels on a leaf of width 2 x."""
    inset, gap, middle = 0.11, 0.036, 0.95
    left, right = -x + inset, x - inset
    if kind == "flat":
        return []
    if kind == "one":
        return [(left, 0.14, right, top - inset)]
    if kind == "boards":
        n = 6
        edges = np.linspace(-x + 0.02, x - 0.02, n + 1)
        return [(float(a) + 0.004, 0.03, float(b) - 0.004, top - 0.03) for a, b in pairwise(edges)]
    if kind in ("three", "five"):
        levels = np.linspace(0.13, top - 0.07, 4 if kind == "three" else 6)
        return [(left, float(a), right, float(b) - 0.06) for a, b in pairwise(levels)]
    rows = [(0.14, middle - 0.06), (middle + 0.06, top - inset)]
    if kind == "six":
        rows = [(0.14, 0.78), (0.88, 1.45), (1.53, top - inset)]
    columns = [(left, right)] if kind == "two" else [(left, -gap), (gap, right)]
    return [(a, low, b, high) for low, high in rows for a, b in columns]


def _handles(w: float, d: float, hinge_at_start: bool, kind: str) -> list[_Box]:
    # On either side, away from the hinges.
    side = 1.0 if hinge_at_start else -1.0
    u, front = side * (w / 2 - _FRAME_M - 0.06), d / 2 - 0.005
    boxes: list[_Box] = []
    for face, out in ((front, 1.0), (front - _LEAF_M, -1.0)):

        def box(
            x: tuple[float, float],
            y: tuple[float, float],
            z: tuple[float, float],
            face: float = face,
            out: float = out,
        ) -> _Box:
            (x0, x1), (z0, z1) = sorted(x), sorted((face + out * z[0], face + out * z[1]))
            return (x0, y[0], z0), (x1, y[1], z1)

        y = _HANDLE_M
        if kind == "knob":
            boxes.append(box((u - 0.01, u + 0.01), (y - 0.01, y + 0.01), (0.0, 0.04)))
            boxes.append(box((u - 0.026, u + 0.026), (y - 0.026, y + 0.026), (0.04, 0.065)))
            boxes.append(box((u - 0.03, u + 0.03), (y - 0.03, y + 0.03), (0.0, 0.008)))
        elif kind in ("bar", "pull"):
            reach = 0.14 if kind == "bar" else 0.09
            if kind == "pull":
                boxes.append(box((u - 0.025, u + 0.025), (y - 0.13, y + 0.13), (0.0, 0.004)))
            boxes += [
                box((u - 0.008, u + 0.008), (low, low + 0.02), (0.0, 0.045))
                for low in (y - reach, y + reach - 0.02)
            ]
            boxes.append(
                box((u - 0.01, u + 0.01), (y - reach - 0.03, y + reach + 0.03), (0.04, 0.06))
            )
        else:
            if kind == "plate":
                boxes.append(box((u - 0.02, u + 0.02), (y - 0.15, y + 0.07), (0.0, 0.006)))
            if kind == "rose":
                boxes += [
                    box((u - 0.025, u + 0.025), (low - 0.025, low + 0.025), (0.0, 0.006))
                    for low in (y, y - 0.075)
                ]
            boxes.append(box((u - 0.01, u + 0.01), (y - 0.01, y + 0.01), (0.0, 0.05)))
            boxes.append(box((u, u - side * 0.11), (y - 0.01, y + 0.01), (0.035, 0.05)))
    return boxes


def _sashes(
    w: float, h: float, design: OpeningDesign, *, is_french: bool
) -> Iterator[tuple[tuple[float, float], list[_Box], list[_Box], list[_Box]]]:
    """(span of x, bars, panes, catches) of sashes narrower than a metre; a light above one turns with it."""
    n = max(1, round((w - 2 * _FRAME_M) / _WIDEST_SASH_M + 0.3))
    inner, low, high = w - 2 * _FRAME_M, _FRAME_M * 0.7, h - _FRAME_M
    # Where an upper light begins, and what each of the two shows.
    kind = design.sash
    share, lower, upper = {
        "transom": (0.7, "plain", "plain"),
        "halves": (0.5, "plain", "plain"),
        "small_top": (0.72, "plain", "mullion"),
        "sash_grid": (0.5, "plain", "cross"),
    }.get(kind, (1.0, kind, kind))
    for k in range(n):
        bars: list[_Box] = []
        panes: list[_Box] = []
        left, right = -inner / 2 + k * inner / n + 0.002, -inner / 2 + (k + 1) * inner / n - 0.002
        middle = low + share * (high - low)
        sill = low + _KICK_M if is_french and kind in _KICKED else low
        if sill > low:
            bars.append(((left, low, -_SASH_DEPTH_M), (right, sill, _SASH_DEPTH_M)))
            out, x0, x1 = _SASH_DEPTH_M + _PANEL_M, left + 0.07, right - 0.07
            bars.append(((x0, low + 0.08, -out), (x1, sill - 0.05, out)))
        _sash(bars, panes, (left, sill, right, middle), lower)
        if share < 1:
            _sash(bars, panes, (left, middle, right, high), upper)
        x = left if k % 2 else right - _SASH_M
        catches = _catch(x, (low + middle) / 2, (low, high), design.handle)
        hinge, z = (right - 0.016 if k % 2 else left), _SASH_DEPTH_M
        ys = np.linspace(low + 0.15, middle - 0.23, 3 if middle - low > 1.3 else 2).tolist()
        # Hinges are flat, so that the handle is the foremost part of a closed sash.
        catches += [((hinge, y, z), (hinge + 0.016, y + 0.08, z + 0.003)) for y in ys]
        yield (left, right), bars, panes, catches


def _catch(x: float, y: float, span: tuple[float, float], kind: str) -> list[_Box]:
    """Handle of a sash, on the room side of its upright bar that begins at x; span: lowest and highest y."""
    mid, front = x + _SASH_M * 0.4, _SASH_DEPTH_M
    if kind == "knob":
        return [((mid - 0.012, y - 0.012, front), (mid + 0.012, y + 0.012, front + 0.03))]
    rose = ((mid - 0.013, y - 0.03, front), (mid + 0.013, y + 0.03, front + 0.008))
    if kind in ("bar", "pull"):
        return [rose]
    reach = 0.11 if kind == "lever" else 0.075
    rods: list[_Box] = []
    if kind == "plate" and span[1] - span[0] > 1.2:  # a bolt as high as the sash, in two guides
        rods.append(((mid - 0.006, span[0], front), (mid + 0.006, span[1], front + 0.006)))
        rods += [
            ((mid - 0.011, g, front), (mid + 0.011, g + 0.03, front + 0.011))
            for g in (span[0] + 0.1, span[1] - 0.13)
        ]
    return [
        *rods,
        rose,
        ((mid - 0.009, y - reach, front + 0.022), (mid + 0.009, y + 0.01, front + 0.036)),
        ((mid - 0.006, y - 0.006, front + 0.008), (mid + 0.006, y + 0.006, front + 0.022)),
    ]


def _sash(
    bars: list[_Box], panes: list[_Box], inside: tuple[float, float, float, float], kind: str
) -> None:
    left, low, right, high = inside
    z, t = _SASH_DEPTH_M, _SASH_M * (0.7 if kind == "slim" else 1.0)
    bars += [
        ((left, low, -z), (left + t, high, z)),
        ((right - t, low, -z), (right, high, z)),
        ((left + t, low, -z), (right - t, low + t, z)),
        ((left + t, high - t, -z), (right - t, high, z)),
    ]
    # Bars part the pane into a grid of smaller ones.
    tall, wide = _GRIDS.get(kind, (np.inf, np.inf))
    rows, columns = (
        max(1, round(length / pane))
        for length, pane in ((high - low - 2 * t, tall), (right - left - 2 * t, wide))
    )
    if kind in _GRIDS and rows * columns == 1:
        rows = 2
    ys = np.linspace(low + t, high - t, rows + 1).tolist()
    xs = np.linspace(left + t, right - t, columns + 1).tolist()
    half, pane, y0, y1 = _BAR_M / 2, _PANE_M / 2, low + t, high - t
    bars += [((left + t, y - half, -0.02), (right - t, y + half, 0.02)) for y in ys[1:-1]]
    for a, b in pairwise([y0 - half, *ys[1:-1], y1 + half]):
        bars += [((x - half, a + half, -0.02), (x + half, b - half, 0.02)) for x in xs[1:-1]]
    for a, b in pairwise(ys):
        for c, d in pairwise(xs):
            panes.append(
                (
                    (c + half * (c > xs[0]), a + half * (a > ys[0]), -pane),
                    (d - half * (d < xs[-1]), b - half * (b < ys[-1]), pane),
                )
            )
