"""Radiators below windows, coats in halls, pin boards."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.catalogue import EMPTY, Catalogue, Piece, Place, Shape
from pbrs_farm.core.classes import BED, OTHERPROP
from pbrs_farm.core.house import Item, ItemKind, Material
from pbrs_farm.core.mesh import signed_volume, triangle_corners
from pbrs_farm.dress.finish_scheme import finish_scheme
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space import house_space
from pbrs_farm.dress.style import Style, style_for
from pbrs_farm.dress.surface_finishes import material_of_finish
from pbrs_farm.dress.walls import furnish_walls, hung_things
from pbrs_farm.dress.walls.hang_walls import hang_coats
from pbrs_farm.dress.walls.hanging import WANTS, Hanging
from pbrs_farm.dress.walls.radiators import hang_radiators, wants_radiators
from pbrs_farm.furnishings.things import hung, radiators
from pbrs_farm.furnishings.things.maker import Thing
from pbrs_farm.geometry.solids import box
from pbrs_farm.home.room_use import RoomKind
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.dress.furniture import solid
from tests.repair import wall_rooms
from tests.repair.wall_rooms import covers, walls_around


def _style() -> Style:
    return style_for(np.random.default_rng(1))


def _houses(n: int = 8) -> list[MutableHouse]:
    houses = [MutableHouse(builtin_home(), seed) for seed in range(1, n)]
    for mutable in houses:
        furnish_walls(mutable, EMPTY, _style(), 1.0)
    return houses


def _bare_houses(n: int) -> list[MutableHouse]:
    """Houses without furniture, with radiators hung below the windows."""
    home = builtin_home()
    bare = home.with_items(i for i in home.items if i.kind is not ItemKind.OBJECT)
    houses = [MutableHouse(bare, seed) for seed in range(1, n)]
    for mutable in houses:
        for room in house_space(mutable).rooms if wants_radiators(mutable) else ():
            hang_radiators(Hanging(mutable, room, "walls"), _style(), 1.0)
    return houses


def _named(mutable: MutableHouse, name: str) -> list[Item]:
    return [i for i in mutable.items if i.name == name]


@pytest.mark.parametrize(
    ("thing", "given"),
    [
        (radiators.wall_radiator, (1.0, 0.5, Material("paint"))), (hung.coat_rack, (3, False)),
        (hung.pin_board, (0.8, 0.5, Material("frame"))), (hung.tool_rail, (0.9,)), (radiators.towel_radiator, ()),
        *((hung.wall_cupboard, (Material("body"), Material("front"), 0.8, 0.6, 0.3, 2, n)) for n in range(6)),
        (hung.open_cupboard, (Material("body"), 0.8, 0.6, 0.3)),
        *((hung.wall_switch, (2, (0.9, 0.9, 0.9), n, n % 4)) for n in range(hung_things.SWITCH_FORMS)),
        *((hung.wall_socket, (2, (0.9, 0.9, 0.9), n, n % 4)) for n in range(hung_things.SOCKET_FORMS)),
    ],
)  # fmt: skip
def test_wall_items_begin_at_their_wall_and_face_outwards(
    thing: Thing[...], given: tuple[object, ...]
) -> None:
    _piece, shape = thing.make(np.random.default_rng(1), _style(), *given)
    assert shape.bounds[0, 2] == pytest.approx(0.0, abs=1e-6)
    for surface in shape.surfaces:
        corners = triangle_corners(surface.positions, surface.faces)
        assert signed_volume(corners, corners[0, 0]) > 0


def test_radiators_hang_below_windows_in_most_homes_and_not_in_all() -> None:
    houses = _bare_houses(9)
    has_radiators = [wants_radiators(mutable) for mutable in houses]
    assert len(set(has_radiators)) == 2
    for mutable, wants in zip(houses, has_radiators, strict=True):
        radiators = _named(mutable, "Panel radiator")
        assert bool(radiators) == wants
        for item in radiators:
            windows = [w for r in house_space(mutable).rooms for w in r.windows]
            middle = item.bounds.mean(0)
            nearest = min(windows, key=lambda w, m=middle: float(np.linalg.norm((w.centre - m)[[0, 2]])))  # fmt: skip
            assert item.bounds[1, 1] < nearest.bottom_y
            assert abs(float((middle - nearest.centre) @ nearest.along)) < 0.05


def test_added_radiators_have_the_coat_of_the_home() -> None:
    coats = set()
    for mutable in _bare_houses(24):
        coat = material_of_finish(finish_scheme(mutable, _style()).radiator)
        for item in _named(mutable, "Panel radiator"):
            assert coat in [mutable.materials[s.material] for s in item.surfaces]
            coats.add(coat)
    assert len(coats) > 2


def test_a_home_with_a_radiator_gets_none() -> None:
    house = builtin_home()
    drawn = replace(house.items[-1], id="drawn", name="Radiator", source_class="radiator")
    assert not wants_radiators(MutableHouse(house.with_items((*house.items, drawn)), 3))


@pytest.mark.long
def test_coats_hang_clear_of_the_floor() -> None:
    coats = [i for mutable in _houses() for i in _named(mutable, "Coat rack")]
    assert coats
    for item in coats:
        assert item.bounds[0, 1] > 0.3


def test_no_coats_hang_over_a_bed_or_beside_it() -> None:
    rect = (0.0, 0.0, 3.4, 3.4)
    bedroom = replace(wall_rooms.room("0_0", rect), name="Bedroom")
    bed = replace(solid("Bed", [0.7, 0.0, 0.02], [2.3, 0.5, 2.0]), nyu40=BED)
    home = wall_rooms.house([*walls_around(rect), *covers(bedroom), bed], [bedroom])
    n = 0
    for seed in range(12):
        mutable = MutableHouse(home, seed)
        space = house_space(mutable)
        hang_coats(Hanging(mutable, space.rooms[0], "walls"), space, _style(), 1.0)
        for item in mutable.items[len(mutable.source.items) :]:
            gap = np.maximum(item.bounds[0] - bed.bounds[1], bed.bounds[0] - item.bounds[1])
            assert gap[[0, 2]].max() >= 0.5
            n += 1
    assert n > 2


def test_every_use_of_a_room_has_a_row_of_wall_items() -> None:
    assert set(WANTS) == set(RoomKind)
    for row in WANTS.values():
        assert row.pictures <= row.most_pictures
        assert row.shelves <= row.most_shelves
        assert bool(row.coats) == bool(row.most_coats)


@pytest.mark.long
def test_notes_hang_flat_on_a_wall_at_eye_height() -> None:
    notes = [(m, item) for m in _houses() for item in _named(m, "Wall notes")]
    assert notes
    for mutable, item in notes:
        low, high = item.bounds
        floor_y = next(r.floor_y for r in mutable.source.rooms if r.id == item.room_id)
        assert min(high[0] - low[0], high[2] - low[2]) < 0.002
        assert low[1] - floor_y > 0.9
        assert high[1] - floor_y < 2.4


def test_all_mains_sockets_of_a_home_are_of_one_standard() -> None:
    shape = Shape(
        (box("plate", np.array([0, 0.04, 0.004]), np.array([0.04, 0.04, 0.004]), 0),),
        (Material("white"),),
    )
    names = ("Type A plug", "Type E plug", "Type G plug", "RJ45 plug")
    pieces = tuple(
        Piece(f"s#{name}", name, "socket", Place.WALL, OTHERPROP, (0.08, 0.008, 0.08))
        for name in names
    )
    catalogue = Catalogue(pieces, lambda _piece: shape, "sockets")
    standards = []
    for seed in range(1, 6):
        mutable = MutableHouse(builtin_home(), seed)
        furnish_walls(mutable, catalogue, _style(), 1.0)
        named = {i.name for i in mutable.items if i.name in names or i.name == "wall socket"}
        standards.append(named - {"RJ45 plug"})
    assert all(len(of_home) <= 1 for of_home in standards)
    assert len(set.union(*standards)) > 1
