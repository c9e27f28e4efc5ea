"""A made home by its seed: plan, furniture, file; no effects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from shapely.geometry import Polygon

from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import EMPTY, Catalogue
from pbrs_farm.core.made_home import VERSION, MadeHome
from pbrs_farm.generate.drawn_home import drawn_home
from pbrs_farm.generate.floor_plan import PlacedPiece, Plan, PlanRoom, Point, Storey
from pbrs_farm.generate.furnish.furnished import furnished
from pbrs_farm.generate.home_file import home_file
from pbrs_farm.generate.programme import Programme, Wishes
from pbrs_farm.generate.staircase import Stair


@dataclass(frozen=True, slots=True)
class Made:
    """A home that was made."""

    storeys: tuple[Storey, ...]  # from below
    data: bytes  # of its .sh3d
    origin: str
    stair: Stair | None = None  # between them


def made(home: MadeHome, catalogue: Catalogue, programme: Programme | None = None) -> Made:
    """The home of a seed, or of a seed and a programme; equal arguments give equal bytes.

    Raises BadInput for wishes that no home meets.
    """
    wishes = Wishes(
        home.bedrooms, (float(home.area[0]), float(home.area[1])), home.storeys, home.plans
    )
    # All randomness comes from one stream that the wishes and the version name.
    words = (home.word,) if programme is None else (home.word, repr(programme))
    rng = np.random.default_rng(keys.seed("made", home.version, *words))
    shelf = catalogue if home.furniture else EMPTY
    drawn = drawn_home(rng, shelf, wishes=wishes, programme=programme, style=home.style)
    said = origin(home, shelf, programme)
    data = home_file(drawn.storeys, shelf, rng, drawn.stair, name=home.name, origin=said)
    return Made(drawn.storeys, data, said, drawn.stair)


def origin(home: MadeHome, catalogue: Catalogue, programme: Programme | None = None) -> str:
    """What tells a made home from every other, in its file: its word and a digest of the rest."""
    shelf = catalogue if home.furniture else EMPTY
    digest = keys.digest("made", home.version, home.word, repr(programme), shelf.digest)
    return f"{home.word} {digest}"


def made_of_plan(
    plan: Plan, catalogue: Catalogue, *, seed: int, style: str = "", name: str = "home"
) -> Made:
    """A user's own plan, furnished by a seed: turned so that most of its walls run along x or z.

    What would stand through a skewed wall is left out.
    """
    own = ((),)
    return made_of_storeys(
        [turned(plan)], own, catalogue, repr(plan), seed=seed, style=style, name=name
    )


def made_of_storeys(
    plans: Sequence[Plan], given_pieces: Sequence[Sequence[PlacedPiece]], catalogue: Catalogue, key: str, *,
    seed: int, style: str = "", name: str = "home",
) -> Made:  # fmt: skip
    """Upright storeys from below; rooms in which no given piece stands are furnished by a seed.

    key: what the plans come from, of which the seed makes a home.
    """
    rng = np.random.default_rng(keys.seed("own plan", VERSION, seed, style, key))
    storeys = []
    for plan, own in zip(plans, given_pieces, strict=True):
        grounds = [Polygon(room.polygon).buffer(0.02) for room in plan.rooms]
        taken = {piece.room for piece in own}
        drawn = [
            p for p in furnished(plan, catalogue, rng, style)
            if p.room not in taken and grounds[p.room].contains(Polygon(p.corners))
        ]  # fmt: skip
        storeys.append(Storey(plan, (*own, *drawn)))
    words = [repr(own) for own in given_pieces if own]
    digest = keys.digest("own plan", VERSION, seed, style, key, catalogue.digest, *words)
    data = home_file(storeys, catalogue, rng, name=name, origin=f"plan {digest}")
    return Made(tuple(storeys), data, f"plan {digest}")


def turned(plan: Plan) -> Plan:
    """The plan turned about its origin by less than 45 degrees, the longest way of its walls upright."""
    return turned_by(plan, upright_angle(plan.rooms))


def upright_angle(rooms: Sequence[PlanRoom]) -> float:
    """Radians by which rooms are turned about the origin so that most of their walls are upright."""
    ways: dict[float, float] = {}
    for (x0, z0), (x1, z1) in (edge for room in rooms for edge in room.edges):
        angle = math.degrees(math.atan2(z1 - z0, x1 - x0)) % 90
        tenth = round(angle, 1) % 90
        ways[tenth] = ways.get(tenth, 0.0) + math.hypot(x1 - x0, z1 - z0)
    main = max(ways, key=lambda angle: (ways[angle], -angle))
    return math.radians(-main if main < 45 else 90 - main)


def turned_by(plan: Plan, angle_rad: float) -> Plan:
    """The plan turned about its origin."""
    if angle_rad == 0:
        return plan
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)

    def moved(p: Point) -> Point:
        return round(p[0] * cos - p[1] * sin, 3), round(p[0] * sin + p[1] * cos, 3)

    walls = tuple(replace(w, start=moved(w.start), end=moved(w.end)) for w in plan.walls)
    rooms = tuple(replace(r, polygon=tuple(map(moved, r.polygon))) for r in plan.rooms)
    return replace(plan, walls=walls, rooms=rooms)
