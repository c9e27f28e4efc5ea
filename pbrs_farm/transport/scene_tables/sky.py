"""Sky: outdoor light as one latitude-longitude image of the dome and one sun; no effects.

A clear sky, its sun and clouds have the level of standard tables at the sun's elevation, by day, dusk
and night; `sky_lx` and `sun_lx` scale them. A panorama gives `sky_lx` on open level ground, its sun at
most `sun_lx` more. Rows run from the zenith (+y, row 0) to the nadir, columns with the azimuth
atan2(x, -z).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.edits import unedited_id
from pbrs_farm.core.errors import BadRecipe
from pbrs_farm.core.frames import LM_PER_W, LUMINANCE
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.raycast.variant import choose_variant, mitsuba

DOME_SHAPE: Final = (256, 512)  # texels of an analytic sky
SUN_HALF_ANGLE_RAD: Final = math.radians(0.5358 / 2)
GROUND_ALBEDO: Final = 0.2  # grey
NO_SKIES: Final = ("interior", "studio", "courtyard", "night")  # panoramas without a daylight sky

_SUN_ELEVATION_DEG: Final = (15.0, 60.0)  # range from which a house's sun is drawn
_DUSK_DEG: Final = (-6.0, -1.5)  # range from which a house's dusk is drawn
_NIGHT_DEG: Final = -30.0
_NIGHT_FROM_DEG: Final = 12.0  # below the horizon: nautical twilight is over
_HORIZON_RAD: Final = math.radians(1.0)  # elevation of the sun whose sky is used at sunset
_BLUE_DEG: Final = 8.0  # below the horizon, where no glow is left
# Elevation of the sun in degrees -> log10 lx that a clear sky without its sun and without a moon gives
# to open level ground: the US Naval Observatory's twilight tables, by day the means of CIE 110.
_CLEAR_LOG_LX: Final = (
    (-18.0, -12.0, -6.0, -3.0, 0.0, 2.0, 10.0, 30.0, 60.0, 90.0),
    (-3.2, -2.1, 0.53, 1.6, 2.78, 3.15, 3.65, 4.0, 4.11, 4.15),
)
_CLEAR_LX: Final = 10_000.0  # of that table with the sun at 30 degrees: what sky_lx is the level of
_OVERCAST_LX: Final = (300.0, 21_000.0)  # at sunset, and more by the sine of the elevation (IES)
_OVERCAST_SHARE: Final = 0.5  # of the clear sky's light that clouds let through after sunset
_TOWN_LX: Final = 0.3  # of street lamps in the air of a town
_BLUE: Final = (0.35, 0.55, 1.0)
_TOWN: Final = (1.0, 0.8, 0.6)
_CLOUDS: Final = (0.94, 0.98, 1.06)
_OPTICAL_DEPTH: Final = 0.21  # of clear air at the zenith, for the sun's light (IES)
_SUN_RAD: Final = math.radians(4)  # around a panorama's brightest texel, where its sun is sought
_RING_RAD: Final = math.radians(
    6
)  # outer edge of the ring in which the sky around the sun is measured
_SUN_FACTOR: Final = 20  # the sun is brighter than that ring by this


@dataclass(frozen=True, slots=True, eq=False)
class Sky:
    """Light from outside, in the world frame: a dome of radiance and a sun apart from it.

    `sky_for_house` makes that of a recipe; `dark_sky` and `uniform_sky` are for tests.
    """

    name: str  # of view.json
    dome: F32  # (H, W, 3) radiance in W m-2 sr-1, sun removed
    sun_direction: F64  # (3,) unit, towards the sun
    sun_irradiance: F64  # (3,) W m-2 facing the sun, linear RGB; zeros = no sun
    sun_half_angle_rad: float = SUN_HALF_ANGLE_RAD  # of its disc
    rotation_rad: float = 0.0  # of the source about +y
    scale: float = 1.0  # of the source's radiance

    @property
    def sky_lx(self) -> float:
        """Illuminance of open level ground by the dome alone."""
        return LM_PER_W * float(horizontal_irradiance(self.dome) @ LUMINANCE)

    @property
    def sun_lx(self) -> float:
        """Illuminance of open level ground by the sun alone."""
        up = max(float(self.sun_direction[1]), 0.0)
        return LM_PER_W * float(self.sun_irradiance @ LUMINANCE) * up

    def facts(self) -> dict[str, Any]:
        """Entries for view.json."""
        x, y, z = (float(v) for v in self.sun_direction)
        return {
            "name": self.name,
            "rotation_deg": round(math.degrees(self.rotation_rad), 3),
            "scale": float(self.scale),
            "sky_lx": round(self.sky_lx, 1),
            "sun_lx": round(self.sun_lx, 1),
            "sun_direction": [round(v, 6) for v in (x, y, z)],
            "sun_elevation_deg": round(math.degrees(math.asin(max(-1.0, min(1.0, y)))), 3),
        }


def dark_sky() -> Sky:
    """No light from outside."""
    return Sky("none", np.zeros((2, 4, 3), np.float32), np.array([0.0, 1.0, 0.0]), np.zeros(3))


def uniform_sky(radiance: tuple[float, float, float]) -> Sky:
    """The same radiance from every direction, no sun: the furnace of the tests."""
    dome = np.broadcast_to(np.array(radiance, np.float32), (16, 32, 3)).copy()
    return Sky("uniform", dome, np.array([0.0, 1.0, 0.0]), np.zeros(3))


def choose_panorama(names: list[str], house_id: str, seed: int) -> str:
    """The panorama of a house, without known interiors and nights; BadRecipe if none is left."""
    skies = sorted(n for n in names if not any(word in n.lower() for word in NO_SKIES))
    if not skies:
        hint = "latitude-longitude .exr or .hdr files; `blender-data` has some"
        raise BadRecipe("sky.panoramas: no outdoor panorama in the folder", hint=hint)
    return skies[keys.seed("panorama", unedited_id(house_id), seed) % len(skies)]


def sky_for_house(
    recipe: Recipe, house_id: str, *, panorama: tuple[str, NDArray[np.floating]] | None = None
) -> Sky:
    """The sky of a house under a recipe; panorama: (name, (H, W, 3) linear radiance, row 0 = up).

    Raises BadRecipe when the recipe wants a panorama and none is given, or its shape is not 2:1.
    """
    if recipe.sky.kind == "panorama":
        if panorama is None:
            hint = "--set sky.panoramas=FOLDER, or --set sky.kind=sunsky"
            raise BadRecipe("sky.kind is panorama and no panorama is given", hint=hint)
        rotation = _uniform(house_id, recipe.seed, "rotation") * 2 * math.pi
        return sky_from_panorama(panorama[0], panorama[1], recipe, rotation_rad=rotation)
    elevation, azimuth, is_overcast = _sun_of_house(recipe, house_id)
    if is_overcast:
        return overcast(recipe, elevation_rad=elevation, azimuth_rad=azimuth)
    if elevation < 0:
        return evening(recipe, elevation_rad=elevation, azimuth_rad=azimuth)
    return sunsky(recipe, elevation_rad=elevation, azimuth_rad=azimuth)


def _sun_of_house(recipe: Recipe, house_id: str) -> tuple[float, float, bool]:
    """The sun's elevation and azimuth, rad, and whether clouds hide it: of the recipe or by seeds of the house."""
    fields = recipe.sky
    low, high = _SUN_ELEVATION_DEG
    elevation = math.radians(low + (high - low) * _uniform(house_id, recipe.seed, "elevation"))
    azimuth = _uniform(house_id, recipe.seed, "azimuth") * 2 * math.pi
    time, is_overcast = str(fields.time), fields.overcast
    is_sun_given = fields.hour is not None or fields.sun_elevation_deg is not None
    # The recipe gives the sun: dusk, night and clouds are then as it says, not drawn.
    if time == "drawn" and not is_sun_given:
        time, drawn_overcast = drawn_time(house_id, recipe.seed)
        is_overcast |= drawn_overcast
    if time == "dusk":
        low, high = _DUSK_DEG
        elevation = math.radians(low + (high - low) * _uniform(house_id, recipe.seed, "elevation"))
    elif time == "night":
        elevation = math.radians(_NIGHT_DEG)
    if fields.hour is not None:
        elevation, azimuth = sun_of_hour(fields.hour, fields.latitude_deg, fields.day_of_year)
    if fields.sun_elevation_deg is not None:
        elevation = math.radians(fields.sun_elevation_deg)
    if fields.sun_azimuth_deg is not None:
        azimuth = math.radians(fields.sun_azimuth_deg)
    return elevation, azimuth, is_overcast


def drawn_time(house_id: str, seed: int) -> tuple[str, bool]:
    """("day", "dusk" or "night", whether overcast) of a house: a third is lit by its lamps."""
    share = _uniform(house_id, seed, "hour")
    if share < 1 / 6:
        return "night", False
    if share < 1 / 3:
        return "dusk", False
    return "day", share < 1 / 2


def sun_of_hour(hour: float, latitude_deg: float, day_of_year: int) -> tuple[float, float]:
    """(elevation, azimuth) of the sun in rad at an hour by the sun itself; azimuth from -z, north, to +x.

    Declination by Cooper 1969, which is within half a degree.
    """
    declination = math.radians(23.45) * math.sin(2 * math.pi * (284 + day_of_year) / 365)
    turned, latitude = math.radians(15 * (hour - 12)), math.radians(latitude_deg)
    up = math.sin(latitude) * math.sin(declination)
    up += math.cos(latitude) * math.cos(declination) * math.cos(turned)
    east = -math.cos(declination) * math.sin(turned)
    north = math.cos(latitude) * math.sin(declination)
    north -= math.sin(latitude) * math.cos(declination) * math.cos(turned)
    return math.asin(max(-1.0, min(1.0, up))), math.atan2(east, north)


def clear_sky_lx(elevation_rad: float) -> float:
    """Illuminance of open horizontal ground by a clear sky without its sun, by the sun's elevation.

    Without moon or city light: 14,000 lx with the sun at the zenith, 600 at the horizon, 3.4 at 6 degrees
    below, 0.0006 by night.

        >>> round(clear_sky_lx(0.0))
        603
    """
    return float(10 ** np.interp(math.degrees(elevation_rad), *_CLEAR_LOG_LX))


def sun_normal_lx(elevation_rad: float, zenith_lx: float) -> float:
    """Illuminance of a surface that faces the sun, above the horizon, through clear air.

    zenith_lx: the same with the sun at the zenith. Air mass by Kasten and Young 1989.

        >>> round(sun_normal_lx(0.5, 100_000.0), -3)
        80000.0
    """
    degrees = math.degrees(elevation_rad)
    air_mass = 1 / (math.sin(elevation_rad) + 0.50572 * (degrees + 6.07995) ** -1.6364)
    return zenith_lx * math.exp(-_OPTICAL_DEPTH * (air_mass - 1))


def evening(recipe: Recipe, *, elevation_rad: float, azimuth_rad: float) -> Sky:
    """A sky whose sun is below the horizon: its glow fades to blue, and by night to that of a town.

    Its level is `clear_sky_lx` times sky_lx / 10,000; _TOWN_LX is added.
    """
    # The model's sky at sunset, bluer the lower the sun is.
    depth_deg = -math.degrees(elevation_rad)
    glow, _sun = _hosek(_direction(_HORIZON_RAD, azimuth_rad))
    glow[glow.shape[0] // 2 :] = 0.0
    share = min(depth_deg / _BLUE_DEG, 1.0)
    dome = (1 - share) * _scaled_to(glow, 1.0) + share * _scaled_to(_even(_BLUE), 1.0)
    dome *= clear_sky_lx(elevation_rad) * recipe.emission.sky_lx / _CLEAR_LX
    dome += _scaled_to(_even(_TOWN), _TOWN_LX)
    name = "dusk" if depth_deg < _NIGHT_FROM_DEG else "night"
    sun = _direction(elevation_rad, azimuth_rad)
    return _with_ground(Sky(name, dome.astype(np.float32), sun, np.zeros(3)))


def overcast(recipe: Recipe, *, elevation_rad: float, azimuth_rad: float) -> Sky:
    """The CIE's overcast sky: three times as bright at the zenith as at the horizon, no sun seen.

    elevation_rad: of the sun behind the clouds, which sets the level: 10,800 lx at 30 degrees (IES),
    half of the clear sky's below the horizon, times sky_lx / 10,000; _TOWN_LX is added.
    """
    height = np.maximum(directions(*DOME_SHAPE)[..., 1:2], 0.0)
    dome = (1 + 2 * height) / 3 * np.array(_CLOUDS)
    dome[dome.shape[0] // 2 :] = 0.0
    at_sunset, more = _OVERCAST_LX
    if elevation_rad >= 0:
        level = at_sunset + more * math.sin(elevation_rad)
    else:
        level = _OVERCAST_SHARE * clear_sky_lx(elevation_rad)
    scaled = _scaled_to(dome, level * recipe.emission.sky_lx / _CLEAR_LX)
    scaled += _scaled_to(_even(_TOWN), _TOWN_LX)
    sun = _direction(elevation_rad, azimuth_rad)
    return _with_ground(Sky("overcast", scaled.astype(np.float32), sun, np.zeros(3)))


def _even(rgb: tuple[float, float, float]) -> F64:
    """(H, W, 3) of one colour above the horizon."""
    dome = np.zeros((*DOME_SHAPE, 3))
    dome[: DOME_SHAPE[0] // 2] = rgb
    return dome


def _scaled_to(dome: NDArray[np.floating], lux: float) -> F64:
    """The dome with another illuminance of open level ground."""
    return np.asarray(dome * (lux / (LM_PER_W * float(horizontal_irradiance(dome) @ LUMINANCE))))


def _direction(elevation_rad: float, azimuth_rad: float) -> F64:
    """(3,) unit, from azimuth -z towards +x."""
    level = math.cos(elevation_rad)
    return np.array(
        [level * math.sin(azimuth_rad), math.sin(elevation_rad), -level * math.cos(azimuth_rad)]
    )


def sunsky(recipe: Recipe, *, elevation_rad: float, azimuth_rad: float) -> Sky:
    """Hosek and Wilkie's clear sky (Mitsuba's `sunsky`) with the sun at that place.

    elevation_rad: 0 or above. azimuth_rad: from -z towards +x. Open level ground gets `clear_sky_lx`
    times emission.sky_lx / 10,000 of the dome; the sun gives what air leaves of emission.sun_lx.
    """
    # Evaluate the model, which has no sky for a sun that touches the horizon, and scale its upper half.
    sun = _direction(elevation_rad, azimuth_rad)
    dome, sun_rgb = _hosek(_direction(max(elevation_rad, _HORIZON_RAD), azimuth_rad))
    dome[dome.shape[0] // 2 :] = 0.0
    level = clear_sky_lx(elevation_rad) * recipe.emission.sky_lx / _CLEAR_LX
    scale = level / (LM_PER_W * float(horizontal_irradiance(dome) @ LUMINANCE))
    dome *= scale
    # Dim the sun by the air before it.
    lux = sun_normal_lx(elevation_rad, recipe.emission.sun_lx)
    irradiance = sun_rgb / (sun_rgb @ LUMINANCE) * lux / LM_PER_W
    return _with_ground(Sky("sunsky", dome, sun, irradiance, scale=scale))


def sky_from_panorama(
    name: str, rgb: NDArray[np.floating], recipe: Recipe, *, rotation_rad: float
) -> Sky:
    """A panorama with its sun taken out, both on the photometric scale; its ground stays.

    The preset `released` scales the whole image by `released_sky` and does not turn it.
    """
    if rgb.ndim != 3 or rgb.shape[1] != 2 * rgb.shape[0] or rgb.shape[2] < 3:
        raise BadRecipe(f"panorama {name}: expected (H, 2 H, 3), got {rgb.shape}")
    picture = np.maximum(np.nan_to_num(np.asarray(rgb[..., :3], np.float64)), 0.0)
    if recipe.emission.preset == "released":
        scale, up = recipe.emission.released_sky, np.array([0.0, 1.0, 0.0])
        return Sky(name, (picture * scale).astype(np.float32), up, np.zeros(3), scale=scale)
    # Turn the image about the vertical by whole texels and take its sun out.
    shift = round(rotation_rad / (2 * math.pi) * picture.shape[1])
    picture = np.roll(picture, shift, axis=1)
    dome, sun, irradiance = _without_sun(picture)
    # Scale the dome to sky_lx and the sun alike, but to what clear air lets through at most.
    dome_lx = LM_PER_W * float(horizontal_irradiance(dome) @ LUMINANCE)
    if dome_lx <= 0:
        raise BadRecipe(f"panorama {name}: its upper half is black")
    scale = recipe.emission.sky_lx / dome_lx
    irradiance = irradiance * scale
    sun_lx = LM_PER_W * float(irradiance @ LUMINANCE)
    most_lx = sun_normal_lx(math.asin(min(max(sun[1], 0.0), 1.0)), recipe.emission.sun_lx)
    if sun_lx > most_lx:
        irradiance = irradiance * (most_lx / sun_lx)
    turned_rad = shift / picture.shape[1] * 2 * math.pi
    scaled = (dome * scale).astype(np.float32)
    return Sky(name, scaled, sun, irradiance, rotation_rad=turned_rad, scale=scale)


def directions(height: int, width: int) -> F64:
    """(H, W, 3) unit directions of the texels' centres."""
    theta = (np.arange(height) + 0.5) / height * math.pi
    phi = (np.arange(width) + 0.5) / width * 2 * math.pi
    s = np.sin(theta)[:, None]
    y = np.broadcast_to(np.cos(theta)[:, None], (height, width))
    return np.stack([s * np.sin(phi), y, -s * np.cos(phi)], -1)


def solid_angles(height: int, width: int) -> F64:
    """(H,) exact solid angle of one texel of each row, sr."""
    edges = np.cos(np.arange(height + 1) / height * math.pi)
    return np.asarray((edges[:-1] - edges[1:]) * 2 * math.pi / width)


def horizontal_irradiance(dome: NDArray[np.floating]) -> F64:
    """(3,) irradiance of level open ground by the upper half of a latitude-longitude image."""
    height, width = dome.shape[:2]
    up = np.maximum(directions(height, width)[..., 1], 0.0)
    weight = up * solid_angles(height, width)[:, None]
    return np.asarray(np.einsum("hwc,hw->c", np.asarray(dome, np.float64), weight))


def _with_ground(sky: Sky) -> Sky:
    # Fill the lower half with grey ground, lit by the whole sky.
    ground = horizontal_irradiance(sky.dome) + sky.sun_irradiance * max(sky.sun_direction[1], 0.0)
    dome = sky.dome.copy()
    dome[dome.shape[0] // 2 :] = (GROUND_ALBEDO * ground / math.pi).astype(np.float32)
    return Sky(
        sky.name, dome, sky.sun_direction, sky.sun_irradiance, rotation_rad=0.0, scale=sky.scale
    )


def _hosek(sun: F64) -> tuple[F32, F64]:
    """(dome (256, 512, 3) unscaled, colour of the sun (3,)) for a sun direction, world frame."""
    variant = choose_variant()
    mi = mitsuba(variant)
    towards = directions(*DOME_SHAPE).reshape(-1, 3)

    # Turn into Mitsuba's frame, +z up: world (x, y, z) is its (x, -z, y).
    def turned(v: F64) -> F64:
        return np.stack([v[..., 0], -v[..., 2], v[..., 1]], -1)

    # Load sky and sun as two emitters, so that each can be evaluated alone.
    fields = {"type": "sunsky", "sun_direction": [float(v) for v in turned(sun)]}
    sky = mi.load_dict({**fields, "sun_scale": 0.0})
    disc = mi.load_dict({**fields, "sky_scale": 0.0})
    dome = _evaluated(mi, variant, sky, turned(towards)).reshape(*DOME_SHAPE, 3)
    return dome, _evaluated(mi, variant, disc, turned(sun)[None])[0].astype(np.float64)


def _evaluated(mi: Any, variant: str, emitter: Any, towards: F64) -> F32:
    """(N, 3) radiance of an emitter at infinity from directions (N, 3)."""
    if variant.startswith("scalar"):
        rows = []
        for direction in towards:
            si = mi.SurfaceInteraction3f()
            si.wi = mi.Vector3f(*(-direction))
            rows.append(np.asarray(emitter.eval(si), np.float32))
        return np.stack(rows)
    import drjit as dr

    si = dr.zeros(mi.SurfaceInteraction3f, len(towards))
    si.wi = mi.Vector3f(*(np.ascontiguousarray(-towards[:, k], np.float32) for k in range(3)))
    return np.asarray(emitter.eval(si).numpy().T, np.float32)


def _without_sun(picture: F64) -> tuple[F64, F64, F64]:
    """(image without its sun, unit direction of it, irradiance facing it) of a panorama.

    The sun's texels lie within 4 degrees of the brightest one and are brighter than 20 times the
    mean of the ring of 4 to 6 degrees around it, which replaces them.
    """
    # Find the brightest texel above the horizon and measure the ring around it.
    height, width = picture.shape[:2]
    luminance = picture @ LUMINANCE
    upper = luminance[: height // 2]
    towards = directions(height, width)
    row, column = np.unravel_index(int(np.argmax(upper)), upper.shape)
    peak = towards[row, column]
    cosine = towards @ peak
    ring = (cosine < math.cos(_SUN_RAD)) & (cosine > math.cos(_RING_RAD))
    level = float(np.mean(luminance[ring])) if ring.any() else float(np.mean(upper))
    disc = (cosine >= math.cos(_SUN_RAD)) & (luminance > _SUN_FACTOR * max(level, 1e-9))
    if not disc.any():
        return picture, peak, np.zeros(3)
    # Integrate what the disc has above its surroundings: irradiance, and its centre.
    filling = picture[ring].mean(0) if ring.any() else np.full(3, level)
    weight = np.broadcast_to(solid_angles(height, width)[:, None], disc.shape)[disc]
    excess = np.maximum(picture[disc] - filling, 0.0)
    irradiance = np.asarray((excess * weight[:, None]).sum(0))
    strength = excess @ LUMINANCE * weight
    sun = (towards[disc] * strength[:, None]).sum(0)
    # Fill the disc with the mean of the ring.
    out = picture.copy()
    out[disc] = filling
    return out, sun / np.linalg.norm(sun), irradiance


def _uniform(house_id: str, seed: int, what: str) -> float:
    return keys.seed("sky", what, unedited_id(house_id), seed) / 2**32
