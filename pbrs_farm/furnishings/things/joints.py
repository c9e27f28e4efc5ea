"""Building blocks of furniture: carcasses, fronts that open, pulls, legs; no effects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from typing import Final, NamedTuple

from numpy import pi

from pbrs_farm.core.frames import LYING_ALONG_Z, rotation_x, rotation_z
from pbrs_farm.core.house import Material
from pbrs_farm.dress.thing_materials import BLACK_GLASS, FROSTED, plain
from pbrs_farm.furnishings.things.maker import Maker
from pbrs_farm.furnishings.things.shapes import Pair, row
from pbrs_farm.geometry.outlines import Outline, bent, d_shape, rect, ring_path, rings

# fmt: off
_DIGITS: Final = plain("digits", (0.75, 0.88, 0.92), 0.5)
_HEIGHTS: Final = {"door": 3.4, "low": 0.7}  # of fronts in one column, against a drawer's
_FRONT_M: Final = 0.019  # thickness of a front
_BOARD_M: Final = 0.016  # of a carcass
_BACK_M: Final = 0.008
_DOOR_RAD: Final = 95 * pi / 180  # limit of usual cupboard hinges
_FLAP_RAD: Final = 95 * pi / 180
_FLAP_M: Final = 0.2  # lower fronts are drawers
_DRAWN_OUT: Final = 0.75  # share of its depth that a drawer opens
_SLIDE_M: Final = 0.013  # width of a drawer's rail, each side
_LEAST_BOX_M: Final = 0.03  # least height of a drawer's box
_SHELF_STEP_M: Final = 0.36
_HANGING_M: Final = 1.2  # least height of a space with a rail for clothes


class Inside(NamedTuple):
    """The space behind fronts."""

    back: float  # z of the back's inner face
    has_boards: bool = True  # uprights between columns, shelves behind doors
    rail: Material | None = None  # of a rail for clothes
    top: float = 10.0  # y that nothing of drawers reaches: of a sink's bowl


class Look(NamedTuple):
    """Look of the doors and drawers of a piece."""

    kind: str  # of a front: flat, shaker, grooved, raised, glazed
    front: Material
    body: Material
    top: Material
    pull: str  # what opens them: bar, bow, square, knob, disc, ring, cup, edge, none
    pull_material: Material


def hollow(m: Maker, x: Pair, y: Pair, z: Pair, t: float, material: Material,
    has_top: bool = True) -> None:
    """A box of boards t thick, open to the front: sides, bottom, top, back."""
    with m.of(material):
        for a in (x[0], x[1] - t):
            m.box(t, (y[0], y[1]), (z[0], z[1]), left=a)
        for b in (y[0], y[1] - t)[: 1 + has_top]:
            m.box((x[0] + t, x[1] - t), t, (z[0], z[1]), on=b)
        m.box((x[0] + t, x[1] - t), (y[0] + t, y[1] - t), min(_BACK_M, t), against=z[0])


def shell(m: Maker, x: Pair, y: Pair, z: Pair, wall: float, material: Material, r: float = 0.004,
    liner: Material | None = None) -> None:
    """A body of thick walls, open to the front, r: of its edges; liner: of its inside."""
    middle, size = ((x[0] + x[1]) / 2, -(y[0] + y[1]) / 2), (x[1] - x[0], y[1] - y[0])

    def ring(inset: float, at: float) -> tuple[Outline, float]:
        return (rect(size[0] - 2 * inset, size[1] - 2 * inset, max(r - inset, 0.002), x=middle[0],
            z=middle[1], n=3), at)

    m.loft([ring(0.0, z[0]), ring(0.0, z[1]), ring(wall, z[1]), ring(wall, z[0] + wall)],
        turn=LYING_ALONG_Z, of=material)
    if liner is not None:
        m.loft([ring(wall + 0.0002, z[0] + wall + 0.0002), ring(wall + 0.0002, z[1] - 0.001),
            ring(wall + 0.002, z[1] - 0.001), ring(wall + 0.002, z[0] + wall + 0.002)],
            turn=LYING_ALONG_Z, of=liner)


def opens(m: Maker, kind: str, x: Pair, y: Pair, z: float, back: float, opens_left: bool = True,
    is_high: bool = False) -> AbstractContextManager[None]:
    """Add parts inside this context that open as a 'door', 'drawer', 'low' drawer or 'flap'.

    z: of its outer face; back: z of the end of the space behind it. A door's hinges are at its left
    if opens_left, a flap's above if is_high.
    """
    if kind == "door":
        return m.hinged("door", at=(x[0] if opens_left else x[1], y[0], z),
            axis=(0.0, -1.0 if opens_left else 1.0, 0.0), upper_rad=_DOOR_RAD)
    if kind == "flap" and y[1] - y[0] > _FLAP_M:
        return m.hinged("flap", at=(x[0], y[1] if is_high else y[0], z),
            axis=(-1.0 if is_high else 1.0, 0.0, 0.0), upper_rad=_FLAP_RAD)
    return m.sliding("drawer", along=(0.0, 0.0, 1.0), upper_m=_DRAWN_OUT * (z - back))


def is_drawer(kind: str, y: Pair) -> bool:
    """True if a front of that kind and height belongs to a drawer."""
    return kind in ("drawer", "low") or (kind == "flap" and y[1] - y[0] <= _FLAP_M)


def drawer_box(m: Maker, x: Pair, y: Pair, z: Pair, material: Material, top: float = 10.0) -> None:
    """A drawer without its front between two sides, in the space x, y, z."""
    a, b = x[0] + _SLIDE_M, x[1] - _SLIDE_M
    low, high = y[0] + 0.018, min(y[0] + 0.75 * (y[1] - y[0]), y[1] - 0.03, top - 0.01)
    back, t = z[0] + 0.012, 0.012
    if high - low < _LEAST_BOX_M:
        return
    with m.of(material):
        for c in (a, b - t):
            m.box(t, (low, high), (back, z[1]), left=c)
        m.box((a + t, b - t), (low, high), t, against=back)
        m.box((a + t, b - t), 0.008, (back + t, z[1]), on=low + 0.006)


def shelves(m: Maker, x: Pair, y: Pair, z: Pair, material: Material,
    rail: Material | None = None) -> None:
    """Shelves in the space x, y, z; rail: one shelf above, a rail for clothes under it."""
    tall = y[1] - y[0]
    levels = [y[0] + tall * k / n for n in (round(tall / _SHELF_STEP_M),) for k in range(1, n)]
    if rail is not None and tall > _HANGING_M:
        levels = [y[1] - 0.3]
        m.rod((x[0], x[1]), y[1] - 0.36, (z[0] + z[1]) / 2, 0.0125, of=rail)
    for level in levels:
        m.box((x[0], x[1]), _BOARD_M, (z[0], z[1] - 0.02), on=level, of=material)


def panel(m: Maker, kind: str, x: Pair, y: Pair, z: float, material: Material) -> None:
    """A front 19 mm thick before z, 2 mm within its edges.

    Flat, shaker, grooved, raised or glazed.
    """
    a, b, c, d = x[0] + 0.0015, x[1] - 0.0015, y[0] + 0.0015, y[1] - 0.0015
    rail = min(0.065, 0.22 * (b - a), 0.3 * (d - c))
    with m.of(material):
        if kind in ("shaker", "glazed"):
            m.frame((a, b), (c, d), rail, 0.019, 0.002, against=z)
            inner = (a + rail, b - rail), (c + rail, d - rail)
            if kind == "shaker":
                m.box(*inner, 0.011, against=z)
            else:
                m.box(*inner, 0.004, against=z + 0.006, of=FROSTED)
        elif kind == "grooved":
            m.box((a, b), (c, d), 0.012, against=z)
            for board in row(a, b, max(2, round((b - a) / 0.11)), gap=0.002):
                m.box(board, (c, d), 0.007, 0.002, against=z + 0.012)
        else:
            m.box((a, b), (c, d), 0.019, 0.002, against=z)
            if kind == "raised" and b - a > 0.16 and d - c > 0.12:
                m.box((a + rail * 0.8, b - rail * 0.8), (c + rail * 0.8, d - rail * 0.8), 0.006,
                    0.006, against=z + 0.019)


def pull(m: Maker, kind: str, x: float, y: float, z: float, across: bool, long: float,
    material: Material) -> None:
    """The pull of a front, its foot at z.

    Bar, bow, knob, cup, edge, ring or none. across: along x.
    """
    h = long / 2
    with m.of(material), m.moved(at=(x, y, z)):
        match kind:
            case "knob":
                m.revolve([(0.0, 0.0), (0.006, 0.0), (0.006, 0.012), (0.015, 0.016), (0.013, 0.025),
                    (0.0, 0.027)], n=10, turn=LYING_ALONG_Z)
            case "disc":
                m.revolve([(0.0, 0.0), (0.007, 0.0), (0.007, 0.014), (0.019, 0.015), (0.019, 0.022),
                    (0.0, 0.023)], n=12, turn=LYING_ALONG_Z)
        with m.moved(turn=rotation_z(0.0 if across else pi / 2)):
            match kind:
                case "bar":
                    m.rod((-h, h), 0.0, 0.027, 0.006)
                    for s in (-0.8 * h, 0.8 * h):
                        m.rod(s, 0.0, (0.0, 0.027), 0.0045, n=6)
                case "bow":
                    m.tube(bent([(-h, 0.0, 0.0), (-0.8 * h, 0.0, 0.027), (0.8 * h, 0.0, 0.027),
                        (h, 0.0, 0.0)], 0.02, n=3), 0.0055)
                case "square":
                    m.box(2 * h, (-0.005, 0.005), (0.02, 0.028), 0.0015)
                    m.box(0.01, (-0.005, 0.005), (0.0, 0.021), left=0.001 - h, mirrored="x")
                case "cup":
                    m.loft(rings(d_shape, [(min(long, 0.09), 0.024, 0.0),
                        (min(long, 0.085), 0.022, 0.022), (0.05, 0.012, 0.03)], share=0.9),
                        at=(0.0, -0.012, 0.0))
                case "edge":
                    m.box(2 * h, (-0.002, 0.002), (0.0, 0.022), 0.0008)
                    m.box(2 * h, (-0.014, 0.0015), (0.019, 0.022), 0.0008)
                case "ring":
                    m.box(0.024, (-0.016, 0.016), (0.0, 0.003), 0.001)
                    m.tube(ring_path(0.018, n=14), 0.0028, n=6, turn=rotation_x(pi / 2),
                        at=(0.0, -0.016, 0.012))
                    m.rod(0.0, 0.0, (0.0, 0.016), 0.004, n=6)


def door_front(m: Maker, look: Look, x: Pair, y: Pair, z: float, opens_left: bool,
    is_high: bool) -> None:
    """A front with a pull at the side away from its hinges.

    At its upper end below, its lower end above eyes.
    """
    panel(m, look.kind, x, y, z, look.front)
    tall = y[1] - y[0]
    a = x[1] - 0.04 if opens_left else x[0] + 0.04
    long = min(0.16, 0.4 * tall)
    b = y[0] + 0.06 + long / 2 if is_high else y[1] - 0.06 - long / 2
    b = y[0] + 0.5 * tall if tall > 1.1 else b
    if look.pull == "edge":
        pull(m, "edge", (x[0] + x[1]) / 2, y[0] if is_high else y[1] - 0.004, z + 0.012, True,
            0.7 * (x[1] - x[0]), look.pull_material)
    elif look.pull == "cup":
        pull(m, "knob", a, b, z + 0.019, False, long, look.pull_material)
    else:
        pull(m, look.pull, a, b, z + 0.019, False, long, look.pull_material)


def drawer_front(m: Maker, look: Look, x: Pair, y: Pair, z: float, hangs: bool = False) -> None:
    """The front of a drawer or flap with its pull, or two on wide ones; hangs: its hinges are above."""
    wide, tall = x[1] - x[0], y[1] - y[0]
    # Low drawers are flat where doors have a frame.
    is_flat = (tall < 0.17 and look.kind != "grooved") or look.kind == "glazed"
    panel(m, "flat" if is_flat else look.kind, x, y, z, look.front)
    end = y[0] + 0.045 if hangs else y[1] - 0.045
    middle, high, long = ((x[0] + x[1]) / 2, end if tall > 0.2 else (y[0] + y[1]) / 2,
        min(0.16 if wide < 0.5 else 0.24, 0.5 * wide))
    if look.pull == "edge":
        pull(m, "edge", middle, y[0] if hangs else y[1] - 0.004, z + 0.012, True, 0.7 * wide,
            look.pull_material)
    elif look.pull in ("knob", "disc", "ring") and wide > 0.6:
        for s in (-0.25, 0.25):
            pull(m, look.pull, middle + s * wide, high, z + 0.019, True, long, look.pull_material)
    else:
        pull(m, look.pull, middle, high, z + 0.019, True, long, look.pull_material)


def fronts_of(m: Maker, look: Look, x: Pair, y: Pair, z: float, columns: Sequence[Sequence[str]],
    is_high: bool, inside: Inside, add_to: Callable[[int], None] | None = None) -> None:
    """Columns of fronts before z that open, each named from the top, and their interiors.

    'door', 'drawer', 'low' (a lower drawer), 'flap', 'open'. add_to: adds moving parts to a front of
    the column of that number.
    """
    n, t = len(columns), _BOARD_M
    for k, kinds in enumerate(columns):
        a, b = x[0] + (x[1] - x[0]) * k / n, x[0] + (x[1] - x[0]) * (k + 1) / n
        space = (a + (t / 2 if k else t), b - (t / 2 if k < n - 1 else t))
        if k and inside.has_boards:
            m.box(t, (y[0] + t, min(y[1], inside.top)), (inside.back, z), x=a, of=look.body)
        total, below = sum(_HEIGHTS.get(kind, 1.0) for kind in kinds), 0.0
        for kind in kinds:
            above = below
            below += _HEIGHTS.get(kind, 1.0)
            c, d = y[1] - (y[1] - y[0]) * below / total, y[1] - (y[1] - y[0]) * above / total
            if kind == "open":
                continue
            is_left = k % 2 == 0 if n > 1 else True
            with opens(m, kind, (a, b), (c, d), z + _FRONT_M, inside.back, is_left, is_high):
                if kind == "door":
                    door_front(m, look, (a, b), (c, d), z, is_left, is_high)
                else:
                    hangs = is_high and not is_drawer(kind, (c, d))
                    drawer_front(m, look, (a, b), (c, d), z, hangs)
                if is_drawer(kind, (c, d)):
                    drawer_box(m, space, (c, d), (inside.back, z), look.body, inside.top)
                if add_to is not None:
                    add_to(k)
            if inside.has_boards and not is_drawer(kind, (c, d)):
                shelves(m, space, (c, min(d, inside.top)), (inside.back, z), look.body,
                    inside.rail if k % 2 == 0 else None)


def clock(m: Maker, x: float, y: float, z: float) -> None:
    """A display with four digits about (x, y) before z."""
    m.box(0.075, 0.03, 0.0008, x=x, on=y - 0.015, against=z, of=BLACK_GLASS)
    for i in range(4):
        m.box(0.006, 0.011, 0.0003, x=x + 0.011 * (i - 1.5), on=y - 0.0055, against=z + 0.0007,
            of=_DIGITS)
