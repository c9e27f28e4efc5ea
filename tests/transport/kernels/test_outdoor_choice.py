"""The choice of outdoor techniques by place: grid, weights, and unbiased pictures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.lighting import Group
from pbrs_farm.core.recipe import LightFields, recipe_from_name
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import sunsky
from pbrs_farm.transport.validation import known_rooms as rooms
from pbrs_farm.transport.validation.claims import blocks, z_scores

if choose_variant().startswith("scalar"):
    pytest.skip("the kernels need LLVM or CUDA", allow_module_level=True)

RECIPE = recipe_from_name("fast")
FIELDS: LightFields = RECIPE.light.model_copy(update={"filter": "box", "spp": 64})


@pytest.mark.parametrize(
    ("size", "edge", "shape"),
    [((4.0, 2.4, 0.2), 0.5, (9, 5, 1)), ((0.0, 0.0, 0.0), 0.5, (1, 1, 1))],
)
def test_voxels_are_half_a_metre(
    size: tuple[float, ...], edge: float, shape: tuple[int, ...]
) -> None:
    from pbrs_farm.transport.kernels.voxel_grid import voxel_grid

    corners = np.add([np.zeros(3), size], (1, 2, 3)).astype(np.float32)
    low, grid_shape, found_edge = voxel_grid(corners)
    assert (tuple(low), tuple(grid_shape), found_edge) == ((1, 2, 3), shape, edge)


def test_a_vast_home_has_at_most_the_fitting_voxels() -> None:
    from pbrs_farm.transport.kernels.voxel_grid import voxel_grid

    _low, shape, edge = voxel_grid(np.float32([(0, 0, 0), (900, 30, 700)]))
    assert shape.prod() <= 1 << 16
    assert (shape * edge >= (900, 30, 700)).all()


@pytest.mark.long
def test_a_corner_that_is_nowhere_has_no_voxel() -> None:
    # A face excluded from the light, and corners of no face.
    surfaces = rooms.shell((4.0, 2.5, 4.0), 0, front=False)
    box = rooms.box((1.5, 0.0, 2.2), (2.5, 0.6, 2.9), 0)
    corners = np.float32([*box.positions, (np.nan, 0, 0), (np.inf, 0, 1), (0, 1, 0)])
    faces = np.int32([*box.faces, np.arange(3) + len(box.positions)])
    surfaces.append(replace(box, positions=corners, faces=faces))
    house = rooms.house(surfaces, [rooms.matte("wall", 0.7)])
    camera = rooms.camera((2, 1.5, 0.3), (2, 0.5, 3))
    scene = LightScene.load(house, {}, RECIPE, sunsky(RECIPE, elevation_rad=0.6, azimuth_rad=0.35))
    assert scene.notes == ("1 degenerate faces left out of the light",)
    result = scene.render(camera.with_size(8, 6), "-", FIELDS.model_copy(update={"spp": 4}), 1)
    assert result.outdoor.mean() > 0


def test_a_voxel_prefers_the_techniques_that_light_it_and_keeps_all() -> None:
    from pbrs_farm.transport.kernels.outdoor_choice import MAX_TECHNIQUES, weights_by_place
    from pbrs_farm.transport.kernels.voxel_grid import VoxelGrid

    grid = VoxelGrid(np.array([[0, 0, 0], [3.2, 0.2, 0.2]], np.float32))
    assert grid.n_voxels == 7
    weights = np.array([0.2, 0.3, 0.5])
    counts = np.zeros((2, 7, MAX_TECHNIQUES), np.uint32)
    counts[0, [0, 3], :3] = 100  # vertices in two of seven voxels
    counts[1, 0, 1], counts[1, 3, 2] = 1024 * 80, 1024 * 40
    rows = weights_by_place(weights, counts, grid)
    assert np.allclose(rows.sum(1), 1)
    assert rows[0, 1] > 0.7
    assert rows[3, 2] > 0.7
    # Voxels without vertices use their neighbours, and isolated ones the view's weights.
    assert rows[1, 1] > 0.6
    assert rows[2, 2] > 0.6
    assert np.allclose(rows[5:], weights, atol=1e-5)
    # Every technique keeps a minimum weight everywhere.
    assert (rows >= 0.19 * weights).all()


def test_a_dim_sky_is_chosen_like_a_bright_one() -> None:
    # A hundred-thousandth of the light, with no part rounded away.
    house, camera = rooms.window_room(0.7)
    rows = []
    for scale in (1.0, 1e-5):
        sky = sunsky(RECIPE, elevation_rad=0.6, azimuth_rad=0.35)
        dim = replace(sky, dome=sky.dome * scale, sun_irradiance=sky.sun_irradiance * scale)
        _emitters, weights = LightScene.load(house, {}, RECIPE, dim).emitters(camera, FIELDS, 1)
        rows.append(weights.outdoor_by_place)
    assert np.ptp(rows[0], axis=0).max() > 0.1
    np.testing.assert_allclose(rows[1], rows[0], atol=0.01)


@pytest.mark.long
def test_weights_by_place_keep_the_mean_and_reduce_the_noise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Significance: 16 blocks, |z| < 4.5 each is missed by chance once in 9000 runs.
    from pbrs_farm.transport import pilot

    house, camera = rooms.window_room(0.7)
    camera = camera.with_size(32, 24)
    scene = LightScene.load(house, {}, RECIPE, sunsky(RECIPE, elevation_rad=0.6, azimuth_rad=0.35))
    by_place = [scene.render(camera, "-", FIELDS, seed) for seed in range(10, 18)]
    again = scene.render(camera, "-", FIELDS, 10)
    np.testing.assert_array_equal(again.outdoor, by_place[0].outdoor)
    monkeypatch.setattr(pilot, "weights_by_place", lambda _weights, _counts, _grid: None)
    everywhere = [scene.render(camera, "-", FIELDS, seed) for seed in range(20, 28)]
    sums = [[blocks(r.group(Group.OUTDOOR)) for r in runs] for runs in (by_place, everywhere)]
    assert np.abs(z_scores(*sums)).max() < 4.5
    noises = [np.mean([r.noise["outdoor"] ** 2 for r in runs]) for runs in (by_place, everywhere)]
    assert noises[0] < noises[1]


def test_a_home_of_another_size_is_traced_by_the_same_kernel() -> None:
    import drjit as dr

    traced = []
    for size in ((4.0, 2.5, 4.0), (9.0, 2.5, 7.0), (31.0, 6.0, 23.0)):
        lamp = rooms.bulb((1.0, 2.0, 1.0), 1, 900.0)
        house = rooms.house(
            rooms.shell(size, 0), [rooms.matte("wall", 0.7), rooms.BULB], lamps=[lamp]
        )
        sky = sunsky(RECIPE, elevation_rad=0.6, azimuth_rad=0.35)
        scene = LightScene.load(house, {}, RECIPE, sky)
        camera = rooms.camera((0.5, 1.5, 0.5), (2.0, 1.0, 2.0)).with_size(16, 12)
        scene.emitters(camera, FIELDS, 1)  # the first view measures lampshades
        dr.kernel_history_clear()
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            scene.render(camera, "-", FIELDS.model_copy(update={"spp": 1}), 2)
            kernels = dr.kernel_history([dr.KernelType.JIT])
        # One of paths and one of sun rays; the others are copies of a few operations.
        traced.append({k["hash"] for k in kernels if k["operation_count"] > 1000})
    assert len(traced[0]) == 2
    assert all(kernels == traced[0] for kernels in traced)
