"""Closed parts of a piece among thousands of loose ones."""

import numpy as np

from pbrs_farm.core.house import Item, ItemKind, Surface
from pbrs_farm.geometry.solids import box
from pbrs_farm.repair.structure.booleans import TagTable
from pbrs_farm.repair.structure.closed_shells import ClosedShells, shells_from_item


def _item(*surfaces: Surface) -> Item:
    return Item("plant", "plant", ItemKind.OBJECT, "0", surfaces)


def _pot(x: float) -> Surface:
    return box("pot", np.array([x, 0.2, 0.0]), np.array([0.1, 0.2, 0.1]), 0)


def test_the_pot_of_a_plant_is_found_among_20_000_leaves() -> None:
    rng = np.random.default_rng(0)
    places = rng.uniform(1, 2, (20_000, 1, 3)) + rng.uniform(0, 0.02, (20_000, 3, 3))
    corners = places.reshape(-1, 3).astype(np.float32)
    faces = np.arange(60_000, dtype=np.int32).reshape(-1, 3)
    shells = ClosedShells(_item(Surface("leaves", corners, faces, 0), _pot(0.0)))
    pot = shells.within(np.full(3, -9.0), np.full(3, 9.0))
    assert pot is not None
    assert round(float(pot.volume()), 6) == 0.016
    assert shells.within(np.full(3, 1.0), np.full(3, 9.0)) is None


def test_a_shell_of_several_has_only_the_vertices_it_uses() -> None:
    two = _item(_pot(0.0), _pot(1.0))
    shells = shells_from_item(two, 0, TagTable())
    assert shells is not None
    solids, parts = zip(*shells, strict=True)
    assert [round(float(s.volume()), 6) for s in solids] == [0.016, 0.016]
    assert [len(patch.positions) for part in parts for patch in part] == [24, 24]
