"""Panelling, boards and brick on walls: permitted rooms, and the height of a dado."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.dress.patterns import Pattern
from pbrs_farm.dress.style import COVERED_ROOMS, COVERS, STYLES, Style, style_for
from pbrs_farm.dress.surfaces.home_finish import WallFinish, covered
from pbrs_farm.furnishings.textures.families import FAMILIES, size_of
from pbrs_farm.home.room_use import RoomKind

PAINT = WallFinish(Pattern("paint", 1))
PAPER = WallFinish(Pattern("wallpaper", 1))
TILES = WallFinish(Pattern("paint", 1), low=Pattern("tiles", 1, variant="20"), low_m=2.0)


def style(*covers: str) -> Style:
    return replace(style_for(np.random.default_rng(1), "classic"), covers=covers)


def finishes(walls: WallFinish, kind: RoomKind, *covers: str) -> list[WallFinish]:
    """Finishes of the walls for a hundred seeds."""
    rngs = (np.random.default_rng(seed) for seed in range(100))
    return [covered(rng, style(*covers), walls, kind) for rng in rngs]


def test_every_cover_is_a_surface_that_can_be_painted_and_some_taste_likes_it() -> None:
    assert {c.pattern for c in COVERS.values()} <= {*FAMILIES}
    liked = {name for taste in STYLES for name in style_for(np.random.default_rng(1), taste).covers}
    assert liked == {*COVERS}


def test_the_share_of_covered_rooms_is_the_tables() -> None:
    n = sum(f != PAINT for f in finishes(PAINT, RoomKind.LIVING, *COVERS))
    share = COVERED_ROOMS[RoomKind.LIVING]
    # Five standard deviations of a hundred draws.
    assert abs(n / 100 - share) < 5 * np.sqrt(share * (1 - share) / 100)
    assert all(f == PAINT for f in finishes(PAINT, RoomKind.STORE, *COVERS))
    assert all(f == PAINT for f in finishes(PAINT, RoomKind.LIVING)), "a taste without covers"


def test_panels_end_with_their_picture() -> None:
    feet = [f for f in finishes(PAINT, RoomKind.LIVING, "panels") if f.low is not None]
    assert len({f.low_m for f in feet}) > 1
    assert all(f.low is not None and f.low_m == size_of(f.low)[1] for f in feet)


@pytest.mark.parametrize("walls", [PAPER, TILES], ids=["paper", "tiles"])
def test_paper_and_tiles_stay_above_a_foot(walls: WallFinish) -> None:
    for finish in finishes(walls, RoomKind.BATHROOM, *COVERS):
        assert finish.main == walls.main
        assert finish.accent is None
    changed = [f for f in finishes(walls, RoomKind.BATHROOM, "matchboard") if f != walls]
    assert changed
    assert all(f.low is not None and f.low.family == "upright boards" for f in changed)


def test_a_wall_that_has_an_accent_keeps_it() -> None:
    walls = replace(PAINT, accent=Pattern("brick", 1))
    assert all(f == walls for f in finishes(walls, RoomKind.LIVING, *COVERS))
