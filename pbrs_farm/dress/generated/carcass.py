"""What furniture of boards is put together from: boards, boxes, fronts, handles; no effects.

A piece stands with its back at -z and its front at +z; sizes are width, height, depth in metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from pbrs_farm.core.house import Material
from pbrs_farm.dress.generated.assembly import Part, transformed
from pbrs_farm.dress.generated.turned import slab, turned
from pbrs_farm.dress.style import Rgb

Size = tuple[float, float, float]

BOARD_M: Final = 0.018
THIN_M: Final = 0.006  # of back panels
_GAP_M: Final = 0.004  # between two fronts


@dataclass(frozen=True, slots=True)
class Boards:
    """What a piece is made of."""

    body: Material
    front: Material
    top: Material
    metal: Material
    cloth: Rgb = (0.6, 0.58, 0.55)


def board(boards: Boards, low: Size, high: Size) -> Part:
    return slab(low, high), boards.body


def sides(boards: Boards, size: Size) -> list[Part]:
    # Two uprights from the floor to the top.
    w, h, d = size
    return [
        board(boards, (-w / 2, 0.0, -d / 2), (-w / 2 + BOARD_M, h, d / 2)),
        board(boards, (w / 2 - BOARD_M, 0.0, -d / 2), (w / 2, h, d / 2)),
    ]


def carcass(
    rng: np.random.Generator, boards: Boards, size: Size, *, legs: bool = True
) -> list[Part]:
    """The closed box behind fronts, a top over it, a plinth or legs under it; the box comes first."""
    w, h, d = size
    top = float(rng.choice([0.018, 0.025]))
    has_legs = legs and rng.random() < 0.55
    foot = float(rng.uniform(0.09, 0.16)) if has_legs else float(rng.uniform(0.04, 0.07))
    parts: list[Part] = [
        (slab((-w / 2, foot, -d / 2), (w / 2, h - top, d / 2 - 0.018)), boards.body),
        (slab((-w / 2 - 0.004, h - top, -d / 2), (w / 2 + 0.004, h, d / 2 + 0.006)), boards.top),
    ]
    if not has_legs:
        parts.append(
            (slab((-w / 2 + 0.01, 0.0, -d / 2), (w / 2 - 0.01, foot, d / 2 - 0.05)), boards.body)
        )
        return parts
    # Legs taper towards the floor.
    leg = turned([(0.0, 0.0), (0.013, 0.0), (0.022, foot), (0.0, foot)], n=12)
    for x in (-w / 2 + 0.06, w / 2 - 0.06):
        for z in (-d / 2 + 0.05, d / 2 - 0.08):
            parts.append((transformed(leg, np.eye(3), (x, 0.0, z)), boards.top))
    return parts


def foot_of(parts: list[Part]) -> float:
    # Where the box of a carcass begins.
    return float(parts[0][0].positions[:, 1].min())


def all_fronts(
    rng: np.random.Generator, boards: Boards, size: Size, foot: float,
    columns: list[tuple[str, ...]],
) -> list[Part]:  # fmt: skip
    """Fronts before a carcass, a column of kinds from the top downwards for each."""
    w, h, d = size
    step = w / len(columns)
    own, parts = int(rng.integers(1 << 30)), list[Part]()
    for k, kinds in enumerate(columns):
        x = (-w / 2 + k * step, -w / 2 + (k + 1) * step)
        handle = np.random.default_rng(own)
        hinge = k % 2 == 0
        parts += fronts(
            handle, boards, x, (foot, h - 0.026), d / 2 - 0.018, kinds, rows=True, hinge=hinge
        )
    return parts


def fronts(
    rng: np.random.Generator, boards: Boards, x: tuple[float, float], y: tuple[float, float],
    z: float, kinds: tuple[str, ...], *, rows: bool = False, hinge: bool = True,
) -> list[Part]:  # fmt: skip
    """Doors side by side, or fronts from the top downwards (rows), 16 mm thick before z."""
    n = len(kinds)
    weight = np.array([3.2 if kind == "door" and n > 1 and rows else 1.0 for kind in kinds])
    share = np.concatenate([[0.0], np.cumsum(weight) / weight.sum()])
    knob, parts = rng.random() < 0.4, list[Part]()
    for k, kind in enumerate(kinds):
        if rows:
            a, b = x
            low, high = (y[1] - (y[1] - y[0]) * float(share[j]) for j in (k + 1, k))
        else:
            a, b = (x[0] + (x[1] - x[0]) * j / n for j in (k, k + 1))
            low, high = y
        g = _GAP_M / 2
        parts.append(
            (slab((a + g, low + g, z + 0.0005), (b - g, high - g, z + 0.0165)), boards.front)
        )
        opens_left = hinge if rows else k % 2 == 0
        parts += _handle(boards, kind, (a, b), (low, high), z + 0.0165, knob=knob, left=opens_left)
    return parts


def _handle(
    boards: Boards, kind: str, x: tuple[float, float], y: tuple[float, float], z: float, *,
    knob: bool, left: bool,
) -> list[Part]:  # fmt: skip
    # A door's handle stands at the side that is not hinged, a drawer's lies across.
    middle = ((x[0] + x[1]) / 2, (y[0] + y[1]) / 2)
    if kind == "door":
        at = x[1] - 0.035 if left else x[0] + 0.035
        long = min(0.16, 0.3 * (y[1] - y[0]))
        height = y[0] + 0.55 * (y[1] - y[0]) if y[1] - y[0] > 0.9 else y[1] - 0.05 - long
        if knob:
            return [_knob(boards, at, height, z)]
        return _bar(boards, (at - 0.005, height - long), (at + 0.005, height + long), z)
    height = y[1] - 0.035 if kind == "flap" else middle[1]
    if knob:
        reach = 0.25 * (x[1] - x[0]) if x[1] - x[0] > 0.5 else 0.0
        return [
            _knob(boards, middle[0] + s * reach, height, z) for s in ((-1, 1) if reach else (0,))
        ]
    half = min(0.08, 0.3 * (x[1] - x[0]))
    return _bar(boards, (middle[0] - half, height - 0.005), (middle[0] + half, height + 0.005), z)


def _knob(boards: Boards, x: float, y: float, z: float) -> Part:
    profile = [
        (0.0, 0.0),
        (0.006, 0.0),
        (0.006, 0.012),
        (0.014, 0.016),
        (0.012, 0.026),
        (0.0, 0.028),
    ]
    out = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    return transformed(turned(profile, n=12), out, (x, y, z)), boards.metal


def _bar(
    boards: Boards, low: tuple[float, float], high: tuple[float, float], z: float
) -> list[Part]:
    # A bar on two short feet.
    parts: list[Part] = [(slab((*low, z + 0.018), (*high, z + 0.028)), boards.metal)]
    is_wide = high[0] - low[0] > high[1] - low[1]
    for end in (0.1, 0.9):
        x, y = (
            a + (b - a) * (end if wide else 0.5)
            for a, b, wide in ((low[0], high[0], is_wide), (low[1], high[1], not is_wide))
        )
        parts.append(
            (slab((x - 0.004, y - 0.004, z), (x + 0.004, y + 0.004, z + 0.018)), boards.metal)
        )
    return parts
