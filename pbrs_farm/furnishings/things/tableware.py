"""Plates, cutlery, pots, pans and mills; no effects."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

from pbrs_farm.core.classes import PAPER
from pbrs_farm.core.frames import rotation_x, rotation_y, rotation_z
from pbrs_farm.dress.thing_materials import STEEL, plain
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.furnishings.things.profiles import profiles
from pbrs_farm.geometry.bodies import bevelled
from pbrs_farm.geometry.outlines import Outline, fluted, oval, rect, rings, scaled


# fmt: off
@thing(group="plate")
def plates(m: Maker) -> None:
    """A plate, or a few on top of each other."""
    n = m.pick(1, 1, 2, 4, 6)
    m.name = "plates" if n > 1 else "plate"
    pile(m, n)


@thing(group="plate", called="plate")
def one_plate(m: Maker) -> None:
    """A plate to eat from."""
    pile(m, 1)


_DEEP = 6  # of the round plates: no others lie on it


def pile(m: Maker, n: int) -> None:
    """Plates of one form on top of each other."""
    r, glaze, form = m.uniform(0.1, 0.14), m.china(), m.integers(0, 13)
    form = 0 if form == _DEEP and n > 1 else form
    round_plates = [plate.profile for plate in profiles("plate").values()]
    sides = 24 if n == 1 else 16 if n < 4 else 10
    # They nest 6.6 mm apart.
    for k in range(n):
        with m.moved(at=(0, 0.0066 * k, 0)), m.of(glaze):
            match form:
                case 7:  # square
                    plate_of(m, rect, (1.2 * r, 1.2 * r, 0.01), (1.9 * r, 1.9 * r, 0.02), n=2)
                case 8:  # oval
                    plate_of(m, oval, (1.6 * r, r), (2.4 * r, 1.6 * r), n=18)
                case 9:  # fluted
                    plate_of(m, fluted, (1.3 * r, 10, 0.03), (2 * r, 10, 0.06))
                case 10:  # with eight corners
                    plate_of(m, oval, (1.3 * r, 1.3 * r), (2 * r, 2 * r), n=8)
                case 11:  # long, with round corners
                    plate_of(m, rect, (1.5 * r, 0.8 * r, 0.02), (2.3 * r, 1.3 * r, 0.04), n=4)
                case 12:  # of many scallops
                    ribs = 16 if n == 1 else 8
                    plate_of(m, fluted, (1.3 * r, ribs, 0.02), (2 * r, ribs, 0.045))
                case _:
                    m.turned(scaled(r, 1.0, round_plates[form]), n=sides)
    if form in (0, 2, 3, 4) and m.chance(0.35):
        top = 0.0066 * (n - 1) + max(y for _x, y in round_plates[form])
        m.hoop(oval(1.975 * r, 1.975 * r, n=28), top - 0.001, 0.0012, n=5,
            of=m.coloured("china band", 0.2))
    # Some have a spoon, a fork or crumbs on them.
    if n == 1 and m.chance(0.25):
        m.tube([(-0.5 * r, 0.012, 0.01), (0.6 * r, 0.026, 0.0)], 0.0025, n=5, of=m.metal)
        m.ellipsoid((0.022, 0.004, 0.013), n=8, at=(-0.55 * r, 0.0125, 0.01), of=m.metal)


def plate_of(m: Maker, outline: Callable[..., Outline], foot: tuple[float, ...],
    rim: tuple[float, ...], **alike: float) -> None:
    """A plate from the outline of its foot to that of its rim, 4 mm thick there."""
    # Widths are between 0.1 and 1 m; corners are smaller, and numbers of ribs larger.
    inner = tuple(v - 0.004 if 0.1 < v < 1 else v for v in rim)
    m.loft(rings(outline, [(*foot, 0), (*rim, 0.018), (*inner, 0.02), (*foot, 0.005)],
        column="", **alike),
        sharp=70.0 if outline is fluted else 50.0)


@thing(group="kitchen_tool")
def mills(m: Maker) -> None:
    """Salt and pepper."""
    # foot, waist, head and turning knob
    for k, colour in enumerate((m.dark_wood, (0.85, 0.84, 0.8))):
        m.turned([(0.024, 0), (0.02, 0.03), (0.024, 0.07), (0.018, 0.082), (0.02, 0.1),
            (0.012, 0.11)], n=12, at=(0.055 * k, 0, 0), of=plain("mill", colour, 0.35))


@thing(group="pot_pan")
def pot(m: Maker) -> None:
    """A cooking pot with its lid, two handles."""
    r = m.uniform(0.09, 0.13)
    tall = r * m.uniform(0.8, 1.2)
    # Body, rim, the lid's dome and its knob in one closed profile.
    m.revolve([(0, 0), (r * 0.95, 0), (r, 0.01), (r, tall), (r * 1.03, tall), (r * 0.9,
        tall + 0.012), (r * 0.2, tall + 0.025), (0.012, tall + 0.028), (0.018, tall + 0.045), (0,
        tall + 0.048)], n=20, of=m.metal if m.chance(0.6) else m.coloured("enamel", 0.2))
    for x in (-1.0, 1.0):
        m.cylinder(0.04, -0.006, 0.006, n=12, at=(x * r, tall * 0.8, 0),
            of=plain("grip", (0.08, 0.08, 0.08), 0.4))


@thing(group="pot_pan")
def pan(m: Maker) -> None:
    """A frying pan, its handle to the front."""
    r, black = m.uniform(0.11, 0.14), plain("black iron", (0.06, 0.06, 0.065), 0.35)
    m.vessel([(0, 0), (r * 0.85, 0), (r, 0.045)], 0.003, n=20, of=black)
    # The handle is along +z, turned a little.
    with m.moved(turn=rotation_y(m.uniform(-0.5, 0.5))), m.of(black):
        m.turned([(0.011, 0.0), (0.009, 0.1), (0.012, 0.18)], n=8, front=(0, 0.035, r * 0.97))


@thing(group="kitchen_tool", nyu40=PAPER)
def kitchen_roll(m: Maker) -> None:
    """A roll of kitchen paper."""
    # The paper, and the cardboard core 2 mm above it.
    m.turned([(0.055, 0), (0.055, 0.23), (0.02, 0.23), (0.02, 0.232)], n=18, name="roll",
        of=plain("tissue", (0.92, 0.92, 0.9), 0.95))


@thing(group="cutlery")
def cutlery(m: Maker) -> None:
    """Spoons and knives.

    In a pot, in a block of wood, on a board with a knife, or a fork and a knife that lie side by side.
    """
    form = m.integers(0, 4)
    grip = m.pick(STEEL, plain("grip", (0.08, 0.08, 0.08), 0.4), plain("grip wood", m.wood, 0.5))
    match form:
        case 0:  # wooden spoons and ladles lean in a pot
            m.name, r, tall = "utensil_pot", m.uniform(0.045, 0.06), m.uniform(0.13, 0.17)
            m.vessel([(0, 0), (r * 0.92, 0), (r, tall)], 0.004, n=18,
                of=m.pick(m.china(), STEEL, m.coloured("pot", 0.4)))
            for k in range(m.integers(3, 6)):
                with m.moved(turn=rotation_y(1.7 * k + m.uniform(0, 0.6))):
                    material, high = (m.pick(STEEL, plain("spoon wood", m.wood, 0.6),
                        plain("nylon", (0.05, 0.05, 0.05), 0.5)), tall + m.uniform(0.06, 0.13))
                    m.tube([(-r * 0.5, 0.012, 0), (r * 0.62, high, 0)], 0.005, n=6, of=material)
                    m.ellipsoid((0.008, 0.036, 0.024), n=10, turn=rotation_z(-0.3),
                        at=(r * 0.62 + 0.008, high + 0.028, 0), of=material)
        case 1:  # the block leans back; handles come out of its top
            m.name = "knife_block"
            m.loft([(rect(0.1, 0.12, 0.006, n=1), 0), (rect(0.1, 0.1, 0.006, n=1, z=-0.04), 0.2)],
                sharp=20.0, of=plain("block wood", m.pick(m.wood, m.dark_wood), 0.5))
            for i, k in product(range(3), range(2)):
                m.add(bevelled((-0.009, 0, -0.007), (0.009, m.uniform(0.08, 0.11), 0.007), 0.003),
                    turn=rotation_x(-0.2), at=(-0.03 + 0.03 * i, 0.195, -0.06 + 0.04 * k), of=grip)
        case 2:
            m.name, w, d = "board_and_knife", m.uniform(0.28, 0.38), m.uniform(0.18, 0.24)
            m.box(w, 0.018, d, 0.004, of=plain("board wood", m.pick(m.wood, (0.8, 0.64, 0.42)),
                0.6))
            with m.moved(turn=rotation_y(m.uniform(-0.5, 0.5)), at=(0, 0.0183, 0)):
                m.loft([([(-0.1, -0.012), (-0.1, 0.012), (0.05, 0.016), (0.06, -0.012)], 0.0),
                    ([(-0.1, -0.012), (-0.1, -0.01), (0.05, -0.01), (0.06, -0.012)], 0.002)],
                    sharp=10.0, of=STEEL)
                m.box((0.0502, 0.16), 0.016, (-0.012, 0.01), 0.004, of=grip)
        case 3:
            m.name = "fork_and_knife"
            for x, head in ((-0.03, "knife"), (0.0, "fork"), (0.03, "spoon")):
                m.box(0.012, 0.005, (0.0, 0.105), 0.0015, x=x, of=grip)
                match head:
                    case "knife":
                        m.box(0.014, 0.002, 0.1048, 0.0007, left=x - 0.008, against=-0.105,
                            of=STEEL)
                    case "fork":
                        m.box(0.004, 0.003, 0.0448, 0.0008, x=x, against=-0.045, of=STEEL)
                        m.box(0.022, 0.003, 0.0148, 0.001, x=x, against=-0.06, of=STEEL)
                        for t in (-0.009, -0.003, 0.003, 0.009):
                            m.box(0.003, 0.0025, 0.0398, 0.0007, x=x + t, against=-0.1, of=STEEL)
                    case "spoon":
                        m.box(0.004, 0.003, 0.0448, 0.0008, x=x, against=-0.045, of=STEEL)
                        m.ellipsoid((0.018, 0.004, 0.028), n=10, at=(x, 0.004, -0.072), of=STEEL)
