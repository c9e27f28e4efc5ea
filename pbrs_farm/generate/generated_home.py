"""A made home by its seed: plan, furniture, file; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from shapely.geometry import Polygon

from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import EMPTY, Catalogue
from pbrs_farm.core.made_home import VERSION, MadeHome
from pbrs_farm.generate.drawn_home import drawn_home
from pbrs_farm.generate.floor_plan import PlacedPiece, Plan, Storey
from pbrs_farm.generate.furnish.furnished import furnished
from pbrs_farm.generate.home_file import HomeContents, home_contents
from pbrs_farm.generate.programme import Programme, Wishes
from pbrs_farm.generate.staircase import Stair


@dataclass(frozen=True, slots=True)
class GeneratedHome:
    """A generated home."""

    storeys: tuple[Storey, ...]  # from below
    contents: HomeContents
    origin: str
    stair: Stair | None = None  # between them

    @property
    def data(self) -> bytes:
        """Its .sh3d, packed anew at each call."""
        return self.contents.archive()


def generate_home(
    home: MadeHome, catalogue: Catalogue, programme: Programme | None = None
) -> GeneratedHome:
    """The home of a seed, or of a seed and a programme; equal arguments give equal bytes.

    Raises BadInput for wishes that no home meets.
    """
    low, high = home.bedrooms
    bedrooms = max(low, home.offices + 1 if home.offices else 0), high
    area = float(home.area[0]), float(home.area[1])
    wishes = Wishes(bedrooms, area, home.storeys, home.plans, home.offices)
    # All randomness comes from one stream that the wishes and the version name.
    words = (home.word,) if programme is None else (home.word, repr(programme))
    rng = np.random.default_rng(keys.seed("made", home.stream, *words))
    shelf = catalogue if home.furniture else EMPTY
    drawn = drawn_home(rng, shelf, wishes=wishes, programme=programme, style=home.style)
    origin = origin_of_home(home, shelf, programme)
    contents = home_contents(drawn.storeys, shelf, rng, drawn.stair, name=home.name, origin=origin)
    return GeneratedHome(drawn.storeys, contents, origin, drawn.stair)


def origin_of_home(home: MadeHome, catalogue: Catalogue, programme: Programme | None = None) -> str:
    """Identity of a generated home, for its file: its word and a digest of all other inputs."""
    shelf = catalogue if home.furniture else EMPTY
    digest = keys.digest("made", home.version, home.word, repr(programme), shelf.digest)
    return f"{home.word} {digest}"


def furnish_storeys(
    plans: Sequence[Plan],
    given_pieces: Sequence[Sequence[PlacedPiece]],
    catalogue: Catalogue,
    key: str,
    *,
    seed: int,
    style: str = "",
    name: str = "home",
) -> GeneratedHome:
    """Build the storeys from below; rooms without given pieces are furnished by a seed.

    key: identifies the plans; it is combined with the seed.
    """
    rng = np.random.default_rng(keys.seed("own plan", VERSION, seed, style, key))
    storeys = []
    for plan, standing in zip(plans, given_pieces, strict=True):
        grounds = [Polygon(room.polygon).buffer(0.02) for room in plan.rooms]
        taken = {piece.room for piece in standing}
        drawn = [
            p
            for p in furnished(plan, catalogue, rng, style)
            if p.room not in taken and grounds[p.room].contains(Polygon(p.corners))
        ]
        storeys.append(Storey(plan, (*standing, *drawn)))
    words = [repr(standing) for standing in given_pieces if standing]
    digest = keys.digest("own plan", VERSION, seed, style, key, catalogue.digest, *words)
    contents = home_contents(storeys, catalogue, rng, name=name, origin=f"plan {digest}")
    return GeneratedHome(tuple(storeys), contents, f"plan {digest}")
