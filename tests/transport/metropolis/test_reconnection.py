"""Suffixes reconnected to many pixels: grouping, and unbiased sharing."""

from __future__ import annotations

from collections.abc import Callable

import drjit as dr
import numpy as np
import pytest

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import House, Material, MaterialKind
from pbrs_farm.core.lighting import Group
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import dark_sky
from pbrs_farm.transport.validation import known_rooms as rooms
from pbrs_farm.transport.validation.claims import blocks, z_scores
from tests.inputs.rendered_rooms import FIELDS, METROPOLIS, RECIPE
from tests.transport import hard_rooms

pytestmark = pytest.mark.skipif(
    choose_variant().startswith("scalar"), reason="the kernels need LLVM or CUDA"
)


@pytest.mark.parametrize(
    ("height", "width", "n"), [(24, 32, 64), (23, 31, 256), (5, 7, 1024), (4, 4, 1)]
)
def test_every_pixel_is_in_one_group_of_at_most_the_requested_size(
    height: int, width: int, n: int
) -> None:
    from pbrs_farm.transport.metropolis.film import stratified_groups

    groups = stratified_groups(height, width, n, seed=3)
    slots, pixels = groups.slots, groups.pixels
    assert groups.n <= max(n, 1)
    assert len(pixels) % groups.n == 0
    assert np.array_equal(pixels[slots], np.arange(height * width))
    assert len(np.unique(slots)) == height * width


def test_groups_are_spread_and_neighbours_are_apart() -> None:
    from pbrs_farm.transport.metropolis.film import stratified_groups

    groups = stratified_groups(64, 64, 256, seed=1)
    group = (groups.slots // groups.n).reshape(64, 64)
    cells = group.reshape(16, 4, 16, 4).swapaxes(1, 2).reshape(256, 16)
    assert np.array_equal(np.sort(cells, 1), np.tile(np.arange(16), (256, 1)))


def test_importance_is_high_in_the_dark_and_bounded() -> None:
    from pbrs_farm.transport.metropolis.chain_start import pixel_importance

    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 48 * 64, 30_000).astype(np.uint32)
    levels = np.where(pixels % 64 < 32, 1.0, 0.01).astype(np.float32)
    importance = pixel_importance((48, 64), pixels, levels)
    assert importance.shape == (48, 64)
    assert importance[:, :16].mean() < 0.1 * importance[:, 48:].mean()
    assert importance.min() > 0
    assert importance.max() <= 20.0


def test_a_black_picture_has_even_importance() -> None:
    from pbrs_farm.transport.metropolis.chain_start import pixel_importance

    importance = pixel_importance((3, 4), np.zeros(10, np.uint32), np.zeros(10, np.float32))
    assert np.array_equal(importance, np.ones((3, 4), np.float32))


def coated_room() -> tuple[House, Camera]:
    """Every kind of second vertex: rough and smooth coats, a metal, a translucent sheet, glass."""
    surfaces = rooms.shell((4.0, 2.5, 4.0), 0)
    surfaces.append(rooms.box((2.4, 0.0, 2.4), (3.2, 0.6, 3.2), 1, "smooth"))
    surfaces.append(rooms.box((0.8, 0.0, 2.6), (1.6, 0.9, 3.4), 2, "metal"))
    surfaces += rooms.panel((0.0, 0.6, 2.0), (1.2, 2.0, 2.02), (0.3, 0.9, 0.5, 1.1), 3)
    surfaces.append(rooms.sphere((3.2, 1.2, 1.0), 0.3, 4, n=16))
    materials = [
        Material("coat", diffuse=(0.7, 0.6, 0.5), specular=(0.5, 0.5, 0.5), shininess=40.0),
        Material("smooth", diffuse=(0.3, 0.5, 0.6), specular=(0.9, 0.9, 0.9), shininess=900.0),
        Material("metal", diffuse=(0.05, 0.05, 0.05), specular=(0.8, 0.7, 0.4), shininess=60.0),
        Material("sheet", diffuse=(0.4, 0.4, 0.4), kind=MaterialKind.SHADE, opacity=0.5),
        Material("glass", kind=MaterialKind.GLASS, opacity=0.1),
        rooms.BULB,
    ]
    lamps = [rooms.bulb((2.0, 2.0, 2.0), 5, 900.0), rooms.bulb((0.5, 1.2, 2.4), 5, 500.0)]
    return rooms.house(surfaces, materials, lamps=lamps), rooms.camera(
        (3.6, 1.5, 0.4), (1.6, 0.8, 3)
    )


def slot_room() -> tuple[House, Camera]:
    """A slot of 6 cm between two boxes, seen from its open end: most light in it travels a few centimetres."""
    surfaces = rooms.shell((4.0, 2.5, 4.0), 0)
    surfaces.append(rooms.box((1.0, 0.0, 2.4), (1.97, 0.6, 3.2), 1, "left"))
    surfaces.append(rooms.box((2.03, 0.0, 2.4), (3.0, 0.6, 3.2), 1, "right"))
    materials = [rooms.matte("wall", 0.7), rooms.matte("box", 0.8), rooms.BULB]
    lamps = [rooms.bulb((2.3, 1.9, 1.6), 2, 900.0)]
    return rooms.house(surfaces, materials, lamps=lamps), rooms.camera(
        (2, 0.5, 1.9), (2, 0.25, 2.6)
    )


def shaded_room() -> tuple[House, Camera]:
    """A bulb deep in a shade, another in a cup in a globe, guided rays, coated walls and boxes."""
    surfaces = rooms.shell((4.0, 2.5, 4.0), 0)
    surfaces.append(hard_rooms.cylinder((2.0, 1.3, 2.2), 0.12, 0.35, 1))
    surfaces.append(rooms.box((2.4, 0.0, 2.4), (3.2, 0.6, 3.2), 2, "glossy"))
    surfaces.append(hard_rooms.cylinder((0.9, 1.42, 2.8), 0.06, 0.1, 1))
    surfaces.append(rooms.sphere((0.9, 1.5, 2.8), 0.12, 3, n=16))
    materials = [
        Material("coat", diffuse=(0.6, 0.6, 0.5), specular=(0.6, 0.6, 0.6), shininess=60.0),
        rooms.matte("white", 0.7),
        Material("glossy", diffuse=(0.3, 0.3, 0.3), specular=(0.9, 0.9, 0.9), shininess=150.0),
        Material("glass", kind=MaterialKind.GLASS, opacity=0.1),
        rooms.BULB,
    ]
    lamps = [
        rooms.bulb((2.0, 1.45, 2.2), 4, 800.0, radius=0.03),
        rooms.bulb((0.9, 1.47, 2.8), 4, 300.0, radius=0.02),
    ]
    return rooms.house(surfaces, materials, lamps=lamps), rooms.camera(
        (0.5, 1.5, 0.4), (2.2, 0.8, 2.6)
    )


# The tolerance of the mean is above 4 standard deviations of four pictures of each.
@pytest.mark.long
@pytest.mark.parametrize(
    ("room", "tolerance"),
    [
        pytest.param(coated_room, 0.02, marks=pytest.mark.slow),
        (slot_room, 0.02),
        pytest.param(shaded_room, 0.08, marks=pytest.mark.slow),
    ],
)
def test_reconnected_suffixes_leave_the_mean_as_path_has_it(
    room: Callable[[], tuple[House, Camera]], tolerance: float
) -> None:
    # Significance: 16 blocks, |z| < 5: missed by chance once in 100,000 runs.
    house, camera = room()
    scene = LightScene.load(house, {}, RECIPE, dark_sky())
    camera = camera.with_size(32, 24)
    plain = FIELDS.model_copy(update={"spp": 512, "pilot_spp": 4})
    shown = METROPOLIS.model_copy(update={"tail_pixels": 256, "direct_spp": 128})
    paths = [scene.render(camera, "0_0", plain, 10 + k) for k in range(4)]
    chains = [scene.render(camera, "0_0", shown, 50 + k) for k in range(4)]
    ours = [blocks(r.group(Group.INDOOR)) for r in chains]
    theirs = [blocks(r.group(Group.INDOOR)) for r in paths]
    z = z_scores(ours, theirs)
    assert np.abs(z).max() < 5
    assert np.mean(ours) == pytest.approx(np.mean(theirs), rel=tolerance)


def test_kernels_with_other_local_memory_are_other_kernels() -> None:
    # The larger kernel first: if both shared a kernel, the smaller one would have spare room.
    house, camera = rooms.window_room(0.7, lumen=800)
    scene = LightScene.load(house, {}, RECIPE, dark_sky())
    few = METROPOLIS.model_copy(update={"direct_spp": 1, "mutations_per_pixel": 1})
    kernels: dict[int, set[tuple[int, str]]] = {512: set(), 256: set()}
    for n in (512, 512, 256, 256):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            fields = few.model_copy(update={"tail_pixels": n})
            scene.render(camera.with_size(32, 24), "0_0", fields, 7)
            compiled = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
        kernels[n] |= {(k["operation_count"], k["hash"]) for k in compiled}
    large, small = kernels[512] - kernels[256], kernels[256] - kernels[512]
    assert {operations for operations, _ in large} & {operations for operations, _ in small}


def test_reconnecting_suffixes_cuts_the_error_of_the_same_chains() -> None:
    house, camera = rooms.window_room(0.7, lumen=800)
    scene = LightScene.load(house, {}, RECIPE, dark_sky())
    camera = camera.with_size(32, 24)
    noise = []
    for n in (0, 256):
        fields = METROPOLIS.model_copy(update={"tail_pixels": n, "direct_spp": 128})
        noise.append(scene.render(camera, "0_0", fields, 7).noise["indoor"])
    assert noise[1] < 0.6 * noise[0]
