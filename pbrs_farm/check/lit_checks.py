"""Light of sun and lamps in radiance.exr against independent shadow rays.

Effects: none beside reading documents. At some hundred places amid surfaces, the arriving light is radiance over
albedo. If a ray to the sun or to a bulb is free it must be at least half of the light that this source alone gives;
if the sun is hidden it must be less than half of it.
"""

from __future__ import annotations

import itertools
import math
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.check.axes import dot
from pbrs_farm.check.cases import ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.colours import LM_PER_W, has_channels, luminance_of
from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.lamp_checks import flux_lm
from pbrs_farm.check.plan import is_within, points_in_plan, polygon_area
from pbrs_farm.check.radiance_checks import COAT, coated_materials, is_amid, matte_items
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.core.arrays import F64, I64, Bools

_WINDOW_PX = 5  # over which light is averaged: noise, and the pixel's filter
_PLACES = 400  # of a view
_LEAST_COSINE = 0.25  # to a light: the shading normal decides about slanting light
_LEAST_ALBEDO = 0.04
_HALF = 0.5  # of the sun's own light: noise, and colours that albedo's luminance averages
_LAMP = 0.6  # of a bulb's own light: noise, and clamped bounces
_LEVEL = 5.0  # ratio of a view's floor to its room's: furniture shades, lamps are near
_SEEN = 0.1  # share of visible places below which a lamp is hidden from them
_BOUNCES = 2.0  # arrivals of light at a floor, by walls and ceiling that reflect a half
_UNEVEN = 4.0  # intensity of a flat lamp that shines down, over that of one that shines evenly
_LEAST_FLOOR_LX = 1.0  # of a floor, below which noise decides
_FLOOR_GRID = 40  # points a side, from which the sun is looked for
_FLOOR_M = 0.1  # height above a floor that still counts as the floor
_UPRIGHT = 0.9  # least cosine of a floor's normal
_BULB_SHARE = 0.05  # relative error of a bulb's radiance
_GREY = 0.02  # range of the colours of a light without one
_WARM_K = 4000.0  # lamps below this are redder than any day
_DAY_LX = 1000.0  # of the sky, above which windows outshine lamps that they mirror
_WINDOW_RAYS = 3000  # of a view, that look for windows
_MOST_BULB_PX = 400  # of a bulb, to look at
_BULB_GRID = 15  # places a side of such a pixel and those around it, a fifth of a pixel apart
_FEW_BULB_PX = 4  # fewer pixels amid a bulb are not judged
_SUN_RAD = math.radians(0.6)  # around the sun's middle, twice its disc: its shadow has soft edges
_FEW = 24  # fewer places are not judged
_SHARE = 0.8  # of places that must agree with shadow rays
_LEAST_LX = 20.0  # of a lamp, below which bounced light decides
_ROUND = 0.5  # shortest side of a bulb over its longest: flatter ones do not shine evenly
_PUSH_M = 2e-3  # off the surface, against its own shadow


@dataclass(frozen=True)
class LitScene:
    """The obstacles of light: triangles of a home, without panes, and the outdoors."""

    house: StoredHouse
    triangles: Triangles

    @cached_property
    def is_outside(self) -> Bools:
        """(F,) the outdoors."""
        outside = [i for i, row in self.house.items.items() if "outside" in row["tags"]]
        return np.isin(self.triangles.instance, outside)

    @cached_property
    def inside(self) -> Rays:
        """Rays among the triangles of the home; panes let light pass."""
        return Rays(self.triangles, ~(self.triangles.is_of("pane") | self.is_outside))

    @cached_property
    def outside(self) -> Rays:
        """Rays among the outdoors."""
        return Rays(self.triangles, self.is_outside)

    @cached_property
    def is_unsure(self) -> Bools:
        """(F,) neither clear nor dark: glass, shades, mirrors, leaves with holes."""
        return self.triangles.is_of("glass", "shade", "mirror") | self.triangles.has_holes

    @cached_property
    def lamps(self) -> dict[str, _Bulb]:
        """Luminous surfaces by the name of their light; {} if the recipe states no flux."""
        emission = self.house.recipe.get("emission")
        if not emission or emission["preset"] == "released":
            return {}
        lamps = {}
        for name, (instance, _k) in self.house.lamps.items():
            light = self.house.light(name)
            corners = self.triangles.points_of_surfaces(instance, light["emitting"])
            if len(corners):
                faces = self.triangles.is_of("bulb") & (self.triangles.instance == instance)
                faces &= np.isin(self.triangles.surface, light["emitting"])
                lamps[name] = _Bulb(corners, flux_lm(light, emission), instance, faces)
        return lamps

    @cached_property
    def bulbs(self) -> dict[str, _Bulb]:
        """Round members of `lamps`."""
        sizes = {name: np.ptp(bulb.corners, axis=0) for name, bulb in self.lamps.items()}
        return {n: self.lamps[n] for n, s in sizes.items() if s.min() >= _ROUND * s.max()}

    def sees(self, lamp: _Bulb, points: F64) -> Bools:
        """(N,) level places (N, 3) below a lamp from which its middle, or its shade, is visible."""
        to = lamp.middle - points
        face = self.inside.first(points, to)
        is_it = (face >= 0) & (self.triangles.instance[face] == lamp.instance)
        return np.asarray(is_it & (to[:, 1] > 0))

    def lux_of_lamps(self, points: F64) -> float:
        """Mean lx on level places (N, 3) by the lamps that they see, each a point that shines evenly."""
        total = 0.0
        for lamp in self.lamps.values():
            to = lamp.middle - points
            distance = np.maximum(np.linalg.norm(to, axis=1), 1e-6)
            lit = self.sees(lamp, points) * to[:, 1] / distance**3
            total += float(lit.mean()) * lamp.flux / (4 * math.pi)
        return total


@dataclass(frozen=True, slots=True, eq=False)
class _Bulb:
    """The luminous surface of a light."""

    corners: F64  # (N, 3) of its triangles
    flux: float  # lm
    instance: int
    faces: Bools  # (F,)

    @property
    def middle(self) -> F64:
        """(3,) the middle of its box."""
        return np.asarray((self.corners.min(0) + self.corners.max(0)) / 2)


@dataclass(frozen=True, slots=True, eq=False)
class LitPlaces:
    """N windows amid surfaces."""

    rows: I64
    columns: I64
    points: F64  # (N, 3), pushed off the surface
    normals: F64  # (N, 3), towards the camera
    corners: F64  # (N, 5, 3) middle and corners of the window, pushed off the surface
    painted: F64  # (N,) share of light at normal incidence that does not pass through a coat; 1 = no coat
    facing: F64  # (N,) cosine of the normal to the view ray

    def __len__(self) -> int:
        return len(self.rows)

    def returned(self, cosine: F64) -> F64:
        """(N,) least share of a matte surface's light sent to the camera; cosine: to the light.

        Under a coat slanting light does not reach the paint, nor leave it (Ashikhmin and Shirley 2000).
        """
        through = [1 - (1 - np.clip(c, 0, 1) / 2) ** 5 for c in (cosine, self.facing)]
        under_coat = np.minimum(28 / 23 * self.painted * through[0] * through[1], 1)
        return np.where(self.painted < 1, under_coat, 1.0)


def check_lit(case: ViewCase) -> None:
    """Judge sun and lamps at up to _PLACES windows of _WINDOW_PX; few of a kind are not judged.

    A view that blurs or has no recipe is judged alike.
    """
    if not has_channels(case.light, case.view.size, "outdoor indoor albedo"):
        return
    _check_visible_bulbs(case)
    _check_windows(case)
    places = _places(case)
    if len(places) < _FEW:
        return
    _check_sun(case, places)
    _check_bulbs(case, places)
    _check_level(case, places)
    _check_colours(case, places)


def _sky(case: ViewCase) -> Mapping[str, Any]:
    sky: Mapping[str, Any] = case.view.table.get("modes", {}).get("light", {}).get("sky", {})
    return sky


def _to_sun(case: ViewCase) -> F64 | None:
    """(3,) the direction to the sun; None at night and under clouds."""
    sky = _sky(case)
    if not sky.get("sun_lx") or sky["sun_direction"][1] <= 0:
        return None
    return np.array(sky["sun_direction"], np.float64)


def _places(case: ViewCase) -> LitPlaces:
    """Windows that show one instance with one normal, of a surface that scatters light."""
    view, (triangles, rays), n = case.view, case.scene, _WINDOW_PX
    albedo = luminance_of(case.light, "albedo")
    flat = is_amid(case.arrays["instance"], case.arrays["normal"], n) & (albedo > _LEAST_ALBEDO)
    edge = n // 2 + 1
    flat[:edge] = flat[-edge:] = False
    flat[:, :edge] = flat[:, -edge:] = False
    rows, columns = np.nonzero(flat)
    rng = np.random.default_rng(zlib.crc32(f"{view.place} lit".encode()))
    chosen = rng.permutation(len(rows))[:_PLACES]
    cast = case.cast(rows[chosen], columns[chosen])
    is_matte = np.isin(triangles.instance[cast.face], matte_items(case.house))
    is_matte &= triangles.kinds_of(cast.face) == "opaque"
    cast = cast.some((cast.face >= 0) & is_matte)
    rows, columns, face, normal = cast.rows, cast.columns, cast.face, cast.normal
    points = []
    h = n // 2
    for dy, dx in ((0, 0), (-h, -h), (-h, h), (h, -h), (h, h)):
        _, ray = view.rays(rows + dy, columns + dx)
        with np.errstate(divide="ignore", invalid="ignore"):
            point = cast.origin + ray * rays.distance(face, cast.origin, ray)[:, None]
        points.append(np.nan_to_num(point) + _PUSH_M * normal)
    corners = np.stack(points, axis=1)
    painted = (1 - COAT) * (1 - COAT / np.maximum(albedo[rows, columns], COAT))
    towards = cast.directions / np.linalg.norm(cast.directions, axis=1, keepdims=True)
    return LitPlaces(
        rows, columns, corners[:, 0], normal, corners,
        np.where(coated_materials(case.house)[triangles.material[face]], painted, 1.0),
        -dot(normal, towards),
    )  # fmt: skip


def _lux(case: ViewCase, name: str, places: LitPlaces) -> F64:
    """(N,) lx that arrive in windows: mean radiance over albedo."""
    albedo = np.maximum(luminance_of(case.light, "albedo"), _LEAST_ALBEDO)
    share = luminance_of(case.light, name) / albedo
    mean = ndimage.uniform_filter(share, _WINDOW_PX, mode="nearest")
    return np.asarray(mean[places.rows, places.columns] * math.pi * LM_PER_W)


def _check_sun(case: ViewCase, places: LitPlaces) -> None:
    """Places that see all of the sun have its light, and places that see none of it have less."""
    to_sun, scene = _to_sun(case), case.now.shared(LitScene)
    if to_sun is None:
        return
    cosine = places.normals @ to_sun
    n_free, n_rays = np.zeros(len(places)), 0
    sure = cosine > _LEAST_COSINE
    for direction in _around(to_sun):
        for k in range(places.corners.shape[1]):
            start = places.corners[:, k]
            rays = np.broadcast_to(direction, start.shape)
            face = scene.inside.first(start, rays)
            free = face < 0
            sure &= ~(~free & scene.is_unsure[face])
            sure &= ~(free & (scene.outside.first(start, rays) >= 0))
            n_free += free
            n_rays += 1
    lux = _lux(case, "outdoor", places)
    least = _HALF * _sky(case)["sun_lx"] / to_sun[1] * cosine
    for name, chosen, right in (
        ("lit by the sun", sure & (n_free == n_rays), lux >= least * places.returned(cosine)),
        ("in its shadow", sure & (n_free == 0), lux < least),
    ):
        _expect_share(case, "sun", name, right[chosen])


def _expect_share(case: ViewCase, check: str, name: str, right: Bools) -> None:
    """Most of the chosen places are right, if there are enough of them."""
    if len(right) >= _FEW:
        share = float(right.mean())
        fault = f"{name} by shadow rays, so it is at {share:.0%} of {len(right)} places"
        case.expect(check, "radiance.exr")(share >= _SHARE, fault)


def _around(direction: F64) -> Iterator[F64]:
    """A direction and four around it."""
    side = np.cross(direction, [1.0, 0, 0] if abs(direction[0]) < 0.7 else [0, 1.0, 0])
    side /= np.linalg.norm(side)
    up = np.cross(direction, side)
    yield direction
    for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        yield direction + _SUN_RAD * (a * side + b * up)


def _check_bulbs(case: ViewCase, places: LitPlaces) -> None:
    """Places that see a bulb have its light."""
    rows = case.view.table.get("modes", {}).get("light", {}).get("lamps") or []
    layers = {row["item"]: row["layer"] for row in rows}
    total = np.zeros(len(places))
    bulbs = case.now.shared(LitScene).bulbs
    for name, bulb in bulbs.items():
        direct = _direct_lux(case, places, bulb)
        total += direct
        layer = layers.get(name)
        if layer is not None and f"{layer}.R" in case.light:
            _expect_lit(case, name, layer, places, direct)
    if bulbs:
        _expect_lit(case, "all lamps", "indoor", places, total)


def _direct_lux(case: ViewCase, places: LitPlaces, bulb: _Bulb) -> F64:
    """(N,) lx of direct light of a round bulb, 0 where it is not wholly visible."""
    scene, corners = case.now.shared(LitScene), bulb.corners
    middle = bulb.middle
    to = middle - places.points
    distance = np.linalg.norm(to, axis=1)
    cosine = dot(places.normals, to) / np.maximum(distance, 1e-6)
    free = cosine > _LEAST_COSINE
    step = max(len(corners) // 8, 1)
    for target in (middle, *(middle + 0.9 * (c - middle) for c in corners[::step])):
        face = scene.inside.first(places.points, target - places.points)
        free &= (face >= 0) & (scene.triangles.instance[face] == bulb.instance)
        free &= scene.triangles.kinds_of(face) == "bulb"
    lux = bulb.flux / (4 * math.pi * distance**2) * cosine * places.returned(cosine)
    return np.where(free, lux, 0.0)


def _expect_lit(case: ViewCase, name: str, layer: str, places: LitPlaces, direct: F64) -> None:
    lit = direct >= _LEAST_LX
    right = _lux(case, layer, places)[lit] >= _LAMP * direct[lit]
    _expect_share(case, "lamplight", f"lit by {name}", right)


def _sun_on_floor(case: ViewCase, room: Mapping[str, Any]) -> float:
    """Sunlight in lx on a level floor of which the sun sees any part, else 0."""
    to_sun, scene = _to_sun(case), case.now.shared(LitScene)
    if to_sun is None:
        return 0.0
    start = points_in_plan(room["polygon"], _FLOOR_GRID, room["floor_y"] + _FLOOR_M)
    face = scene.inside.first(start, np.broadcast_to(to_sun, start.shape))
    free = (face < 0) | scene.is_unsure[face]
    return float(_sky(case)["sun_lx"]) if free.any() else 0.0


def _check_level(case: ViewCase, places: LitPlaces) -> None:
    """The visible floor is about as bright as the room's in illuminance.json."""
    house, name = case.house, str(case.view.table.get("room"))
    room, row = house.rooms.get(name, {}), house.lux_rows.get(name)
    # Items that have moved since illuminance.json let in other light.
    if row is None or not room or house.moved is not None:
        return
    above = places.points[:, 1] - room["floor_y"]
    floor = (places.normals[:, 1] > _UPRIGHT) & (np.abs(above) < _FLOOR_M)
    # In an open plan the floors of other rooms are visible, too.
    floor &= [is_within(room["polygon"], point) for point in places.points[:, [0, 2]]]
    # A patch of sun outside the view may give most of the room's light, and one inside it more.
    sun_lx = _sun_on_floor(case, room)
    for group in ("outdoor", "indoor"):
        stored = float(row[f"{group}_lx"])
        lux = _lux(case, group, places)
        chosen = floor & (lux < sun_lx / 2) if group == "outdoor" and sun_lx else floor
        if chosen.sum() < _FEW:
            continue
        level = float(np.mean(lux[chosen]))
        if max(stored, level) >= _LEAST_FLOOR_LX:
            more, less = sun_lx, 0.0
            if group == "indoor":
                more, less = _lamps_elsewhere(case, room, places.points[chosen])
            same = (level - less) / _LEVEL <= stored <= level * _LEVEL + more
            fault = f"{group} light brings {level:.3g} lx to the visible floor, stored {stored:.3g}"  # fmt: skip
            case.expect("levels", "radiance.exr")(same, fault)


def _lamps_elsewhere(case: ViewCase, room: Mapping[str, Any], seen: F64) -> tuple[float, float]:
    """Lux by which lamps may light a room's floor more than its visible places, and less.

    Inner walls may hide a lamp. One that the visible places do not see sends its light to the rest of the
    floor, some of it more than once; one that mostly they see lights them directly.
    """
    scene = case.now.shared(LitScene)
    grid = points_in_plan(room["polygon"], _FLOOR_GRID // 2, room["floor_y"] + _FLOOR_M)
    if not len(grid):
        return 0.0, 0.0
    hidden = sum(
        lamp.flux
        for lamp in scene.lamps.values()
        if scene.sees(lamp, grid).any() and scene.sees(lamp, seen).mean() < _SEEN
    )
    less = _UNEVEN * (scene.lux_of_lamps(seen) - scene.lux_of_lamps(grid))
    area = polygon_area(np.array(room["polygon"], np.float64))
    return _BOUNCES * hidden / area, max(less, 0.0)


def _check_visible_bulbs(case: ViewCase) -> None:
    """Pixels amid a bulb hold its radiance: its flux over pi and its outer area."""
    level, instance = luminance_of(case.light, "indoor"), case.arrays["instance"]
    for name, bulb in case.now.shared(LitScene).bulbs.items():
        rows, columns = np.nonzero(instance == bulb.instance)
        if len(rows) < _FEW_BULB_PX:
            continue
        mask = np.zeros(instance.shape, bool)
        mask[rows, columns] = _shows(case, bulb.faces, rows, columns)
        amid = np.argwhere(ndimage.binary_erosion(mask, np.ones((3, 3), bool)))[:_MOST_BULB_PX]
        # Between the rods of a bulb are gaps that no pixel's middle meets.
        for dy, dx in itertools.product(np.linspace(-1.4, 1.4, _BULB_GRID), repeat=2):
            amid = amid[_shows(case, bulb.faces, amid[:, 0] + dy, amid[:, 1] + dx)]
        if len(amid) < _FEW_BULB_PX:
            continue
        radiance = float(np.median(level[tuple(amid.T)]))
        area = _outer_area(bulb.corners.reshape(-1, 3, 3))
        expected = bulb.flux / (LM_PER_W * math.pi * area)
        fault = f"bulb {name} shows {radiance:.4g} W m-2 sr-1, by house.json {expected:.4g}"
        is_near = abs(radiance / expected - 1) <= _BULB_SHARE
        case.expect("bulbs", "radiance.exr")(is_near, fault)


def _shows(case: ViewCase, faces: Bools, rows: NDArray[Any], columns: NDArray[Any]) -> Bools:
    """(N,) these places of the picture show one of the faces (F,)."""
    if not len(rows):
        return np.zeros(0, bool)
    face = case.cast(rows, columns).face
    return np.asarray((face >= 0) & faces[face])


def _check_windows(case: ViewCase) -> None:
    """By day, pixels that show the outdoors have daylight, and hardly any light of lamps."""
    if not case.house.rooms or _sky(case).get("sky_lx", 0.0) < _DAY_LX:
        return
    rows, columns = case.sample(_WINDOW_RAYS)
    origin, directions = case.view.rays(rows, columns)
    inside = case.now.shared(LitScene).inside
    through = directions.any(axis=1) & (inside.first(origin, directions) < 0)
    if int(through.sum()) < _FEW:
        return
    day, lamps = (
        float(np.median(luminance_of(case.light, g)[rows, columns][through]))
        for g in ("outdoor", "indoor")
    )
    fault = f"windows show {day:.3g} W m-2 sr-1 of daylight and {lamps:.3g} of lamps"
    case.expect("windows", "radiance.exr")(day > lamps, fault)


def _check_colours(case: ViewCase, places: LitPlaces) -> None:
    """By day, lamps whose sources name no colour are redder than daylight."""
    lights = [light for row in case.house.items.values() for light in row["lights"]]
    emission = case.house.recipe.get("emission", {})
    # The recipe draws a warm white for sources without a colour.
    is_warm = not any(x["is_coloured"] or np.ptp(x["rgb_linear"]) > _GREY for x in lights)
    is_warm &= emission.get("preset") == "photometric" and emission["lamp_kelvin_max"] <= _WARM_K
    if not lights or not is_warm or _sky(case).get("sky_lx", 0.0) < _DAY_LX:
        return
    outdoor, indoor = (_red_over_blue(case, places, g) for g in ("outdoor", "indoor"))
    if min(outdoor, indoor) > 0:
        fault = f"red over blue is {indoor:.2f} of lamps, {outdoor:.2f} of daylight"
        case.expect("colours of light", "radiance.exr")(indoor > outdoor, fault)


def _red_over_blue(case: ViewCase, places: LitPlaces, group: str) -> float:
    """Ratio of a light group's arriving red to its blue."""
    means = []
    for c in "RB":
        light = case.light[f"{group}.{c}"]
        arriving = light / np.maximum(case.light[f"albedo.{c}"], _LEAST_ALBEDO)
        means.append(float(arriving[places.rows, places.columns].mean(dtype=np.float64)))
    red, blue = means
    return red / blue if blue > 0 else 0.0


def _outer_area(corners: F64) -> float:
    """Area in m2 of triangles (F, 3, 3): of one side if each edge has its reverse, else of both."""
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = float(np.linalg.norm(sides, axis=1).sum() / 2)
    _, numbers = np.unique(np.round(corners.reshape(-1, 3), 6), axis=0, return_inverse=True)
    faces = numbers.reshape(-1, 3)
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges = edges[edges[:, 0] != edges[:, 1]]
    counts = np.unique(edges, axis=0, return_counts=True)[1]
    return area if float((counts >= 2).mean()) > 0.95 else 2 * area


CHECKS = (Check("sun and lamps", "view", check_lit, 27, ("radiance",)),)
