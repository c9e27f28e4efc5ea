"""The pass that adds the outdoors to a repaired home, by its storey and a seed; no effects.

Four sides lie about the bounding rectangle of the home's rooms, each a street, a garden, a court or a
lawn with blocks; trees, roofs or hills close the horizon. Rooms have the light of what their
windows see of them (transport/kernels/outside.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import House, Opening, Room
from pbrs_farm.furnishings.surroundings.buildings import (
    STOREY_M,
    Front,
    block,
    car,
    fence,
    ground_looks,
    house,
    lamp_post,
    railing,
)
from pbrs_farm.furnishings.surroundings.facades import HOUSES, TOWN, Facade, facade, lit_rooms
from pbrs_farm.furnishings.surroundings.plants import (
    FIR,
    SPECIES,
    Leaves,
    bush,
    hazy,
    hedge,
    leaves_of,
    tree,
    tree_line,
)
from pbrs_farm.furnishings.surroundings.scenery import (
    Drawn,
    Scenery,
    SceneryMaterial,
    Site,
    lit,
    mottled,
)
from pbrs_farm.home.room_use import RoomKind, named_kind

# fmt: off
LEAST_M: Final = 3.0
"""Nothing but ground and railings is nearer to a wall."""

MAX_FACES: Final = 60_000

_WALL_M: Final = 0.3  # assumed thickness of the walls around rooms
_REACH_M: Final = 46.0  # distance from the home to the horizon's ring
_BELOW_FLOOR_M: Final = 0.15  # ground below the floor of a ground storey
_BELOW_SILL_M: Final = 0.3
_FRENCH_SILL_M, _FRENCH_HEIGHT_M = 0.25, 1.7  # of a window used as a door
_MOST_ROOMS: Final = 500

KINDS: Final = ("street", "garden", "court", "blocks", "hills")
_N_RING: Final = 220
_ROAD: Final = (5.0, 11.5)  # away from the home's side
_PAVEMENT_M: Final = 2.0
_TOWN_TREES: Final = (0, 2, 5)  # of plants.SPECIES
_GARDEN_TREES, _SHARES = (0, 1, 2, FIR, 4), (0.26, 0.24, 0.22, 0.18, 0.10)
_BUSHES: Final = (2, 4, 6, 6, 7)
_HEDGES: Final = (6, 6, 7, FIR)
_PATH_M: Final = 1.2  # width of the paving around a house


class _Side(NamedTuple):
    """A side of the home's bounding rectangle."""

    middle: F64  # (3,) of the side, on the ground
    out: F64  # (3,) unit, away from the home
    along: F64  # (3,) unit
    half: float  # half its length
    number: int

    def at(self, s: float, away: float, y: float = 0.0) -> F64:
        """The place s along and away from the side."""
        return np.asarray(self.middle + s * self.along + away * self.out + [0.0, y, 0.0])


class _Place(NamedTuple):
    """Shared values of all sides."""

    scenery: Scenery
    rng: np.random.Generator
    leaves: Drawn[Leaves]  # by the numbers of SPECIES
    street_tree: int  # the species of a street's trees
    facades: Drawn[Facade]  # of buildings
    cottages: Drawn[Facade]  # of houses with gardens
    rooms: SceneryMaterial  # with lamps on, behind windows
    ground: dict[str, SceneryMaterial]
    eye_m: float  # of a person at the home's highest window, above the ground

    def site(self, name: str, side: _Side) -> Site:
        """An item of a side."""
        return Site(self.scenery, f"{name}_{side.number}", self.rng)

    def front(self, name: str, side: _Side, s: float, away: float) -> Front:
        """The frame of an item that looks at the home, from s along and away from its side."""
        return Front(side.at(s, away), side.along, -side.out, self.site(name, side))


def with_surroundings(home: House, kind: str, seed: int) -> House:
    """The house with the outdoors as items tagged OUTSIDE, after all others.

    home: repaired. kind: of KINDS for all sides, or "drawn" by the seed, the storey and the home. A
    home without rooms or windows is unchanged.
    """
    rooms = home.rooms[:_MOST_ROOMS]
    windows = [o for o in home.openings if o.is_window]
    if not rooms or not windows:
        return home
    rng = np.random.default_rng(keys.seed("surroundings", home.id, seed))
    footprint = shapely.union_all([_walled_area(r) for r in rooms])
    ground_y, n_below = _level_of_ground(home, windows, rng)
    top = max(float(o.quad[:, 1].max()) for o in windows)
    town = tuple(TOWN[int(k)] for k in rng.permutation(len(TOWN)))
    looks = int(rng.integers(0, 1 << 31))
    place = _Place(scenery=Scenery(), rng=rng, leaves=Drawn(looks, len(SPECIES), leaves_of),
        street_tree=int(rng.choice(_TOWN_TREES)), facades=Drawn(looks + 1, len(TOWN), lambda own,
        k: facade(own, k, town)), cottages=Drawn(looks + 2, len(HOUSES), lambda own,
        k: facade(own, k, HOUSES)), rooms=lit("rooms", picture=lit_rooms(rng)),
        ground=ground_looks(rng), eye_m=max(top - ground_y - 0.5, 1.6))
    sides = _sides(footprint, ground_y)
    kinds = _kinds(rng, kind, is_flat=n_below > 0)
    _lay_ground(place, footprint, sides, kinds, ground_y)
    for side, strip in zip(sides, kinds, strict=True):
        _STRIPS[strip](place, side)
    _far_ring(place, footprint, ground_y, kinds)
    place.scenery.keep_off(footprint, LEAST_M)
    if n_below > 0:
        _railings(place, windows, rooms)
    level = min(home.levels, key=lambda x: x.elevation).id
    items, materials, textures = place.scenery.items(level, len(home.materials))
    return replace(home, items=(*home.items, *items), materials=(*home.materials, *materials),
        textures={**home.textures, **textures})


def _walled_area(room: Room) -> BaseGeometry:
    shape = shapely.make_valid(shapely.Polygon(room.polygon))
    return shapely.buffer(shape, _WALL_M, join_style="mitre")


def _level_of_ground(
    home: House, windows: list[Opening], rng: np.random.Generator
) -> tuple[float, int]:
    """(y of the ground, storeys below the home): a flat may be on any storey of its building.

    A home of several storeys, or with a garden or a garage, is on the ground.
    """
    kinds = {named_kind(text) for r in home.rooms for text in (*r.types, r.name)}
    words = {w for r in home.rooms for w in r.name.lower().split()}
    lived = [level for level in home.levels if any(r.level_id == level.id for r in home.rooms)]
    is_flat = len(lived) < 2 and not words & {"garage", "garden", "terrace"}
    has_balcony = RoomKind.OUTDOOR in kinds and "balcony" in words
    n_below = int(rng.integers(1 if has_balcony else 0, 5)) if is_flat else 0
    # Cellars lie below the ground, but the ground below every window.
    floors = [level.elevation for level in lived]
    base = min((y for y in floors if y > -1.0), default=min(floors, default=0.0))
    sill = min(float(o.quad[:, 1].min()) for o in windows)
    ground_y = min(base - _BELOW_FLOOR_M, sill - _BELOW_SILL_M) - n_below * STOREY_M
    return ground_y, n_below


def _sides(footprint: BaseGeometry, ground_y: float) -> list[_Side]:
    x0, z0, x1, z1 = footprint.bounds
    cx, cz, hx, hz = (x0 + x1) / 2, (z0 + z1) / 2, (x1 - x0) / 2, (z1 - z0) / 2
    sides: list[_Side] = []
    for ox, oz, half in ((0, 1, hx), (1, 0, hz), (0, -1, hx), (-1, 0, hz)):
        out = np.array([ox, 0.0, oz])
        middle = np.array([cx + ox * hx, ground_y, cz + oz * hz])
        sides.append(_Side(middle, out, np.array([oz, 0.0, -ox], np.float64), half, len(sides)))
    return sides


def _kinds(rng: np.random.Generator, kind: str, *, is_flat: bool) -> list[str]:
    """The view on each of the four sides."""
    if kind != "drawn":
        return [kind] * 4
    front = int(rng.integers(0, 4))
    if is_flat:
        back, aside = (
            rng.choice(["court", "garden", "blocks"]),
            rng.choice(["blocks", "street", "court"]),
        )
    else:
        back, aside = "garden", rng.choice(["garden", "garden", "hills"])
    drawn = {front: "street", (front + 2) % 4: str(back)}
    return [drawn.get(k, str(aside)) for k in range(4)]


def _strip_of_side(side: _Side, near: float, far: float, wide: float = 0.0) -> BaseGeometry:
    """The plan area between two distances of a side, as long as the surroundings reach."""
    half = wide or side.half + _REACH_M
    corners = [side.at(s, a) for s, a in ((-half, near), (half, near), (half, far), (-half, far))]
    return shapely.Polygon(np.array(corners)[:, [0, 2]])


def _lay_ground(
    place: _Place, footprint: BaseGeometry, sides: list[_Side], kinds: list[str], y: float
) -> None:
    x0, z0, x1, z1 = footprint.bounds
    reach = _REACH_M + 10.0
    free = shapely.box(x0 - reach, z0 - reach, x1 + reach, z1 + reach).difference(footprint)
    zones: list[tuple[str, BaseGeometry, float]] = [
        ("slabs", footprint.buffer(_PATH_M, join_style="mitre"), 0.0)
    ]
    for side, kind in zip(sides, kinds, strict=True):
        if kind == "street":
            near, far = _ROAD
            for edge in (near, far):
                zones.append(("kerb", _strip_of_side(side, edge - 0.08, edge + 0.08), 0.03))
            zones.append(("asphalt", _strip_of_side(side, near, far), 0.0))
            zones.append(
                ("slabs", _strip_of_side(side, near - _PAVEMENT_M, far + _PAVEMENT_M + 1.0), 0.0)
            )
            middle = (near + far) / 2
            for s in np.arange(-side.half - 30, side.half + 30, 6.0):
                dash = [
                    side.at(s + a, middle + b)[[0, 2]]
                    for a, b in ((0, -0.06), (3, -0.06), (3, 0.06), (0, 0.06))
                ]
                place.scenery.lay("ground", place.ground["line"], shapely.Polygon(dash), y + 0.012)
        elif kind == "court":
            name = "slabs" if place.rng.random() < 0.5 else "gravel"
            zones.append((name, _strip_of_side(side, 0.0, 13.0, side.half + 12.0), 0.0))
    # The first zone is on top: each takes the area that is still free.
    for name, area, above in zones:
        ground = free.intersection(area)
        free = free.difference(area)
        place.scenery.lay("ground", place.ground[name], ground, y + above)
    place.scenery.lay("ground", place.ground["lawn"], free, y)


def _street(place: _Place, side: _Side) -> None:
    """A road with parked cars and trees, and a row of buildings across it."""
    rng = place.rng
    away = _ROAD[1] + _PAVEMENT_M + rng.uniform(1.0, 3.5)
    _row_of_blocks(place, side, away, extent=side.half + away + 14.0, is_town=True)
    for s in np.arange(-side.half - 14, side.half + 14, 5.2):
        if rng.random() < 0.55:
            far = rng.random() < 0.6
            distance = _ROAD[1] - 0.25 if far else _ROAD[0] + 1.9
            car(place.front("cars", side, s + rng.uniform(0, 0.5), distance))
    for k, s in enumerate(np.arange(-side.half - 12, side.half + 12, rng.uniform(8, 11))):
        if k % 2 == 0:
            lamp_post(place.front("lamps", side, s, _ROAD[1] + 0.6))
        foot = side.at(s + 3.5, _ROAD[1] + 0.9)
        tree(place.site("trees", side), foot, rng.uniform(4.5, 7.5),
            place.leaves[place.street_tree])


def _court(place: _Place, side: _Side) -> None:
    """A paved court with some green and the backs of buildings about it."""
    rng = place.rng
    away = rng.uniform(11.0, 17.0)
    _row_of_blocks(place, side, away, extent=side.half + away, is_town=True, balconies=True)
    for _ in range(int(rng.integers(2, 5))):
        foot = side.at(rng.uniform(-1, 1) * (side.half + 5), rng.uniform(5.5, away - 2.5))
        tree(place.site("trees", side), foot, rng.uniform(4, 8),
            place.leaves[int(rng.choice(_TOWN_TREES))])
    for _ in range(9):
        foot = side.at(rng.uniform(-1, 1) * (side.half + 6), rng.uniform(4.2, away - 1.5))
        bush(place.site("bushes", side), foot, rng.uniform(0.6, 1.3),
            place.leaves[int(rng.choice(_BUSHES))])


def _blocks(place: _Place, side: _Side) -> None:
    """Lawn with trees, and blocks of flats across it."""
    rng = place.rng
    away = rng.uniform(20.0, 27.0)
    _row_of_blocks(place, side, away, extent=side.half + away, is_town=False, balconies=True)
    _trees(place, side, 8, (6.0, away - 3.0), side.half + 14)


def _garden(place: _Place, side: _Side) -> None:
    """Lawn with bushes and trees, a hedge or a fence, and the neighbours' houses behind."""
    rng = place.rng
    depth = rng.uniform(7.5, 12.0)
    half = side.half + depth * 0.8
    ends = np.stack([side.at(-half, depth), side.at(half, depth)])
    if rng.random() < 0.55:
        leaves = place.leaves[int(rng.choice(_HEDGES))]
        hedge(place.site("hedge", side), ends, rng.uniform(1.3, 2.1), leaves)
    else:
        fence(place.front("fence", side, -half, depth), 2 * half, rng.uniform(1.2, 1.9))
    for _ in range(10):
        foot = side.at(rng.uniform(-1, 1) * half, rng.uniform(4.2, depth - 0.8))
        bush(place.site("bushes", side), foot, rng.uniform(0.5, 1.4),
            place.leaves[int(rng.choice(_BUSHES))])
    _trees(place, side, 4, (5.0, depth + 6.0), half)
    s = -half - 4.0
    while s < half:
        cottage = place.cottages[int(rng.integers(0, len(place.cottages)))]
        away = depth + rng.uniform(7.0, 13.0)
        if rng.random() < 0.75:
            house(place.front("houses", side, s, away), cottage, place.rooms)
        s += rng.uniform(15.0, 20.0)
    _trees(place, side, 8, (depth + 5.0, depth + 22.0), half + 12)


def _hills(place: _Place, side: _Side) -> None:
    """A meadow with a fence and few trees; hills are seen beyond."""
    rng = place.rng
    away = rng.uniform(8.0, 14.0)
    half = side.half + away
    fence(place.front("fence", side, -half, away), 2 * half, rng.uniform(0.9, 1.3))
    _trees(place, side, 9, (away + 2.0, 34.0), half + 14)


_STRIPS: Final[dict[str, Callable[[_Place, _Side], None]]] = {"street": _street,
    "court": _court, "blocks": _blocks, "garden": _garden, "hills": _hills}


def _row_of_blocks(place: _Place, side: _Side, away: float, *, extent: float,
    is_town: bool, balconies: bool = False) -> None:
    """Buildings in a row, the eye of the home no higher than most of their storeys."""
    rng = place.rng
    least = int(np.ceil((place.eye_m + 0.22 * away) / STOREY_M)) + (0 if is_town else 1)
    s = -extent
    before = -1
    while s < extent:
        k = int(rng.integers(0, len(place.facades)))
        k = (k + 1) % len(place.facades) if k == before else k
        before, facade = k, place.facades[k]
        n_bays = int(rng.integers(3, 7)) if is_town else int(rng.integers(7, 11))
        n_storeys = int(np.clip(least + rng.integers(-1, 3), 2, 11))
        width = n_bays * facade.bay_m
        set_back = 0.0 if is_town else rng.uniform(0, 6)
        block(place.front("buildings", side, s, away + set_back), facade, place.rooms, n_bays,
            n_storeys, depth_m=10.0, has_balconies=balconies or rng.random() < 0.25)
        s += width + (0.0 if is_town else rng.uniform(3, 9))


def _trees(place: _Place, side: _Side, n: int, away: tuple[float, float], half: float) -> None:
    rng = place.rng
    for _ in range(n):
        kind = int(rng.choice(_GARDEN_TREES, p=_SHARES))
        foot = side.at(rng.uniform(-1, 1) * half, rng.uniform(*away))
        leaves, n_sprays = place.leaves[kind], 360 if away[0] < 8.0 else 200
        tree(place.site("trees", side), foot, rng.uniform(4.5, 10.0), leaves, n=n_sprays)


def _far_ring(place: _Place, footprint: BaseGeometry, ground_y: float, kinds: list[str]) -> None:
    """Two uneven bands about everything: a line of trees or roofs, and hills behind."""
    rng = place.rng
    x0, z0, x1, z1 = footprint.bounds
    centre = np.array([(x0 + x1) / 2, ground_y, (z0 + z1) / 2])
    radius = max(x1 - x0, z1 - z0) / 2 + _REACH_M
    turn = np.linspace(0, 2 * np.pi, _N_RING + 1)
    waves = sum(rng.uniform(0.4, 1) / k * np.sin(k * turn + rng.uniform(0, 7)) for k in range(1, 8))
    far = "hills" in kinds
    trees = SceneryMaterial("far trees", picture=hazy(tree_line(rng), 0.22))
    hills = SceneryMaterial("far hills", picture=hazy(mottled(rng, (0.05, 0.062, 0.045),
        (0.12, 0.13, 0.085), slope=2.0), 0.6), size_m=(90.0, 90.0))
    for look, away, share, wave_m in (
        (trees, radius, 0.15, 1.5),
        (hills, radius + 8.0, 0.30 if far else 0.22, 5.0 if far else 2.0),
    ):
        top = np.maximum(place.eye_m + share * away + wave_m * waves, 2.0)
        foot = np.stack([np.cos(turn) * away, np.zeros_like(turn), np.sin(turn) * away], 1) + centre
        high = foot + np.stack([np.zeros_like(turn), top, np.zeros_like(turn)], 1)
        foot[:, 1] -= 1.0
        quads = np.stack([foot[:-1], foot[1:], high[1:], high[:-1]], 1)
        uvs = None
        if look is trees:
            # The picture goes round some whole times, each tree twice as high as wide, about.
            n = round(2 * np.pi * away / (4.0 * float(top.mean())))
            u = np.linspace(0, n, _N_RING + 1)
            uvs = np.stack([np.stack([p, q], -1) for p, q in ((u[:-1], 0 * u[1:]),
                (u[1:], 0 * u[1:]), (u[1:], 0 * u[1:] + 1), (u[:-1], 0 * u[1:] + 1))], 1)
            uvs[..., 1] *= 1 - 1 / 96
        place.scenery.add("horizon", look, quads, uvs)


def _railings(place: _Place, windows: list[Opening], rooms: tuple[Room, ...]) -> None:
    """A railing before each French window that leads out to nothing."""
    areas = [(r, shapely.Polygon(r.polygon)) for r in rooms]
    site = Site(place.scenery, "railings", place.rng)
    for opening in windows:
        quad = np.asarray(opening.quad, np.float64)
        low, high = float(quad[:, 1].min()), float(quad[:, 1].max())
        floors = [a for r, a in areas if r.floor_y - 0.3 < low < r.ceiling_y]
        floor = [r.floor_y for r, a in areas if r.floor_y - 0.3 < low < r.ceiling_y]
        if not floors or low > min(floor) + _FRENCH_SILL_M or high - low < _FRENCH_HEIGHT_M:
            continue
        normal = np.array([opening.normal[0], 0.0, opening.normal[2]])
        length = float(np.linalg.norm(normal))
        if length < 0.9:
            continue
        middle, normal = quad.mean(0), normal / length
        outside = [sign for sign in (1.0,
            -1.0) if not any(a.contains(shapely.Point((middle + sign * 0.7 * normal)[[0,
            2]])) for a in floors)]
        if len(outside) != 1:
            continue
        out = outside[0] * normal
        along = np.array([-out[2], 0.0, out[0]])
        half = float(np.abs((quad - middle) @ along).max())
        foot = middle - half * along + 0.24 * out
        foot[1] = low
        railing(Front(foot, along, -out, site), 2 * half)
