"""Curtains, blinds, rugs and towels: closed cloth, hung on walls or laid on floors."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import cache
from typing import cast

import numpy as np
import pytest
import shapely

from benchmarks.homes.variety import effective
from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.house import House, Item, ItemKind, Surface
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.core.mesh import edges_are_paired, signed_volume, triangle_corners
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space import Passage, house_space
from pbrs_farm.dress.style import style_for
from pbrs_farm.dress.textiles import add_textiles
from pbrs_farm.dress.textiles.curtains import WindowSide, is_flat
from pbrs_farm.dress.textiles.hanging_cloth import (
    Pleats,
    pleated_panel,
    round_rail,
    towel_over_rail,
)
from pbrs_farm.dress.textiles.large_textiles import towel_rail
from pbrs_farm.dress.textiles.rugs import rug
from pbrs_farm.furnishings.rug_patterns import PATTERNS, inks_of, rug_pixels
from pbrs_farm.geometry.solids import box
from pbrs_farm.read.builtin.builtin_home import builtin_home

STYLE = style_for(np.random.default_rng(1))
CURTAIN, BLINDS, RUG = 16, 13, 20


def _bare() -> House:
    """The built-in home without its rug."""
    home = builtin_home()
    return replace(home, items=tuple(i for i in home.items if i.nyu40 != RUG))


def _empty(*more: Item) -> House:
    """The built-in home with only these items as furniture."""
    home = builtin_home()
    bare = [i for i in home.items if not i.id.startswith("piece_")]
    return replace(home, items=(*bare, *more))


def _dressed(seed: int, house: House | None = None, share: float = 1.0) -> MutableHouse:
    mutable = MutableHouse(house or _bare(), seed)
    add_textiles(mutable, EMPTY, STYLE, share)
    return mutable


_SEEN = cache(_dressed)  # for tests that only look


def _added(mutable: MutableHouse, nyu40: int) -> list[Item]:
    return [i for i in mutable.items[len(mutable.source.items) :] if i.nyu40 == nyu40]


def _is_closed(surface: Surface) -> bool:
    corners = triangle_corners(surface.positions, surface.faces)
    _, places = np.unique(np.round(corners.reshape(-1, 3), 6), axis=0, return_inverse=True)
    return edges_are_paired(places.reshape(-1, 3)) and signed_volume(corners, corners[0, 0]) > 0


@pytest.mark.parametrize(
    "surface",
    [
        pleated_panel("p", 0.6, 2.2, 0.1, Pleats(0.15, 0.03, 1.0), 0.25),
        towel_over_rail(0.4, 0.6, 0.07, np.random.default_rng(1)),
        round_rail("b", -0.5, 0.5, 2.0, 0.1, 0.012),
    ],
    ids=["panel", "towel", "bar"],
)
def test_cloth_is_a_closed_body_with_its_front_outside(surface: Surface) -> None:
    assert _is_closed(surface)
    assert surface.normals is not None
    # Shading normals agree with the faces.
    corners = triangle_corners(surface.positions, surface.faces)
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    shading = surface.normals[surface.faces].sum(1)
    assert ((flat * shading).sum(1) > -1e-12).mean() > 0.99


def test_a_panel_has_the_requested_folds() -> None:
    folds = Pleats(0.15, 0.03, sway=0.0)
    depth = folds.depths(np.linspace(0, 0.9, 400), np.zeros(400))
    assert 5 <= np.count_nonzero(np.diff((depth > 0).astype(int)) == 1) <= 7
    sheet = pleated_panel("p", 0.9, 2.0, 0.1, folds, 0.25)
    assert 0.04 < np.ptp(sheet.positions[:, 2]) < 0.09
    assert np.ptp(sheet.positions[:, 0]) == pytest.approx(0.9, abs=0.005)


@pytest.mark.parametrize("seed", range(1, 9))
def test_curtains_hang_from_the_wall_over_the_window(seed: int) -> None:
    mutable = _SEEN(seed)
    faces = {"window_living": (2, 0.0, 1.0), "window_bedroom": (2, 4.0, -1.0)}
    for item in _added(mutable, CURTAIN) + _added(mutable, BLINDS):
        points = np.concatenate([s.positions for s in item.surfaces])
        axis, centre, sign = faces["window_living" if item.room_id == "0_0" else "window_bedroom"]
        out = sign * (points[:, axis] - centre)
        assert 0.0005 < out.min() < 0.001
        assert out.max() < 0.3
        assert item.bounds[1, 1] < 2.5
        if item.nyu40 == CURTAIN:
            assert item.bounds[1, 1] > 2.1


def test_a_bracket_needs_a_straight_wall() -> None:
    # The wall's face is z = 0, and beyond x = 1 it bends into the room, 1 cm in 50.
    free = shapely.Polygon([(-2, 0), (1, 0), (2, 0.02), (2, 3), (-2, 3)])
    side = WindowSide(
        cast(Passage, None), 0, np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 0, 1.0]), 0, 2.5, 0
    )  # fmt: skip
    assert is_flat(free, side, -0.9)
    assert is_flat(free, side, 0.95)
    assert not is_flat(free, side, 1.3)


def test_each_panel_covers_a_seventh_to_a_quarter_of_its_window_or_drapes_the_wall() -> None:
    n_panels, draped = 0, 0
    for seed in range(1, 9):
        for item in _added(_dressed(seed, _empty()), CURTAIN):
            x0, x1 = (1.6, 3.4) if item.room_id == "0_0" else (6.7, 7.9)
            sheets = [s for s in item.surfaces if s.name == "curtain"]
            assert len(sheets) == 2
            for sheet in sheets:
                a, b = float(sheet.positions[:, 0].min()), float(sheet.positions[:, 0].max())
                cover = (min(b, x1) - max(a, x0)) / (x1 - x0)
                # From the ceiling down they cover half as much again, and the whole free wall.
                is_draped = item.bounds[1, 1] > 2.4
                assert (0.21 < cover < 0.39) if is_draped else (0.14 < cover < 0.26)
                beside = max(x0 - a, b - x1)
                assert (beside > 0.59) if is_draped else (beside < 0.49)
                n_panels += 1
                draped += is_draped
    assert n_panels > 4
    assert 0 < draped < n_panels


@pytest.mark.long
@pytest.mark.parametrize(
    ("low", "high"),
    [
        ([3.45, 0.0, 0.02], [4.2, 2.0, 0.4]),  # a cupboard on one side of the window
        ([1.0, 0.0, 0.02], [4.0, 0.88, 0.6]),  # a worktop in front of the window
    ],
)
def test_a_window_with_cloth_on_one_side_or_over_a_worktop_gets_a_blind(
    low: list[float], high: list[float]
) -> None:
    a, b = np.array(low), np.array(high)
    thing = Item("t", "t", ItemKind.OBJECT, "0", (box("t", (a + b) / 2, (b - a) / 2, 0),), 3)
    n_added = [_added(_dressed(seed, _empty(thing)), k) for seed in range(1, 3) for k in (CURTAIN, BLINDS)]  # fmt: skip
    rooms = [(i.nyu40, i.room_id) for items in n_added for i in items]
    assert (CURTAIN, "0_0") not in rooms
    assert (BLINDS, "0_0") in rooms


def test_a_window_that_has_curtains_keeps_them() -> None:
    home = _bare()
    cloth = box("c", np.array([2.5, 1.3, 0.06]), np.array([1.0, 1.2, 0.03]), 0)
    cotton = Item("own", "Curtains", ItemKind.OBJECT, "0", (cloth,), CURTAIN)
    full = replace(home, items=(*home.items, cotton))
    for seed in range(1, 6):
        mutable = _dressed(seed, full)
        assert all(i.room_id != "0_0" for i in _added(mutable, CURTAIN) + _added(mutable, BLINDS))


@pytest.mark.parametrize("seed", range(1, 9))
def test_rugs_lie_flat_in_the_room_clear_of_doors(seed: int) -> None:
    mutable = _SEEN(seed)
    space = house_space(mutable)
    for item in _added(mutable, RUG):
        low, high = item.bounds
        assert 0 <= low[1] < 0.001
        assert 0.008 < high[1] < 0.0105
        assert "rug" in item.tags
        room = space.room(str(item.room_id))
        area = shapely.box(low[0], low[2], high[0], high[2])
        assert room.area.contains(area)
        if "generated#rug" in item.source_class and area.area > 0.5:
            for door in room.doors:
                side = door.side_of(room.room.id)
                assert side is not None
                assert not door.swing(side).buffer(-0.01).intersects(area)


def test_some_seed_lays_a_large_rug_before_the_sofa() -> None:
    areas = [
        float(np.prod(np.ptp(i.bounds, axis=0)[[0, 2]]))
        for seed in range(1, 7)
        for i in _added(_SEEN(seed), RUG)
        if i.room_id == "0_0"
    ]
    assert max(areas) > 2.5


def test_a_room_with_a_rug_gets_no_second_one_on_it() -> None:
    for seed in range(1, 5):
        mutable = _dressed(seed, builtin_home())
        old = next(i for i in mutable.items if i.nyu40 == RUG)
        a = shapely.box(*old.bounds[0, [0, 2]], *old.bounds[1, [0, 2]])
        for item in _added(mutable, RUG):
            b = shapely.box(*item.bounds[0, [0, 2]], *item.bounds[1, [0, 2]])
            assert not a.intersects(b)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_every_pattern_of_rugs_can_be_woven(pattern: str) -> None:
    pixels = rug_pixels(np.random.default_rng(3), 1.6, 2.3, STYLE, pattern)
    assert pixels.shape == (304, 436, 3)
    assert pixels.std() > 2
    assert len(inks_of(np.random.default_rng(3), STYLE)) == 5


def test_rugs_end_in_many_ways_and_are_as_large_as_asked() -> None:
    counts: Counter[str] = Counter()
    for seed in range(120):
        _piece, shape = rug(np.random.default_rng(seed), 0.9, 1.3, STYLE)
        low, high = shape.bounds
        assert (high - low)[[0, 2]] == pytest.approx([1.3, 0.9], abs=0.03)
        assert high[1] < 0.01, "one walks over it"
        counts[str(sorted(len(s.faces) for s in shape.surfaces))] += 1
    assert effective(counts) > 12


def test_a_rug_shows_its_picture_on_top() -> None:
    _piece, shape = rug(np.random.default_rng(1), 1.0, 2.0, STYLE, forms=("sharp",))
    face = shape.surfaces[0]
    assert shape.materials[face.material].texture_id
    corners = triangle_corners(face.positions, face.faces)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normal[:, 1] > 0).all()
    assert np.ptp(face.positions[:, 0]) == pytest.approx(2.0)
    assert np.ptp(face.positions[:, 2]) == pytest.approx(1.0)


def test_towels_hang_over_rails_of_several_constructions() -> None:
    mutable = MutableHouse(builtin_home(), 1)
    constructions = set()
    for seed in range(24):
        piece, shape = towel_rail(mutable, STYLE, np.random.default_rng(seed))
        constructions.add(tuple(sorted(s.name for s in shape.surfaces)))
        assert piece.nyu40 == 27
        assert shape.bounds[0, 2] == pytest.approx(0, abs=1e-6)
        assert shape.bounds[0, 1] == pytest.approx(0, abs=0.005)
        assert shape.bounds[:, 0].sum() == pytest.approx(0, abs=1e-5)
    assert len(constructions) >= 5


def test_a_seed_decides_every_bit_and_no_share_adds_nothing() -> None:
    a, b = _dressed(3), _dressed(3)
    assert [i.id for i in a.items] == [i.id for i in b.items]
    for x, y in zip(a.items, b.items, strict=True):
        for s, t in zip(x.surfaces, y.surfaces, strict=True):
            assert np.array_equal(s.positions, t.positions)
    assert a.textures.keys() == b.textures.keys()
    assert len(_dressed(3, share=0.0).items) == len(_bare().items)


def test_a_drawn_rug_of_one_colour_gets_a_picture_that_covers_it_once() -> None:
    home = builtin_home()
    (place,) = (k for k, i in enumerate(home.items) if i.nyu40 == RUG)
    plain = tuple(replace(m, texture_id=None) for m in home.materials)
    # An item with a picture keeps it.
    assert _dressed(3, home).items[place] is home.items[place]
    mutable = _dressed(3, replace(home, materials=plain))
    item = mutable.items[place]
    assert mutable.materials[item.surfaces[0].material].texture_id is not None
    for now, was in zip(item.surfaces, home.items[place].surfaces, strict=True):
        assert np.array_equal(now.positions, was.positions)
        assert now.uvs is not None
        assert now.uvs.min() >= 0
        assert now.uvs.max() <= 1


@pytest.mark.long
def test_curtains_keep_clear_of_drawers_that_open_towards_the_window() -> None:
    # A chest facing the window's wall; its drawers come within 5 cm of it.
    space = house_space(MutableHouse(_bare(), 1))
    (window,) = space.room("0_0").windows
    side = window.side_of("0_0")
    assert side is not None
    middle = window.face_point(side)[0]
    low, high = np.array([middle - 1.6, 0.0, 0.46]), np.array([middle + 1.6, 0.5, 0.9])
    body = box("body", (low + high) / 2, (high - low) / 2, 0)
    ahead = np.array([0.0, 0.0, 0.23])
    front = box("front", (low + high) / 2 - ahead, (high - low) / 2 * [1, 1, 0.02], 0)
    chest = Item(
        "chest", "Chest", ItemKind.OBJECT, "0", (body, replace(front, part="drawer")), 17,
        room_id="0_0", joints=(Joint("drawer", JointKind.PRISMATIC, (0, 0, 0), (0, 0, -1), 0.4),),
    )  # fmt: skip
    usual = [_dressed(seed, _empty()) for seed in range(1, 7)]
    assert any(i.room_id == "0_0" for m in usual for i in _added(m, CURTAIN))
    for seed in range(1, 7):
        for curtain in _added(_dressed(seed, _empty(chest)), CURTAIN):
            # Short curtains may end above the sill.
            assert curtain.room_id != "0_0" or curtain.bounds[0, 1] > 0.5
