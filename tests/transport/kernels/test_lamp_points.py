"""Points on lamps: all on the visible side, with the stated pdf, and unbiased."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pbrs_farm.core.recipe import LightFields, recipe_from_name
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import dark_sky
from pbrs_farm.transport.validation import known_rooms as rooms
from pbrs_farm.transport.validation.claims import blocks, z_scores

if choose_variant().startswith("scalar"):
    pytest.skip("the kernels need LLVM or CUDA", allow_module_level=True)

RECIPE = recipe_from_name("fast")
FIELDS: LightFields = RECIPE.light.model_copy(update={"filter": "box", "spp": 64})


def scene_of(lamp_radius: float, *, symmetric: bool) -> LightScene:
    """A closed room with one bulb near its floor, whose symmetry is known or not."""
    lamp = rooms.bulb((2.0, 0.5, 2.5), 1, 900.0, radius=lamp_radius)
    house = rooms.house(
        rooms.shell((4.0, 2.5, 4.0), 0), [rooms.matte("wall", 0.6), rooms.BULB], lamps=[lamp]
    )
    scene = LightScene.load(house, {}, RECIPE, dark_sky())
    if not symmetric:
        unknown = np.zeros_like(scene.tables.lamp_symmetries)
        scene.tables = replace(scene.tables, lamp_symmetries=unknown)
    return scene


def pictures(scene: LightScene, first_seed: int) -> list[Any]:
    camera = rooms.camera((2, 1.5, 0.3), (2, 0.5, 3)).with_size(32, 24)
    return [scene.render(camera, "-", FIELDS, first_seed + k).indoor for k in range(8)]


def test_every_point_of_a_ball_faces_the_vertex_and_is_on_the_ball() -> None:
    import drjit as dr
    import mitsuba as mi

    from pbrs_farm.transport.kernels.lamp_points import LampPointSampler

    scene = scene_of(0.3, symmetric=True)
    n = 20_000
    sampler = LampPointSampler(scene.tables)
    rng = np.random.default_rng(3)
    u, uv = mi.Float(rng.random(n)), mi.Point2f(rng.random((2, n)))
    p, on = mi.Point3f(2.0, 2.0, 1.0), mi.Bool(True)
    q, normal, is_seen = sampler.sample(scene.device_scene, dr.zeros(mi.UInt32, n), p, u, uv, on)
    facing = is_seen.numpy()
    to_vertex = np.array((2.0, 2.0, 1.0))[:, None] - q.numpy()
    assert ((to_vertex * normal.numpy()).sum(0)[facing] >= 0).all()
    # A share (1 - r / d) / 2 of a sphere's points face a vertex at distance d from its centre;
    # choosing between opposite points doubles it.
    assert facing.mean() == pytest.approx(1 - 0.3 / np.sqrt(1.5**2 + 1.5**2), abs=0.02)
    radii = np.linalg.norm(q.numpy() - np.array((2.0, 0.5, 2.5))[:, None], axis=0)
    assert radii.min() > 0.28
    assert radii.max() < 0.301


@pytest.mark.long
@pytest.mark.parametrize("radius", [0.05, 0.4])
def test_shadow_rays_to_the_near_side_keep_the_mean_and_reduce_the_noise(radius: float) -> None:
    # Significance: 16 blocks, |z| < 4.5 each is missed by chance once in 9000 runs.
    near = pictures(scene_of(radius, symmetric=True), 10)
    pictures_of_both = pictures(scene_of(radius, symmetric=False), 20)
    assert (
        np.abs(z_scores([blocks(x) for x in near], [blocks(x) for x in pictures_of_both])).max()
        < 4.5
    )
    variances = [float(np.median(np.var(x, axis=0))) for x in (near, pictures_of_both)]
    assert variances[0] < 0.8 * variances[1]
