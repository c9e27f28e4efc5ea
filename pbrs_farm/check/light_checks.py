"""Pictures in the light modes: radiance.exr through denoiser, white balance and tone again. Effects: reads files.

Formulas are written again here from docs/light.md and the sources named; the stages' code is not used.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.embree_caster import Floats
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.picture_cameras import PictureCamera
from pbrs_farm.core.recipe import Recipe, SensorFields, ToneFields

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear sRGB
_MITSUBA_LUMINANCE = np.array([0.212671, 0.715160, 0.072169])
_GROUPS = {"mlt_ol": ("outdoor",), "mlt_il_ol": ("outdoor", "indoor")}

# What a picture may differ by from the one developed here, in steps of 255.
_EXACT_STEPS, _EXACT_SHARE = 1, 0.002  # by one step at most, in so few values
_DENOISED_STEPS, _DENOISED_SHARE = 2, 0.01  # another processor's denoiser
_TILE_PX = 16  # over which noise is averaged, of a sensor or of light at half its size
_TILE_STEPS, _TILES = 10, 0.9  # mean of a tile, share of tiles
_LEAST_HALVED_PX = 160  # a shorter side has few tiles at half the size, and costs little
_FACTOR = 0.002  # of exposure and gains that view.json tells
_TIE, _HALVED_TIE = 1e-6, 0.02  # of a level: what single precision, or half the size, keeps of it
_HALVED_FACTOR = 0.2  # of those at half the size: of 2 samples a pixel it is up to 0.08


def check_developed(
    view: StoredView,
    channels: Mapping[str, NDArray[np.float32]],
    arrays: Mapping[str, NDArray[Any]],
    tally: Tally,
    *,
    is_halved: bool = False,
) -> None:
    """Develop radiance.exr (its channels) again, and compare with the stored pictures of the light modes.

    is_halved: light that was denoised is denoised again at half its size, and its pictures are
    compared by tiles; as it stands costs most of the time. Only where `may_be_halved` says so. What
    differs so is looked at again as it stands, and that decides: a white balance may turn on which
    half of the pixels is lit, and half the size has others.

    Does nothing where the view has no picture of a light mode, no radiance.exr or no recipe:
    `methods.not_looked_at` says so. arrays has the layers by name.
    """
    if is_halved:
        tried = Tally()
        _check_modes(view, channels, arrays, tried, is_halved=True)
        if not tried.n_failed:
            tally.take(tried)
            return
    _check_modes(view, channels, arrays, tally, is_halved=False)


def _check_modes(
    view: StoredView,
    channels: Mapping[str, NDArray[np.float32]],
    arrays: Mapping[str, NDArray[Any]],
    tally: Tally,
    *,
    is_halved: bool,
) -> None:
    modes = [m for m in _GROUPS if m in arrays]
    if not modes or view.recipe is None:
        return
    light = stored_light(view, channels, is_halved, tally)
    if light is None:
        return
    stated = view.table.get("modes", {}).get("develop", {})
    camera = _camera_of(view, view.recipe, 0)
    for mode in modes:
        place, told = f"{view.place}/{mode}.png", stated.get(mode, {})
        shot = _Shot(place, mode, told, camera, is_halved, _follows(view, camera))
        _check_picture(shot, arrays[mode], light, view.recipe, tally)
    _check_errors(view, stated, camera, tally)
    _check_variants(view, stated.get("variants", []), arrays, light, is_halved, tally)


def may_be_halved(view: StoredView) -> bool:
    """Whether a view's light was denoised, and its pictures are large enough for tiles at half their size."""
    if view.recipe is None or not view.recipe.light.denoise or not view.has("radiance.exr"):
        return False
    is_lit = any(view.has(f"{mode}.png") for mode in _GROUPS)
    return is_lit and min(view.size) >= _LEAST_HALVED_PX


@dataclass(frozen=True, slots=True)
class _Shot:
    """One picture: where it is, its mode, what view.json states of it, and what took it."""

    place: str
    mode: str
    stated: Mapping[str, Any]
    camera: PictureCamera
    is_halved: bool  # its light is denoised at half its size
    follows: bool  # its exposure lags behind that of frames before


def _camera_of(view: StoredView, recipe: Recipe, variant: int) -> PictureCamera:
    return recipe.camera_of(view.folder.parent.parent.name, view.folder.name, variant)


def _follows(view: StoredView, camera: PictureCamera) -> bool:
    return camera.sensor.lag_s > 0 and view.table.get("time_s") is not None


def _check_variants(
    view: StoredView,
    rows: Any,
    arrays: Mapping[str, NDArray[Any]],
    light: Mapping[str, NDArray[np.float32]],
    is_halved: bool,
    tally: Tally,
) -> None:
    """Each further picture is there, is stated, and is what the camera drawn for it takes."""
    rows, recipe = rows if isinstance(rows, list) else [], view.recipe
    assert recipe is not None
    wanted = [f"mlt_il_ol.{n}.png" for n in range(1, recipe.tone.variants + 1)]
    told = [row.get("file") if isinstance(row, dict) else None for row in rows]
    there = sorted(path.name for path in view.folder.glob("mlt_il_ol.*.png"))
    what = (
        f"view.json tells of the variants {told}, the recipe asks for {wanted}, there are {there}"
    )
    if not tally.expect("light developed", view.place, told == wanted == there, what):
        return
    for n, row in enumerate(rows, 1):
        camera = _camera_of(view, recipe, n)
        _check_errors(view, row, camera, tally)
        place = f"{view.place}/{row['file']}"
        shot = _Shot(place, "mlt_il_ol", row, camera, is_halved, _follows(view, camera))
        if f"mlt_il_ol.{n}" in arrays:  # else it is damaged, and the check of layers says so
            _check_picture(shot, arrays[f"mlt_il_ol.{n}"], light, recipe, tally)


def _check_errors(
    view: StoredView, stated: Mapping[str, Any], camera: PictureCamera, tally: Tally
) -> None:
    """What view.json tells of a camera that errs, and of its errors, is what the recipe draws."""
    told = {name: stated.get(name) for name in ("camera", "tone")}
    names = ("exposure_ev", "warmth_ev", "tint_ev", "contrast")
    drawn: dict[str, Any] = {"camera": None, "tone": None}
    if camera.name != "neutral":
        drawn = {"camera": camera.name, "tone": {n: getattr(camera.tone, n) for n in names}}
    what = f"view.json tells of its camera {told}, the recipe draws {drawn}"
    tally.expect("light developed", view.place, told == drawn, what)


def _check_picture(
    shot: _Shot,
    stored: NDArray[Any],
    light: Mapping[str, NDArray[np.float32]],
    recipe: Recipe,
    tally: Tally,
) -> None:
    tone, sensor = shot.camera.tone, shot.camera.sensor
    total = sum((light[g] for g in _GROUPS[shot.mode]), np.zeros_like(light["outdoor"]))
    total = _add_glare(total, tone.glare)
    gains, exposure = _check_factors(shot, total, light["albedo"], tally)
    balanced = np.maximum(np.nan_to_num((total * gains).astype(np.float64), posinf=0.0), 0)
    expected = _tone(balanced, exposure, shot.camera, gains, float(shot.stated.get("iso", 0.0)))
    if shot.is_halved:
        _compare_tiles("light by tiles", shot.place, _halved(stored), expected, tally)
    elif sensor.is_on:
        _compare_tiles("light developed", shot.place, stored, expected, tally)
    else:
        is_denoised = recipe.light.denoise
        _compare_pixels(shot.place, stored, expected, tally, is_denoised=is_denoised)


def _check_factors(
    shot: _Shot, total: NDArray[np.float32], albedo: NDArray[np.float32], tally: Tally
) -> tuple[NDArray[Any], float]:
    """(gains (3,), exposure) that view.json tells, where they are near those of the light; else these.

    Whether a pixel lies above a percentile hangs on its last bit: what is told goes on.
    """
    tone, stated = shot.camera.tone, shot.stated
    slack, tie = (_HALVED_FACTOR, _HALVED_TIE) if shot.is_halved else (_FACTOR, _TIE)
    told = np.array(stated.get("gains", ()), np.float64)
    own_gains = _white_balance(total, albedo, tone)
    is_told = told.shape == (3,) and "exposure" in stated
    if is_told and np.abs(told - own_gains).max() > slack:
        # Half the picture may be a sky of one level, of which a last bit decides what counts.
        either = [_white_balance(total, albedo, tone, least=1 + s) for s in (-tie, tie)]
        own_gains = min(either, key=lambda found: float(np.abs(told - found).max()))
    balanced = np.maximum(np.nan_to_num((total * own_gains).astype(np.float64), posinf=0.0), 0)
    own = _exposure(balanced, tone)
    what = "view.json does not tell three gains and an exposure"
    if not tally.expect("light developed", shot.place, is_told, what):
        return own_gains, own
    exposure = float(stated["exposure"])
    by_sensor = shot.camera.sensor.is_on
    off_exposure = _off_sensor(shot, own) if by_sensor else abs(exposure / own - 1)
    off = float(np.max([np.abs(told - own_gains).max(), off_exposure]))
    what = f"view.json tells other factors, by {off:.4f}"
    same = tally.expect("light developed", shot.place, off <= slack, what)
    return (told, exposure) if same else (own_gains, own)


def _off_sensor(shot: _Shot, wanted: float) -> float:
    """By what share shutter, ISO and exposure are off those that the sensor chooses for a wanted factor."""
    sensor, stated = shot.camera.sensor, shot.stated
    # The factor of a second at ISO 1, by ISO 12232's saturation: docs/lenses.md.
    unit = 179 * np.pi / 4 / sensor.f_number**2 / 78 * sensor.headroom
    shutter, iso = (float(stated.get(name, 0.0)) for name in ("shutter_s", "iso"))
    off = abs(float(stated["exposure"]) - shutter * iso * unit) / max(shutter * iso * unit, 1e-9)
    if shot.follows:
        return off
    product = wanted * 2**sensor.compensation_ev / unit
    longest = max(sensor.shutter_max_s, sensor.shutter_min_s)
    own = sensor.shutter_s or np.clip(product / sensor.iso_min, sensor.shutter_min_s, longest)
    own_iso = np.clip(product / own, sensor.iso_min, max(sensor.iso_max, sensor.iso_min))
    return float(np.max([off, abs(shutter / own - 1), abs(iso / own_iso - 1)]))


def _compare_pixels(
    place: str, stored: NDArray[Any], expected: NDArray[Any], tally: Tally, *, is_denoised: bool
) -> None:
    steps, share = _EXACT_STEPS, _EXACT_SHARE
    if is_denoised:
        steps, share = _DENOISED_STEPS, _DENOISED_SHARE
    difference = np.abs(stored.astype(int) - expected.astype(int))
    wrong = (difference > steps).any(axis=-1)
    n_wrong = int(wrong.sum())
    off_by_one = float((difference > 0).mean()) if not is_denoised else 0.0
    # The network's last bits differ between processors; a patch does not hide among so few.
    allowed = n_wrong <= (share * wrong.size if is_denoised else 0)
    is_patch = allowed and bool(ndimage.uniform_filter(wrong.astype(float), 5).max() > 0.5)
    good = allowed and not is_patch and off_by_one <= share
    tally.add("light developed", wrong.size, ties=n_wrong if good else 0)
    if not good:
        row, column = np.argwhere(difference.any(axis=-1))[0]
        what = f"differs from radiance.exr at row {row}, column {column}"
        tally.fail("light developed", place, what, max(n_wrong, 1))


def _halved(picture: NDArray[Any]) -> NDArray[np.float32]:
    """(H / 2, W / 2, 3) means of 2 x 2 pixels; an odd row or column is left out."""
    height, width = (n // 2 * 2 for n in picture.shape[:2])
    cut = picture[:height, :width].astype(np.float32)
    parts = cut.reshape(height // 2, 2, width // 2, 2, 3)
    return np.ascontiguousarray(parts.mean(axis=(1, 3)))


def _compare_tiles(
    check: str, place: str, stored: NDArray[Any], expected: NDArray[Any], tally: Tally
) -> None:
    """Means of tiles: noise goes in them; what is left of a sensor is its lens, mosaic and JPEG."""
    difference = np.abs(_tiles(stored) - _tiles(expected)).mean(axis=-1)
    share = float((difference <= _TILE_STEPS).mean())
    what = f"{1 - share:.0%} of its tiles differ from radiance.exr"
    tally.expect(check, place, share >= _TILES, what)


def _tiles(picture: NDArray[Any]) -> Floats:
    height, width = (max(n // _TILE_PX, 1) * min(_TILE_PX, n) for n in picture.shape[:2])
    size = min(_TILE_PX, picture.shape[0]), min(_TILE_PX, picture.shape[1])
    cut = picture[:height, :width].astype(float)
    parts = cut.reshape(height // size[0], size[0], width // size[1], size[1], 3)
    return np.asarray(parts.mean(axis=(1, 3)))


def stored_light(
    view: StoredView, channels: Mapping[str, NDArray[np.float32]], is_halved: bool, tally: Tally
) -> dict[str, NDArray[np.float32]] | None:
    """Both light groups (denoised where the recipe says), albedo and normal; None where it cannot be had.

    is_halved: at half the picture's size.
    """
    names = {g: [f"{g}.{c}" for c in "RGB"] for g in ("outdoor", "indoor", "albedo")}
    names["normal"] = [f"normal.{c}" for c in "XYZ"]
    if not all(n in channels for row in names.values() for n in row):
        return None  # the check of radiance says so
    planes = {g: np.stack([channels[n] for n in row], axis=-1) for g, row in names.items()}
    if is_halved:
        planes = {g: _halved(plane) for g, plane in planes.items()}
    return denoised_light(view, planes, tally)


def denoised_light(
    view: StoredView, planes: dict[str, NDArray[np.float32]], tally: Tally
) -> dict[str, NDArray[np.float32]] | None:
    """The planes outdoor, indoor, albedo and normal, light denoised where the recipe says; None if it cannot be."""
    if view.recipe is None or not view.recipe.light.denoise:
        return planes
    planes = dict(planes)
    try:
        pyoidn = _pyoidn()
    except ImportError:
        tally.note(f"{view.place}: light was denoised, and pyoidn is not installed to do it again")
        return None
    # A panorama is denoised across its edge.
    n = min(64, planes["albedo"].shape[1]) if view.recipe.lens.model == "equirect" else 0
    wide = {g: np.pad(a, ((0, 0), (n, n), (0, 0)), mode="wrap") for g, a in planes.items()}
    lit = (wide["outdoor"] + wide["indoor"] > 0) | (wide["albedo"] > 0)
    guides = (np.ascontiguousarray(wide[g], np.float32) for g in ("albedo", "normal"))
    albedo, normal = guides
    for group in ("outdoor", "indoor"):
        noisy = np.ascontiguousarray(wide[group], np.float32)
        if (noisy > 0).any():
            clean = pyoidn.denoise(noisy, albedo, normal, hdr=True, clean_aux=True)
            clean = np.maximum(np.nan_to_num(np.asarray(clean, np.float32), posinf=0.0), 0)
            noisy = clean * np.asarray(lit).any(axis=-1, keepdims=True)
        planes[group] = noisy[:, n : noisy.shape[1] - n]
    return planes


def _pyoidn() -> Any:
    """The denoiser's module, imported as if there were no torch: it would load it for nothing, in 6 s."""
    is_hidden = "torch" not in sys.modules
    if is_hidden:
        sys.modules["torch"] = None  # type: ignore[assignment]  # what import takes for "not there"
    try:
        import pyoidn
    finally:
        if is_hidden:
            del sys.modules["torch"]
    return pyoidn


def _add_glare(total: NDArray[np.float32], share: float) -> NDArray[np.float32]:
    if share == 0:
        return total
    finite = np.nan_to_num(total, posinf=0.0)
    blurred = np.zeros_like(finite)
    for part in (0.01, 0.04, 0.16):
        wide = finite
        for axis in (0, 1):
            wide = ndimage.gaussian_filter1d(
                wide, part * total.shape[1], axis, mode="nearest", truncate=3
            )
        blurred += wide / 3
    return np.asarray((1 - share) * finite + share * blurred, np.float32)


def _white_balance(
    total: NDArray[Any], albedo: NDArray[Any], tone: ToneFields, *, least: float = 1.0
) -> Floats:
    """(3,) gains against the median of radiance over albedo where it is high, of constant luminance.

    least: of the median level, from which a pixel counts.
    """
    errors = 2.0 ** np.array([tone.warmth_ev / 2, tone.tint_ev, -tone.warmth_ev / 2])
    light = np.ones(3)
    known = (albedo > 0.02).all(axis=-1) & (total > 0).all(axis=-1)
    if tone.white_balance > 0 and known.sum() >= 16:
        light = _light_colour(total[known], albedo[known].astype(np.float64), least)
    gains = (light / (light @ _LUMINANCE)) ** -tone.white_balance * errors
    return np.asarray((gains / (gains @ _LUMINANCE)).astype(np.float32))


def _light_colour(total: NDArray[Any], surface: Floats, least: float) -> Floats:
    """(3,) of (N, 3) radiance over albedo, the median of those from the middle to the 95th percentile."""
    level = (total / surface) @ _LUMINANCE
    low, high = np.percentile(level, [50, 95])
    lit = (level >= low * least) & (level <= high)
    total, surface = total[lit], surface[lit]
    logs = np.median(np.log(total / surface), axis=0)
    # Walls of one hue colour the light they reflect at each other: hold it to lamps and skies.
    most, least = surface.max(axis=1), surface.min(axis=1)
    is_colour = most - least > 0.35 * most
    if is_colour.mean() > 0.5:
        chroma = surface[is_colour] - surface[is_colour].mean(axis=1, keepdims=True)
        hue = chroma / np.maximum(np.linalg.norm(chroma, axis=1, keepdims=True), 1e-9)
        common = np.median(hue, axis=0)
        length = float(np.linalg.norm(common))
        alike = int((hue @ common > 0.9 * length).sum()) if length > 0 else 0
        if alike / len(surface) > 0.5:
            tint = np.clip(logs[1] - (logs[0] + logs[2]) / 2, -0.1, 0.35)
            warmth = np.clip(logs[0] - logs[2], -0.7, 1.6)
            side = logs.mean() - tint / 3
            logs = np.array([side + warmth / 2, logs.mean() + 2 * tint / 3, side - warmth / 2])
    return np.asarray(np.exp(logs))


def _exposure(balanced: Floats, tone: ToneFields) -> float:
    """The factor that brings the log-average to the key; `photo` counts 1/32 to 4 times the median."""
    if tone.preset == "released":
        level = balanced @ _MITSUBA_LUMINANCE
        return tone.key / float(np.exp(np.log(level + 1e-3).mean()))
    level = balanced @ _LUMINANCE
    level = level[level > 0]
    if not level.size:
        return 1.0
    middle = float(np.median(level))
    average = float(np.exp(np.log(np.clip(level, middle / 32, middle * 4)).mean()))
    return float(tone.key / average * 2**tone.exposure_ev)


def _tone(
    balanced: Floats, exposure: float, camera: PictureCamera, gains: NDArray[Any], iso: float
) -> NDArray[np.uint8]:
    """8 bits by Reinhard's operator (`released`), else by a line and a logarithm that ends at white.

    balanced: light times gains (3,), of which a sensor at that ISO sees what it was before.
    """
    tone, sensor = camera.tone, camera.sensor
    is_released = tone.preset == "released" and not sensor.is_on
    if is_released:
        level = balanced @ _MITSUBA_LUMINANCE * exposure
        white = float(level.max()) * 0.64
        linear = balanced
        if white > 0:
            ratio = (1 + level / white**2) / (1 + level) * exposure
            linear = balanced * ratio[..., None]
    else:
        light, white = balanced * exposure, tone.white
        light = light + tone.flare * np.minimum(light, tone.white).mean(axis=(0, 1))
        if sensor.is_on:
            white = sensor.headroom
            light = _read(light * _vignette(light, sensor), gains / gains.min(), iso, sensor)
        linear = _roll_off(_flattened(light, tone), white)
    linear = np.clip(linear, 0, 1)
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    response = srgb if is_released else _respond(srgb, tone)
    return np.asarray(np.rint(255 * np.clip(response, 0, 1)), np.uint8)


def _read(light: Floats, gains: NDArray[Any], iso: float, sensor: SensorFields) -> Floats:
    """Light (H, W, 3) with a sensor's noise drawn anew: what it makes of darkness is brighter in the mean."""
    rng = np.random.default_rng(0)
    well = sensor.full_well_e * sensor.iso_min / max(iso, sensor.iso_min)
    electrons = rng.poisson(np.clip(light / gains / sensor.headroom * well, 0, 1e9)).astype(float)
    electrons += rng.normal(0, sensor.read_noise_e, light.shape)
    lowest = -sensor.black_level / (1 - sensor.black_level)
    raw = np.clip(electrons / well, lowest, 1) * sensor.headroom
    return np.asarray(np.clip(raw * gains, 0, sensor.headroom))


def _respond(srgb: Floats, tone: ToneFields) -> Floats:
    """Luma by an S whose odds go to a power, then sharpened by its difference to a blurred one."""
    luma = srgb @ [0.299, 0.587, 0.114]
    with np.errstate(divide="ignore"):
        s_shaped = 1 / (1 + (np.maximum(1 / luma - 1, 0)) ** tone.contrast)
    chroma = np.minimum(np.divide(s_shaped, luma, out=np.zeros_like(luma), where=luma > 0), 1)
    picture = s_shaped[..., None] + (srgb - luma[..., None]) * chroma[..., None]
    if tone.sharpening == 0:
        return np.asarray(picture)
    soft = s_shaped
    for axis in (0, 1):
        soft = ndimage.gaussian_filter1d(soft, 0.8, axis, mode="nearest")
    return np.asarray(picture + tone.sharpening * (s_shaped - soft)[..., None])


def _flattened(light: Floats, tone: ToneFields) -> Floats:
    """Light whose large differences in stops are smaller by local_contrast: He's self-guided filter."""
    if tone.local_contrast == 0:
        return light
    stops = np.log2(np.maximum(light @ _LUMINANCE, 2.0**-10))
    r = round(light.shape[1] / 24)
    first, second = _box_means(stops, r), _box_means(stops**2, r)
    a = np.maximum(second - first**2, 0) / (np.maximum(second - first**2, 0) + 0.25)
    large = _box_means(a, r) * stops + _box_means(first - a * first, r)
    return np.asarray(light * (2 ** (tone.local_contrast * (np.log2(tone.key) - large)))[..., None])


def _box_means(values: Floats, r: int) -> Floats:
    """Means over squares of 2 r + 1, by sums of sums; the border goes on as its last pixel."""
    wide = np.pad(values, r, mode="edge").cumsum(0).cumsum(1)
    wide = np.pad(wide, ((1, 0), (1, 0)))
    n = 2 * r + 1
    return np.asarray((wide[n:, n:] - wide[:-n, n:] - wide[n:, :-n] + wide[:-n, :-n]) / n**2)


def _vignette(light: Floats, sensor: SensorFields) -> Floats:
    """(H, W, 1) what a lens lets through, by the squared distance from the middle."""
    height, width = light.shape[:2]
    y, x = np.mgrid[0:height, 0:width] + 0.5
    squared = ((y - height / 2) ** 2 + (x - width / 2) ** 2) / (
        (height / 2) ** 2 + (width / 2) ** 2
    )
    return np.asarray(1 - sensor.vignetting * squared)[..., None]


def _roll_off(light: Floats, white: float) -> Floats:
    """Straight to 0.6, then 0.6 + k log(1 + (x - 0.6) / k), which is 1 at white; from a luminance of 1 on it pales."""
    # The sum rises with k, so that halving its logarithm finds it.
    low, high = -9.3, 9.3
    for _ in range(100):
        middle = (low + high) / 2
        k = float(np.exp(middle))
        is_short = 0.6 + k * np.log1p((white - 0.6) / k) < 1
        low, high = (middle, high) if is_short else (low, middle)
    top = light.max(axis=-1, keepdims=True)
    over = np.maximum(top - 0.6, 0)
    target = np.where(top > 0.6, np.minimum(0.6 + k * np.log1p(over / k), 1), top)
    scaled = light * np.divide(target, top, out=np.ones_like(top), where=top > 0)
    level = np.maximum(light @ _LUMINANCE, 1)[..., None]
    pale = np.clip(np.log2(level) / max(np.log2(white), 1e-3), 0, 1)
    return np.asarray(scaled * (1 - pale) + target * pale)
