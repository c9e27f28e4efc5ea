"""Generated doors and windows, for homes without one of the right size in the catalogue; no effects.

A shape fills the opening: metres, its base centred at the origin, x along the wall, its front (the
room a door swings into) towards +z. A home has one design of doors and one of windows.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from pbrs_farm.core.catalogue import Shape
from pbrs_farm.core.house import Material, MaterialKind, Surface
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.generate.floor_plan import OpeningKind, PlanOpening, RoomType
from pbrs_farm.geometry.solids import Triple, boxes_surface, lathe

_FRAME_M: Final = 0.06  # breadth of a frame's posts
_LEAF_M: Final = 0.04  # thickness of a door's leaf
_PANEL_M: Final = 0.006  # protrusion of a panel, metres
_STEP_M: Final = 0.003  # of a second board on it: the hinges at the leaf's face allow 10 mm in all
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

LEAVES: Final = ("four", "flat", "two", "six", "one", "boards", "three", "five", "slats", "column")
"""Designs of a door's leaf, by its panels; boards are upright, slats level."""

LIGHTS: Final = ("full", "half", "squares", "strip")
"""Panes of satin glass in the doors of living rooms and kitchens."""

MOULDINGS: Final = ("raised", "framed", "stepped")
"""Panels: a board, a frame around a level field, a board on a board."""

CASINGS: Final = ("plain", "band", "double", "blocks")
"""Strips along a frame, on both sides of the wall; blocks are at its corners."""

HANDLES: Final = ("lever", "knob", "plate", "bar", "rose", "pull")
"""Of doors, catches of windows alike; a rose has a keyhole below its lever, a pull a bow on a plate."""

# Boxes of a door's handle on one side, metres: x from its spindle towards the hinges, y, and z out of the leaf.
_POST: Final = ((-0.01, -0.01, 0.0), (0.01, 0.01, 0.05))
_LEVER: Final = (_POST, ((0.0, -0.01, 0.035), (0.11, 0.01, 0.05)))
_HANDLE_BOXES: Final = {
    "lever": _LEVER,
    "knob": (),
    "plate": (((-0.02, -0.15, 0.0), (0.02, 0.07, 0.006)), *_LEVER),
    "bar": (
        *(((-0.008, y, 0.0), (0.008, y + 0.02, 0.045)) for y in (-0.14, 0.12)),
        *(((-0.015, y, 0.0), (0.015, y + 0.03, 0.005)) for y in (-0.145, 0.115)),
        ((-0.01, -0.17, 0.04), (0.01, 0.17, 0.06)),
    ),
    "rose": _LEVER,
    "pull": (
        ((-0.025, -0.13, 0.0), (0.025, 0.13, 0.004)),
        *(((-0.008, y, 0.0), (0.008, y + 0.02, 0.045)) for y in (-0.09, 0.07)),
        ((-0.01, -0.12, 0.04), (0.01, 0.12, 0.06)),
    ),
}
_TURN: Final = (((-0.018, -0.108, 0.0), (0.018, -0.072, 0.008)), ((-0.004, -0.104, 0.008), (0.004, -0.076, 0.026)))  # fmt: skip
"""Bolt of bathroom doors, below the handle."""
_ROSE: Final = ((0.0, 0.0), (0.025, 0.0), (0.025, 0.006), (0.0, 0.006))
_KNOB: Final = (
    *((0.0, 0.0), (0.03, 0.0), (0.03, 0.007), (0.011, 0.012), (0.011, 0.034), (0.024, 0.04)),
    *((0.028, 0.052), (0.024, 0.062), (0.0, 0.066)),
)
_ROUND: Final = {"knob": ((0.0, _KNOB),), "rose": ((0.0, _ROSE), (-0.075, _ROSE))}
"""Round parts: height, and (radius, distance from the leaf) of their outline."""

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

_WITH_LIGHTS: Final = {RoomType.LIVING, RoomType.KITCHEN, RoomType.DINING, RoomType.STUDIO}
_BEAD_M: Final = 0.022  # breadth of the strips around a panel
_BLOCK_M: Final = 0.05  # from a frame's corner to the far sides of its block

_SATIN: Final = Material(
    "satin glass", diffuse=(0.78, 0.83, 0.82), specular=(0.4, 0.4, 0.4), shininess=30.0
)

_Box = tuple[Triple, Triple]  # low and high corner
_Field = tuple[float, float, float, float]  # left, low, right, high


@dataclass(frozen=True, slots=True)
class OpeningDesign:
    """Design of a home's doors and windows."""

    leaf: str = LEAVES[0]  # of doors between rooms
    entrance: str = LEAVES[0]
    handle: str = HANDLES[0]
    sash: str = SASHES[0]
    colour: Triple = (0.93, 0.92, 0.90)  # sRGB of their wood
    has_vents: bool = False  # slotted strips at the heads of windows
    lights: str = ""  # of doors of living rooms and kitchens; "" = none
    moulding: str = MOULDINGS[0]
    casing: str = CASINGS[0]
    n_hinges: int = 2  # of a leaf
    has_beads: bool = False  # around the panes of a sash
    has_fixed_sash: bool = False  # one sash of a wide window has no hinges


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
    has_vents = bool(rng.random() < 0.3)
    lights = LIGHTS[int(rng.integers(len(LIGHTS)))] if rng.random() < 0.6 else ""
    moulding, casing = (c[int(rng.integers(len(c)))] for c in (MOULDINGS, CASINGS))
    n_hinges, has_beads, is_fixed = 2 + int(rng.integers(2)), rng.random() < 0.5, rng.random() < 0.5
    return OpeningDesign(
        *(leaf, entrance, handle, sash, colour, has_vents, lights, moulding, casing, n_hinges),
        has_beads=bool(has_beads),
        has_fixed_sash=bool(is_fixed),
    )


def opening_model(
    opening: PlanOpening, wall_m: float, design: OpeningDesign, rooms: Collection[RoomType] = ()
) -> Shape:
    """The door or window of an opening between rooms, whose types a door's form depends on.

    Its frame is 2 cm deeper than the wall, to show on both sides.
    """
    paint = Material("joinery", diffuse=design.colour, specular=(0.3, 0.3, 0.3), shininess=40.0)
    metal = Material("handle", diffuse=(0.2, 0.2, 0.2), specular=(0.7, 0.7, 0.7), shininess=60.0)
    glass = Material("pane", kind=MaterialKind.PANE, diffuse=(0.9, 0.95, 0.95), opacity=0.2)
    w, h, d = opening.width, opening.height, wall_m + 0.02
    has_sill = opening.sill > 0
    frame = _frame_boxes(w, h, d, has_sill=has_sill) + _casing(w, h, d, design, has_sill=has_sill)
    if opening.kind is OpeningKind.PASSAGE:
        return Shape((boxes_surface("frame", frame, 0),), (paint,))
    is_door = opening.kind in (OpeningKind.DOOR, OpeningKind.ENTRANCE)
    is_entrance = opening.kind is OpeningKind.ENTRANCE
    if has_sill and design.has_vents:
        frame.append(((-0.17, h - 0.04, d / 2), (0.17, h - 0.02, d / 2 + 0.012)))
    if is_door:
        frame += _stops(w, h, d, has_threshold=is_entrance)
    body = [boxes_surface("frame", frame, 0)]
    if is_door:
        form = "" if is_entrance else door_form(design, rooms)
        kind = (
            design.entrance if is_entrance else design.lights if form == "lights" else design.leaf
        )
        leaf, panes = _door_leaf_boxes(w, h, d, kind, design.moulding)
        side = -1.0 if opening.hinge_at_start else 1.0
        moving = [boxes_surface("leaf", leaf, 0)]
        if panes:
            moving.append(boxes_surface("pane", panes, 2))
        moving += _door_metal(w, h, d, side, design, has_bolt=form == "bolt")
        # It hangs at the front of its leaf, which swings into the room.
        hinge = (side * (w / 2 - _FRAME_M - _GAP_M), 0.0, d / 2 - 0.005)
        hung = Joint("leaf 1", JointKind.REVOLUTE, hinge, (0.0, side, 0.0), _WIDE_OPEN_RAD)
        made_of = (paint, metal, _SATIN)[: 3 if panes else 2]
        return _with_joints(body, [(hung, moving)], made_of)
    hung_sashes = []
    is_french = opening.kind is OpeningKind.FRENCH_WINDOW
    for k, (x, bars, panes, catches) in enumerate(_sashes(w, h, design, is_french=is_french)):
        # Its catch is at the right of even sashes, the hinges at the other end, in front.
        is_left = k % 2 == 0
        hinge = (x[0] if is_left else x[1], 0.0, _SASH_DEPTH_M)
        axis = (0.0, -1.0 if is_left else 1.0, 0.0)
        hung = Joint(f"sash {k + 1}", JointKind.REVOLUTE, hinge, axis, _WIDE_OPEN_RAD)
        boxes = [("bars", bars, 0), ("pane", panes, 1), ("catch", catches, 2)]
        surfaces = [boxes_surface(*row) for row in boxes if row[1]]
        if catches:
            hung_sashes.append((hung, surfaces))
        else:
            body += surfaces
    return _with_joints(body, hung_sashes, (paint, glass, metal))


def door_form(design: OpeningDesign, rooms: Collection[RoomType]) -> str:
    """Form of the door between rooms: "bolt" of bathrooms, "lights" with satin glass, or ""."""
    if RoomType.BATHROOM in rooms or RoomType.WC in rooms:
        return "bolt"
    has_lights = design.lights and RoomType.BEDROOM not in rooms and set(rooms) & _WITH_LIGHTS
    return "lights" if has_lights else ""


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


def _casing(w: float, h: float, d: float, design: OpeningDesign, *, has_sill: bool) -> list[_Box]:
    """Strips on a frame's posts and head, of windows also on its sill, on both sides of the wall."""
    if design.casing == "plain":
        return []
    # Distances from the opening's edge, and heights above the frame.
    strips = [(0.008, 0.03, 0.006)]
    if design.casing == "double":
        strips = [(0.002, 0.02, 0.008), (0.034, 0.046, 0.004)]
    is_blocks = design.casing == "blocks"
    sheets: list[tuple[float, float, float, float, float]] = []  # left, low, right, high, height
    for near, far, out in strips:
        x0, x1 = w / 2 - near, w / 2 - far
        # Blocks interrupt the strips at the corners.
        y, x = (_BLOCK_M, w / 2 - _BLOCK_M) if is_blocks else (near, x1)
        base = y if has_sill else 0.0
        sheets += [(-x0, base, -x1, h - y, out), (x1, base, x0, h - y, out)]
        sheets.append((-x, h - far, x, h - near, out))
        if has_sill:
            sheets.append((-x, near, x, min(far, _FRAME_M * 0.7), out))
    if is_blocks:
        ys = ([0.002] if has_sill else []) + [h - _BLOCK_M]
        xs, side = (0.002 - w / 2, w / 2 - _BLOCK_M), _BLOCK_M - 0.002
        sheets += [(x, y, x + side, y + side, 0.009) for y in ys for x in xs]
    return [
        ((x0, y0, z), (x1, y1, z + out))
        for x0, y0, x1, y1, out in sheets
        for z in (d / 2, -d / 2 - out)
    ]


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


def _door_leaf_boxes(
    w: float, h: float, d: float, kind: str, moulding: str
) -> tuple[list[_Box], list[_Box]]:
    """A door's leaf, flush with the room it swings into, and its panes; panels protrude on both sides."""
    x, front = w / 2 - _FRAME_M - _GAP_M, d / 2 - 0.005
    back, top = front - _LEAF_M, h - _FRAME_M - _GAP_M
    boxes: list[_Box] = [((-x, 0.006, back), (x, top, front))]
    panes: list[_Box] = []

    def add(to: list[_Box], field: _Field, out: float) -> None:
        left, low, right, high = field
        to.append(((left, low, front), (right, high, front + out)))
        to.append(((left, low, back - out), (right, high, back)))

    if kind in LIGHTS:
        for field in _lights(x, top, kind):
            add(panes, field, _PANEL_M / 3)
            left, low, right, high = field
            m = _BEAD_M
            for strip in _around((left - m, low - m, right + m, high + m), m):
                add(boxes, strip, _PANEL_M)
    for field in _panels(x, top, kind):
        is_board = kind in ("boards", "slats")
        for strip in _around(field, _BEAD_M) if moulding == "framed" and not is_board else [field]:
            add(boxes, strip, _PANEL_M)
        if moulding == "stepped" and not is_board:
            left, low, right, high = field
            m = min(0.03, (right - left) / 4)
            add(boxes, (left + m, low + m, right - m, high - m), _PANEL_M + _STEP_M)
    return boxes, panes


def _around(field: _Field, breadth: float) -> list[_Field]:
    """Four strips along the inside of a field's edge."""
    (left, low, right, high), b = field, breadth
    return [
        (left, low, left + b, high),
        (right - b, low, right, high),
        (left + b, low, right - b, low + b),
        (left + b, high - b, right - b, high),
    ]


def _lights(x: float, top: float, kind: str) -> list[_Field]:
    """Panes in a leaf of width 2 x."""
    left, right = -x + 0.13, x - 0.13
    if kind == "squares":
        levels = np.linspace(0.5, top - 0.1, 5)
        return [(-0.1, float(a), 0.1, float(b) - 0.09) for a, b in pairwise(levels)]
    if kind == "strip":
        return [(-0.07, 0.3, 0.07, top - 0.25)]
    return [(left, 0.28 if kind == "full" else 1.0, right, top - 0.13)]


def _panels(x: float, top: float, kind: str) -> list[_Field]:
    """Panels on a leaf of width 2 x."""
    inset, gap, middle = 0.11, 0.036, 0.95
    left, right = -x + inset, x - inset
    if kind in ("flat", "full", "squares", "strip"):
        return []
    if kind == "half":
        return [(left, 0.14, right, 0.88)]
    if kind == "column":
        return [(left, 0.14, left + 0.12, top - inset), (left + 0.18, 0.14, right, top - inset)]
    if kind == "slats":
        edges = np.linspace(0.03, top - 0.02, 9)
        return [(-x + 0.02, float(a), x - 0.02, float(b) - 0.008) for a, b in pairwise(edges)]
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


def _door_metal(
    w: float, h: float, d: float, side: float, design: OpeningDesign, *, has_bolt: bool
) -> Iterator[Surface]:
    """Handles on either side of a leaf, a bolt, and the hinges in front; side: sign of the hinges' x."""
    u, front = -side * (w / 2 - _FRAME_M - 0.06), d / 2 - 0.005
    boxes: list[_Box] = []
    for face, out in ((front, 1.0), (front - _LEAF_M, -1.0)):
        for low, high in (*_HANDLE_BOXES[design.handle], *(_TURN if has_bolt else ())):
            (x0, x1), (z0, z1) = (
                sorted((at + sign * low[k], at + sign * high[k]))
                for k, at, sign in ((0, u, side), (2, face, out))
            )
            boxes.append(((x0, _HANDLE_M + low[1], z0), (x1, _HANDLE_M + high[1], z1)))
        for y, outline in _ROUND.get(design.handle, ()):
            turned = lathe("handle", np.array(outline), np.zeros(3), 1, n=12)
            place = np.array([u, _HANDLE_M + y, face], np.float32)
            # From the vertical to the leaf's normal.
            turn = np.array([[1, 0, 0], [0, 0, -out], [0, out, 0]], np.float32)
            normals = None if turned.normals is None else turned.normals @ turn.T
            yield replace(turned, positions=turned.positions @ turn.T + place, normals=normals)
    x0, x1 = sorted((side * (w / 2 - _FRAME_M - _GAP_M), side * (w / 2 - _FRAME_M - 0.02)))
    ys = np.linspace(0.2, h - 0.35, design.n_hinges).tolist()
    boxes += [((x0, y, front), (x1, y + 0.1, front + 0.004)) for y in ys]
    yield boxes_surface("handle", boxes, 1)


def _sashes(
    w: float, h: float, design: OpeningDesign, *, is_french: bool
) -> Iterator[tuple[tuple[float, float], list[_Box], list[_Box], list[_Box]]]:
    """(span of x, bars, panes, catches) of sashes narrower than a metre; a light above one turns with it.

    A fixed sash has no catches.
    """
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
        is_fixed = design.has_fixed_sash and not is_french and n > 1 and k == n // 2
        sill = low + _KICK_M if is_french and kind in _KICKED else low
        if sill > low:
            bars.append(((left, low, -_SASH_DEPTH_M), (right, sill, _SASH_DEPTH_M)))
            out, x0, x1 = _SASH_DEPTH_M + _PANEL_M, left + 0.07, right - 0.07
            bars.append(((x0, low + 0.08, -out), (x1, sill - 0.05, out)))
        _sash(bars, panes, (left, sill, right, middle), lower, has_beads=design.has_beads)
        if share < 1:
            _sash(bars, panes, (left, middle, right, high), upper, has_beads=design.has_beads)
        if is_fixed:
            yield (left, right), bars, panes, []
            continue
        x = left if k % 2 else right - _SASH_M
        catches = _catch(x, (low + middle) / 2, (low, high), design.handle)
        hinge, z = (right - 0.016 if k % 2 else left), _SASH_DEPTH_M
        n_hinges = design.n_hinges + (middle - low > 1.3)
        ys = np.linspace(low + 0.15, middle - 0.23, n_hinges).tolist()
        # Hinges are flat, so that the handle is the foremost part of a closed sash.
        catches += [((hinge, y, z), (hinge + 0.016, y + 0.08, z + 0.003)) for y in ys]
        yield (left, right), bars, panes, catches


def _catch(x: float, y: float, span: tuple[float, float], kind: str) -> list[_Box]:
    """Handle of a sash, on the room side of its upright bar that begins at x; span: lowest and highest y."""
    mid, front = x + _SASH_M * 0.4, _SASH_DEPTH_M
    if kind == "knob":
        return [((mid - 0.012, y - 0.012, front), (mid + 0.012, y + 0.012, front + 0.03))]
    rose = ((mid - 0.013, y - 0.03, front), (mid + 0.013, y + 0.03, front + 0.008))
    if kind == "bar":  # a short cross bar
        return [
            rose,
            ((mid - 0.02, y - 0.008, front + 0.008), (mid + 0.02, y + 0.008, front + 0.03)),
        ]
    if kind == "pull":  # a bow on two feet
        ends = (y - 0.05, y + 0.036)
        return [
            *(((mid - 0.009, a, front), (mid + 0.009, a + 0.014, front + 0.004)) for a in ends),
            *(((mid - 0.005, a + 0.002, front + 0.004), (mid + 0.005, a + 0.012, front + 0.022)) for a in ends),
            ((mid - 0.006, y - 0.055, front + 0.022), (mid + 0.006, y + 0.055, front + 0.032)),
        ]  # fmt: skip
    reach = 0.11 if kind == "lever" else 0.075
    rods: list[_Box] = []
    if kind == "rose":  # its lock
        rods.append(
            ((mid - 0.008, y + 0.012, front + 0.008), (mid + 0.008, y + 0.028, front + 0.02))
        )
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
    bars: list[_Box], panes: list[_Box], inside: _Field, kind: str, *, has_beads: bool
) -> None:
    left, low, right, high = inside
    z, t = _SASH_DEPTH_M, _SASH_M * (0.7 if kind == "slim" else 1.0)
    bars += [
        ((left, low, -z), (left + t, high, z)),
        ((right - t, low, -z), (right, high, z)),
        ((left + t, low, -z), (right - t, low + t, z)),
        ((left + t, high - t, -z), (right - t, high, z)),
    ]
    if has_beads:
        for x0, y0, x1, y1 in _around((left + t, low + t, right - t, high - t), 0.012):
            bars += [((x0, y0, a), (x1, y1, b)) for a, b in ((0.004, 0.024), (-0.024, -0.004))]
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
