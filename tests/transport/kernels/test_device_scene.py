"""Rays of the path tracer find the first surface with each of Embree's intersection tests."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrs_farm.raycast.tracer import scene_from_mesh
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.scene_tables import SceneTables
from pbrs_farm.transport.scene_tables.sky import dark_sky
from tests.transport import hard_rooms
from tests.transport.recorded_blocks import RECIPE

N_RAYS = 20_000

pytestmark = pytest.mark.skipif(
    choose_variant().startswith("scalar"), reason="the kernels need LLVM or CUDA"
)


@pytest.fixture
def tables() -> SceneTables:
    house, _camera = hard_rooms.covered_cup()
    return LightScene.load(house, {}, RECIPE, dark_sky()).tables


def faces_hit(scene: Any, tables: SceneTables) -> NDArray[np.int64]:
    """(N_RAYS,) faces hit by rays from the middle of the room, -1 = none."""
    import drjit as dr
    import mitsuba as mi

    directions = np.random.default_rng(3).standard_normal((3, N_RAYS)).astype(np.float32)
    directions /= np.linalg.norm(directions, axis=0)
    eye = (tables.positions.min(axis=0) + tables.positions.max(axis=0)) / 2
    o = dr.repeat(mi.Point3f(*map(float, eye)), N_RAYS)
    si = scene.intersect(o, mi.Vector3f(directions), mi.Bool(True))
    return np.where(si.valid.numpy(), si.face.numpy().astype(np.int64), -1)


@pytest.mark.parametrize(("limit", "counted"), [("FACES", "faces"), ("LAMPS", "lamps")])
def test_the_faster_test_finds_the_same_faces(
    tables: SceneTables, monkeypatch: pytest.MonkeyPatch, limit: str, counted: str
) -> None:
    from pbrs_farm.transport.kernels import device_scene

    fast = device_scene.DeviceScene(tables)
    monkeypatch.setattr(device_scene, f"MAX_FAST_{limit}", len(getattr(tables, counted)) - 1)
    plain = device_scene.DeviceScene(tables)
    hit_faces = faces_hit(fast, tables)
    assert (fast.fast is None, plain.fast is None) == (False, True)
    assert (hit_faces >= 0).mean() > 0.9
    assert (hit_faces == faces_hit(plain, tables)).mean() > 0.9999


def test_a_ray_that_slips_out_through_the_faster_test_is_traced_again(tables: SceneTables) -> None:
    # Without the most-hit faces the tree is like one with gaps along its edges.
    import mitsuba as mi

    from pbrs_farm.transport.kernels.device_scene import DeviceScene

    scene = DeviceScene(tables)
    before = faces_hit(scene, tables)
    last = np.bincount(before[before >= 0]).argmax()
    scene.fast = scene_from_mesh(mi, tables.positions, tables.faces[:last], watertight=False)
    after = faces_hit(scene, tables)
    assert ((before == last) & (after == last)).any()
    assert ((after >= 0) == (before >= 0)).all()
