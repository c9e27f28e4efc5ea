"""Estimated mass of an item or part, from volume and material density; no effects.

Densities are from handbooks: chipboard 650 kg/m3 (EN 312 has 600 to 700), glass 2,500 (EN 572),
steel 7,850 or, for sheet metal round air or foam, 8 kg/m2 (1 mm), stone and china 2,400, plastic
1,000, paper 700, cloth 300 around foam and feathers of 40.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final, NamedTuple

from pbrs_farm.core import classes
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Material, MaterialKind
from pbrs_farm.core.mesh import closed_edge_share, face_areas, signed_volume

_BOARD_KG_M3: Final = 650.0
_GLASS_KG_M3: Final = 2_500.0
_STEEL_KG_M3: Final = 7_850.0
_SHEET_KG_M2: Final = 8.0
_GLASSY: Final = (MaterialKind.GLASS, MaterialKind.PANE, MaterialKind.MIRROR)
_CLOSED: Final = 0.9  # share of paired edges from which triangles bound a solid
_SHEETS: Final = ("enamel", "steel", "chrome", "brass", "iron", "metal", "handle", "machine")


def mass_kg(corners: F64, material: Material) -> float:
    """Mass in kilograms of one closed solid (F, 3, 3) of a material, metres.

    Metal and enamel weigh as solid steel or as sheet metal, whichever is less. An open mesh is closed
    by a cone to its centre.
    """
    if not len(corners):
        return 0.0
    volume = abs(signed_volume(corners, corners.mean((0, 1))))
    name = material.name.casefold()
    if material.kind in _GLASSY or "glass" in name:
        return _GLASS_KG_M3 * volume
    if material.is_metal or any(word in name for word in _SHEETS):
        area = float(face_areas(corners).sum())
        return min(_STEEL_KG_M3 * volume, _SHEET_KG_M2 * area)
    return _BOARD_KG_M3 * volume


class _Stuff(NamedTuple):
    """Construction of an item: a wall of some thickness around a filling."""

    words: str  # of materials, between blanks; `steel` is in "brushed steel"
    wall_kg_m3: float
    wall_m: float  # parts thinner than this are solid, metres
    core_kg_m3: float = 0.0
    nyu40: tuple[int, ...] = ()  # classes made of it if the material's name is not conclusive


_BOARDS: Final = _Stuff("wood oak timber board", 650, 0.018)
# fmt: off
_STUFFS: Final = (
    _Stuff("glass pane mirror bottle", 2_500, 0.006, nyu40=(classes.MIRROR,)),
    _Stuff("steel chrome brass iron metal enamel tin bronze copper aluminium machine", 7_850, 0.001),
    _Stuff("stone marble granite concrete", 2_400, 0.03),
    _Stuff("ceramic china porcelain terracotta clay pot", 2_400, 0.006, nyu40=(
        classes.TOILET, classes.SINK, classes.BATHTUB)),
    _Stuff("plastic rubber nylon vinyl", 1_000, 0.003, nyu40=(
        classes.TELEVISION, classes.LAMP, classes.OTHERPROP, classes.BOX)),
    _Stuff("paper page pages book card cardboard carton", 700, 0.05, nyu40=(
        classes.BOOKS, classes.PAPER, classes.PICTURE)),
    _Stuff(
        "cloth fabric linen wool cotton leather velvet felt fur duvet blanket pillow cushion "
        "mattress throw towel textile", 300, 0.003, 40, nyu40=(
            classes.BED, classes.SOFA, classes.PILLOW, classes.CLOTHES, classes.TOWEL,
            classes.CURTAIN, classes.FLOOR_MAT, classes.BAG)),
    _BOARDS,
)
# fmt: on


def body_kg(solids: Iterable[tuple[F64, Material]], nyu40: int) -> float:
    """Mass in kilograms of an item's connected bodies, given as triangles (F, 3, 3) and material.

    Models draw a chest as one closed shell, so of bodies thicker than their material's wall only the
    wall and a cushion's filling count. An open mesh weighs as a sheet of that thickness. nyu40: the
    item's class, used if the material's name is not conclusive.
    """
    total = 0.0
    for corners, material in solids:
        stuff = _stuff_of(material, nyu40)
        walls = stuff.wall_m * float(face_areas(corners).sum())
        volume = walls
        if closed_edge_share(corners.round(5)) >= _CLOSED:
            volume = abs(signed_volume(corners, corners.mean((0, 1))))
        total += stuff.wall_kg_m3 * min(volume, walls) + stuff.core_kg_m3 * max(volume - walls, 0.0)
    return total


def _stuff_of(material: Material, nyu40: int) -> _Stuff:
    words = set(re.findall("[a-z]+", material.name.casefold()))
    if material.kind in _GLASSY:
        words.add("glass")
    match = next((s for s in _STUFFS if words & set(s.words.split())), None)
    if match is None and material.is_metal:
        return next(s for s in _STUFFS if "metal" in s.words.split())
    return match or next((s for s in _STUFFS if nyu40 in s.nyu40), _BOARDS)
