"""Furniture added along free walls: placement, materials, free space."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from pbrs_farm.core.catalogue import EMPTY, Catalogue, Piece, Place
from pbrs_farm.core.classes import BOOKSHELF, COUNTER
from pbrs_farm.core.house import Item
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.core.mesh import signed_volume, triangle_corners
from pbrs_farm.dress.furniture import KINDS, add_furniture, model_from_catalogue
from pbrs_farm.dress.models import Model
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space import FloorCells, doors_are_joined, house_space
from pbrs_farm.dress.style import style_for
from pbrs_farm.dress.supports import supports_of_item
from pbrs_farm.dress.thing_materials import plain
from pbrs_farm.furnishings.things.case_goods import CASE_GOODS, Boards, desk_chair
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.dress.furniture import solid

STYLE = style_for(np.random.default_rng(1))
_WOOD = plain("wood", (0.6, 0.5, 0.4), 0.4)
BOARDS = Boards(_WOOD, plain("white", (0.9, 0.9, 0.9), 0.4), _WOOD)


def _draft(seed: int, share: float = 1.0) -> MutableHouse:
    mutable = MutableHouse(builtin_home(), seed)
    add_furniture(mutable, EMPTY, STYLE, share)
    return mutable


def _added(mutable: MutableHouse) -> list[Item]:
    return mutable.items[len(mutable.source.items) :]


def _pieces() -> list[Model]:
    pieces = []
    for name, kind in KINDS.items():
        for seed in range(3):
            rng = np.random.default_rng([seed, *name.encode()])
            size = tuple(
                float(rng.uniform(*side)) for side in (kind.width, kind.height, kind.depth)
            )
            pieces.append(CASE_GOODS[kind.model].make(rng, STYLE, BOARDS, size))
    return [*pieces, desk_chair.make(np.random.default_rng(1), STYLE, BOARDS)]


def test_every_kind_rests_on_its_base_and_its_bodies_are_closed_and_outward() -> None:
    for piece, shape in _pieces():
        low, high = shape.bounds
        assert low[1] == pytest.approx(0.0, abs=1e-6), piece.name
        assert np.allclose(high - low, np.array(piece.size)[[0, 2, 1]], atol=1e-5)
        assert piece.nyu40 > 0
        for surface in shape.surfaces:
            corners = triangle_corners(surface.positions, surface.faces)
            assert signed_volume(corners, corners[0, 0]) > 0, piece.name


def test_catalogue_pieces_come_from_the_users_library_by_its_share() -> None:
    _piece, shape = desk_chair.make(np.random.default_rng(1), STYLE, BOARDS)
    chest, size = KINDS["chest"], (1.0, 0.4, 0.9)
    pieces = tuple(Piece(f"T#{k}", "T", "dresser", Place.FLOOR, 17, size) for k in range(50))
    catalogue = Catalogue(pieces, lambda _piece: shape, "test", own=frozenset({"T#7"}))
    for share, least, most in ((1.0, 200, 200), (0.5, 70, 130), (0.0, 0, 20)):
        drawn = [model_from_catalogue(catalogue, chest, 1.0, seed, share) for seed in range(200)]
        ids = [model[0].id for model in drawn if model is not None]
        assert least <= ids.count("T#7") <= most, share


def test_pieces_have_the_size_of_their_kind() -> None:
    for kind in KINDS.values():
        rng = np.random.default_rng(5)
        size = (kind.width[1], kind.height[1], kind.depth[1])
        w, d, h = CASE_GOODS[kind.model].make(rng, STYLE, BOARDS, size)[0].size
        assert w < size[0] + 0.02
        assert h < size[1] + 0.03
        assert d < size[2] + 0.05


@pytest.mark.parametrize(
    ("name", "size", "least"),
    [("bookcase", (0.8, 2.0, 0.3), 4), ("cube_shelf", (1.1, 1.5, 0.38), 12)],
)
def test_the_boards_of_a_shelf_are_found_as_supports(
    name: str, size: tuple[float, float, float], least: int
) -> None:
    shelf = CASE_GOODS[name].make(np.random.default_rng(2), STYLE, BOARDS, size)
    mutable = MutableHouse(builtin_home(), 1)
    room = mutable.source.rooms[0]
    middle = room.polygon.mean(0)
    origin = np.array([middle[0], room.floor_y, middle[1]])
    item = mutable.placed(
        *shelf, origin, 0.0, item_id="shelf", room_id=room.id, level_id=room.level_id
    )
    mutable.items = [item]
    supports = supports_of_item(SceneTriangles(mutable.items), 0, room)
    assert len(supports) >= least


@pytest.mark.parametrize("seed", range(1, 6))
def test_furniture_is_on_the_floor_with_its_back_at_a_wall_of_its_room(seed: int) -> None:
    mutable = _draft(seed)
    space = house_space(mutable)
    stood = [i for i in _added(mutable) if "chair" not in i.name]
    assert stood
    for item in stood:
        room = space.room(str(item.room_id))
        low, high = item.bounds
        assert low[1] == pytest.approx(room.room.floor_y, abs=0.0005)
        assert shapely.contains(room.area, shapely.box(low[0], low[2], high[0], high[2]))
        corners = np.array([[x, 0.0, z] for x in (low[0], high[0]) for z in (low[2], high[2])])
        back = min(float(np.abs(face.out_of(corners)).min()) for face in room.faces)
        assert back < 0.03


@pytest.mark.parametrize("seed", range(1, 6))
def test_doors_stay_free_and_joined_and_the_floor_open(seed: int) -> None:
    mutable = _draft(seed)
    space = house_space(mutable)
    for item in _added(mutable):
        room = space.room(str(item.room_id))
        low, high = item.bounds
        body = shapely.box(low[0], low[2], high[0], high[2])
        for door in room.doors:
            side = door.side_of(room.room.id)
            assert side is not None
            assert not door.before(side).union(door.swing(side)).intersects(body)
    for room in space.rooms:
        bitmap = FloorCells(space, room).bitmap()
        assert doors_are_joined(bitmap, room)
        assert (bitmap.occupied & bitmap.inside).sum() < 0.6 * bitmap.inside.sum()


def test_furniture_leaves_space_for_drawers_of_the_room() -> None:
    # Half of a living-room wall has chests whose drawers come out by a metre.
    home = builtin_home()
    bare = [i for i in home.items if not i.id.startswith("piece_")]
    body = solid("Chest", [0.3, 0, 0.05], [3.3, 0.8, 0.5])
    front = replace(solid("", [0.3, 0.1, 0.5], [3.3, 0.7, 0.52]).surfaces[0], part="drawer")
    joint = Joint("drawer", JointKind.PRISMATIC, (0, 0, 0), (0, 0, 1), 1.0)
    chest = replace(body, surfaces=(*body.surfaces, front), joints=(joint,))
    chest_zone, n = shapely.box(0.3, 0.5, 3.3, 1.52), 0
    for seed in range(4):
        mutable = MutableHouse(replace(home, items=(*bare, chest)), seed)
        add_furniture(mutable, EMPTY, STYLE, 1.0)
        for item in _added(mutable):
            low, high = item.bounds
            n += item.room_id == "0_0"
            assert not shapely.box(low[0], low[2], high[0], high[2]).intersects(chest_zone), (
                item.name
            )
    assert n > 0


def test_no_bookcase_is_among_kitchen_units() -> None:
    # A worktop along a living-room wall, the rest of which is free.
    worktop = replace(solid("Worktop", [0.0, 0, 1.2], [0.6, 0.9, 2.6]), nyu40=COUNTER)
    home = builtin_home()
    bare = [i for i in home.items if not i.id.startswith("piece_")]
    n = 0
    for seed in range(3):
        mutable = MutableHouse(replace(home, items=(*bare, worktop)), seed)
        add_furniture(mutable, EMPTY, STYLE, 1.0)
        for item in _added(mutable):
            if item.nyu40 == BOOKSHELF and item.room_id == "0_0":
                gap = np.maximum(
                    item.bounds[0] - worktop.bounds[1], worktop.bounds[0] - item.bounds[1]
                )
                assert gap[[0, 2]].max() > 0.9
                n += 1
    assert n > 0


def test_a_seed_decides_every_bit_and_no_share_adds_nothing() -> None:
    for a, b in zip(_draft(3).items, _draft(3).items, strict=True):
        assert a.id == b.id
        assert np.array_equal(a.bounds, b.bounds)
    assert not _added(_draft(3, 0.0))
