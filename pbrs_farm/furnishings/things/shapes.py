"""Vocabulary of solids: each method builds one and adds it to the item; no effects.

`Maker` inherits these methods. All take the keywords of `Put`. Metres, y up.

    m.box(w, 0.03, d, 0.002, on=h - 0.03)            # a table top with edges cut by 2 mm
    m.box(0.04, h, 0.04, left=-w / 2, mirrored="x")  # a post at the left, another at the right
    for x in row(-w / 2, w / 2, 3, gap=0.004):       # three doors side by side
        m.box(x, h, 0.018, against=d / 2)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import TypedDict, Unpack

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Material, Surface
from pbrs_farm.furnishings.things.cloth import bulged
from pbrs_farm.geometry import bodies
from pbrs_farm.geometry.outlines import Outline, Profile, Triple, scaled

Pair = tuple[float, float]
Extent = float | Pair
"""A size, or the two coordinates that a solid reaches from and to."""


# profiles of legs: shares of the thickness and the height
_BUN = [(0, 0), (0.3, 0), (0.62, 0.3), (0.62, 0.6), (0.35, 0.85), (0.5, 1), (0, 1)]
_TURNED = [
    *[(0, 0), (0.35, 0), (0.4, 0.06), (0.28, 0.1), (0.5, 0.3), (0.42, 0.62), (0.55, 0.7)],
    *[(0.4, 0.74), (0.55, 0.78), (0.55, 1), (0, 1)],
]


class PutBox(TypedDict, total=False):
    """How a box is added: keywords of `Maker.add`."""

    of: Material | None
    at: Triple | None
    turn: F64 | None
    name: str


class Put(PutBox, total=False):
    """How any other solid is added: the keywords of `Maker.add`."""

    front: Triple | None
    mirrored: str


class Shapes:
    """Methods that build solids; a subclass collects them in `add`."""

    def add(
        self,
        solid: Surface,
        *,
        of: Material | None = None,
        at: Triple | None = None,
        turn: F64 | None = None,
        front: Triple | None = None,
        name: str = "",
        mirrored: str = "",
    ) -> None:
        """Add a solid to the item."""
        raise NotImplementedError

    def box(
        self,
        w: Extent,
        h: Extent,
        d: Extent,
        cut: float = 0.0,
        *,
        left: float | None = None,
        x: float = 0.0,
        on: float = 0.0,
        against: float | None = None,
        z: float = 0.0,
        mirrored: str = "",
        **put: Unpack[PutBox],
    ) -> None:
        """A box w wide (x), h high (y) and d deep (z).

        Each extent is a size or a pair of coordinates. Sizes extend from `left`, `on` and
        `against`, or to both sides of the middle x, z. cut: width of the bevel along all edges.
        mirrored: "x", "z" or "xz" repeats the box on the other side of the origin.
        """
        for low, high in _corners((w, h, d), (left, on, against), (x, z), mirrored):
            self.add(bodies.bevelled(low, high, cut) if cut else bodies.slab(low, high), **put)

    def rounded(
        self,
        w: Extent,
        h: Extent,
        d: Extent,
        r: float,
        *,
        n: int = 2,
        left: float | None = None,
        x: float = 0.0,
        on: float = 0.0,
        against: float | None = None,
        z: float = 0.0,
        mirrored: str = "",
        **put: Unpack[PutBox],
    ) -> None:
        """A box as of `box`, its edges round with radius r in 2 n steps: cushions, upholstery."""
        for low, high in _corners((w, h, d), (left, on, against), (x, z), mirrored):
            self.add(bodies.rounded(low, high, r, n=n), **put)

    def frame(
        self,
        x: Pair,
        y: Pair,
        t: float,
        d: Extent,
        cut: float = 0.0,
        *,
        against: float | None = None,
        **put: Unpack[PutBox],
    ) -> None:
        """A frame of four bars t wide between two x and two y, d deep, the sides at full height."""
        inner = (x[0] + t, x[1] - t)
        for w, h in (
            ((x[0], x[0] + t), y),
            ((x[1] - t, x[1]), y),
            (inner, (y[0], y[0] + t)),
            (inner, (y[1] - t, y[1])),
        ):
            self.box(w, h, d, cut, against=against, **put)

    def leg(
        self,
        kind: str,
        top: Pair,
        high: float,
        thick: float,
        *,
        foot: Pair | None = None,
        of: Material | None = None,
    ) -> None:
        """A leg up to a point (x, z) at height `high`, from `foot` on the floor, else from below.

        kind: square, round, tapered, turned, hairpin or bun.
        """
        x, z = top
        a, b = foot or top
        match kind:
            case "square":
                self.box(thick, high, thick, 0.003, x=x, z=z, of=of)
            case "round":
                self.tube([(a, 0.0, b), (x, high, z)], thick / 2, n=12, of=of)
            case "tapered":
                self.tube([(a, 0.0, b), (x, high, z)], 0.3 * thick, n=12, end=0.55 * thick, of=of)
            case "bun":
                self.revolve(scaled(thick, high, _BUN), at=(x, 0.0, z), of=of)
            case "hairpin":
                for s in (-0.035, 0.035):
                    self.tube([(a, 0.004, b), (x + s, high, z)], 0.005, n=6, of=of)
                self.rod((a - 0.008, a + 0.008), 0.005, b, 0.005, n=6, of=of)
            case "turned":
                self.revolve(scaled(thick, high, _TURNED), n=14, at=(x, 0.0, z), of=of)

    def legs(
        self,
        kind: str,
        w: float,
        d: float,
        high: float,
        thick: float,
        inset: float,
        splay: float = 0.0,
        *,
        of: Material | None = None,
    ) -> None:
        """Four legs below a top w by d, inset from its edges, leaning outwards by `splay`."""
        for sx, sz in product((-1.0, 1.0), (-1.0, 1.0)):
            foot = (sx * (w / 2 - inset + splay), sz * (d / 2 - inset + splay))
            top = (sx * (w / 2 - inset), sz * (d / 2 - inset))
            self.leg(kind, top, high, thick, foot=foot, of=of)

    def rod(
        self,
        x: Extent,
        y: Extent,
        z: Extent,
        r: float,
        *,
        n: int = 8,
        end: float | None = None,
        **put: Unpack[Put],
    ) -> None:
        """A round bar along an axis: one of x, y, z is the pair that it runs from and to."""
        starts, ends = zip(*(v if isinstance(v, tuple) else (v, v) for v in (x, y, z)), strict=True)
        self.tube([starts, ends], r, n=n, end=end, **put)

    def tube(
        self,
        path: Sequence[Triple],
        r: float,
        *,
        n: int = 8,
        end: float | None = None,
        **put: Unpack[Put],
    ) -> None:
        """A round bar along a path; end: its radius there, where it tapers."""
        self.add(bodies.tube(path, r, n=n, end=end), **put)

    def square_tube(self, a: Triple, b: Triple, w: float, d: float, **put: Unpack[Put]) -> None:
        """A straight bar of rectangular section from a to b."""
        self.add(bodies.square_tube(a, b, w, d), **put)

    def revolve(self, profile: Profile | F64, *, n: int = 16, **put: Unpack[Put]) -> None:
        """A turned solid: a (radius, height) profile about the vertical, n sides."""
        self.add(bodies.revolve(profile, n=n), **put)

    def turned(self, profile: Profile, *, n: int = 16, **put: Unpack[Put]) -> None:
        """A turned solid with flat ends: `revolve` of a profile that begins and ends beside the axis."""
        closed = [(0.0, profile[0][1]), *profile, (0.0, profile[-1][1])]
        self.add(bodies.revolve(closed, n=n), **put)

    def ellipsoid(self, radii: Triple, *, n: int = 16, **put: Unpack[Put]) -> None:
        """A ball about the origin with radii along x, y and z."""
        self.add(bodies.stretched(bodies.sphere((0.0, 0.0, 0.0), 1.0, n=n), radii), **put)

    def vessel(self, outside: Profile, wall_m: float, *, n: int = 16, **put: Unpack[Put]) -> None:
        """A turned vessel, open at the top, from its outer profile."""
        self.add(bodies.vessel(outside, wall_m, n=n), **put)

    def cylinder(
        self, r: float, low: float, high: float, *, n: int = 16, **put: Unpack[Put]
    ) -> None:
        """An upright cylinder between two heights."""
        self.add(bodies.cylinder(r, low, high, n=n), **put)

    def frustum(self, low: Pair, high: Pair, *, n: int = 16, **put: Unpack[Put]) -> None:
        """A cone without its tip: (radius, height) of both ends."""
        self.add(bodies.frustum(low, high, n=n), **put)

    def sphere(self, centre: Triple, radius: float, *, n: int = 16, **put: Unpack[Put]) -> None:
        """A ball, n sides round."""
        self.add(bodies.sphere(centre, radius, n=n), **put)

    def loft(
        self, rings: Sequence[tuple[Outline, float]], *, sharp: float = 50.0, **put: Unpack[Put]
    ) -> None:
        """A solid through outlines at heights; sharp: degrees of turning that make an edge."""
        self.add(bodies.loft(rings, sharp=sharp), **put)

    def ring(self, r: Pair, y: Pair, *, n: int = 16, **put: Unpack[Put]) -> None:
        """A ring of rectangular section between two radii and two heights."""
        (a, b), (low, high) = r, y
        self.revolve([(a, low), (b, low), (b, high), (a, high), (a, low)], n=n, **put)

    def hoop(self, outline: Outline, y: float, r: float, *, n: int = 6, **put: Unpack[Put]) -> None:
        """A ring of round section along an outline at height y."""
        self.add(bodies.hoop(outline, y, r, n=n), **put)

    def board(
        self,
        w: float,
        d: float,
        low: float,
        high: float,
        corner: float = 0.0,
        edge: float = 0.003,
        *,
        x: float = 0.0,
        z: float = 0.0,
        n: int = 4,
        **put: Unpack[Put],
    ) -> None:
        """A board between two heights, round corners in plan, edges cut: table tops, seats, lids."""
        self.add(bodies.board(w, d, low, high, corner, edge, x=x, z=z, n=n), **put)

    def disc(
        self,
        w: float,
        d: float,
        low: float,
        high: float,
        edge: float = 0.003,
        *,
        x: float = 0.0,
        z: float = 0.0,
        n: int = 32,
        power: float = 2.0,
        **put: Unpack[Put],
    ) -> None:
        """A round or oval board between two heights, its edges cut."""
        self.add(bodies.disc(w, d, low, high, edge, x=x, z=z, n=n, power=power), **put)

    def bulged(
        self,
        size: Triple,
        *,
        n: int = 12,
        edge: float = 0.0,
        bulge: float = 2.2,
        **put: Unpack[Put],
    ) -> None:
        """A cushion (width, thickness, depth) about the origin, as of cloth.py."""
        self.add(bulged(size, n=n, edge=edge, bulge=bulge), **put)


def row(low: float, high: float, n: int, gap: float = 0.0) -> Iterator[Pair]:
    """Extents of n equal parts side by side between two coordinates, `gap` metres apart."""
    step = (high - low) / n
    for k in range(n):
        yield low + k * step + gap / 2, low + (k + 1) * step - gap / 2


def on_side(side: float, a: float, b: float) -> Pair:
    """The extent between two distances from the middle, to the left (side -1) or right (side 1)."""
    return min(side * a, side * b), max(side * a, side * b)


def _corners(
    sizes: tuple[Extent, Extent, Extent],
    starts: tuple[float | None, float, float | None],
    middles: Pair,
    mirrored: str,
) -> Iterator[tuple[Triple, Triple]]:
    """Lower and upper corner of a box and of its mirror images."""
    x = _span(sizes[0], starts[0], middles[0])
    y = _span(sizes[1], starts[1], 0.0)
    z = _span(sizes[2], starts[2], middles[1])
    for a, b in (x, (-x[1], -x[0])) if "x" in mirrored else (x,):
        for c, d in (z, (-z[1], -z[0])) if "z" in mirrored else (z,):
            yield (a, y[0], c), (b, y[1], d)


def _span(extent: Extent, start: float | None, middle: float) -> Pair:
    if isinstance(extent, tuple):
        return extent
    if start is not None:
        return (start, start + extent)
    return (middle - extent / 2, middle + extent / 2)
