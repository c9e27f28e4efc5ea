"""Windows of buildings are in their walls; leaves have holes between them."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import corners_of_surfaces
from pbrs_farm.furnishings.surroundings.buildings import STOREY_M, Front, block, house
from pbrs_farm.furnishings.surroundings.facades import (
    HOUSES,
    TOWN,
    Facade,
    Style,
    facade,
    lit_rooms,
)
from pbrs_farm.furnishings.surroundings.plants import SPECIES, leaves_of, tree, tree_line
from pbrs_farm.furnishings.surroundings.scenery import Scenery, SceneryMaterial, Site, lit

STYLES = [(TOWN, k) for k in range(len(TOWN))] + [(HOUSES, k) for k in range(len(HOUSES))]


def built(own: Facade, *, is_house: bool) -> dict[str, F64]:
    """Corners of a building at z = 0 by the last word of its materials' names."""
    scenery, rng = Scenery(), np.random.default_rng(3)
    rooms = lit("rooms", picture=lit_rooms(rng))
    front = Front(np.zeros(3), np.eye(3)[0], np.eye(3)[2], Site(scenery, "one", rng))
    if is_house:
        house(front, own, rooms)
    else:
        block(front, own, rooms, 4, 5, has_balconies=True)
    items, materials, _textures = scenery.items("0", 0)
    (item,) = items
    corners_by_name: dict[str, list[F64]] = {}
    for surface in item.surfaces:
        name = materials[surface.material].name.split()[-1]
        corners_by_name.setdefault(name, []).append(corners_of_surfaces([surface]))
    return {name: np.concatenate(rows) for name, rows in corners_by_name.items()}


@pytest.mark.parametrize(("styles", "number"), STYLES)
def test_windows_are_behind_the_wall_and_unobstructed(
    styles: tuple[Style, ...], number: int
) -> None:
    front = facade(np.random.default_rng(number), number, styles)
    corners_by_name = built(front, is_house=styles is HOUSES)
    windows = corners_by_name["windows"]
    np.testing.assert_allclose(windows[..., 2], -0.17, atol=1e-6)
    # The front wall has holes there: no triangle of it contains the middle of a window.
    wall = corners_by_name["wall"][(np.abs(corners_by_name["wall"][..., 2]) < 1e-6).all(1)][..., :2]
    middles = windows.reshape(-1, 2, 3, 3).mean((1, 2))[:, :2]
    a, b, c = (wall[:, k] for k in range(3))
    sides = [_side(p, q, middles) for p, q in ((a, b), (b, c), (c, a))]
    inside = (np.sign(sides[0]) == np.sign(sides[1])) & (np.sign(sides[1]) == np.sign(sides[2]))
    assert len(wall) > 40
    assert not inside.any()
    # A window or a door in each bay of each storey.
    n = len(windows) // 2 + len(corners_by_name["door"]) // 2
    assert n % max(round(float(np.ptp(wall[..., 0])) / front.bay_m), 1) == 0
    assert windows[..., 1].max() > STOREY_M * 0.7


def _side(p: F64, q: F64, points: F64) -> F64:
    """(T, N) side of the lines p to q (T, 2) for the points (N, 2)."""
    d, to = q - p, points[None] - p[:, None]
    return np.asarray(d[:, None, 0] * to[..., 1] - d[:, None, 1] * to[..., 0])


def share_left(picture: F64) -> float:
    return float((picture[..., 3] > 0.5).mean())


@pytest.mark.parametrize("number", range(len(SPECIES)))
def test_sprays_of_leaves_have_holes(number: int) -> None:
    leaves = leaves_of(np.random.default_rng(1), number)
    assert leaves.outer.picture is not None
    assert 0.25 < share_left(np.asarray(leaves.outer.picture, np.float64)) < 0.8
    scenery = Scenery()
    tree(Site(scenery, "tree", np.random.default_rng(2)), np.zeros(3), 7.0, leaves)
    items, materials, textures = scenery.items("0", 0)
    cut = [m for m in materials if m.alpha_cutout]
    plants = [leaves._replace(tint=k) for k in range(len(leaves.tints))]
    assert {m.name for m in cut} in [{p.outer.name, p.inner.name} for p in plants]
    assert {textures[m.texture_id or ""].media_type for m in cut} == {"image/png"}
    # It rests on its foot and has about the requested height.
    corners = corners_of_surfaces(items[0].surfaces)
    assert abs(corners[..., 1].min()) < 0.1
    assert 5.5 < corners[..., 1].max() < 9.0


def test_a_line_of_trees_ends_in_the_air_and_has_no_hole_at_its_foot() -> None:
    picture = np.asarray(tree_line(np.random.default_rng(1)), np.float64)
    assert share_left(picture[-12:]) == 1.0
    assert share_left(picture[:2]) < 0.2


def test_colours_are_realistic() -> None:
    looks: list[SceneryMaterial] = []
    for styles, number in STYLES:
        front = facade(np.random.default_rng(number), number, styles)
        looks += [front.wall, front.windows, front.roof, front.door]
    for look in looks:
        assert look.picture is not None
        assert float(look.picture[..., :3].min()) >= 0, look.name
        assert float(look.picture[..., :3].max()) < 0.9, look.name
