"""Outlines, profiles and paths that bodies are made through; no effects.

An outline is (x, z) in plan, clockwise seen from above; a profile (radius, height) from the axis
outwards and up; a path (x, y, z). Metres.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

Triple = tuple[float, float, float]
Outline = Sequence[tuple[float, float]]
Profile = Sequence[tuple[float, float]]


def oval(
    w: float, d: float, *, x: float = 0.0, z: float = 0.0, n: int = 24, power: float = 2.0
) -> list[tuple[float, float]]:
    """An ellipse w wide and d deep about (x, z); a higher power is nearer to a rectangle."""
    t = 2 * np.pi * (np.arange(n) + 0.5) / n
    c, s = np.cos(t), -np.sin(t)
    px = np.sign(c) * np.abs(c) ** (2 / power) * w / 2 + x
    pz = np.sign(s) * np.abs(s) ** (2 / power) * d / 2 + z
    return [(float(p), float(q)) for p, q in zip(px, pz, strict=True)]


def rect(
    w: float, d: float, r: float = 0.0, *, x: float = 0.0, z: float = 0.0, n: int = 4
) -> list[tuple[float, float]]:
    """A rectangle about (x, z) with round corners of radius r, n + 1 points a corner."""
    r = max(min(r, 0.49 * min(w, d)), 1e-4)
    result = []
    for k, (sx, sz) in enumerate(((1, -1), (-1, -1), (-1, 1), (1, 1))):
        for t in np.pi / 2 * (k + np.arange(n + 1) / n):
            result.append(
                (
                    float(x + sx * (w / 2 - r) + r * np.cos(t)),
                    float(z + sz * (d / 2 - r) - r * np.sin(t)),
                )
            )
    return result


def fluted(w: float, ribs: int, depth: float) -> list[tuple[float, float]]:
    """A circle w wide whose rim goes in and out so many times, by a share of its radius."""
    n = 3 * ribs
    t = 2 * np.pi * np.arange(n) / n
    r = w / 2 * (1 - depth / 2 + depth / 2 * np.cos(ribs * t))
    return [(float(a * np.cos(b)), float(-a * np.sin(b))) for a, b in zip(r, t, strict=True)]


def gathered(w: float, d: float, fold: float, deep: float) -> list[tuple[float, float]]:
    """A rectangle w by d whose sides go in and out by `deep` every `fold` metres: gathered cloth."""
    result = []
    for (x, z), (dx, dz), side in (
        ((-w / 2, d / 2), (1.0, 0.0), w),
        ((w / 2, d / 2), (0.0, -1.0), d),
        ((w / 2, -d / 2), (-1.0, 0.0), w),
        ((-w / 2, -d / 2), (0.0, 1.0), d),
    ):
        n = 2 * max(2, round(side / fold))
        for k in range(n):
            # In and out by turns; outwards is to the right of the way round.
            out, s = deep * (1.0 if k % 2 else -1.0), side * k / n
            result.append((x + dx * s - dz * out, z + dz * s + dx * out))
    return result


def d_shape(
    w: float, d: float, *, back: float = 0.0, share: float = 0.6, r: float = 0.01, n: int = 16
) -> list[tuple[float, float]]:
    """An outline straight at z = back, round for a share of its depth in front; r: of its back corners."""
    t = np.pi * np.arange(n + 1) / n
    end = back + d * (1 - share)
    front = [(float(-w / 2 * np.cos(a)), float(end + d * share * np.sin(a))) for a in t]
    quarter = np.pi / 2 * np.arange(4) / 3
    right = [(float(w / 2 - r + r * np.cos(a)), float(back + r - r * np.sin(a))) for a in quarter]
    rest = [(float(-w / 2 + r - r * np.sin(a)), float(back + r - r * np.cos(a))) for a in quarter]
    return [*front, *right, *rest]


def rings(
    outline: Callable[..., Outline],
    rows: Sequence[tuple[float, ...]],
    *,
    column: str = "",
    **alike: float,
) -> list[tuple[Outline, float]]:
    """Outlines at heights, as `loft` takes them, all of one form.

    rows: what each outline takes, and its height last; alike: what all take. column: the keyword
    for the number before the height, where it differs from row to row.

        loft(rings(oval, [(0.2, 0.1, 0.0), (0.3, 0.2, 0.5)], n=20))  # ovals at 0 and 0.5 m
    """
    if column:
        return [(outline(*row[:-2], **{column: row[-2]}, **alike), row[-1]) for row in rows]
    return [(outline(*row[:-1], **alike), row[-1]) for row in rows]


def scaled(
    radius: float, height: float, profile: Sequence[tuple[float, float]]
) -> list[tuple[float, float]]:
    """A profile from one in shares of a radius and a height."""
    return [(r * radius, y * height) for r, y in profile]


def bent(points: Sequence[Triple], r: float, *, n: int = 4) -> list[Triple]:
    """The path with its corners rounded, r before and after each."""
    path = [np.asarray(p, np.float64) for p in points]
    result = [path[0]]
    for before, corner, after in zip(path, path[1:], path[2:], strict=False):
        to, off = before - corner, after - corner
        near = min(r, 0.49 * float(np.linalg.norm(to)), 0.49 * float(np.linalg.norm(off)))
        a = corner + to / np.linalg.norm(to) * near
        b = corner + off / np.linalg.norm(off) * near
        for t in np.linspace(0, 1, n + 1):
            result.append((1 - t) ** 2 * a + 2 * t * (1 - t) * corner + t**2 * b)
    result.append(path[-1])
    return [(float(p[0]), float(p[1]), float(p[2])) for p in result]


def ring_path(r: float, *, y: float = 0.0, n: int = 24, share: float = 1.0) -> list[Triple]:
    """Points on a level circle about the origin, or on a share of it; the first comes again at the end."""
    t = 2 * np.pi * share * np.arange(n + 1) / n
    return [(float(r * np.cos(a)), float(y), float(-r * np.sin(a))) for a in t]


def polar(
    r: float | tuple[float, float], y: float, angle: float, *, x: float = 0.0, z: float = 0.0
) -> Triple:
    """The point at height y and an angle (radians) of a circle about (x, z); r: or (r along x, along z)."""
    rx, rz = r if isinstance(r, tuple) else (r, r)
    return (float(x + rx * np.cos(angle)), y, float(z + rz * np.sin(angle)))


def spaced(low: float, high: float, n: int) -> list[float]:
    """n numbers from low to high, both among them, evenly spaced."""
    return [float(v) for v in np.linspace(low, high, n)]
