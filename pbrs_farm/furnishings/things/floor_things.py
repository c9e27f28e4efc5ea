"""Items on floors: cables, toy bricks, a computer, a mat; no effects."""

from __future__ import annotations

from numpy import pi

from pbrs_farm.core.frames import LYING_ALONG_X, rotation_y
from pbrs_farm.dress.thing_materials import BLACK_GLASS, STEEL, plain
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.geometry.bodies import bevelled
from pbrs_farm.geometry.outlines import Triple, bent, polar


# fmt: off
@thing(group="cable", called="power_strip")
def power_strip(m: Maker) -> None:
    """A strip of sockets with its cable in loops, a plug or two and chargers in it."""
    n, white = m.integers(3, 7), m.chance(0.7)
    colour = (0.9, 0.9, 0.88) if white else (0.08, 0.08, 0.085)
    body, wire = plain("strip", colour, 0.45), plain("cable", colour, 0.6)
    long = 0.045 * n + 0.06
    m.box(long, 0.038, 0.052, 0.006, of=body)
    for k in range(n):
        x = -long / 2 + 0.045 + 0.045 * k
        m.cylinder(0.017, 0.0375, 0.0385, n=14, at=(x, 0.0, 0.0),
            of=plain("socket", (0.2, 0.2, 0.2), 0.6))
        if m.chance(0.45):
            plug = plain("plug", m.pick((0.07, 0.07, 0.07), (0.9, 0.9, 0.88)), 0.5)
            m.add(bevelled((x - 0.017, 0.0385, -0.02), (x + 0.017, 0.0385 + m.uniform(0.02, 0.05),
                0.02), 0.003), of=plug)
            end = 0.2 + 0.1 * m.uniform(0, 1)
            m.tube(bent([(x, 0.05, 0.018), (x, 0.045, 0.06), (x + m.normal(0, 0.05), 0.004, 0.11),
                (x + m.normal(0, 0.1), 0.004, end)], 0.03, n=3), 0.003, n=5, of=plug)
    # The cable leaves at one end, makes a loop and goes on.
    r, z = m.uniform(0.07, 0.12), m.uniform(-0.05, 0.05)
    path: list[Triple] = [(long / 2 - 0.01, 0.012, 0.0), (long / 2 + 0.05, 0.005, 0.0)]
    turns = m.pick(1.0, 1.6, 2.4)
    for k in range(int(18 * turns) + 1):
        a = -pi / 2 + 2 * pi * k / 18
        path.append(polar(r, 0.005 + 0.0075 * k / 18, a, x=long / 2 + 0.08, z=z + r))
    path += [(long / 2 + 0.15, 0.005, z + 2.2 * r), (long / 2 - 0.05, 0.005, z + 2.5 * r)]
    m.tube(path, 0.0042, n=6, of=wire)


@thing(group="toy", called="building_blocks")
def toy_blocks(m: Maker) -> None:
    """Blocks, balls and a car where a child left them."""
    colours = [m.coloured("toy", 0.5) for _ in range(2)]
    colours += [plain("toy wood", (0.8, 0.62, 0.4), 0.6), plain("toy red", (0.75, 0.14, 0.12), 0.4)]
    colours += [plain("toy blue", (0.12, 0.3, 0.62), 0.4),
        plain("toy yellow", (0.9, 0.72, 0.15), 0.4)]
    for k in range(m.integers(6, 15)):
        # A ring of places keeps them apart.
        a, r = 2.4 * k, 0.055 * (k + 0.6) ** 0.62
        s = m.uniform(0.014, 0.021)
        position = polar(r, 0.0, a)
        of = m.pick(*colours)
        match m.integers(0, 5):
            case 0:
                m.cylinder(s, 0.0, 2 * s, n=14, at=position, of=of)
            case 1:
                m.sphere((0.0, s, 0.0), s, n=10, at=position, of=of)
            case 2:
                m.box(3.8 * s, s, 2 * s, 0.0015, at=position, turn=rotation_y(m.uniform(0, pi)),
                    of=of)
            case _:
                m.box(2 * s, 2 * s, 2 * s, 0.0015, at=position, turn=rotation_y(m.uniform(0, pi)),
                    of=of)


@thing(group="computer", called="computer_tower")
def computer_tower(m: Maker) -> None:
    """A desktop computer: a case with a drive, buttons, a grille, on four feet."""
    w, h, d = m.uniform(0.17, 0.22), m.uniform(0.36, 0.46), m.uniform(0.38, 0.46)
    grey = m.pick(0.05, 0.08, 0.62, 0.85)
    case = plain("computer", (grey, grey, grey * 1.01), 0.4)
    m.box(w, (0.015, h), d, 0.004, of=case)
    for x in (-w / 2 + 0.03, w / 2 - 0.03):
        m.cylinder(0.014, 0.0, 0.016, n=10, at=(x, 0.0, -d / 2 + 0.04),
            of=plain("foot", (0.06, 0.06, 0.06), 0.7), mirrored="z")
    front = (BLACK_GLASS if m.chance(0.3) else plain("front", (grey * 0.8, grey * 0.8, grey * 0.82),
        0.35))
    m.box(w - 0.012, (0.03, h - 0.012), 0.012, 0.003, against=d / 2, of=front)
    z = d / 2 + 0.012
    if m.chance(0.6):
        m.box(w - 0.04, 0.035, 0.0015, on=h - 0.075, against=z, of=STEEL)
    for k in range(m.integers(5, 10)):
        m.box(w - 0.06, 0.006, 0.002, on=0.07 + 0.014 * k, against=z, of=case)
    m.cylinder(0.009, 0.0, 0.003, n=12, front=(0.0, h - 0.1, z), of=STEEL)


@thing(group="mat", called="rolled_mat")
def rolled_mat(m: Maker) -> None:
    """A rolled-up exercise mat with a strap round it."""
    r, long = m.uniform(0.055, 0.08), m.uniform(0.55, 0.65)
    mat = m.coloured("mat foam", 0.9)
    m.revolve([(0.0, 0.0), (0.35 * r, 0.004), (0.4 * r, 0.0), (0.7 * r, 0.003), (0.75 * r, 0.0),
        (r, 0.0), (r, long), (0.0, long)], n=24, turn=LYING_ALONG_X, at=(-long / 2, r, 0.0), of=mat)
    for x in (-0.25, 0.25):
        m.turned([(1.02 * r, 0.0), (1.02 * r, 0.02)], n=24, turn=LYING_ALONG_X,
            at=(x * long, r, 0.0), of=plain("strap", (0.1, 0.1, 0.1), 0.7))
