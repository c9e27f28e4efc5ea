"""Wall items: shelves, cupboards, rails with tools, sockets, mirrors, pin boards, coats; no effects.

Each has its back at z = 0 and grows to +z, the middle of its lower edge at the origin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise, product
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import CABINET, CLOTHES, MIRROR, PAPER, SHELVES, WHITEBOARD
from pbrs_farm.core.frames import LYING_ALONG_X, rotation_z
from pbrs_farm.core.house import Material, Surface
from pbrs_farm.dress.style import Rgb, mix, shade
from pbrs_farm.dress.thing_materials import MIRROR_GLASS, plain
from pbrs_farm.furnishings.things.joints import Inside, Look, fronts_of, hollow
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.furnishings.things.papers import printed, white_paper
from pbrs_farm.geometry.bodies import smooth
from pbrs_farm.geometry.outlines import Profile, rect, spaced
from pbrs_farm.geometry.solids import lathe, quads_surface

# fmt: off
_STICKY: Final[tuple[Rgb, ...]] = ((0.95, 0.88, 0.35), (0.95, 0.6, 0.7), (0.6, 0.85, 0.6),
    (0.55, 0.8, 0.93))
# middle (x, y), width and height of the slots of a socket, by form
_SLOTS: Final = {
    2: [(0.0, 0.052, 0.004, 0.009), (-0.011, 0.03, 0.008, 0.004), (0.011, 0.03, 0.008, 0.004)],
    3: [(x, y + dy, w, h) for y in (0.037, 0.078) for x, dy, w, h in ((-0.006, 0.0, 0.002, 0.008),
        (0.006, 0.0, 0.002, 0.007), (0.0, -0.011, 0.005, 0.005))],
    4: [(x, 0.0405, 0.005, 0.005) for x in (-0.013, 0.0, 0.013)],
}
# turns an upright solid so that its top faces +z
_LYING: Final = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


@thing(group="shelves", nyu40=SHELVES, place=Place.WALL)
def wall_shelf(m: Maker, width: float, depth: float, n: int, board: Material) -> None:
    """Boards above one another on brackets, rails or nothing seen; the lowest board's top is at y = 0.04."""
    form, thick = m.pick("slab", "bracket", "bracket", "bent", "corbel", "rail"), m.pick(0.018, 0.024)
    thick = m.pick(0.035, 0.05) if form == "slab" and n < 3 else thick
    xs = (0.12 - width / 2, width / 2 - 0.12) if width < 1.1 or m.chance(0.5) else (0.12 - width / 2,
        0.0, width / 2 - 0.12)
    lipped = m.chance(0.2)
    for k in range(n):
        top = 0.04 + 0.32 * k
        m.box(width, (max(top - thick, 0.0), top), (0.0, depth), 0.002, name="board", of=board)
        if lipped:  # a dark band along its front
            m.box(width, (max(top - thick, 0.0), top), (depth, depth + 0.003), of=m.metal)
        low = top - thick
        for x in xs:
            match form:
                case "bracket":
                    m.box(0.02, (low - 0.012, low), (0.0, 0.8 * depth), x=x, name="bracket",
                        of=m.metal)
                case "bent":  # a strip up the wall and under the board
                    m.box(0.025, (low - 0.004, low), (0.0, 0.9 * depth), x=x, of=m.metal)
                    m.box(0.025, (top, top + 0.09), 0.004, x=x, against=0.0, of=m.metal)
                case "corbel":
                    m.loft([(rect(0.03, 0.02, 0.002, x=x, z=0.01, n=1), max(low - 0.12, 0.0)),
                        (rect(0.03, 0.75 * depth, 0.002, x=x, z=0.375 * depth, n=1), low)], of=board)
                case "rail":
                    m.box(0.012, (low - 0.012, low), (0.0, 0.85 * depth), x=x, of=m.metal)
    for x in xs if form == "rail" else ():
        m.box(0.025, (0.0, 0.32 * n - 0.1), 0.008, x=x, against=0.0, of=m.metal)


@thing(group="upper_cabinet", nyu40=CABINET, place=Place.WALL)
def wall_cupboard(m: Maker, body: Material, face: Material, width: float, height: float, d: float,
    n: int, form: int) -> None:
    """A closed cupboard with its doors.

    Bars, knobs, grip edges, shaker fronts, flaps, an open end.
    """
    w, t = width / 2, 0.018
    # The last form leaves an open end with shelves.
    e = 0.22 if form == 5 and width > 0.75 else 0.0
    hollow(m, (-w, w - e), (0.0, height), (0.0, d), t, body)
    if e > 0:
        with m.of(body):
            m.box((w - e, w), height, (0.0, t))
            m.box((w - t, w), height, (t, d))
            for y in spaced(0.0, height - t, max(2, round(height / 0.3) + 1)):
                m.box((w - e, w - t), t, (t, d), on=y)
    kind, grip = (("flat", "bar"), ("flat", "knob"), ("flat", "edge"), ("shaker", "knob"),
        ("flat", "bar"), ("shaker", "none"))[form]
    # Flaps open upwards, one above the other.
    columns = [("flap",) * (2 if height > 0.5 else 1)] if form == 4 else [("door",)] * n
    fronts_of(m, Look(kind, face, body, body, grip, m.metal), (-w, w - e), (0.0, height), d,
        columns, True, Inside(0.008))


@thing(group="shelves", nyu40=SHELVES, place=Place.WALL)
def open_cupboard(m: Maker, body: Material, width: float, height: float, d: float) -> None:
    """An open cupboard of one to three shelves, some with an upright board or rails in front."""
    w, t, form = width / 2, 0.018, m.pick("plain", "divided", "railed")
    with m.of(body):
        m.box(t, height, (0.0, d), left=-w)
        m.box((w - t, w), height, (0.0, d))
        m.box(2 * w - 2 * t, height, (0.0, 0.006))
        levels = spaced(0.0, height - t, max(1, round(height / 0.3)) + 1)
        for y in levels:
            m.box(2 * w - 2 * t, t, (0.006, d), on=y)
        for low, high in pairwise(levels) if form == "divided" and width > 0.4 else ():
            m.box(t, (low + t, high), (0.006, d - 0.01))
    for y in levels[:-1] if form == "railed" else ():
        m.rod((t - w, w - t), y + t + 0.03, d - 0.012, 0.004, of=m.metal)


@thing(group="kitchen_tool", place=Place.WALL)
def tool_rail(m: Maker, width: float) -> None:
    """A bar on two holders with tools, pans and cups on hooks; the bar hangs above y = 0.3."""
    half, y = width / 2, 0.36
    m.cylinder(0.006, 0.0, width, n=12, turn=LYING_ALONG_X, at=(-half, y, 0.045), of=m.metal)
    m.box(0.016, 0.016, 0.041, left=0.022 - half, on=y - 0.008, against=0.0, mirrored="x",
        of=m.metal)
    x = -half + 0.1
    while x < half - 0.08:
        tool = m.weighted(0.3, 0.3, 0.22, 0.18)
        # A hook reaches from the bar down to what hangs.
        m.box(0.003, 0.031, 0.003, x=x, on=y - 0.006 - 0.03, z=0.045, of=m.metal)
        match tool:
            case 0:
                ladle(m, x, y - 0.006)
            case 1:
                turner(m, x, y - 0.006)
            case 2:
                pan(m, x, y - 0.006)
            case 3:
                hung_cup(m, x, y - 0.006)
        x += m.uniform(0.1, 0.15) + (0.1 if tool == 2 else 0.0)


def stick(m: Maker, x: float, top: float, low: float) -> None:
    """The handle of a tool from `low` to `top`."""
    m.box(0.012, (low, top), 0.006, x=x, z=0.045)


def ladle(m: Maker, x: float, y: float) -> None:
    """A ladle that hangs from (x, y)."""
    r, low = m.uniform(0.03, 0.042), y - m.uniform(0.24, 0.3)
    with m.of(m.pick(m.metal, plain("handle", (0.08, 0.08, 0.08), 0.5),
        plain("handle " + m.style.wood.name, m.wood, 0.6))):
        stick(m, x, y - 0.028, low + 0.6 * r)
    m.revolve([(0.0, -r), (0.7 * r, -0.7 * r), (r, 0.0), (0.7 * r, 0.7 * r), (0.0, r)], n=14,
        turn=np.diag((1.0, 1.0, 0.55)), at=(x, low, 0.045), of=m.metal)


def turner(m: Maker, x: float, y: float) -> None:
    """A turner that hangs from (x, y)."""
    w, low = m.uniform(0.028, 0.04), y - m.uniform(0.2, 0.24)
    grip = m.pick(m.metal, plain("handle", (0.08, 0.08, 0.08), 0.5),
        plain("handle " + m.style.wood.name, m.wood, 0.6))
    with m.of(grip):
        stick(m, x, y - 0.028, low)
    m.box(2 * w, 0.102, 0.003, x=x, on=low - 0.1, z=0.045, of=grip if m.chance(0.5) else m.metal)


def pan(m: Maker, x: float, y: float) -> None:
    """A pan that hangs from (x, y), its inside to the front."""
    r, low, black = m.uniform(0.08, 0.1), y - 0.13, plain("pan", (0.07, 0.07, 0.075), 0.4)
    m.box(0.018, (low - 0.004, y - 0.024), (0.028, 0.046), x=x, of=black)
    m.turned([(0.85 * r, 0.0), (r, 0.035), (0.96 * r, 0.035), (0.82 * r, 0.005)], n=24, front=(x,
        low - r, 0.008), of=black if m.chance(0.6) else m.metal)


def hung_cup(m: Maker, x: float, y: float) -> None:
    """A cup that hangs by its handle, its mouth to the side."""
    r, h = 0.038, 0.085
    with m.of(m.coloured("hung cup", 0.25)):
        m.box(0.036, 0.024, 0.01, x=x, on=y - 0.05, z=0.045)
        m.turned([(r, 0.0), (r, h), (r - 0.004, h), (r - 0.004, 0.004)], n=18, turn=LYING_ALONG_X,
            at=(x - h / 2, y - 0.03 - 0.018 - r, 0.045))


@thing(group="socket", place=Place.WALL)
def wall_socket(m: Maker, n: int, colour: Rgb, form: int, plate: int) -> None:
    """Sockets of the usual 8 cm beside one another, by national standard.

    A round well, one with a pin, slots below a rocker, two pairs of slots, three holes in a row.
    """
    hole = plain("plate hole", shade(colour, 0.25), 0.5)
    xs = [(k - (n - 1) / 2) * 0.081 for k in range(n)]
    with m.of(plain("plate", colour, 0.3)):
        cover(m, n, plate, 0.115 if form == 3 else 0.081)
        for x in xs if form == 2 else ():
            m.box(0.012, (0.05, 0.07), (0.0085, 0.0125), x=x + 0.022, name="rocker")
    for x in xs:
        if form < 2:
            m.add(facing_disc([(0.019 + 0.003, 0.009), (0.019, 0.0093), (0, 0.0093)], 0.0405, x),
                name="well", of=hole)
        for dx, y, w, h in _SLOTS.get(form, ()):
            m.box(w, (y - h / 2, y + h / 2), (0.0088, 0.0093), x=x + dx, name="well", of=hole)
        if form == 1:
            m.box(0.005, (0.049, 0.054), (0.009, 0.019), x=x, name="pin", of=m.metal)


@thing(group="switch", place=Place.WALL)
def wall_switch(m: Maker, n: int, colour: Rgb, form: int, plate: int) -> None:
    """Switches of the usual 8 cm beside one another.

    Rockers, halved ones, small ones in a plate, round ones that turn.
    """
    with m.of(plain("plate", colour, 0.3)):
        cover(m, n, plate)
        for k in range(n):
            x = (k - (n - 1) / 2) * 0.081
            match form:
                case 0:  # a rocker
                    m.box(0.058, (0.0115, 0.0695), (0.0085, 0.0125), x=x, name="rocker")
                case 1:  # halved
                    for s in (-1, 1):
                        m.box(0.0276, (0.0115, 0.0695), (0.0085, 0.0125), x=x + 0.0148 * s,
                            name="rocker")
                case 2:  # small, in a screwed plate
                    m.box(0.024, (0.0185, 0.0625), (0.0085, 0.0145), x=x, name="rocker")
                case 3:  # round, it turns
                    m.add(facing_disc([(0.024, 0.009), (0.024, 0.013), (0, 0.013)], 0.0405, x),
                        name="rocker")
                    m.box(0.008, (0.0225, 0.0585), (0.0125, 0.0255), x=x, name="rocker")
                case 4:  # round
                    m.add(facing_disc([(0.03, 0.009), (0.03, 0.0105), (0.024, 0.014), (0, 0.0145)],
                        0.0405, x), name="rocker")
                case 5:  # flat, nearly the whole plate
                    m.box(0.076, (0.0025, 0.0785), (0.0086, 0.011), x=x, name="rocker")
        for y in (0.012, 0.069):
            if form == 2:
                m.box(0.006, 0.006, (0.0088, 0.0104), on=y - 0.003, name="screw")


def cover(m: Maker, n: int, form: int, tall: float = 0.081) -> None:
    """The plate of n switches or sockets side by side: plain, rounded, in two steps, one for each."""
    match form:
        case 0:
            m.box(0.081 * n, tall, (0.0, 0.009), name="plate")
        case 1:
            m.box(0.081 * n, tall, (0.0, 0.009), 0.003, name="plate")
        case 2:
            m.box(0.081 * n, tall, (0.0, 0.004), name="plate")
            m.box(0.081 * n - 0.006, (0.003, tall - 0.003), (0.004, 0.009), name="plate")
        case _:
            for k in range(n):
                m.box(0.0795, tall, (0.0, 0.009), 0.0015, x=(k - (n - 1) / 2) * 0.081, name="plate")
            m.box(0.081 * n, (0.001, tall - 0.001), (0.0, 0.006), name="plate")


@thing(group="mirror", nyu40=MIRROR, place=Place.WALL)
def round_mirror(m: Maker, diameter: float, frame: Material) -> None:
    """A round mirror: in a ring, a wide or a round one, with a bare edge, or with rays about it."""
    form = m.pick("ring", "ring", "wide", "bead", "bare", "rays")
    r = diameter / 2 * (0.7 if form == "rays" else 1.0)
    y, t = diameter / 2, {"wide": 0.045, "bare": 0.002}.get(form, 0.014)
    rim = {"bare": [(r, 0.0), (r, 0.012), (r - t, 0.012)], "bead": [(r, 0.0), (r, 0.012), (r - 0.003, 0.019), (r - 0.007, 0.021),
        (r - 0.011, 0.019), (r - t, 0.012)], "wide": [(r, 0.0), (r, 0.014), (r - 0.006, 0.022),
        (r - t + 0.006, 0.016), (r - t, 0.012)]}.get(form, [(r, 0.0), (r, 0.02), (r - t, 0.02), (r - t, 0.012)])
    m.add(facing_disc([(0, 0), *rim], y), name="rim", of=frame)
    m.add(facing_disc([(r - t, 0.012), (0, 0.012)], y), name="mirror", of=MIRROR_GLASS)
    rays = m.pick(16, 24, 32) if form == "rays" else 0
    for k in range(rays):
        with m.moved(turn=rotation_z(2 * np.pi * k / rays), at=(0.0, y, 0.0)):
            m.box(0.008, (r - 0.004, y * (0.86 if k % 2 else 1.0)), (0.004, 0.012), of=frame)
    if form not in ("rays", "bare") and m.chance(0.35):  # on a strap
        for s in (-1.0, 1.0):
            m.tube([(0.7 * s * r, y + 0.7 * r, 0.006), (0.0, y + 1.25 * r, 0.006)], 0.004, n=6, of=frame)
        m.add(facing_disc([(0.012, 0.0), (0.012, 0.02), (0, 0.022)], y + 1.25 * r), name="peg", of=frame)


@thing(group="pin_board", nyu40=WHITEBOARD, place=Place.WALL)
def pin_board(m: Maker, width: float, height: float, frame: Material) -> None:
    """Cork in a frame, with papers, cards and photographs pinned to it."""
    profile = [(0, 0), (0, 0.016), (0.002, 0.018), (0.02, 0.018), (0.022, 0.016), (0.022, 0)]
    m.add(moulding("frame", (-width / 2, 0.0), (width / 2, height), profile), of=frame)
    m.box(width - 0.044, (0.022, height - 0.022), (0.001, 0.01),
        of=plain("cork", (0.66, 0.5, 0.34), 0.9))
    # Sheets are pinned to cells of a grid, so that they lie beside one another.
    columns, rows = max(2, int(width / 0.19)), max(2, int(height / 0.2))
    for row, column in product(range(rows), range(columns)):
        if not m.chance(0.3):
            w, h = m.uniform(0.07, 0.15), m.uniform(0.08, 0.16)
            x = -width / 2 + 0.03 + (column + 0.5) * (width - 0.06) / columns
            y = 0.03 + (row + 0.5) * (height - 0.06) / rows
            is_white = m.chance(0.5)
            m.box(w, h, (0.01, 0.0108), x=x, on=y - h / 2, of=plain("sheet",
                (0.92, 0.91, 0.88) if is_white else m.any_colour(), 0.8))
            for k in range(m.integers(2, 5) if is_white else 0):
                high = y + h / 2 - 0.018 - 0.018 * k
                m.box(0.73 * w, (high - 0.003, high), (0.0108, 0.0111), left=x - 0.38 * w,
                    of=plain("print", (0.45, 0.45, 0.47), 0.8))
            m.box(0.01, 0.01, (0.0108, 0.016), x=x, on=y + h / 2 - 0.012, of=m.coloured("pin", 0.3))


@thing(group="notes", nyu40=PAPER, place=Place.WALL)
def wall_notes(m: Maker) -> None:
    """Sheets, cards and sticky notes taped to a wall beside one another, none quite straight."""
    columns, rows, z = m.integers(1, 4), m.integers(1, 4), 0.0
    for column in range(columns):
        for row in range(rows):
            if column + row and m.chance(0.25):
                continue
            x, y = (column - (columns - 1) / 2) * 0.25, 0.17 + 0.33 * row
            with m.moved(turn=rotation_z(m.normal(0, 0.03)), at=(x + m.normal(0, 0.012), y, 0.0)):
                if m.chance(0.3):
                    for k in range(m.integers(2, 5)):
                        with m.moved(at=(0.085 * (k % 2) - 0.04, 0.09 * (k // 2) - 0.05, 0.0)):
                            printed(m, 0.075, 0.075, z, plain("sticky note", m.pick(*_STICKY), 0.8))
                else:
                    w, h = m.pick((0.21, 0.297), (0.21, 0.297), (0.148, 0.21), (0.13, 0.18))
                    printed(m, w, h, z, white_paper(m))
                    m.box(0.04, 0.022, 0.0002, on=h / 2 - 0.012, against=z + 0.0006,
                        of=plain("tape", (0.86, 0.83, 0.72), 0.5))


@thing(group="clothes", nyu40=CLOTHES, place=Place.WALL)
def coat_rack(m: Maker, n: int, is_bath: bool) -> None:
    """A board with hooks 0.3 m apart and garments on most; its lower edge at y = 0."""
    half = n * 0.3 / 2
    m.box(2 * half, 0.09, (0.0, 0.018), of=plain("rack " + m.style.wood.name, m.wood,
        0.4) if m.chance(0.6) else plain("rack white", (0.9, 0.9, 0.88), 0.4))
    hook = m.pick("arm", "knob", "peg")
    for k in range(n):
        x = -half + (k + 0.5) * 0.3
        if hook == "arm":  # out of the board, its tip turns up
            m.box(0.016, (0.035, 0.05), (0.018, 0.06), x=x, of=m.metal)
            m.box(0.016, (0.05, 0.07), (0.048, 0.06), x=x, of=m.metal)
        else:
            m.add(facing_disc([(0.008, 0.018), (0.007, 0.06)] + ([(0.017, 0.064), (0.017, 0.07)]
                if hook == "knob" else []) + [(0, 0.072)], 0.05, x), of=m.metal)
        if n == 1 or m.chance(0.85):
            coat(m, x, is_bath)


def coat(m: Maker, x: float, is_bath: bool) -> None:
    """A coat that hangs by its collar at (x, 0.04), before the board; its sleeves a little behind."""
    long, wide = m.uniform(0.95, 1.15) if is_bath else m.uniform(0.65, 1.05), m.uniform(0.2, 0.27)
    if is_bath:
        colour = mix((0.92, 0.91, 0.89), m.any_colour(), 0.3)
    else:
        colour = (m.pick((0.09, 0.1, 0.13), (0.2, 0.2, 0.2), (0.35, 0.28, 0.2),
            (0.16, 0.2, 0.16)) if m.chance(0.6) else m.any_colour())
    phase = m.uniform(0, 6)
    with m.of(plain("coat", colour, 0.95)):
        m.add(garment(wide, long, 0.075, phase), at=(x, 0.045, 0.105))
        for sign in (-1.0, 1.0):
            m.add(garment(0.07, min(0.62, 0.8 * long), 0.055, phase + sign),
                at=(x + sign * (wide / 2 - 0.015), 0.02, 0.085))


def moulding(name: str, low: Sequence[float] | F64, high: Sequence[float] | F64,
    profile: Profile) -> Surface:
    """A closed rectangular moulding with mitred corners; low, high (2,) are its outer corners.

    profile: (inset from the outer edge, z) in metres, from the outer to the inner edge at the wall.
    """
    outer = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    inward = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    loops = np.array([np.c_[outer + inset * inward, np.full(4, z)] for inset, z in profile])
    after, turned = np.roll(loops, -1, 0), np.roll(loops, -1, 1)
    quads = np.stack([loops, turned, np.roll(after, -1, 1), after], 2)
    return quads_surface(name, quads.reshape(-1, 4, 3), 0)


def facing_disc(profile: Profile | F64, up: float, x: float = 0.0) -> Surface:
    """A profile (radius, height) turned about +z, its middle at y = up."""
    upright = lathe("disc", np.asarray(profile), np.zeros(3), 0, n=40)
    normals = upright.normals
    assert normals is not None
    lying = replace(upright,
        positions=(upright.positions @ _LYING.T.astype(np.float32)).astype(np.float32),
        normals=(normals @ _LYING.T.astype(np.float32)).astype(np.float32))
    return replace(lying, positions=(lying.positions + np.array((x, up, 0.0))).astype(np.float32))


def garment(wide: float, long: float, deep: float, phase: float) -> Surface:
    """A closed hanging bag of cloth, its top at y = 0: pinched above, folded below."""
    n, rows = 22, 9
    angles = 2 * np.pi * np.arange(n) / n
    v = np.linspace(0, 1, rows)
    # Widen from the collar to the shoulders, then slowly to the hem.
    grow = np.interp(v, [0.0, 0.06, 0.14, 0.5, 1.0], [0.25, 0.62, 0.9, 0.85, 1.0])
    fold = 1 + 0.22 * v[:, None] * np.sin(5 * angles + phase + 0.8 * v[:, None])
    x = wide / 2 * grow[:, None] * np.cos(angles)
    z = deep / 2 * np.minimum(grow + 0.1, 1.0)[:, None] * np.sin(angles) * fold
    y = np.broadcast_to(-long * v[:, None], x.shape)
    ring = np.stack([x, y, z], -1).reshape(-1, 3)
    points = np.concatenate([ring, [[0.0, 0.0, 0.0]], [[0.0, -long, 0.0]]])
    k, after = np.arange(n), (np.arange(n) + 1) % n
    faces = [np.stack([np.full(n, rows * n), after, k], -1)]
    for r in range(rows - 1):
        a, b = r * n, (r + 1) * n
        faces += [np.stack([a + k, a + after, b + after], -1),
            np.stack([a + k, b + after, b + k], -1)]
    last = (rows - 1) * n
    faces.append(np.stack([np.full(n, rows * n + 1), last + k, last + after], -1))
    return smooth("coat", points, np.concatenate(faces).astype(np.int32))
