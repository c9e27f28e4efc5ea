"""Placement of models: a model that fits is placed, whatever else is requested."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shapely.geometry.base import BaseGeometry

import pbrs_farm as pf
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import House, Item, ItemKind, Room
from pbrs_farm.geometry.solids import quads_surface
from pbrs_farm.scene.physics import settled_poses
from pbrs_farm.scene.placing import Target, free_pose, scattered_poses
from tests.dress.furniture import DEPTH, WIDTH, boards, house, room, solid
from tests.hypothesis_profiles import examples

EDGES_M = {"small": 0.04, "middle": 0.25, "large": 0.95}
"""Cubes by name. A stool takes the small one, a table the middle one, the floor all three."""

HEIGHTS_M = {"stool": 0.3, "table": 0.75, "floor": 0.0}
LARGEST = {"stool": 1, "table": 2, "floor": 3, "roof": 0, "rail": 0}
"""How many of the models, by size, fit on a target; a roof and a rail have no level top."""


def _roof() -> Item:
    """A sheet at 45 degrees."""
    corners = np.array([[[3.0, 1.0, 2.0], [3.0, 1.0, 2.8], [3.8, 1.8, 2.8], [3.8, 1.8, 2.0]]])
    surface = quads_surface("sheet", corners, 0)
    return Item("roof", "roof", ItemKind.OBJECT, "0", (surface,), 7, room_id="0_0")


def _home() -> tuple[House, dict[str, Target]]:
    floor = solid("floor", [0, -0.1, 0], [WIDTH, 0, DEPTH])
    floor = Item("floor", "floor", ItemKind.FLOOR, "0", floor.surfaces, 2, room_id="0_0")
    items = {
        "stool": solid("stool", [0.2, 0, 0.2], [0.45, HEIGHTS_M["stool"], 0.45]),
        "table": solid("table", [2.4, 0, 0.2], [3.8, HEIGHTS_M["table"], 1.1]),
        "rail": boards("rail", [([0.1, 1.0, 2.9], [1.5, 1.05, 2.91])], 40),
        "roof": _roof(),
    }
    home = house(floor, *items.values())
    return home, {**items, "floor": room()}


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> dict[str, pf.Model]:
    folder = tmp_path_factory.mktemp("models")
    for name, edge in EDGES_M.items():
        trimesh.creation.box((edge, edge, edge)).export(folder / f"{name}.glb")
    return {name: pf.model(folder / f"{name}.glb", category="box") for name in EDGES_M}


def _outline(model: pf.Model, pose: F64) -> tuple[BaseGeometry, float, float]:
    points = model.shape.points @ pose[:3, :3].T + pose[:3, 3]
    hull = shapely.MultiPoint(points[:, [0, 2]]).convex_hull
    return hull, float(points[:, 1].min()), float(points[:, 1].max())


def _area_of(name: str) -> shapely.Polygon:
    target = _home()[1][name]
    if isinstance(target, Room):
        return shapely.box(0, 0, WIDTH, DEPTH)
    (x0, _, z0), (x1, _, z1) = target.bounds
    return shapely.box(x0, z0, x1, z1)


names = st.lists(st.sampled_from(sorted(EDGES_M)), min_size=1, max_size=3, unique=True)
targets = st.lists(st.sampled_from(sorted(LARGEST)), min_size=1, max_size=5, unique=True)


@given(names=names, on=targets, n=st.integers(1, 2), seed=st.integers(0, 1000))
@settings(
    max_examples=examples(60),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
def test_every_model_that_fits_somewhere_is_placed_there(
    models: dict[str, pf.Model], names: list[str], on: list[str], n: int, seed: int
) -> None:
    home, supports = _home()
    sizes = sorted(EDGES_M, key=EDGES_M.__getitem__)
    fits = {(m, t) for m in names for t in on if sizes.index(m) < LARGEST[t]}
    arguments = [models[m] for m in names], n, [supports[t] for t in on], seed
    if not fits:
        says = "has space for 0 of" if any(LARGEST[t] for t in on) else "no level surface"
        with pytest.raises(BadInput, match=says):
            scattered_poses(home, *arguments)
        return
    placed = scattered_poses(home, *arguments)
    assert len(placed) == n
    stood = [_outline(model, pose) for model, pose in placed]
    for (model, _pose), (outline, low, _high) in zip(placed, stood, strict=True):
        spots = [
            t for m, t in fits
            if models[m] is model and low == pytest.approx(HEIGHTS_M[t], abs=1e-5)
        ]  # fmt: skip
        assert len(spots) == 1
        assert _area_of(spots[0]).buffer(1e-6).contains(outline)
    for k, (outline, low, high) in enumerate(stood):
        for lower, other_low, other_high in stood[:k]:
            assert low >= other_high or other_low >= high or not outline.intersects(lower)


@given(name=st.sampled_from(sorted(EDGES_M)), on=targets, seed=st.integers(0, 1000))
@settings(
    max_examples=examples(40),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
def test_one_model_finds_a_target_with_space(
    models: dict[str, pf.Model], name: str, on: list[str], seed: int
) -> None:
    home, supports = _home()
    rank = sorted(EDGES_M, key=EDGES_M.__getitem__).index(name)
    heights = [HEIGHTS_M[t] for t in on if rank < LARGEST[t]]
    if heights:
        pose = free_pose(home, models[name], [supports[t] for t in on], seed)
        _hull, low, _high = _outline(models[name], pose)
        assert any(low == pytest.approx(height, abs=1e-5) for height in heights)
    else:
        with pytest.raises(BadInput, match=r"no free place for"):
            free_pose(home, models[name], [supports[t] for t in on], seed)


def test_nothing_is_placed_on_the_contents_of_a_table(models: dict[str, pf.Model]) -> None:
    home, supports = _home()
    tray = solid("tray", [2.4, 0.75, 0.2], [3.4, 0.8, 1.1])
    home = house(*home.items, tray)
    placed = scattered_poses(home, [models["middle"]], 1, [supports["table"]], 1)
    outline, _low, _high = _outline(*placed[0])
    assert outline.bounds[0] > 3.4
    with pytest.raises(BadInput, match=r"has space for [1-3] of 20 objects"):
        scattered_poses(home, [models["middle"]], 20, [supports["table"]], 1)


@pytest.mark.parametrize("on", [["roof"], ["roof", "rail"]])
def test_targets_without_a_level_top_are_refused_with_advice(
    models: dict[str, pf.Model], on: list[str]
) -> None:
    home, supports = _home()
    for place in (scattered_poses, settled_poses):
        with pytest.raises(BadInput, match="no level surface: roof") as caught:
            place(home, [models["small"]], 1, [supports[t] for t in on], 0)
        assert "level top" in caught.value.hint


def test_dropped_models_skip_targets_without_space(models: dict[str, pf.Model]) -> None:
    home, supports = _home()
    # A board 20 cm over the stool leaves no room for a middle cube above it.
    home = house(*home.items, solid("board", [0.1, 0.5, 0.1], [0.6, 0.52, 0.6]))
    on = [supports[t] for t in ("stool", "roof", "table")]
    placed = settled_poses(home, [models["middle"], models["small"]], 4, on, 2)
    assert len(placed) == 4
    for model, pose in placed:
        _hull, low, _high = _outline(model, pose)
        if model is models["middle"]:
            assert low == pytest.approx(HEIGHTS_M["table"], abs=2e-3)


def test_furniture_outside_rooms_is_a_target_too(models: dict[str, pf.Model]) -> None:
    home, _known = _home()
    bench = solid("bench", [6, 0, 1], [7, 0.45, 1.6])
    bench = Item("bench", "bench", ItemKind.OBJECT, "0", bench.surfaces, 40)
    pose = free_pose(house(*home.items, bench), models["middle"], [bench], 0)
    assert _outline(models["middle"], pose)[1] == pytest.approx(0.45, abs=1e-5)
