"""Sunlit points give the same light as paths that find it by chance, with less noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import House, Material, MaterialKind
from pbrs_farm.core.lighting import Group
from pbrs_farm.core.optics_fields import LensFields
from pbrs_farm.core.recipe import LightFields, recipe_from_name
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.light_result import LightResult
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import sunsky
from pbrs_farm.transport.validation import known_rooms as rooms
from pbrs_farm.transport.validation.claims import blocks, z_scores
from tests.inputs.bumpy_coats import waves, with_material
from tests.transport import hard_rooms

if choose_variant().startswith("scalar"):
    pytest.skip("the kernels need LLVM or CUDA", allow_module_level=True)

RECIPE = recipe_from_name("fast")
FIELDS: LightFields = RECIPE.light.model_copy(update={"filter": "box", "spp": 64})


def sunny(
    house: House, *, azimuth_rad: float = 0.35, textures: dict[str, np.ndarray] | None = None
) -> LightScene:
    """The scene of a house with the sun in front of its window, 29 degrees high."""
    sky = sunsky(RECIPE, elevation_rad=0.5, azimuth_rad=azimuth_rad)
    return LightScene.load(house, textures or {}, RECIPE, sky)


def bare_room() -> tuple[House, Camera]:
    """The window room: a patch of sun on floor and table, a sill outside."""
    house, camera = rooms.window_room(0.7)
    return house, camera.with_size(32, 24)


def hard_room() -> tuple[House, Camera]:
    """The window room with a coat on all walls, a smooth ball and a pane of glass in the patch, a mirror
    beside it, and a translucent shade.
    """
    house, camera = bare_room()
    coated = replace(house.materials[0], specular=(0.5, 0.5, 0.5), roughness=0.6)
    glass = Material("glass", kind=MaterialKind.GLASS, opacity=0.1)
    mirror = Material("mirror", kind=MaterialKind.MIRROR, specular=(1.0, 1.0, 1.0))
    shade = Material("shade", kind=MaterialKind.SHADE, diffuse=(0.9, 0.9, 0.9))
    n = len(house.materials)
    things = (
        rooms.sphere((1.6, 0.25, 1.6), 0.25, n, n=24),
        rooms.quad([(2.4, 0, 1.2), (2.4, 1, 1.2), (2.4, 1, 2.4), (2.4, 0, 2.4)], n + 1),
        rooms.quad([(1.0, 0, 1.4), (1.0, 0.8, 1.4), (1.3, 0.8, 2.4), (1.3, 0, 2.4)], n + 2),
        rooms.quad([(1.9, 0.9, 0.3), (2.6, 0.9, 0.3), (2.6, 1.4, 0.5), (1.9, 1.4, 0.5)], n + 3),
    )
    materials = (coated, *house.materials[1:], rooms.matte("ball", 0.8), glass, mirror, shade)
    (walls,) = house.items
    items = (replace(walls, surfaces=(*walls.surfaces, *things)),)
    return replace(house, items=items, materials=materials), camera


def shiny_room() -> tuple[House, Camera]:
    """The window room with a plate of brushed metal in the patch, which reflects the sun onto the walls."""
    house, camera = bare_room()
    coat = replace(rooms.matte("plate", 0.0), specular=(0.9, 0.8, 0.7), roughness=0.6)
    (walls,) = house.items
    plate = [(0.8, 0.02, 0.3), (0.8, 0.02, 2.4), (3.2, 0.02, 2.4), (3.2, 0.02, 0.3)]
    surfaces = (*walls.surfaces, rooms.quad(plate, len(house.materials)))
    items = (replace(walls, surfaces=surfaces),)
    return replace(house, items=items, materials=(*house.materials, coat)), camera


def seen_all_round() -> tuple[House, Camera]:
    """The window room as a panorama."""
    house, camera = bare_room()
    intrinsics = LensFields(model="equirect").intrinsics(camera.intrinsics)
    return house, Camera(intrinsics, camera.world_from_camera).with_size(32, 16)


def renders(scene: LightScene, camera: Camera, seeds: range) -> list[LightResult]:
    return [scene.render(camera, "-", FIELDS, seed) for seed in seeds]


def hide_points(patch: pytest.MonkeyPatch) -> None:
    """Disable sunlit points."""
    from pbrs_farm.transport.kernels.sunlit_points import SunlitPoints

    real = SunlitPoints.set_view
    patch.setattr(SunlitPoints, "set_view", lambda self, _vertices: real(self, None))


def renders_by_chance(scene: LightScene, camera: Camera, fields: LightFields) -> list[LightResult]:
    """Eight pictures without sunlit points."""
    with pytest.MonkeyPatch.context() as patch:
        hide_points(patch)
        return [scene.render(camera, "-", fields, seed) for seed in range(20, 28)]


@pytest.mark.quick(1)
@pytest.mark.parametrize(
    ("room", "most"),
    [(bare_room, 0.4), (hard_room, 0.8), (shiny_room, 0.44), (seen_all_round, 0.6)],
)
def test_sunlit_points_keep_the_mean_and_reduce_the_noise(
    room: Callable[[], tuple[House, Camera]], most: float
) -> None:
    # Significance: 16 blocks, |z| < 4.5 each is missed by chance once in 9000 runs.
    house, camera = room()
    scene = sunny(house)
    by_chance = renders_by_chance(scene, camera, FIELDS)
    by_points = renders(scene, camera, range(10, 18))
    again = scene.render(camera, "-", FIELDS, 10)
    np.testing.assert_array_equal(again.outdoor, by_points[0].outdoor)
    sums = [[blocks(r.group(Group.OUTDOOR)) for r in runs] for runs in (by_points, by_chance)]
    assert np.abs(z_scores(*sums)).max() < 4.5
    noises = [np.mean([r.noise["outdoor"] ** 2 for r in runs]) for runs in (by_points, by_chance)]
    assert noises[0] < most * noises[1]


@pytest.mark.long
def test_points_on_bumpy_coats_keep_the_mean() -> None:
    # Significance: 16 blocks, |z| < 4.5 each is missed by chance once in 9000 runs.
    house, camera = bare_room()
    coat = {"specular": (0.6, 0.5, 0.4), "roughness": 0.5, "normal_texture_id": "waves"}
    scene = sunny(with_material(house, **coat), textures={"waves": waves(0.4)})
    pictures_by_chance = (
        renders_by_chance(scene, camera, FIELDS),
        renders(scene, camera, range(10, 18)),
    )
    sums = [[blocks(r.group(Group.OUTDOOR)) for r in runs] for runs in pictures_by_chance]
    assert np.abs(z_scores(*sums)).max() < 4.5


def test_a_room_without_sun_has_no_points() -> None:
    house, camera = bare_room()
    for azimuth_rad, some in ((0.35, True), (np.pi, False)):
        scene = sunny(house, azimuth_rad=azimuth_rad)
        emitters, _weights = scene.emitters(camera, FIELDS, 1)
        emitters.sunlit.trace(scene.device_scene, emitters.sun, 1000, 1)
        p, n = np.float32([2, 1.2, 1]), 64
        sample = points_seen(emitters, p, n)
        assert sample.any() == some


def points_seen(emitters: object, p: np.ndarray, n: int) -> np.ndarray:
    """(n,) bool: whether each point is visible from p."""
    import drjit as dr
    import mitsuba as mi

    u = (dr.arange(mi.Float, n) + 0.5) / n
    point = mi.Point3f(*(mi.Float(float(x)) + 0 * u for x in p))
    return emitters.sunlit.sample(point, u, mi.Bool(True)).valid.numpy()  # type: ignore[attr-defined]


def test_points_are_on_sunlit_surfaces_in_the_order_of_their_groups() -> None:
    from pbrs_farm.transport.kernels.sun_rays import COS_SUN, PLANE_PDF, RADIANCE
    from pbrs_farm.transport.kernels.sunlit_tables import find_used_cells, trace_points

    house, camera = bare_room()
    scene = sunny(house)
    emitters, weights = scene.emitters(camera, FIELDS, 1)
    grid, device = emitters.outdoor_choice.grid, scene.device_scene
    used = find_used_cells(device, emitters.sun, grid, weights.vertices)
    assert used.shares.sum() == pytest.approx(1)
    tables = trace_points(device, emitters.sun, used, 1 << 20, 3)
    rows = tables.rows
    assert len(rows) > 1000
    assert tables.first[-1] == len(rows)
    assert (rows[:, COS_SUN] > 0).all()
    assert (rows[:, PLANE_PDF] > 0).all()
    assert (rows[:, RADIANCE] > 0).all()
    # Each begins a ray that leaves through the window, or is in front of it.
    towards = np.asarray(scene.sky.sun_direction)
    inside = rows[:, 2] > 1e-3
    assert inside.mean() > 0.3
    y = rows[inside, :3] - rows[inside, 2:3] / towards[2] * towards
    assert (y[:, 0] > 1.25).all()
    assert (y[:, 0] < 2.75).all()
    assert (y[:, 1] > 0.85).all()
    assert (y[:, 1] < 2.15).all()


def test_every_source_cell_of_points_has_sent_its_rays() -> None:
    # A terrace of 24 x 14 m has more cells than a small launch has rays.
    house, camera = bare_room()
    (walls,) = house.items
    terrace = rooms.quad([(-10, 0, -14.1), (-10, 0, -0.1), (14, 0, -0.1), (14, 0, -14.1)], 0)
    house = replace(house, items=(replace(walls, surfaces=(*walls.surfaces, terrace)),))
    scene = sunny(house)
    emitters, weights = scene.emitters(camera, FIELDS, 1)
    from pbrs_farm.transport.kernels.sun_rays import PLANE_PDF
    from pbrs_farm.transport.kernels.sunlit_tables import find_used_cells, trace_points

    device, grid = scene.device_scene, emitters.outdoor_choice.grid
    used = find_used_cells(device, emitters.sun, grid, weights.vertices)
    for n_samples in (1, 1 << 22):
        tables = trace_points(device, emitters.sun, used, n_samples, 3)
        # A group's points represent the lit part of its cells, with each cell counted once.
        for group, (first, last) in enumerate(zip(tables.first, tables.first[1:], strict=False)):
            cells = (tables.cells[:, 0] > 0) & (tables.cells[:, 1] == group)
            area = cells.sum() * used.plane.edge_m**2
            stands_for = (1 / tables.rows[first:last, PLANE_PDF]).sum() / max(last - first, 1)
            assert stands_for <= area * 1.001
            if n_samples > 1 and area > 0.5:
                assert stands_for > 0.3 * area


@pytest.mark.long
def test_lamps_and_a_trial_with_sunlit_points_keep_the_mean(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Significance: 16 blocks of two groups, |z| < 4.7 each is missed by chance once in 12,000 runs.
    from pbrs_farm.transport import pilot

    house, camera = hard_rooms.open_shade()
    camera, scene = camera.with_size(32, 24), sunny(house)
    by_chance = renders_by_chance(scene, camera, FIELDS)
    monkeypatch.setattr(pilot, "MIN_SAMPLES", 0)  # also try small pictures
    monkeypatch.setattr(
        pilot, "GUIDING_COST", 0
    )  # force guiding, which the sun's noise would rule out
    by_points = renders(scene, camera, range(10, 18))
    assert all(r.facts["guided"] for r in by_points)
    for group in Group:
        sums = [[blocks(r.group(group)) for r in runs] for runs in (by_points, by_chance)]
        assert np.abs(z_scores(*sums)).max() < 4.7


@pytest.mark.long
def test_points_count_from_the_path_length_they_represent() -> None:
    # Significance: 16 blocks, |z| < 4.5 each is missed by chance once in 9000 runs.
    house, camera = bare_room()
    scene = sunny(house)
    short, longer = (FIELDS.model_copy(update={"max_depth": n}) for n in (2, 3))
    by_chance = renders_by_chance(scene, camera, longer)
    by_points = [scene.render(camera, "-", longer, seed) for seed in range(10, 18)]
    sums = [[blocks(r.outdoor) for r in runs] for runs in (by_points, by_chance)]
    assert np.abs(z_scores(*sums)).max() < 4.5
    # A path of one vertex has no second one for the sun to light.
    by_chance = renders_by_chance(scene, camera, short)
    np.testing.assert_array_equal(
        scene.render(camera, "-", short, 20).outdoor, by_chance[0].outdoor
    )


@pytest.mark.long
def test_another_view_in_between_changes_no_bit() -> None:
    house, camera = bare_room()
    scene = sunny(house)
    first = scene.render(camera, "-", FIELDS, 1)
    other_camera = rooms.camera((2.0, 1.2, 0.5), (1.0, 0.5, 3.5)).with_size(32, 24)
    scene.render(other_camera, "-", FIELDS, 2)
    scene.floor_lux(house)
    np.testing.assert_array_equal(scene.render(camera, "-", FIELDS, 1).outdoor, first.outdoor)


def test_paths_have_one_kernel_with_sunlit_points_and_without() -> None:
    import drjit as dr

    house, camera = rooms.window_room(0.7, lumen=800.0)
    camera, few = camera.with_size(16, 12), FIELDS.model_copy(update={"spp": 1})
    hashes = set()
    for azimuth_rad in (0.35, np.pi):
        scene = sunny(house, azimuth_rad=azimuth_rad)
        scene.render(camera, "-", few, 1)
        dr.kernel_history_clear()
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            scene.render(camera, "-", few, 2)
            kernels = dr.kernel_history([dr.KernelType.JIT])
        hashes |= {k["hash"] for k in kernels if k["operation_count"] > 4000}
    assert len(hashes) == 1


def test_a_cell_is_found_again_along_the_sun() -> None:
    import drjit as dr
    import mitsuba as mi

    from pbrs_farm.transport.kernels.sun import SunPlane

    direction = np.array([0.48, 0.6, -0.64])
    plane = SunPlane(direction, np.array([(0.0, 0, 0), (3, 2, 4)]))
    cell = dr.arange(mi.UInt32, plane.n_cells)
    d = mi.Vector3f(*direction.tolist())
    p = plane.point(cell, mi.Point2f(0.3, 0.8)) - 1.5 * d
    cells, inside = plane.cell(p, d)
    assert inside.numpy().all()
    np.testing.assert_array_equal(cells.numpy(), cell.numpy())
    _found, inside = plane.cell(mi.Point3f(40.0, 0, 0), d)
    assert not inside.numpy().any()


def test_a_vast_plane_has_at_most_the_fitting_cells() -> None:
    from pbrs_farm.transport.kernels.sun import SunPlane

    plane = SunPlane(np.array([0.0, 1.0, 0.0]), np.array([(0.0, 0, 0), (90, 3, 70)]))
    assert plane.n_cells <= 1 << 15
    assert plane.edge_m**2 * plane.n_cells >= 90 * 70
