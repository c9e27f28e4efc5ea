"""Laptop, papers, notebook, pens, remote control, telephone: what lies on desks; no effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import BOOKS, PAPER
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Surface
from pbrs_farm.dress.generated.assembly import Made, Part, any_colour, made, plain, transformed
from pbrs_farm.dress.generated.turned import slab, turned, vessel
from pbrs_farm.dress.style import Rgb, Style, shade

_LYING_PEN: F64 = np.array([[0.0, 1.0, 0], [-1.0, 0, 0], [0, 0, 1.0]])


def laptop(rng: np.random.Generator, style: Style) -> Made:
    """An open laptop; its screen is dark."""
    # Width and depth of a 13 to 15 inch laptop, metres; z points to who sits before it.
    w, d = float(rng.uniform(0.3, 0.36)), float(rng.uniform(0.21, 0.25))
    grey = float(rng.choice([0.12, 0.62, 0.75]))
    body = plain("laptop", (grey, grey, grey * 1.01), 0.35)
    black = plain("screen", (0.02, 0.02, 0.025), 0.08)
    keys = plain("keys", (0.09, 0.09, 0.09), 0.6)
    base = slab((-w / 2, 0, -d / 2), (w / 2, 0.014, d / 2))
    board = slab((-w * 0.44, 0.014, -d * 0.38), (w * 0.44, 0.0155, d * 0.08))
    pad = slab((-w * 0.15, 0.014, d * 0.16), (w * 0.15, 0.0145, d * 0.42))
    # Open the lid by 105 degrees about the hinge at the back.
    angle = -float(rng.uniform(0.15, 0.4))
    c, s = np.cos(angle), np.sin(angle)
    lean: F64 = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    lid = transformed(slab((-w / 2, 0, -0.006), (w / 2, d, 0)), lean, (0, 0.0142, -d / 2))
    screen = transformed(
        slab((-w * 0.47, d * 0.06, 0), (w * 0.47, d * 0.96, 0.0006)), lean, (0, 0.0142, -d / 2)
    )
    parts = [
        (base, body),
        (board, keys),
        (pad, plain("pad", shade((grey, grey, grey), 0.85), 0.3)),
        (lid, body),
        (screen, black),
    ]
    return made("laptop", parts, group="laptop")


def papers(rng: np.random.Generator, style: Style) -> Made:
    """A few sheets or a pile of paper."""
    parts: list[Part] = []
    y = 0.0
    for _ in range(int(rng.integers(2, 6))):
        thick = float(rng.uniform(0.0006, 0.005))
        white = float(rng.uniform(0.85, 0.94))
        # Sheets of A4, turned a little against each other.
        sheet = slab((-0.105, 0, -0.1485), (0.105, thick, 0.1485))
        at = (float(rng.uniform(-0.012, 0.012)), y, float(rng.uniform(-0.012, 0.012)))
        paper = plain("paper", (round(white, 2), round(white, 2), round(white * 0.98, 2)), 0.9)
        parts.append((transformed(sheet, rotation_y(float(rng.normal(0, 0.1))), at), paper))
        y += thick + 0.0002
    return made("papers", parts, group="newspaper", nyu40=PAPER)


def notebook(rng: np.random.Generator, style: Style) -> Made:
    """A notebook with a pen on it."""
    cover = plain("notebook", any_colour(rng, style), 0.6)
    book = slab((-0.075, 0, -0.105), (0.075, 0.014, 0.105))
    # The pages stand out of the cover by up to 1 mm, on all sides but the spine's.
    pages = slab((-0.073, 0.003, -0.106), (0.0755, 0.011, 0.106))
    pen = transformed(_pen(), rotation_y(float(rng.uniform(-0.6, 0.6))), (0.01, 0.0142 + 0.0045, 0))
    ink: Rgb = ((0.08, 0.1, 0.3), (0.05, 0.05, 0.05), (0.6, 0.1, 0.1))[int(rng.integers(3))]
    parts = [
        (book, cover),
        (pages, plain("pages", (0.9, 0.89, 0.84), 0.9)),
        (pen, plain("pen", ink, 0.3)),
    ]
    return made("notebook", parts, group="office_small", nyu40=PAPER)


def _pen() -> Surface:
    # (radius, height) of an upright pen 14 cm long; then lay it along x, its middle at the origin.
    body = turned([(0, 0), (0.002, 0.002), (0.0045, 0.015), (0.0045, 0.138), (0, 0.14)], n=8)
    return transformed(body, _LYING_PEN, (-0.07, 0, 0))


def pen_pot(rng: np.random.Generator, style: Style) -> Made:
    """A pot with pens."""
    pot = vessel([(0, 0), (0.04, 0), (0.04, 0.1)], 0.003)
    parts: list[Part] = [(pot, plain("pot", any_colour(rng, style), 0.5))]
    for k in range(int(rng.integers(3, 7))):
        # Up to six pens lean outwards round the pot, each 0.1 to 0.17 rad off the vertical.
        angle = 2 * np.pi * k / 6 + float(rng.uniform(-0.2, 0.2))
        tilt = float(rng.uniform(0.1, 0.17))
        c, s = np.cos(tilt), np.sin(tilt)
        lean: F64 = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
        body = turned([(0, 0), (0.004, 0), (0.004, 0.15), (0, 0.156)], n=6)
        pen = transformed(transformed(body, lean, (0.008, 0.0045, 0)), rotation_y(float(angle)))
        colour = tuple(float(v) for v in rng.uniform(0.1, 0.8, 3))
        parts.append((pen, plain("pen", (colour[0], colour[1], colour[2]), 0.4)))
    return made("pen_pot", parts, group="office_small")


def remote(rng: np.random.Generator, style: Style) -> Made:
    """A remote control."""
    body = slab((-0.024, 0, -0.085), (0.024, 0.016, 0.085))
    # Keys in three columns and five rows on its upper side.
    keys = [
        slab((x - 0.005, 0.016, z - 0.004), (x + 0.005, 0.0175, z + 0.004))
        for x in (-0.013, 0.0, 0.013)
        for z in (-0.06, -0.035, -0.015, 0.005, 0.03)
    ]
    grey = float(rng.choice([0.05, 0.08, 0.5]))
    button = plain("keys", (0.35, 0.35, 0.36), 0.6)
    parts = [(body, plain("remote", (grey, grey, grey), 0.45)), *((k, button) for k in keys)]
    return made("remote_control", parts, group="remote")


def phone(rng: np.random.Generator, style: Style) -> Made:
    """A mobile phone, its screen up."""
    # The screen lies 0.3 mm proud of the shell.
    body = slab((-0.036, 0, -0.075), (0.036, 0.0085, 0.075))
    screen = slab((-0.0335, 0.0085, -0.0715), (0.0335, 0.0088, 0.0715))
    shell: Rgb = ((0.1, 0.1, 0.11), (0.8, 0.8, 0.8), (0.3, 0.35, 0.45))[int(rng.integers(3))]
    parts = [
        (body, plain("phone", shell, 0.3)),
        (screen, plain("screen", (0.02, 0.02, 0.025), 0.06)),
    ]
    return made("phone", parts, group="phone")


def magazine_file(rng: np.random.Generator, style: Style) -> Made:
    """Two to four ring binders side by side, their backs to the front."""
    parts: list[Part] = []
    x = 0.0
    colour = any_colour(rng, style)
    for _ in range(int(rng.integers(2, 5))):
        # Binders for A4 are 50 or 78 mm wide; x is the row's end so far.
        w = float(rng.choice([0.05, 0.078]))
        parts.append((slab((x, 0, -0.28), (x + w, 0.315, 0)), plain("binder", colour, 0.5)))
        label = slab((x + 0.008, 0.12, 0), (x + w - 0.008, 0.26, 0.0006))
        parts.append((label, plain("label", (0.92, 0.92, 0.9), 0.8)))
        x += w + 0.0005
    return made("binders", parts, group="office_small", nyu40=BOOKS)
