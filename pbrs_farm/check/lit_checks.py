"""Whether sun and lamps light in radiance.exr what they reach by shadow rays of the checker's own.

Effects: none beside reading documents. At some hundred places amid surfaces, the light that arrives is
radiance over albedo. Where a ray to the sun or to a bulb is free it must be at least half of what that
alone brings; where the sun is hidden it must be less than half of it.
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

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.embree_caster import Faces, Floats, Rays
from pbrs_farm.check.fact_checks import lamp_names
from pbrs_farm.check.lamp_checks import flux_lm
from pbrs_farm.check.radiance_checks import COAT, LUMINANCE, Channels, coated_materials, matte_items
from pbrs_farm.check.solid_checks import is_within
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.check.stored_view import StoredView

LM_PER_W = 179.0  # of white
_WINDOW_PX = 5  # over which light is averaged: noise, and the pixel's filter
_PLACES = 400  # of a view
_LEAST_COSINE = 0.25  # to a light: slanting light is of the shading normal's making
_LEAST_ALBEDO = 0.04
_HALF = 0.5  # of what the sun brings by itself: noise, and colours that albedo's luminance averages
_LAMP = 0.6  # of what a bulb brings by itself: noise, and clamped bounces
_LEVEL = (
    5.0  # between the floor that a view sees and that of its room: furniture shades, lamps are near
)
_LEAST_FLOOR_LX = 1.0  # of a floor, below which noise decides
_FLOOR_GRID = 40  # points a side, from which the sun is looked for
_UPRIGHT = 0.9  # least cosine of a floor's normal
_BULB_SHARE = 0.05  # of a bulb's radiance
_GREY = 0.02  # between the colours of a light that names none
_WARM_K = 4000.0  # of lamps that are redder than any day
_DAY_LX = 1000.0  # of the sky, above which windows outshine lamps that they mirror
_WINDOW_RAYS = 3000  # of a view, that look for windows
_MOST_BULB_PX = 400  # that are looked at
_BULB_GRID = 15  # places a side of such a pixel and those about it, a fifth of a pixel apart
_FEW_BULB_PX = 4  # pixels amid a bulb that tell nothing
_SUN_RAD = math.radians(0.6)  # about the sun's middle, twice its disc: its shadow has soft edges
_FEW = 24  # places that tell nothing
_SHARE = 0.8  # of places that must be as shadow rays say
_LEAST_LX = 20.0  # of a lamp, below which bounced light decides
_ROUND = 0.5  # shortest side of a bulb over its longest: flatter ones do not shine evenly
_PUSH_M = 2e-3  # off the surface, against its own shadow


@dataclass(frozen=True)
class LitScene:
    """What stands in light's way: triangles of a home, without panes, and what lies outside."""

    house: StoredHouse
    triangles: Triangles

    @cached_property
    def is_outside(self) -> NDArray[np.bool_]:
        """(F,) of what lies before the windows."""
        outside = [i for i, row in self.house.items.items() if "outside" in row["tags"]]
        return np.isin(self.triangles.instance, outside)

    @cached_property
    def inside(self) -> Rays:
        """Rays that meet the home alone; panes let light pass."""
        clear = self._of_kinds("pane")
        return Rays(self.triangles, ~(clear | self.is_outside))

    @cached_property
    def outside(self) -> Rays:
        """Rays that meet what lies outside."""
        return Rays(self.triangles, self.is_outside)

    def _of_kinds(self, *kinds: str) -> NDArray[np.bool_]:
        found = np.array([k in kinds for k in self.triangles.kinds], bool)
        t = self.triangles
        return found[t.material] if len(t.material) else np.zeros(0, bool)

    @cached_property
    def is_unsure(self) -> NDArray[np.bool_]:
        """(F,) of what is neither clear nor dark: glass, shades, mirrors, leaves with holes."""
        return self._of_kinds("glass", "shade", "mirror") | self.triangles.has_holes

    @cached_property
    def is_bulb(self) -> NDArray[np.bool_]:
        """(F,) of what shines by itself."""
        return self._of_kinds("bulb")

    @cached_property
    def bulbs(self) -> dict[str, tuple[Floats, float, int]]:
        """Name of a light -> points (N, 3) of its bulb, its flux in lm, its item's instance; round ones alone."""
        found = {}
        emission = self.house.recipe.get("emission")
        if not emission or emission["preset"] == "released":
            return {}
        for name, (instance, k) in lamp_names(self.house).items():
            light = self.house.items[instance]["lights"][k]
            corners = self.triangles.points_of_surfaces(instance, light["emitting"])
            if len(corners):
                size = np.ptp(corners, axis=0)
                if size.min() >= _ROUND * size.max():
                    found[name] = corners, flux_lm(light, emission), instance
        return found


@dataclass(frozen=True, slots=True, eq=False)
class _Places:
    """N windows amid surfaces."""

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    points: Floats  # (N, 3), pushed off the surface
    normals: Floats  # (N, 3), towards the camera
    corners: Floats  # (N, 5, 3) middle and corners of the window, on the surface, pushed off it
    painted: Floats  # (N,) of light that comes and leaves upright: not by a coat; 1 = has none
    facing: Floats  # (N,) cosine of the normal to the ray that sees it

    def __len__(self) -> int:
        return len(self.rows)

    def returned(self, cosine: Floats) -> Floats:
        """(N,) share of a matt surface's light that is sent to the camera, at least; cosine: to the light.

        Under a coat slanting light does not reach the paint, nor leave it (Ashikhmin and Shirley 2000).
        """
        through = [1 - (1 - np.clip(c, 0, 1) / 2) ** 5 for c in (cosine, self.facing)]
        under_coat = np.minimum(28 / 23 * self.painted * through[0] * through[1], 1)
        return np.where(self.painted < 1, under_coat, 1.0)


def check_lit(
    view: StoredView,
    channels: Channels,
    arrays: Mapping[str, NDArray[Any]],
    scene: LitScene,
    rays: Rays,
    tally: Tally,
) -> None:
    """Judge sun and lamps at up to _PLACES windows of _WINDOW_PX; few of a kind tell nothing.

    rays: of all triangles, as labels see them. A view that blurs or has no recipe is judged alike.
    """
    needed = [f"{n}.{c}" for n in ("outdoor", "indoor", "albedo") for c in "RGB"]
    if not all(n in channels and channels[n].shape == view.size for n in needed):
        return
    _check_seen_bulbs(view, channels, arrays["instance"], scene, rays, tally)
    _check_windows(view, channels, scene, rays, tally)
    places = _places(view, channels, arrays, scene, rays)
    if len(places) < _FEW:
        return
    _check_sun(view, channels, places, scene, tally)
    _check_bulbs(view, channels, places, scene, tally)
    _check_level(view, channels, places, scene, tally)
    _check_colours(view, channels, places, scene, tally)


def _places(
    view: StoredView, channels: Channels, arrays: Mapping[str, NDArray[Any]], scene: LitScene,
    rays: Rays,
) -> _Places:  # fmt: skip
    """Windows that show one instance with one normal, of a surface that scatters light."""
    n = _WINDOW_PX
    instance = arrays["instance"]
    flat = ndimage.minimum_filter(instance, n) == ndimage.maximum_filter(instance, n)
    for axis in range(3):
        plane = arrays["normal"][..., axis].astype(np.int64)
        flat &= ndimage.maximum_filter(plane, n) - ndimage.minimum_filter(plane, n) < 600
    flat &= _luminance(channels, "albedo") > _LEAST_ALBEDO
    edge = n // 2 + 1
    flat[:edge] = flat[-edge:] = False
    flat[:, :edge] = flat[:, -edge:] = False
    rows, columns = np.nonzero(flat)
    rng = np.random.default_rng(zlib.crc32(f"{view.place} lit".encode()))
    chosen = rng.permutation(len(rows))[:_PLACES]
    rows, columns = rows[chosen], columns[chosen]
    origin, directions = view.rays(rows, columns)
    face = rays.first(origin, directions)
    kinds = scene.triangles.kinds_of(face)
    keep = (face >= 0) & np.isin(kinds, ("opaque",))
    keep &= np.isin(scene.triangles.instance[face], matte_items(scene.house))
    rows, columns, face, directions = rows[keep], columns[keep], face[keep], directions[keep]
    normal = rays.normal(face, directions)
    points = []
    h = n // 2
    for dy, dx in ((0, 0), (-h, -h), (-h, h), (h, -h), (h, h)):
        _, ray = view.rays(rows + dy, columns + dx)
        with np.errstate(divide="ignore", invalid="ignore"):
            at = origin + ray * rays.distance(face, origin, ray)[:, None]
        points.append(np.nan_to_num(at) + _PUSH_M * normal)
    corners = np.stack(points, axis=1)
    albedo = _luminance(channels, "albedo")[rows, columns]
    painted = (1 - COAT) * (1 - COAT / np.maximum(albedo, COAT))
    towards = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return _Places(
        rows, columns, corners[:, 0], normal, corners,
        np.where(coated_materials(scene.house)[scene.triangles.material[face]], painted, 1.0),
        -np.einsum("ni,ni->n", normal, towards),
    )  # fmt: skip


def _luminance(channels: Channels, name: str) -> Floats:
    planes = [channels[f"{name}.{c}"].astype(np.float64) for c in "RGB"]
    return np.asarray(sum(p * w for p, w in zip(planes, LUMINANCE, strict=True)))


def _lux(channels: Channels, name: str, places: _Places) -> Floats:
    """(N,) lx that arrive in windows: mean radiance over albedo."""
    share = _luminance(channels, name) / np.maximum(_luminance(channels, "albedo"), _LEAST_ALBEDO)
    mean = ndimage.uniform_filter(share, _WINDOW_PX, mode="nearest")
    return np.asarray(mean[places.rows, places.columns] * math.pi * LM_PER_W)


def _check_sun(
    view: StoredView, channels: Channels, places: _Places, scene: LitScene, tally: Tally
) -> None:
    sky = view.table.get("modes", {}).get("light", {}).get("sky", {})
    if not sky.get("sun_lx") or sky["sun_direction"][1] <= 0:
        return
    to_sun = np.array(sky["sun_direction"], np.float64)
    normal_lx = sky["sun_lx"] / to_sun[1]
    cosine = places.normals @ to_sun
    turned = cosine > _LEAST_COSINE
    n_free = np.zeros(len(places))
    sure = turned.copy()
    n_rays = 0
    for ray in _about(to_sun):
        for k in range(places.corners.shape[1]):
            start = places.corners[:, k]
            rays = np.broadcast_to(ray, start.shape)
            met = scene.inside.first(start, rays)
            free = met < 0
            sure &= ~(~free & scene.is_unsure[met])
            sure &= ~(free & (scene.outside.first(start, rays) >= 0))
            n_free += free
            n_rays += 1
    lux = _lux(channels, "outdoor", places)
    least = _HALF * normal_lx * cosine
    place = f"{view.place}/radiance.exr"
    for name, chosen, right in (
        ("lit by the sun", sure & (n_free == n_rays), lux >= least * places.returned(cosine)),
        ("in its shadow", sure & (n_free == 0), lux < least),
    ):
        n = int(chosen.sum())
        if n >= _FEW:
            share = float(right[chosen].mean())
            what = f"{name} by shadow rays, so it is at {share:.0%} of {n} places"
            tally.expect("sun", place, share >= _SHARE, what)


def _about(direction: Floats) -> Iterator[Floats]:
    """A direction and four about it."""
    side = np.cross(direction, [1.0, 0, 0] if abs(direction[0]) < 0.7 else [0, 1.0, 0])
    side /= np.linalg.norm(side)
    up = np.cross(direction, side)
    yield direction
    for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        yield direction + _SUN_RAD * (a * side + b * up)


def _check_bulbs(
    view: StoredView, channels: Channels, places: _Places, scene: LitScene, tally: Tally
) -> None:
    rows = view.table.get("modes", {}).get("light", {}).get("lamps") or []
    layers = {row["item"]: row["layer"] for row in rows}
    total = np.zeros(len(places))
    place = f"{view.place}/radiance.exr"
    for name, (corners, flux, instance) in scene.bulbs.items():
        direct = _direct_lux(places, corners, flux, instance, scene)
        total += direct
        layer = layers.get(name)
        if layer is not None and f"{layer}.R" in channels:
            _expect_lit(place, name, _lux(channels, layer, places), direct, tally)
    if scene.bulbs:
        _expect_lit(place, "all lamps", _lux(channels, "indoor", places), total, tally)


def _direct_lux(
    places: _Places, corners: Floats, flux: float, instance: int, scene: LitScene
) -> Floats:
    """(N,) lx that a round bulb alone is seen to bring, 0 where not all of it is in sight."""
    middle = (corners.min(0) + corners.max(0)) / 2
    to = middle - places.points
    distance = np.linalg.norm(to, axis=1)
    cosine = np.einsum("ni,ni->n", places.normals, to) / np.maximum(distance, 1e-6)
    free = cosine > _LEAST_COSINE
    step = max(len(corners) // 8, 1)
    for target in (middle, *(middle + 0.9 * (c - middle) for c in corners[::step])):
        ray = target - places.points
        met: Faces = scene.inside.first(places.points, ray)
        free &= (met >= 0) & (scene.triangles.instance[met] == instance)
        free &= scene.triangles.kinds_of(met) == "bulb"
    lux = flux / (4 * math.pi * distance**2) * cosine * places.returned(cosine)
    return np.where(free, lux, 0.0)


def _expect_lit(place: str, name: str, lux: Floats, direct: Floats, tally: Tally) -> None:
    lit = direct >= _LEAST_LX
    n = int(lit.sum())
    if n >= _FEW:
        share = float((lux[lit] >= _LAMP * direct[lit]).mean())
        what = f"lit by {name} by shadow rays, so it is at {share:.0%} of {n} places"
        tally.expect("lamplight", place, share >= _SHARE, what)


def _sun_on_floor(view: StoredView, room: Mapping[str, Any], scene: LitScene) -> float:
    """lx that the sun brings to a level floor of which it sees any part, else 0."""
    sky = view.table.get("modes", {}).get("light", {}).get("sky", {})
    if not sky.get("sun_lx") or sky["sun_direction"][1] <= 0:
        return 0.0
    corners = np.array(room["polygon"], np.float64)
    low, high = corners.min(0), corners.max(0)
    x, z = np.meshgrid(*(np.linspace(a, b, _FLOOR_GRID) for a, b in zip(low, high, strict=True)))
    start = np.stack([x.ravel(), np.full(x.size, room["floor_y"] + 0.1), z.ravel()], axis=1)
    inside = np.array([is_within(room["polygon"], p) for p in start[:, [0, 2]]], bool)
    start = start[inside]
    to_sun = np.broadcast_to(np.array(sky["sun_direction"], np.float64), start.shape)
    met = scene.inside.first(start, to_sun)
    free = (met < 0) | scene.is_unsure[met]
    return float(sky["sun_lx"]) if free.any() else 0.0


def _check_level(
    view: StoredView, channels: Channels, places: _Places, scene: LitScene, tally: Tally
) -> None:
    """The floor that is seen is about as bright as illuminance.json tells of the room's."""
    room = scene.house.rooms.get(str(view.table.get("room")), {})
    row = scene.house.lux_rows.get(str(view.table.get("room")))
    # What stands elsewhere than illuminance.json had it lets in other light.
    if row is None or not room or scene.house.moved is not None:
        return
    floor = (places.normals[:, 1] > _UPRIGHT) & (places.points[:, 1] < room["floor_y"] + 0.1)
    floor &= places.points[:, 1] > room["floor_y"] - 0.1
    # Through an open plan one sees the floors of others.
    floor &= [is_within(room["polygon"], point) for point in places.points[:, [0, 2]]]
    # A patch of sun that this view does not show may bring most of what is told, and one that it
    # shows may bring more.
    sun_lx = _sun_on_floor(view, room, scene)
    for group in ("outdoor", "indoor"):
        told = float(row[f"{group}_lx"])
        lux = _lux(channels, group, places)
        chosen = floor & (lux < sun_lx / 2) if group == "outdoor" and sun_lx else floor
        if chosen.sum() < _FEW:
            continue
        seen = float(np.mean(lux[chosen]))
        if max(told, seen) >= _LEAST_FLOOR_LX:
            most = seen * _LEVEL + (sun_lx if group == "outdoor" else 0.0)
            same = seen / _LEVEL <= told <= most
            what = f"{group} light brings {seen:.3g} lx to the floor that it shows, told {told:.3g}"
            tally.expect("levels", f"{view.place}/radiance.exr", same, what)


def _check_seen_bulbs(
    view: StoredView,
    channels: Channels,
    instance: NDArray[Any],
    scene: LitScene,
    rays: Rays,
    tally: Tally,
) -> None:
    """Pixels amid a bulb hold its radiance: its flux over pi and what of its area is outside."""
    level = _luminance(channels, "indoor")
    for name, (corners, flux, number) in scene.bulbs.items():
        rows, columns = np.nonzero(instance == number)
        if len(rows) < _FEW_BULB_PX:
            continue
        light = scene.house.items[number]["lights"][lamp_names(scene.house)[name][1]]
        emitting = scene.is_bulb & (scene.triangles.instance == number)
        emitting &= np.isin(scene.triangles.surface, light["emitting"])
        mask = np.zeros(instance.shape, bool)
        mask[rows, columns] = _shows(emitting, view, rays, rows, columns)
        amid = np.argwhere(ndimage.binary_erosion(mask, np.ones((3, 3), bool)))[:_MOST_BULB_PX]
        # Between the rods of a bulb are gaps that no pixel's middle meets.
        for dy, dx in itertools.product(np.linspace(-1.4, 1.4, _BULB_GRID), repeat=2):
            amid = amid[_shows(emitting, view, rays, amid[:, 0] + dy, amid[:, 1] + dx)]
        if len(amid) < _FEW_BULB_PX:
            continue
        found = float(np.median(level[tuple(amid.T)]))
        expected = flux / (LM_PER_W * math.pi * _area_outside(corners.reshape(-1, 3, 3)))
        what = f"bulb {name} shows {found:.4g} W m-2 sr-1, by house.json {expected:.4g}"
        same = abs(found / expected - 1) <= _BULB_SHARE
        tally.expect("bulbs", f"{view.place}/radiance.exr", same, what)


def _shows(
    faces: NDArray[np.bool_],
    view: StoredView,
    rays: Rays,
    rows: NDArray[Any],
    columns: NDArray[Any],
) -> NDArray[np.bool_]:
    """(N,) whether these places of the picture show one of the faces (F,)."""
    if not len(rows):
        return np.zeros(0, bool)
    face = rays.first(*view.rays(rows, columns))
    return np.asarray((face >= 0) & faces[face])


def _check_windows(
    view: StoredView, channels: Channels, scene: LitScene, rays: Rays, tally: Tally
) -> None:
    """By day, what is seen through panes, or where nothing is, has outdoor light, and hardly any of lamps."""
    sky = view.table.get("modes", {}).get("light", {}).get("sky", {})
    if not scene.house.rooms or sky.get("sky_lx", 0.0) < _DAY_LX:
        return
    height, width = view.size
    rng = np.random.default_rng(zlib.crc32(f"{view.place} windows".encode()))
    index = rng.choice(height * width, min(_WINDOW_RAYS, height * width), replace=False)
    rows, columns = index // width, index % width
    origin, directions = view.rays(rows, columns)
    through = directions.any(axis=1) & (scene.inside.first(origin, directions) < 0)
    if int(through.sum()) < _FEW:
        return
    day, lamps = (
        float(np.median(_luminance(channels, g)[rows, columns][through]))
        for g in ("outdoor", "indoor")
    )
    what = f"windows show {day:.3g} W m-2 sr-1 of daylight and {lamps:.3g} of lamps"
    tally.expect("windows", f"{view.place}/radiance.exr", day > lamps, what)


def _check_colours(
    view: StoredView, channels: Channels, places: _Places, scene: LitScene, tally: Tally
) -> None:
    """By day, lamps whose sources name no colour are redder than what comes from outside."""
    sky = view.table.get("modes", {}).get("light", {}).get("sky", {})
    lights = [light for row in scene.house.items.values() for light in row["lights"]]
    emission = scene.house.recipe.get("emission", {})
    # Sources that name no colour have a warm white one, drawn by the recipe.
    is_warm = not any(x["is_coloured"] or np.ptp(x["rgb_linear"]) > _GREY for x in lights)
    is_warm &= emission.get("preset") == "photometric" and emission["lamp_kelvin_max"] <= _WARM_K
    if not lights or not is_warm or sky.get("sky_lx", 0.0) < _DAY_LX:
        return
    share = {}
    for group in ("outdoor", "indoor"):
        red, blue = (
            float(
                (channels[f"{group}.{c}"] / np.maximum(channels[f"albedo.{c}"], _LEAST_ALBEDO))[
                    places.rows, places.columns
                ].mean(dtype=np.float64)
            )
            for c in "RB"
        )
        share[group] = red / blue if blue > 0 else 0.0
    if min(share.values()) > 0:
        what = (
            f"red over blue is {share['indoor']:.2f} of lamps, {share['outdoor']:.2f} of daylight"
        )
        same = share["indoor"] > share["outdoor"]
        tally.expect("colours of light", f"{view.place}/radiance.exr", same, what)


def _area_outside(corners: Floats) -> float:
    """m2 of triangles (F, 3, 3): once where each edge has its reverse, else from both sides."""
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = float(np.linalg.norm(sides, axis=1).sum() / 2)
    _, numbers = np.unique(np.round(corners.reshape(-1, 3), 6), axis=0, return_inverse=True)
    faces = numbers.reshape(-1, 3)
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges = edges[edges[:, 0] != edges[:, 1]]
    counts = np.unique(edges, axis=0, return_counts=True)[1]
    return area if float((counts >= 2).mean()) > 0.95 else 2 * area
