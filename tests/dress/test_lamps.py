"""Lamps for rooms that lack light: choice of room, place, power."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.catalogue import EMPTY, Catalogue
from pbrs_farm.core.house import House, Item, ItemKind
from pbrs_farm.core.lighting import flux_lm
from pbrs_farm.dress import made_lamps as made
from pbrs_farm.dress.lamps import add_lamps, draw_lamp
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space import house_space
from pbrs_farm.dress.style import style_for
from pbrs_farm.geometry.solids import box
from pbrs_farm.read.builtin.builtin_home import builtin_home

STYLE = style_for(np.random.default_rng(1))


def _dark() -> House:
    home = builtin_home()
    return replace(home, items=tuple(i for i in home.items if i.kind is not ItemKind.LAMP))


def _dressed(house: House, seed: int, share: float = 1.0) -> MutableHouse:
    mutable = MutableHouse(house, seed)
    add_lamps(mutable, EMPTY, STYLE, share)
    return mutable


def _hanging(mutable: MutableHouse) -> list[Item]:
    added = mutable.items[len(mutable.source.items) :]
    return [i for i in added if i.bounds[1, 1] > 2.0]


@pytest.mark.parametrize("seed", range(1, 6))
def test_every_dark_room_gets_a_lamp_that_touches_the_ceiling(seed: int) -> None:
    mutable = _dressed(_dark(), seed)
    hanging = _hanging(mutable)
    assert sorted(str(i.room_id) for i in hanging) == ["0_0", "0_1"]
    for item in hanging:
        assert item.bounds[1, 1] == pytest.approx(2.5, abs=0.001)
        assert item.bounds[1, 1] < 2.5
        assert item.kind is ItemKind.LAMP
        assert item.nyu40 == 35


@pytest.mark.parametrize("seed", range(1, 6))
def test_a_lamp_leaves_headroom_unless_a_table_is_below(seed: int) -> None:
    mutable = _dressed(_dark(), seed)
    space = house_space(mutable)
    for item in _hanging(mutable):
        low, high = item.bounds
        if low[1] > 1.9:
            continue
        middle = (low + high) / 2
        below = [i for i in space.room(str(item.room_id)).items if mutable.items[i].nyu40 == 7]
        assert any(
            (space.bounds[n][0] < middle).all() or abs(space.bounds[n].mean(0) - middle)[[0, 2]].max() < 0.3
            for n in below
        )  # fmt: skip


def test_the_flux_suits_the_area() -> None:
    for item in _hanging(_dressed(_dark(), 2)):
        flux = sum(flux_lm(x.power, x.unit, x.share) for x in item.lights)
        area = {"0_0": 20.0, "0_1": 15.6}[str(item.room_id)]
        assert 100 < flux * 0.45 / area < 200


def test_a_room_with_enough_lamps_gets_no_ceiling_lamp() -> None:
    assert not _hanging(_dressed(builtin_home(), 1))


def test_a_room_open_to_the_sky_gets_no_lamp() -> None:
    home = _dark()
    bare = replace(home, items=tuple(i for i in home.items if i.kind is not ItemKind.CEILING))
    mutable = _dressed(bare, 1)
    assert not _hanging(mutable)
    assert mutable.refused["lamps: no place under the ceiling"] == 2


def test_a_lamp_keeps_clear_of_items_as_high_as_the_ceiling() -> None:
    home = _dark()
    tower = box("tower", np.array([2.5, 1.25, 2.0]), np.array([0.6, 1.24, 0.6]), 0)
    full = replace(home, items=(*home.items, Item("tower", "tower", ItemKind.OBJECT, "0", (tower,), 3)))  # fmt: skip
    (lamp,) = [i for i in _hanging(_dressed(full, 1)) if i.room_id == "0_0"]
    low, high = lamp.bounds
    assert high[0] < 1.9 or low[0] > 3.1 or high[2] < 1.4 or low[2] > 2.6


def test_a_lamp_rests_exactly_on_the_nightstand() -> None:
    for seed in range(1, 9):
        mutable = _dressed(_dark(), seed)
        for item in mutable.items[len(mutable.source.items) :]:
            if "table_lamp" in item.source_class:
                stand = next(i for i in mutable.items if i.nyu40 == 32)
                assert item.bounds[0, 1] == pytest.approx(stand.bounds[1, 1], abs=0.0005)
                return
    pytest.fail("no seed of eight gave the nightstand a lamp")


def test_catalogue_lamps_come_from_the_users_library_by_its_share() -> None:
    piece, shape = made.table_lamp(np.random.default_rng(1), STYLE)
    pieces = tuple(replace(piece, id=f"T#{k}") for k in range(50))
    catalogue = Catalogue(pieces, lambda _piece: shape, "test", own=frozenset({"T#7"}))
    for share, least, most in ((1.0, 200, 200), (0.5, 70, 130), (0.0, 0, 20)):
        mutable, rng = MutableHouse(_dark(), 1, own_share=share), np.random.default_rng(5)
        drawn = [draw_lamp(mutable, catalogue, "table_lamp", rng) for _ in range(400)]
        ids = [lamp[0].id for lamp in drawn if lamp is not None][:200]
        assert least <= ids.count("T#7") <= most, share


def test_a_seed_decides_every_bit_and_no_share_adds_nothing() -> None:
    a, b = _dressed(_dark(), 3), _dressed(_dark(), 3)
    for x, y in zip(a.items, b.items, strict=True):
        assert x.id == y.id
        assert np.array_equal(x.bounds, y.bounds)
    assert len(_dressed(_dark(), 3, 0.0).items) == len(_dark().items)


@pytest.mark.parametrize(
    "make",
    [made.ceiling_dome, made.globe_pendant, made.shade_pendant, made.floor_lamp, made.table_lamp],
)
def test_a_generated_lamp_rests_at_zero_and_its_light_is_in_its_emitting_part(make) -> None:  # type: ignore[no-untyped-def]
    piece, shape = make(np.random.default_rng(1), STYLE)
    assert shape.bounds[0, 1] == pytest.approx(0, abs=1e-6)
    (light,) = shape.lights
    shining = shape.surfaces[light.emitting[0]].positions
    assert (shining.min(0) - 1e-6 <= light.position).all()
    assert (light.position <= shining.max(0) + 1e-6).all()
    assert piece.size[2] == pytest.approx(float(shape.bounds[1, 1]), abs=1e-6)
