"""Whether the light that enters by windows is what one sees through them: the bench outside.

`python -m benchmarks outside`. On the panes of homes, irradiance is measured twice: by rays over the
hemisphere that see what a camera would see there, the sky and what lies before it, and the sun where
nothing hides it; and as the light scene gives it to a white surface in the pane. What meets the home
itself counts in neither.
"""

from __future__ import annotations

from typing import Any, Final

import drjit as dr
import numpy as np

from benchmarks.figures import write_report
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.house import House, geometry_from_house
from pbrs_farm.core.recipe import Recipe, recipe_from_name
from pbrs_farm.furnishings.surroundings import with_surroundings
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.raycast.variant import choose_variant, mitsuba
from pbrs_farm.repair import repair
from pbrs_farm.run.house_cache import decoded_textures
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import Sky, sky_for_house

HOMES: Final = ("Studio", "2BedroomApartment", "4BedroomHouse", "made:1", "made:2", "made:3")
N_SEEDS: Final = 2
N_POINTS: Final = 32  # of a window
N_RAYS: Final = 128  # of a point
SUNS_DEG: Final = (15.0, 40.0)  # elevations, one a seed


def main() -> None:
    """Write out/bench/outside.json."""
    recipe = recipe_from_name("fast")
    rows = [
        row for name in HOMES for seed in range(N_SEEDS) for row in measured(name, seed, recipe)
    ]
    seen, light = np.array(rows).T
    share = np.minimum(seen, light) / np.maximum(seen, light)
    figures = {
        "outside.light_share": round(float(np.median(share)), 3),
        "outside.light_share_p10": round(float(np.quantile(share, 0.1)), 3),
        "outside.light_ratio": round(float(light.sum() / seen.sum()), 3),
        "outside.windows": len(rows),
    }
    units = {
        "outside.light_share": "min/max of the irradiance of a pane by what is seen and by the light scene, median of windows",
        "outside.light_share_p10": "the same, of the worst tenth",
        "outside.light_ratio": "light of all windows over that of what is seen",
        "outside.windows": "windows of six homes, two seeds each",
    }
    write_report("outside", figures, units)


def measured(name: str, seed: int, recipe: Recipe) -> list[tuple[float, float]]:
    """(irradiance by what is seen, as the light scene gives it) of each window, W m-2 of luminance."""
    house = repair(read_house(resolve(name), recipe.read), recipe.repair)[0]
    house = with_surroundings(house, "drawn", seed)
    sun = {"time": "day", "sun_elevation_deg": SUNS_DEG[seed % len(SUNS_DEG)]}
    recipe = recipe.model_copy(update={"sky": recipe.sky.model_copy(update=sun)})
    sky = sky_for_house(recipe, house.id)
    scene = LightScene.load(house, decoded_textures(house)[0], recipe, sky)
    return irradiances(house, scene, sky, seed)


def irradiances(house: House, scene: LightScene, sky: Sky, seed: int) -> list[tuple[float, float]]:
    """As measured; scene: of the house under the sky."""
    from pbrs_farm.transport.illuminance import radiosity

    rng = np.random.default_rng(seed)
    caster = Caster(geometry_from_house(house, with_panes=False))
    indoor = house.with_items(i for i in house.items if not i.is_outside)
    home = Caster(geometry_from_house(indoor, with_panes=False))
    rows = []
    for opening in house.openings:
        if not opening.is_window:
            continue
        quad = np.asarray(opening.quad, np.float64)
        u, v = rng.random((2, N_POINTS, 1))
        points = quad[0] + u * (quad[1] - quad[0]) + v * (quad[3] - quad[0])
        normal = np.cross(quad[1] - quad[0], quad[3] - quad[0])
        normal /= np.linalg.norm(normal)
        ways = {sign: _hemisphere(sign * normal, rng) for sign in (1.0, -1.0)}
        free = {sign: _leaves(home, points, d) for sign, d in ways.items()}
        sign = max(free, key=lambda s: float(free[s].mean()))
        if free[sign].mean() < 0.25:  # a window between rooms
            continue
        outward = sign * normal
        seen = _seen(scene, sky, points, ways[sign], free[sign])
        clear = _leaves(caster, points, np.tile(sky.sun_direction, (N_POINTS, 1, 1)))
        seen += clear.mean() * max(float(outward @ sky.sun_direction), 0.0) * sky.sun_irradiance
        emitters = scene._view_emitters.at_place(points.mean(0))
        normals = np.tile(outward, (N_POINTS, 1))
        lit = radiosity(scene.device_scene, emitters, points, normals, 512, seed, max_depth=1)[0]
        light = np.pi * lit.mean(0)
        rows.append((float(seen @ LUMINANCE), float(light @ LUMINANCE)))
    return rows


def _hemisphere(normal: F64, rng: np.random.Generator) -> F64:
    """(N_POINTS, N_RAYS, 3) directions by the cosine to normal (3,)."""
    r, phi = np.sqrt(rng.random((N_POINTS, N_RAYS))), 2 * np.pi * rng.random((N_POINTS, N_RAYS))
    a = np.cross(normal, [0.0, 1.0, 0.0])
    a /= np.linalg.norm(a)
    b = np.cross(normal, a)
    x, y, z = r * np.cos(phi), r * np.sin(phi), np.sqrt(np.maximum(1 - r * r, 0))
    return np.asarray(x[..., None] * a + y[..., None] * b + z[..., None] * normal)


def _leaves(caster: Caster, points: F64, ways: F64) -> Any:
    """(N, M) Bool: rays from points (N, 3) in directions (N, M, 3) that meet nothing."""
    o = np.broadcast_to(points[:, None], ways.shape).reshape(-1, 3)
    _t, face = caster.first_hit(o, ways.reshape(-1, 3))
    return (face < 0).reshape(ways.shape[:2])


def _seen(scene: LightScene, sky: Sky, points: F64, ways: F64, free: Any) -> F64:
    """(3,) irradiance by what rays (N, M, 3) see outside, drawn by the cosine."""
    mi = mitsuba(choose_variant())
    d = ways.reshape(-1, 3)
    o = np.broadcast_to(points[:, None], ways.shape).reshape(-1, 3)
    rays = [[np.ascontiguousarray(c, np.float32) for c in x.T] for x in (o, d)]
    outside = scene._view_emitters.at_place(points.mean(0)).outside
    height, width = sky.dome.shape[:2]
    row = np.minimum(np.arccos(np.clip(d[:, 1], -1, 1)) / np.pi * height, height - 1).astype(int)
    column = (np.arctan2(d[:, 0], -d[:, 2]) / (2 * np.pi) % 1 * width).astype(int) % width
    radiance = np.asarray(sky.dome[row, column], np.float64)
    if outside is not None:
        found = outside.seen(
            scene.device_scene, mi.Point3f(*rays[0]), mi.Vector3f(*rays[1]), mi.Bool(free.ravel())
        )
        dr.eval(found)
        shown = np.stack([c.numpy() for c in found.radiance], 1)
        radiance = np.where(found.valid.numpy()[:, None], shown, radiance)
    return np.asarray(np.pi * (radiance * free.reshape(-1, 1)).mean(0))
