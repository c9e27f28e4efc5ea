"""Supporting surfaces are found in raw meshes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.house import Item, ItemKind
from pbrs_farm.dress.supports import Support, floor_support, supports_of_item
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from tests.dress.furniture import boards, bookcase, room, solid, thin_table


def _supports(*items: Item, index: int = 0) -> list[Support]:
    return supports_of_item(SceneTriangles(items), index, room())


def test_a_solid_boxs_top_is_its_only_support() -> None:
    (support,) = _supports(solid("box", [1, 0, 1], [2, 0.7, 1.5]))
    assert support.height == pytest.approx(0.7)
    assert support.area == pytest.approx(0.5, rel=0.05)
    assert not support.is_covered


def test_a_bookcases_inner_shelves_are_supports_open_only_to_the_front() -> None:
    supports = _supports(bookcase(n_shelves=4))
    assert [round(s.above_floor, 2) for s in supports] == [0.12, 0.59, 1.06, 1.53, 2.0]
    for shelf in supports[:-1]:
        assert shelf.open_sides == (False, True, False, False)
        assert shelf.is_covered
        # 96 cm between the sides, 29 cm before the back.
        assert shelf.area == pytest.approx(0.96 * 0.29, rel=0.1)
        assert np.median(shelf.clear[shelf.mask]) == pytest.approx(0.45, abs=0.002)


def test_a_thin_top_that_faces_downwards_is_a_support() -> None:
    (support,) = _supports(thin_table())
    assert support.area == pytest.approx(0.96, rel=0.05)


def test_contents_of_a_table_take_their_place() -> None:
    table, tv = (
        solid("table", [1, 0, 1], [2, 0.7, 1.5]),
        solid("tv", [1.2, 0.7, 1.1], [1.5, 1, 1.3]),
    )
    (support,) = _supports(table, tv)
    assert support.area == pytest.approx(0.5 - 0.3 * 0.2, rel=0.1)
    x, z = np.moveaxis(support.grid.centres(), -1, 0)
    assert not support.mask[(x > 1.2) & (x < 1.5) & (z > 1.1) & (z < 1.3)].any()


def test_the_inside_of_a_closed_cabinet_is_no_support() -> None:
    walls = [
        ([1, 0, 1], [1.02, 1.8, 1.5]), ([1.98, 0, 1], [2, 1.8, 1.5]),
        ([1.02, 0, 1], [1.98, 1.8, 1.02]), ([1.02, 0, 1.48], [1.98, 1.8, 1.5]),
        ([1, 0.05, 1], [2, 0.1, 1.5]), ([1, 1.8, 1], [2, 1.82, 1.5]),
    ]  # fmt: skip
    heights = [s.height for s in _supports(boards("cabinet", walls, 3))]
    assert heights == pytest.approx([1.82])


def test_a_turned_table_has_turned_axes() -> None:
    table = solid("table", [1, 0, 1], [2, 0.7, 1.5])
    turn = np.radians(30)
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    middle = np.array([1.5, 0, 1.25])
    surface = table.surfaces[0]
    positions = (surface.positions - middle) @ rotation.T + middle
    turned = replace(table, surfaces=(replace(surface, positions=positions.astype(np.float32)),))
    (support,) = _supports(turned)
    assert support.area == pytest.approx(0.5, rel=0.05)
    assert support.grid.turn_rad % (np.pi / 2) == pytest.approx(turn, abs=1e-4)


def test_a_support_outside_the_room_is_left_out() -> None:
    assert not _supports(solid("box", [5, 0, 1], [6, 0.7, 1.5]))


def _basin(depth_m: float) -> Item:
    """A worktop of 1 x 0.6 m at 0.9 m with a bowl in its middle, 40 cm square, of boards of 1 cm."""
    x0, x1, z0, z1, top = 1.3, 1.7, 1.1, 1.5, 0.9
    low = top - depth_m
    plates = [([1.0, 0.88, 1.0], [x0, top, 1.6]), ([x1, 0.88, 1.0], [2.0, top, 1.6])]
    plates += [([x0, 0.88, 1.0], [x1, top, z0]), ([x0, 0.88, z1], [x1, top, 1.6])]
    sides = [([x0, low, z0], [x0 + 0.01, top, z1]), ([x1 - 0.01, low, z0], [x1, top, z1])]
    sides += [([x0, low, z0], [x1, top, z0 + 0.01]), ([x0, low, z1 - 0.01], [x1, top, z1])]
    return boards("sink", [*plates, *sides, ([x0, low - 0.01, z0], [x1, low, z1])], 34)


def test_the_bottom_of_a_bowl_is_no_support_and_the_worktop_around_it_is() -> None:
    (support,) = _supports(_basin(0.2))
    assert support.height == pytest.approx(0.9)
    x, z = np.moveaxis(support.grid.centres(), -1, 0)
    assert not support.mask[(x > 1.32) & (x < 1.68) & (z > 1.12) & (z < 1.48)].any()


def test_a_tray_with_a_low_rim_is_a_support() -> None:
    assert len(_supports(_basin(0.02))) == 2


def test_a_worktop_seen_in_the_bowl_of_a_sink_is_no_support() -> None:
    worktop = solid("worktop", [1.0, 0.0, 1.0], [2.0, 0.8, 1.6])
    assert not _supports(worktop, _basin(0.15))


def test_a_rooms_floor_is_the_free_part_of_its_floor_faces() -> None:
    slab = replace(solid("floor", [0, -0.1, 0], [3, 0, 3]), kind=ItemKind.FLOOR)
    # A rug and a chest take their place; a lamp 2 m above the floor does not. Beyond x = 3 m the
    # room has no floor.
    rug, chest = solid("rug", [0, 0, 0], [1, 0.01, 1]), solid("chest", [0, 0, 2], [1, 0.9, 3])
    lamp = solid("lamp", [2, 2, 2], [2.5, 2.3, 2.5])
    support = floor_support(SceneTriangles([slab, rug, chest, lamp]), room())
    assert support is not None
    assert support.height == 0
    assert support.area == pytest.approx(3 * 3 - 1 - 1, rel=0.02)
    assert floor_support(SceneTriangles([rug, chest]), room()) is None
