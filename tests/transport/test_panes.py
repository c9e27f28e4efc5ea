"""Panes mirror the room for camera rays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.house import NOTHING_LEFT, House, Material, MaterialKind, Surface
from pbrs_farm.core.recipe import LightFields, Recipe, recipe_from_name
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import dark_sky, uniform_sky
from pbrs_farm.transport.validation import known_rooms as rooms

pytestmark = pytest.mark.skipif(
    not choose_variant().startswith("llvm"), reason="OptiX takes one scene in a kernel"
)

RECIPE: Recipe = recipe_from_name("fast")
FIELDS: LightFields = RECIPE.light.model_copy(
    update={"filter": "box", "pilot_spp": 0, "spp": 16, "max_depth": 4}
)
CORNERS = (-2, 0), (2, 0), (2, 2.5), (-2, 2.5)
MANY: LightFields = FIELDS.model_copy(update={"spp": 4096})


def fresnel(cos: float) -> float:
    """Reflectance of both surfaces of glass of index 1.5, with all inner reflections."""
    sin_t = np.sqrt(1 - cos * cos) / 1.5
    cos_t = np.sqrt(1 - sin_t**2)
    s = ((cos - 1.5 * cos_t) / (cos + 1.5 * cos_t)) ** 2
    p = ((1.5 * cos - cos_t) / (1.5 * cos + cos_t)) ** 2
    r = (s + p) / 2
    return float(2 * r / (1 + r))


def pane_before_black(*, n_panes: int = 1) -> House:
    """Panes from z = 0 on, a black board behind them, the sky in front."""

    def sheet(z: float, material: int):  # type: ignore[no-untyped-def]
        return rooms.quad([(-9, -9, z), (9, -9, z), (9, 9, z), (-9, 9, z)], material)

    glass = Material("pane", kind=MaterialKind.PANE, opacity=0.3)
    panes = [sheet(-0.01 * k, 1) for k in range(n_panes)]
    return rooms.house([sheet(-1.0, 0), *panes], [rooms.matte("black", 0.0), glass])


@pytest.mark.parametrize("cos", [1.0, 0.5, 0.2])
def test_a_pane_before_a_black_wall_mirrors_the_sky_by_fresnels_law(cos: float) -> None:
    sin = float(np.sqrt(1 - cos * cos))
    camera = rooms.camera((2 * sin, 0.0, 2 * cos), (0, 0, 0), 4, 4, 0.01)
    scene = LightScene.load(pane_before_black(), {}, RECIPE, uniform_sky((1.0, 2.0, 3.0)))
    # By day reflection is sampled at random.
    mean = scene.render(camera, "0_0", MANY, 1).outdoor.mean((0, 1))
    np.testing.assert_allclose(mean, fresnel(cos) * np.array([1.0, 2.0, 3.0]), rtol=0.03)


@pytest.mark.quick(3)
@pytest.mark.parametrize("n_faces", [1, 2, 4])
@pytest.mark.parametrize(("has_board", "expected"), [(True, fresnel(1.0)), (False, 1.0)])
def test_a_glass_item_mirrors_by_its_first_face_without_noise(
    n_faces: int, has_board: bool, expected: float
) -> None:
    def sheet(z: float, material: int, *, x: float = 0.0, half: float = 9.0):  # type: ignore[no-untyped-def]
        corners = [(x - half, -half, z), (x + half, -half, z), (x + half, half, z), (x - half, half, z)]  # fmt: skip
        return rooms.quad(corners, material)

    clear = Material("glass", kind=MaterialKind.GLASS, opacity=0.0)
    pane = Material("pane", kind=MaterialKind.PANE, opacity=0.3)
    surfaces = [sheet(-0.01 * k, 2) for k in range(n_faces)] + [sheet(9.0, 1, x=40.0, half=1.0)]
    surfaces += [sheet(-1.0, 0)] if has_board else []
    home = rooms.house(surfaces, [rooms.matte("black", 0.0), pane, clear])
    camera = rooms.camera((0, 0, 2), (0, 0, 0), 8, 8, 0.01)
    scene = LightScene.load(home, {}, RECIPE, uniform_sky((1.0, 1.0, 1.0)))
    picture = scene.render(camera, "0_0", FIELDS, 1).outdoor
    np.testing.assert_allclose(picture, expected, rtol=0.01)


def test_glass_behind_the_holes_of_a_leaf_mirrors_as_glass_before_them() -> None:
    def sheet(z: float, material: int, *, x: float = 0.0, half: float = 9.0):  # type: ignore[no-untyped-def]
        corners = [(x - half, -half, z), (x + half, -half, z), (x + half, half, z), (x - half, half, z)]  # fmt: skip
        return rooms.quad(corners, material)

    materials = [
        rooms.matte("black", 0.0),
        Material("pane", kind=MaterialKind.PANE, opacity=0.3),
        Material("glass", kind=MaterialKind.GLASS, opacity=0.0),
        Material("holes", alpha_cutout=True, alpha_cutoff=NOTHING_LEFT),
    ]
    surfaces = [sheet(-1.0, 0), sheet(9.0, 1, x=40.0, half=1.0), sheet(0.0, 2), sheet(0.5, 3)]
    camera = rooms.camera((0, 0, 2), (0, 0, 0), 8, 8, 0.01)
    scene = LightScene.load(
        rooms.house(surfaces, materials), {}, RECIPE, uniform_sky((1.0, 1.0, 1.0))
    )
    picture = scene.render(camera, "0_0", FIELDS, 1).outdoor
    np.testing.assert_allclose(picture, fresnel(1.0), rtol=0.01)


def test_only_the_first_of_two_panes_mirrors() -> None:
    camera = rooms.camera((0, 0, 2), (0, 0, 0), 4, 4, 0.01)
    scene = LightScene.load(pane_before_black(n_panes=2), {}, RECIPE, uniform_sky((1.0, 1.0, 1.0)))
    mean = scene.render(camera, "0_0", MANY, 1).outdoor.mean()
    assert mean == pytest.approx(fresnel(1.0), rel=0.03)


@pytest.mark.parametrize("name", ["released", "fast"])
def test_at_night_a_window_shows_the_room_but_in_released(name: str) -> None:
    house, _camera = rooms.window_room(0.7, lumen=800, pane=True)
    camera = rooms.camera((2.0, 1.5, 3.0), (2.0, 1.5, 0.0), 8, 8, 0.2)
    recipe = recipe_from_name(name)
    result = LightScene.load(house, {}, recipe, dark_sky()).render(camera, "0_0", FIELDS, 1)
    assert bool(result.indoor.min() > 0) == (name == "fast")


@pytest.mark.long
def test_metropolis_mirrors_as_path_does() -> None:
    house, _camera = rooms.window_room(0.7, lumen=800, pane=True)
    camera = rooms.camera((2.0, 1.5, 3.0), (2.0, 1.5, 0.0), 12, 12, 0.25)
    scene = LightScene.load(house, {}, RECIPE, dark_sky())
    by_path = scene.render(camera, "0_0", FIELDS.model_copy(update={"spp": 512}), 1).indoor
    chains = FIELDS.model_copy(
        update={"integrator": "metropolis", "direct_spp": 64, "mutations_per_pixel": 512}
    )
    by_chains = scene.render(camera, "0_0", chains, 1).indoor
    assert by_chains.mean() == pytest.approx(by_path.mean(), rel=0.05)


def shell() -> list[Surface]:
    """Floor, ceiling and walls from z = -3 to 3; the wall at -3 is of material 1, the others of 0."""
    walls = [rooms.box((-2, y, -3), (2, y + 0.1, 3), 0) for y in (-0.1, 2.5)]
    walls += [rooms.box((x, 0, -3), (x + 0.1, 2.5, 3), 0) for x in (-2.1, 2)]
    ends = ((-2, 0, 3), (2, 2.5, 3.1), 0), ((-2, 0, -3.1), (2, 2.5, -3), 1)
    return walls + [rooms.box(*end) for end in ends]


@pytest.mark.quick(3)
def test_at_night_the_room_in_a_pane_is_as_free_of_noise_as_in_a_mirror() -> None:
    # A pane before a black wall sends back less than a tenth, which roulette must not thin out.
    def noise(kind: MaterialKind) -> tuple[float, float]:
        sheet = rooms.quad([(x, y, -2.9) for x, y in CORNERS], 2)
        materials = [rooms.matte("grey", 0.6), rooms.matte("black", 0.0)]
        materials += [Material("sheet", kind=kind), Material("b", MaterialKind.BULB)]
        home = rooms.house(
            [*shell(), sheet], materials, lamps=[rooms.bulb((0.5, 2.2, 2.0), 3, 1000.0)]
        )
        scene = LightScene.load(home, {}, RECIPE, dark_sky())
        camera = rooms.camera((0, 1.2, -1), (0, 1.2, -2.9), 24, 18, 0.5)
        fields = FIELDS.model_copy(update={"pilot_spp": 4, "spp": 64, "max_depth": 12})
        pictures = np.array([scene.render(camera, "0_0", fields, k).indoor for k in (1, 2)])
        mean = pictures.mean(0)
        return float(np.sqrt((((pictures[0] - mean) / mean) ** 2).mean())), float(mean.mean())

    (by_pane, faint), (by_mirror, bright) = (
        noise(kind) for kind in (MaterialKind.PANE, MaterialKind.MIRROR)
    )
    assert faint < 0.1 * bright
    assert by_pane < 1.5 * by_mirror


@pytest.mark.parametrize("kind", [MaterialKind.PANE, MaterialKind.GLASS])
def test_the_pilot_and_the_guides_of_the_denoiser_look_through_glass(kind: MaterialKind) -> None:
    # Two rooms with a lamp each, and a sheet of glass between them.
    glass = rooms.quad([(-2, 0, 0), (2, 0, 0), (2, 2.5, 0), (-2, 2.5, 0)], 2)
    materials = [rooms.matte("grey", 0.3), rooms.matte("red", 0.8, 0.1, 0.1)]
    materials += [Material("glass", kind=kind, opacity=0.0), Material("b", MaterialKind.BULB)]
    lamps = [rooms.bulb((0.5, 2.2, z), 3, 1000.0) for z in (2.0, -2.0)]
    home = rooms.house([*shell(), glass], materials, lamps=lamps)
    plan = np.array([[-2, 0], [2, 0], [2, 3], [-2, 3]], np.float64)
    halves = (replace(home.rooms[0], polygon=plan), replace(home.rooms[0], polygon=plan - [0, 3]))
    home = replace(home, rooms=halves)
    scene = LightScene.load(home, {}, RECIPE, dark_sky())
    camera = rooms.camera((0, 1.2, 2.5), (0, 1.2, 0), 16, 12, 0.5)
    found = scene.render(camera, "0_0", FIELDS.model_copy(update={"pilot_spp": 4}), 1)
    # The camera sees nothing but the glass, and the red wall behind it.
    _near, behind = found.facts["lamp_weights"].values()
    assert behind > 0.3
    assert (found.albedo[..., 0] > 5 * found.albedo[..., 1]).all()
    assert np.ptp(found.albedo[..., 0]) < 0.05
