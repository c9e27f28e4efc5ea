"""SVG path data -> polygons: the outlines that doors and staircases cut; no effects.

Understands M L H V C S Q T A Z, absolute and relative. The number of points is bounded.
"""

from __future__ import annotations

import math
import re
from itertools import pairwise

import numpy as np

from pbrs_farm.core.arrays import Points2

MAX_TEXT = 100_000
MAX_POINTS = 20_000
CURVE_STEPS = 16
ARC_STEP_RAD = math.radians(7.5)

_TOKEN = re.compile(r"([MmLlHhVvCcSsQqTtAaZz])|([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)")
_COUNTS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}

Point = tuple[float, float]


def polygons_from_path(text: str) -> tuple[Points2, ...]:
    """The path's closed sub-paths as (N, 2) polygons, N >= 3.

    Raises ValueError for what is no path, numbers that are not finite or larger than 1e6, or one
    that is too long.
    """
    if len(text) > MAX_TEXT:
        raise ValueError(f"path of {len(text)} characters, at most {MAX_TEXT} are read")
    paths: list[list[Point]] = []
    n_points = 0
    for command, numbers in _commands(text):
        n_points += _append(paths, command, numbers)
        if n_points > MAX_POINTS:
            raise ValueError(f"path of more than {MAX_POINTS} points")
    polygons = [np.array(_without_repeats(p), np.float64) for p in paths]
    return tuple(p for p in polygons if len(p) >= 3)


def _commands(text: str) -> list[tuple[str, list[float]]]:
    rest = _TOKEN.sub("", text)
    if rest.strip(" ,\t\r\n"):
        raise ValueError(f"{rest.strip()[:20]!r} is no part of a path")
    commands: list[tuple[str, list[float]]] = []
    for match in _TOKEN.finditer(text):
        if match[1]:
            commands.append((match[1], []))
        elif not commands:
            raise ValueError("a path starts with M")
        else:
            value = float(match[2])
            if not abs(value) <= 1e6:
                raise ValueError(f"{match[2][:20]} in a path")
            commands[-1][1].append(value)
    if not commands or commands[0][0] not in "Mm":
        raise ValueError("a path starts with M")
    return [step for command in commands for step in _repeated(*command)]


def _repeated(command: str, numbers: list[float]) -> list[tuple[str, list[float]]]:
    count = _COUNTS[command.upper()]
    if count == 0:
        return [(command, [])]
    if not numbers or len(numbers) % count:
        raise ValueError(f"{command} takes {count} numbers at a time, got {len(numbers)}")
    groups = [numbers[k : k + count] for k in range(0, len(numbers), count)]
    follow = {"M": "L", "m": "l"}.get(command, command)
    return [(command if k == 0 else follow, g) for k, g in enumerate(groups)]


def _append(paths: list[list[Point]], command: str, numbers: list[float]) -> int:
    kind, is_relative = command.upper(), command.islower()
    at = paths[-1][-1] if paths else (0.0, 0.0)
    if kind == "Z":
        paths[-1].append(paths[-1][0])
        return 1
    x0, y0 = at if is_relative else (0.0, 0.0)
    if kind == "H":
        new = [(numbers[0] + x0, at[1])]
    elif kind == "V":
        new = [(at[0], numbers[0] + y0)]
    elif kind == "A":
        end = (numbers[5] + x0, numbers[6] + y0)
        new = _arc_points(at, numbers, end)
    else:
        given = [(numbers[k] + x0, numbers[k + 1] + y0) for k in range(0, len(numbers), 2)]
        if kind == "M":
            paths.append(given)
            return 1
        # Smooth curves (S, T) are read as if their first control point were where they start.
        new = given if kind in "LT" else _bezier([at, *([at] if kind == "S" else []), *given])
    paths[-1].extend(new)
    return len(new)


def _bezier(control: list[Point]) -> list[Point]:
    t = np.linspace(0, 1, CURVE_STEPS + 1)[1:, None]
    points = [np.broadcast_to(np.array(c), (CURVE_STEPS, 2)) for c in control]
    while len(points) > 1:
        points = [a + t * (b - a) for a, b in pairwise(points)]
    return [(float(x), float(y)) for x, y in points[0]]


def _arc_points(start: Point, numbers: list[float], end: Point) -> list[Point]:
    # Endpoint to centre form (SVG 1.1, appendix F.6.5).
    rx, ry = abs(numbers[0]), abs(numbers[1])
    tilt, large, sweep = math.radians(numbers[2]), numbers[3] != 0, numbers[4] != 0
    if rx < 1e-9 or ry < 1e-9 or start == end:
        return [end]
    c, s = math.cos(tilt), math.sin(tilt)
    hx, hy = (start[0] - end[0]) / 2, (start[1] - end[1]) / 2
    x, y = c * hx + s * hy, -s * hx + c * hy
    grow = math.sqrt(max(1.0, (x / rx) ** 2 + (y / ry) ** 2))
    rx, ry = rx * grow, ry * grow
    down = rx**2 * y**2 + ry**2 * x**2
    k = math.sqrt(max(0.0, (rx * ry) ** 2 / down - 1.0)) * (-1 if large == sweep else 1)
    cx, cy = k * rx * y / ry, -k * ry * x / rx
    mid = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
    first = math.atan2((y - cy) / ry, (x - cx) / rx)
    turn = math.atan2((-y - cy) / ry, (-x - cx) / rx) - first
    if sweep and turn < 0:
        turn += 2 * math.pi
    elif not sweep and turn > 0:
        turn -= 2 * math.pi
    n = max(2, math.ceil(abs(turn) / ARC_STEP_RAD))
    points = []
    for step in range(1, n):
        a = first + turn * step / n
        px, py = cx + rx * math.cos(a), cy + ry * math.sin(a)
        points.append((c * px - s * py + mid[0], s * px + c * py + mid[1]))
    return [*points, end]


def _without_repeats(points: list[Point]) -> list[Point]:
    kept: list[Point] = []
    for p in points:
        if not kept or math.dist(p, kept[-1]) > 1e-9:
            kept.append(p)
    while len(kept) > 1 and math.dist(kept[0], kept[-1]) <= 1e-9:
        kept.pop()
    return kept
