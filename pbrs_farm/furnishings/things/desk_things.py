"""Desk items: screens, laptops, papers, pens, telephones, binders, loudspeakers; no effects."""

from __future__ import annotations

from itertools import product

from numpy import pi

from pbrs_farm.core.classes import BOOKS, PAPER
from pbrs_farm.core.frames import LYING_ALONG_X, rotation_x, rotation_y, rotation_z
from pbrs_farm.dress.style import shade
from pbrs_farm.dress.thing_materials import BLACK_GLASS, BLACK_STEEL, CHROME, STEEL, plain
from pbrs_farm.furnishings.things.maker import Maker, thing


# fmt: off
@thing(group="monitor")
def monitor(m: Maker) -> None:
    """A screen on its foot before a keyboard and a mouse."""
    w, h, black = (m.uniform(0.5, 0.64), m.uniform(0.3, 0.37),
        plain("monitor", m.pick((0.06, 0.06, 0.065), (0.6, 0.6, 0.61), (0.9, 0.9, 0.89)), 0.4))
    y = m.uniform(0.08, 0.14)
    m.box(w, h, 0.03, 0.004, on=y, against=-0.05, of=black)
    m.box(w - 0.016, (y + 0.014, y + h - 0.008), 0.0008, against=-0.02,
        of=plain("screen", (0.02, 0.02, 0.025), 0.08))
    if m.chance(0.5):
        m.box(0.24, 0.012, (-0.14, 0.04), 0.003, of=black)
        m.box(0.05, (0.01, y + 0.12), 0.0245, 0.003, against=-0.075, of=black)
    else:
        for s in (-1.0, 1.0):
            m.tube([(s * 0.16, 0.008, 0.02), (0, 0.03, -0.06)], 0.008, of=black)
        m.tube([(0, 0.03, -0.06), (0, y + 0.1, -0.056)], 0.016, n=10, of=black)
    keys = plain("keys", m.pick((0.1, 0.1, 0.1), (0.88, 0.88, 0.87)), 0.6)
    m.box((-0.21, 0.16), 0.016, (0.1, 0.23), 0.004, of=black)
    for i, k in product(range(4), range(12)):
        m.box(0.024, (0.016, 0.02), 0.024, x=0.0292 * k - 0.188, against=0.108 + 0.0292 * i,
            of=keys)
    m.ellipsoid((0.032, 0.018, 0.055), n=12, at=(0.22, 0.018, 0.17), of=black)


@thing(group="laptop")
def laptop(m: Maker) -> None:
    """An open laptop: keys in a well, a pad, a hinge, ports; its screen is dark in a bezel."""
    # Width and depth of a 13 to 16 inch laptop; z points to who sits before it.
    w, d = m.uniform(0.3, 0.36), m.uniform(0.21, 0.25)
    grey = m.pick(0.12, 0.3, 0.62, 0.75, 0.86)
    shell = m.pick(plain("laptop", (grey, grey, grey * 1.01), 0.35), plain("laptop",
        m.pick((0.2, 0.26, 0.36), (0.72, 0.6, 0.52), (0.55, 0.58, 0.56)), 0.35))
    dark = plain("bezel", (0.03, 0.03, 0.033), 0.3)
    keys = plain("keys", m.pick((0.06, 0.06, 0.06), (0.09, 0.09, 0.09), (0.8, 0.8, 0.8)), 0.6)
    y, round_m = 0.016, m.pick(0.004, 0.01, 0.016)
    m.board(w, d, 0.002, y, round_m, 0.0025, of=shell)
    m.cylinder(0.008, 0.0, 0.0022, n=10, of=dark, at=(0.03 - w / 2, 0, 0.03 - d / 2), mirrored="xz")
    has_numbers = w > 0.335 and m.chance(0.5)
    columns, wide = (16, 0.93 * w) if has_numbers else (m.pick(12, 13, 14), m.pick(0.82, 0.9) * w)
    step, back = wide / columns, -0.38 * d
    m.box(wide + 0.006, (y, y + 0.0003), (back - 0.003, back + 5 * 0.0185 + 0.003),
        of=m.pick(dark, plain("deck", shade((grey, grey, grey), 0.8), 0.4)))
    for i, k in product(range(4), range(columns)):
        m.box(step - 0.0028, (y + 0.0002, y + 0.0016), 0.0125 if i == 0 else 0.0157,
            left=-wide / 2 + step * k + 0.0014, against=back + 0.0185 * i, of=keys)
    for k, (a, b) in enumerate(((0.0, 0.1), (0.1, 0.2), (0.2, 0.28), (0.28, 0.68), (0.68, 0.76),
        (0.76, 0.88), (0.88, 1.0))):
        m.box((wide * (a - 0.5) + 0.0014, wide * (b - 0.5) - 0.0014), (y + 0.0002, y + 0.0016),
            0.0157, against=back + 0.074, of=keys, name=f"key {k}")
    m.box(m.pick(0.26, 0.32, 0.4) * w, (y, y + 0.0006), (0.14 * d, 0.44 * d), 0.0004,
        of=plain("pad", shade((grey, grey, grey), 0.85), 0.3))
    if m.chance(0.4):  # loudspeakers beside the keys
        m.box(0.035 * w, (y, y + 0.0003), (back, back + 0.09), left=0.012 - w / 2, mirrored="x", of=dark)
    for side, k in product((-1.0, 1.0), range(m.pick(2, 3))):  # ports
        m.box(0.0008, (0.006, 0.0115), 0.009 + 0.004 * (k == 0), x=side * w / 2,
            z=-0.3 * d + 0.03 * k, of=dark)
    # The lid is open by 100 to 115 degrees about the hinge at the back.
    m.rod((-0.36 * w, 0.36 * w), y, 0.006 - d / 2, 0.005, n=10, of=m.pick(dark, shell))
    lean, b = rotation_x(-m.uniform(0.15, 0.4)), m.pick(0.005, 0.008, 0.014)
    with m.moved(turn=lean, at=(0, y - 0.001, 0.004 - d / 2)):
        m.box(w, (0.003, d), (-0.006, 0), 0.002, of=shell)
        m.box(w - 0.004, (0.008, d - 0.002), 0.0006, against=0.0, of=dark)
        m.box(w - 2 * b, (m.pick(0.016, 0.03), d - b - 0.003), 0.0004, against=0.0006,
            of=plain("screen", (0.02, 0.02, 0.025), 0.08))
        m.cylinder(0.0018, 0.0, 0.0003, n=10, front=(0, d - 0.5 * b - 0.002, 0.0005), of=CHROME)
        if m.chance(0.6):  # a mark on the lid's back
            m.box(0.05, 0.008, 0.0006, on=0.55 * d, against=-0.0064, of=CHROME)


@thing(group="newspaper", nyu40=PAPER)
def papers(m: Maker) -> None:
    """A few sheets or a pile of paper."""
    y = 0.0
    for _k in range(m.integers(2, 6)):
        thick, white = m.uniform(0.0006, 0.005), m.uniform(0.85, 0.94)
        # Sheets of A4, turned a little against each other.
        m.box(0.21, thick, 0.297, at=(m.uniform(-0.012, 0.012), y, m.uniform(-0.012, 0.012)),
            turn=rotation_y(m.normal(0, 0.1)), of=plain("paper",
            (round(white, 2), round(white, 2), round(white * 0.98, 2)), 0.9))
        y += thick + 0.0002


@thing(group="office_small", nyu40=PAPER)
def notebook(m: Maker) -> None:
    """A notebook with a pen on it."""
    m.box(0.15, 0.014, 0.21, of=m.coloured("notebook", 0.6))
    # The pages exceed the cover by up to 1 mm, except at the spine.
    m.box(0.1485, (0.003, 0.011), 0.212, x=0.00125, of=plain("pages", (0.9, 0.89, 0.84), 0.9))
    # A pen 14 cm long is made along x about the origin, and then turned.
    with (m.moved(turn=rotation_y(m.uniform(-0.6, 0.6)), at=(0.01, 0.0142 + 0.0045, 0)),
        m.of(plain("pen", m.pick((0.08, 0.1, 0.3), (0.05, 0.05, 0.05), (0.6, 0.1, 0.1)), 0.3))):
        m.revolve([(0, 0), (0.002, 0.002), (0.0045, 0.015), (0.0045, 0.138), (0, 0.14)], n=8,
            turn=LYING_ALONG_X, at=(-0.07, 0, 0))


@thing(group="office_small")
def pen_pot(m: Maker) -> None:
    """A pot with pens."""
    m.vessel([(0, 0), (0.04, 0), (0.04, 0.1)], 0.003, of=m.coloured("pot", 0.5))
    # Up to six pens lean outwards round the pot, each 0.1 to 0.17 rad off the vertical.
    for k in range(m.integers(3, 7)):
        angle = 2 * pi * k / 6 + m.uniform(-0.2, 0.2)
        tilt = m.uniform(0.1, 0.17)
        with m.moved(turn=rotation_y(angle)), m.of(plain("pen", m.colour_within(0.1, 0.8), 0.4)):
            m.revolve([(0, 0), (0.004, 0), (0.004, 0.15), (0, 0.156)], n=6, turn=rotation_z(-tilt),
                at=(0.008, 0.0045, 0))


@thing(group="remote", called="remote_control")
def remote(m: Maker) -> None:
    """A remote control."""
    grey = m.pick(0.05, 0.08, 0.5)
    m.box(0.048, 0.016, 0.17, of=plain("remote", (grey, grey, grey), 0.45))
    # Keys in three columns and five rows on its upper side.
    for x, z in product((-0.013, 0.0, 0.013), (-0.06, -0.035, -0.015, 0.005, 0.03)):
        m.box(0.01, (0.016, 0.0175), 0.008, x=x, z=z, of=plain("keys", (0.35, 0.35, 0.36), 0.6))


@thing(group="phone")
def phone(m: Maker) -> None:
    """A mobile phone, its screen up."""
    m.box(0.072, 0.0085, 0.15, of=plain("phone", m.pick((0.1, 0.1, 0.11), (0.8, 0.8, 0.8),
        (0.3, 0.35, 0.45)), 0.3))
    # The screen is 0.3 mm proud of the shell.
    m.box(0.067, (0.0085, 0.0088), 0.143, of=plain("screen", (0.02, 0.02, 0.025), 0.06))


@thing(group="office_small", nyu40=BOOKS)
def binders(m: Maker) -> None:
    """Two to four ring binders side by side, their backs to the front."""
    x, colour = 0.0, m.any_colour()
    for _k in range(m.integers(2, 5)):
        w = m.pick(0.05, 0.078)
        m.box(w, 0.315, (-0.28, 0), left=x, of=plain("binder", colour, 0.5))
        m.box((x + 0.008, x + w - 0.008), (0.12, 0.26), (0, 0.0006),
            of=plain("label", (0.92, 0.92, 0.9), 0.8))
        x += w + 0.0005


@thing(group="electronics")
def electronics(m: Maker) -> None:
    """A loudspeaker, a radio, a router, a player with discs, or a games console."""
    form = m.integers(0, 5)
    shell = m.pick(plain("shell", (0.05, 0.05, 0.053), 0.45), plain("shell", (0.88, 0.88, 0.86),
        0.45), plain("shell wood", m.wood, 0.5), m.coloured("shell", 0.5))
    black, mesh = (plain("black plastic", (0.03, 0.03, 0.032), 0.5),
        plain("mesh", (0.12, 0.12, 0.125), 0.9))
    match form:
        case 0:
            m.name, w, h, d = ("loudspeaker", m.uniform(0.14, 0.19), m.uniform(0.22, 0.32),
                m.uniform(0.16, 0.22))
            m.box(w, h, d, 0.004, of=shell)
            for y, r in ((h * 0.34, w * 0.36), (h * 0.76, w * 0.2)):
                m.cylinder(r, 0, 0.004, n=20, front=(0, y, d / 2 - 0.002), of=mesh)
                m.revolve([(0, 0), (r * 0.35, 0), (0, r * 0.22)], n=14, front=(0, y,
                    d / 2 + 0.0018), of=black)
        case 1:
            m.name, w, h = "radio", m.uniform(0.22, 0.3), m.uniform(0.13, 0.18)
            m.rounded(w, (0.008, h), 0.1, 0.018, n=3, of=shell)
            m.box(0.024, 0.0085, 0.07, 0.002, left=0.028 - w / 2, mirrored="x", of=black)
            m.cylinder(h * 0.34, 0, 0.003, n=22, front=(-w / 4, h * 0.52, 0.0495), of=mesh)
            m.box((0.01, w / 2 - 0.03), (h * 0.55, h * 0.78), (0.0495, 0.051),
                of=plain("scale", (0.85, 0.8, 0.65), 0.4))
            for x in (0.035, w / 2 - 0.045):
                m.frustum((0.016, 0), (0.014, 0.014), n=14, front=(x, h * 0.28, 0.0495),
                    of=m.pick(CHROME, black))
            if m.chance(0.5):
                m.tube([(w / 2 - 0.03, h - 0.01, -0.03), (w / 2 - 0.1, h + 0.2, -0.03)], 0.002, n=5,
                    of=CHROME)
        case 2:
            m.name, w = "router", m.uniform(0.17, 0.24)
            m.box(w, 0.032, 0.14, 0.005, of=shell)
            for k in range(m.pick(2, 3, 4)):
                m.tube([(-w / 2 + 0.03 + 0.045 * k, 0.02, -0.064),
                    (-w / 2 + 0.03 + 0.05 * k, 0.17, -0.068)], 0.006, n=6, of=black)
            for k in range(5):
                m.box(0.005, (0.012, 0.017), (0.07, 0.0706), x=0.018 * k - 0.0375,
                    of=plain("lamp", (0.2, 0.75, 0.35), 0.3))
        case 3:
            m.name, w, d = "hifi", m.uniform(0.38, 0.44), m.uniform(0.28, 0.34)
            m.box(w, (0.012, 0.09), d, 0.003, of=m.pick(shell, STEEL, BLACK_STEEL))
            m.box((-w * 0.3, w * 0.05), (0.055, 0.08), 0.0008, against=d / 2, of=BLACK_GLASS)
            for x, r in ((w * 0.36, 0.024), (w * 0.2, 0.012), (w * 0.12, 0.012)):
                m.frustum((r, 0), (r * 0.9, 0.018), n=18, front=(x, 0.05, d / 2 - 0.001), of=CHROME)
            m.cylinder(0.018, 0, 0.0125, n=12, at=(-w / 2 + 0.04, 0, -d / 2 + 0.04), of=black,
                mirrored="xz")
        case 4:
            m.name, w = "console", m.uniform(0.26, 0.3)
            m.box(w, 0.055, (-0.12, 0.06), 0.005, of=shell)
            m.box((-w / 2 + 0.04, w / 2 - 0.1), (0.03, 0.036), (0.06, 0.0606), of=black)
            m.ellipsoid((0.07, 0.018, 0.035), n=12, at=(-0.02, 0.018, 0.13), of=black)
            for x in (-0.09, 0.05):
                m.ellipsoid((0.02, 0.016, 0.035), n=10, at=(x, 0.016, 0.145), of=black)
