"""Gates are checked on the repaired house: repair removes walls, and no item may float in front of the gap."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import EMPTY, Place
from pbrs_farm.core.classes import OTHERPROP
from pbrs_farm.core.house import House, Item, ItemKind, Material, Surface
from pbrs_farm.core.mesh import distances_to_triangles, triangle_bounds
from pbrs_farm.core.recipe import Recipe, RepairFields, with_settings
from pbrs_farm.dress import dressing
from pbrs_farm.dress.dressing import Dressed, refit_after_repair
from pbrs_farm.dress.models import hanging_piece
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.report import DressReport
from pbrs_farm.dress.space import house_space
from pbrs_farm.dress.walls.hanging import Hanging
from pbrs_farm.geometry.solids import box
from pbrs_farm.geometry.surface_points import item_triangles
from pbrs_farm.prepare.finished_house import finished_house
from pbrs_farm.prepare.passes import PASS, Preparation
from pbrs_farm.prepare.source import resolve
from pbrs_farm.repair import repair
from tests.repair.wall_rooms import Rect, covers, house, room, walls_around

LEFT: Rect = (0.0, 0.0, 4.0, 3.0)
RIGHT: Rect = (4.07, 0.0, 8.0, 3.0)


def _overlapping_walls() -> House:
    """Two rooms 7 cm apart, each with walls of 10 cm, so that each wall reaches into the other room."""
    a, b = room("0_0", LEFT), room("0_1", RIGHT)
    a, b = replace(a, name="Living room"), replace(b, name="Bedroom")
    walls = [replace(w, room_id="0_0") for w in walls_around(LEFT, "a", thickness=0.1)]
    walls += [replace(w, room_id="0_1") for w in walls_around(RIGHT, "b", thickness=0.1)]
    return house([*walls, *covers(a), *covers(b)], [a, b])


def _repaired(some: House) -> House:
    return repair(some, RepairFields(fallback_light=False))[0]


def _gaps(dressed: Dressed, repaired: House) -> dict[str, float]:
    """Distance of each hung item, by id, from the nearest wall, at most 10 cm."""
    walls = np.concatenate([item_triangles(i) for i in repaired.items if i.kind is ItemKind.WALL])
    gaps = {}
    for item in dressed.house.items[dressed.n_source :]:
        if dressed.pieces[item.source_class].place is Place.WALL:
            gaps[item.id] = _distance(item_triangles(item).reshape(-1, 3), walls)
    return gaps


def _distance(points: F64, corners: F64) -> float:
    low, high = triangle_bounds(corners)
    corners = corners[((low <= points.max(0) + 0.1) & (high >= points.min(0) - 0.1)).all(1)]
    pairs = np.repeat(points, len(corners), 0), np.tile(corners, (len(points), 1, 1))
    return min(0.1, float(distances_to_triangles(*pairs).min(initial=0.1)))


def _with_sockets(source: House) -> Dressed:
    """The house with a socket on each wall that a room sees, hung like the dressing's items."""
    with closing(MutableHouse(source, 1)) as mutable:
        lower = hanging_piece(
            "socket", "socket", OTHERPROP, [(box_at([0, 0.04, 0.01]), Material("white"))]
        )
        for space in house_space(mutable).rooms:
            hanging = Hanging(mutable, space, "walls")
            for k, face in enumerate(hanging.faces):
                hanging.hang(*lower, k, face.length / 2, 0.3)
        report = DressReport(house_id=source.id, seed=1)
        return Dressed(mutable.frozen(), report, mutable.used, len(source.items))


def box_at(middle: list[float]) -> Surface:
    return box("box", np.array(middle), np.array([0.04, 0.04, 0.01]), 0)


def test_items_of_a_wall_that_repair_drops_hang_on_the_remaining_one() -> None:
    dressed = _with_sockets(_overlapping_walls())
    repaired = _repaired(dressed.house)
    assert max(_gaps(dressed, repaired).values()) > 0.006
    refitted = refit_after_repair(repaired, dressed, EMPTY)
    after = _repaired(refitted.house)
    assert len(_gaps(refitted, after)) == 8
    assert max(_gaps(refitted, after).values()) <= 0.002
    assert refitted.report.moved_after_repair == 2
    assert refit_after_repair(after, refitted, EMPTY) is refitted


def test_an_item_without_a_wall_is_removed_with_its_contents() -> None:
    dressed = _with_sockets(_overlapping_walls())
    first = dressed.house.items[dressed.n_source]
    repaired = _repaired(dressed.house)
    # Its wall and all walls nearby are gone.
    far = repaired.with_items(
        i for i in repaired.items if i.kind is not ItemKind.WALL or _is_far(i, first)
    )
    refitted = refit_after_repair(far, dressed, EMPTY)
    assert first.id not in {i.id for i in refitted.house.items}
    assert refitted.report.refused["walls: floated or sank after repair"] >= 1
    assert sum(refitted.report.added.values()) == len(refitted.house.items) - refitted.n_source


def _is_far(wall: Item, thing: Item) -> bool:
    return bool((wall.bounds[0] > thing.bounds[1] + 0.1).any() or (wall.bounds[1] < thing.bounds[0] - 0.1).any())  # fmt: skip


def test_a_house_whose_walls_stay_is_unchanged() -> None:
    a = replace(room("0_0", LEFT), name="Living room")
    dressed = _with_sockets(house([*walls_around(LEFT), *covers(a)], [a]))
    assert refit_after_repair(_repaired(dressed.house), dressed, EMPTY) is dressed


def test_a_run_measures_the_gates_on_the_repaired_house(monkeypatch: pytest.MonkeyPatch) -> None:
    with_sockets = _with_sockets(_overlapping_walls())
    monkeypatch.setattr(dressing, "dressed_house", lambda *_: with_sockets)
    source = resolve("builtin").model_copy(update={"dress_seed": 1})
    recipe = with_settings(
        Recipe(), {"dress.catalogue": "generated", "repair.fallback_light": False}
    )
    work = Preparation(source, recipe, lambda _share: None, finished_house, with_sockets.house)
    finished, _repairs, report = PASS["repair"].run(PASS["dress"].run(work)).finished
    assert report is not None
    assert report.moved_after_repair == 2
    assert (
        max(
            _gaps(
                with_sockets._replace(house=finished, n_source=_n_source(finished)), finished
            ).values()
        )
        <= 0.002
    )


def _n_source(finished: House) -> int:
    return next(k for k, item in enumerate(finished.items) if item.id.startswith("dress-"))
