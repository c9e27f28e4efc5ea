"""Pictures in the light modes: radiance.exr denoised, balanced and toned again; views without light. Effects: reads files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.check.cases import ViewCase
from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.checks import Check
from pbrs_farm.check.colours import LM_PER_W, has_channels, luminance_of
from pbrs_farm.check.denoised_light import Planes, stored_light
from pbrs_farm.check.developing import (
    SAME_LEVEL,
    add_glare,
    exposure_of,
    finite_light,
    halved,
    sensor_unit,
    tile_means,
    toned,
    white_balance,
)
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.picture_cameras import PictureCamera
from pbrs_farm.core.recipe import Recipe

_GROUPS = {"mlt_ol": ("outdoor",), "mlt_il_ol": ("outdoor", "indoor")}

# Tolerances of a picture, in steps of 255, and the share of pixels that may be beyond them.
_EXACT_STEPS, _EXACT_SHARE = 1, 0.002
_DENOISED_STEPS, _DENOISED_SHARE = 2, 0.01  # denoisers differ between processors
_TILE_STEPS, _TILES = 10, 0.9  # mean of a tile, share of tiles
_LEAST_HALVED_PX = 160  # a shorter side has few tiles at half the size, and costs little
_FACTOR = 0.002  # tolerance of exposure and gains
_HALVED_FACTOR = 0.2  # the same at half the size: with 2 samples a pixel the error is up to 0.08
_TIE, _HALVED_TIE = 1e-6, 0.02  # relative precision of a level, and at half the size
_BLACK_CD_M2 = 0.05
_DARK_LX = 1.0
_GRID = 8  # of a picture, across and down


def check_developed(case: ViewCase) -> None:
    """Develop radiance.exr again and compare with the stored pictures of the light modes.

    Denoising costs most of the time, so is_halved denoises at half the size and compares by tiles.
    Differences are looked at again at full size, and that decides: a white balance may depend on
    which half of the pixels is lit, and half the size has others.

    Does nothing for a view without a picture of a light mode or without a recipe:
    `methods.not_looked_at` reports that.
    """
    if case.is_halved:
        trial = replace(case, tally=Tally())
        _check_modes(trial)
        if not trial.tally.n_failed:
            case.tally.take(trial.tally)
            return
    _check_modes(replace(case, is_halved=False))


def may_be_halved(view: StoredView) -> bool:
    """True if a view's light was denoised and its pictures have enough tiles at half their size."""
    if view.recipe is None or not view.recipe.light.denoise or not view.has("radiance.exr"):
        return False
    is_lit = any(view.has(f"{mode}.png") for mode in _GROUPS)
    return is_lit and min(view.size) >= _LEAST_HALVED_PX


def _check_modes(case: ViewCase) -> None:
    view, recipe = case.view, case.view.recipe
    modes = [m for m in _GROUPS if m in case.arrays]
    if not modes or recipe is None:
        return
    light = stored_light(view, case.light, case.is_halved, case.tally)
    if light is None:
        return
    stated = view.table.get("modes", {}).get("develop", {})
    camera = _camera_of(view, recipe, 0)
    for mode in modes:
        _Shot(case, recipe, f"{mode}.png", mode, stated.get(mode, {}), camera).check(mode, light)
    _check_errors(case, stated, camera)
    _check_variants(case, recipe, stated.get("variants", []), light)


def _camera_of(view: StoredView, recipe: Recipe, variant: int) -> PictureCamera:
    return recipe.camera_of(view.folder.parent.parent.name, view.folder.name, variant)


def _check_variants(case: ViewCase, recipe: Recipe, rows: Any, light: Planes) -> None:
    """Each further picture is present, is stated, and is taken by the camera drawn for it."""
    rows = rows if isinstance(rows, list) else []
    by_recipe = [f"mlt_il_ol.{n}.png" for n in range(1, recipe.tone.variants + 1)]
    stated = [row.get("file") if isinstance(row, dict) else None for row in rows]
    files = sorted(path.name for path in case.view.folder.glob("mlt_il_ol.*.png"))
    fault = f"view.json lists the variants {stated}, the recipe {by_recipe}, there are {files}"  # fmt: skip
    if not case.expect("light developed")(stated == by_recipe == files, fault):
        return
    for n, row in enumerate(rows, 1):
        camera = _camera_of(case.view, recipe, n)
        _check_errors(case, row, camera)
        if f"mlt_il_ol.{n}" in case.arrays:  # else it is damaged, which the check of layers reports
            shot = _Shot(case, recipe, row["file"], "mlt_il_ol", row, camera)
            shot.check(f"mlt_il_ol.{n}", light)


def _check_errors(case: ViewCase, stated: Mapping[str, Any], camera: PictureCamera) -> None:
    """The stated camera and its errors of exposure and colour are those that the recipe draws."""
    in_table = {name: stated.get(name) for name in ("camera", "tone")}
    names = ("exposure_ev", "warmth_ev", "tint_ev", "contrast")
    drawn: dict[str, Any] = {"camera": None, "tone": None}
    if camera.name != "neutral":
        drawn = {"camera": camera.name, "tone": {n: getattr(camera.tone, n) for n in names}}
    fault = f"view.json has the camera {in_table}, the recipe draws {drawn}"
    case.expect("light developed")(in_table == drawn, fault)


@dataclass(frozen=True, slots=True)
class _Shot:
    """A picture, its facts in view.json, and its camera."""

    case: ViewCase
    recipe: Recipe
    file: str
    mode: str
    stated: Mapping[str, Any]
    camera: PictureCamera

    def check(self, name: str, light: Planes) -> None:
        """Compare a layer with the light developed again."""
        stored, tone = self.case.arrays[name], self.camera.tone
        total = sum((light[g] for g in _GROUPS[self.mode]), np.zeros_like(light["outdoor"]))
        total = add_glare(total, tone.glare)
        gains, exposure = self._factors(total, light["albedo"])
        iso = float(self.stated.get("iso", 0.0))
        expected = toned(finite_light(total * gains), exposure, self.camera, gains, iso)
        if self.case.is_halved:
            self._compare_tiles("light by tiles", halved(stored), expected)
        elif self.camera.sensor.is_on:
            self._compare_tiles("light developed", stored, expected)
        else:
            self._compare_pixels(stored, expected, is_denoised=self.recipe.light.denoise)

    def _factors(self, total: F32, albedo: F32) -> tuple[NDArray[Any], float]:
        """(gains (3,), exposure) of view.json if they are near those of the light, else the latter.

        A pixel's rank may depend on rounding, so the stored factors are used from here on.
        """
        tone, stated, is_halved = self.camera.tone, self.stated, self.case.is_halved
        slack, tie = (_HALVED_FACTOR, _HALVED_TIE) if is_halved else (_FACTOR, _TIE)
        stated_gains = np.array(stated.get("gains", ()), np.float64)
        gains = white_balance(total, albedo, tone)
        is_stated = stated_gains.shape == (3,) and "exposure" in stated
        if is_stated and np.abs(stated_gains - gains).max() > slack:
            # Much of the picture may have one level at the margin, which counts or not by rounding.
            margins = (SAME_LEVEL - tie, SAME_LEVEL + tie)
            either = [white_balance(total, albedo, tone, margin=m) for m in margins]
            gains = min(either, key=lambda g: float(np.abs(stated_gains - g).max()))
        exposure = exposure_of(finite_light(total * gains), tone)
        expect = self.case.expect("light developed", self.file)
        if not expect(is_stated, "view.json lacks three gains and an exposure"):
            return gains, exposure
        stated_exposure = float(stated["exposure"])
        off_exposure = (
            self._off_sensor(exposure)
            if self.camera.sensor.is_on
            else abs(stated_exposure / exposure - 1)
        )
        off = float(np.max([np.abs(stated_gains - gains).max(), off_exposure]))
        is_near = expect(off <= slack, f"view.json has other factors, by {off:.4f}")
        return (stated_gains, stated_exposure) if is_near else (gains, exposure)

    def _off_sensor(self, exposure: float) -> float:
        """Relative error of shutter, ISO and exposure against the sensor's choice for an exposure."""
        sensor, stated = self.camera.sensor, self.stated
        unit = sensor_unit(sensor)
        shutter, iso = (float(stated.get(name, 0.0)) for name in ("shutter_s", "iso"))
        product = shutter * iso * unit
        off = abs(float(stated["exposure"]) - product) / max(product, 1e-9)
        if sensor.lag_s > 0 and self.case.view.table.get("time_s") is not None:
            return off  # it lags behind that of the frames before
        product_s = exposure * 2**sensor.compensation_ev / unit
        longest = max(sensor.shutter_max_s, sensor.shutter_min_s)
        own_shutter = sensor.shutter_s or np.clip(product_s / sensor.iso_min, sensor.shutter_min_s, longest)  # fmt: skip
        own_iso = np.clip(
            product_s / own_shutter, sensor.iso_min, max(sensor.iso_max, sensor.iso_min)
        )
        return float(np.max([off, abs(shutter / own_shutter - 1), abs(iso / own_iso - 1)]))

    def _compare_pixels(
        self, stored: NDArray[Any], expected: NDArray[Any], *, is_denoised: bool
    ) -> None:
        difference = np.abs(stored.astype(int) - expected.astype(int))
        wrong = (difference > (_DENOISED_STEPS if is_denoised else _EXACT_STEPS)).any(axis=-1)
        n_wrong = int(wrong.sum())
        # The network's last bits differ between processors; a patch does not hide among so few.
        allowed = n_wrong <= (_DENOISED_SHARE * wrong.size if is_denoised else 0)
        is_patch = allowed and ndimage.uniform_filter(wrong.astype(float), 5).max() > 0.5
        is_near = is_denoised or float((difference > 0).mean()) <= _EXACT_SHARE
        good = allowed and not is_patch and is_near
        tally = self.case.tally
        tally.add("light developed", wrong.size, ties=n_wrong if good else 0)
        if not good:
            row, column = np.argwhere(difference.any(axis=-1))[0]
            fault = f"differs from radiance.exr at row {row}, column {column}"
            place = f"{self.case.place}/{self.file}"
            tally.fail("light developed", place, fault, max(n_wrong, 1))

    def _compare_tiles(self, check: str, stored: NDArray[Any], expected: NDArray[Any]) -> None:
        """Compare means of tiles, without noise; a sensor's lens, mosaic and JPEG remain."""
        difference = np.abs(tile_means(stored) - tile_means(expected)).mean(axis=-1)
        share = float((difference <= _TILE_STEPS).mean())
        fault = f"{1 - share:.0%} of its tiles differ from radiance.exr"
        self.case.expect(check, self.file)(share >= _TILES, fault)


def check_darkness(case: ViewCase) -> None:
    """A picture fails if all light together leaves it black; a room below 1 lx is noted."""
    hit = case.arrays["valid"] > 0
    if has_channels(case.light, hit.shape, "outdoor indoor") and hit.any():
        planes = [np.nan_to_num(luminance_of(case.light, g)) for g in ("outdoor", "indoor")]
        fault = f"all light together leaves nine tenths of it below {_BLACK_CD_M2:g} cd/m2"
        level = _ninth_tenth(LM_PER_W * (planes[0] + planes[1]), hit)
        case.expect("black pictures")(level >= _BLACK_CD_M2, fault)
    room = str(case.view.table.get("room", ""))
    lux = _lux_of_rooms(case.house.illuminance).get(room)
    if lux is not None and lux < _DARK_LX:
        note = f"is in room {room}, which has {lux:.2g} lx by all light"
        case.tally.note(f"{case.place} {note}")


def _ninth_tenth(level: F64, hit: NDArray[Any]) -> float:
    """90th percentile of the mean levels of the tiles that hit something."""
    rows, columns = (np.arange(n) * _GRID // n for n in level.shape)
    tile = (rows[:, None] * _GRID + columns)[hit]
    n = np.bincount(tile)
    means = np.bincount(tile, level[hit])[n > 0] / n[n > 0]
    return float(np.quantile(means, 0.9))


def _lux_of_rooms(document: dict[str, Any]) -> dict[str, float]:
    """Room id -> lx on its floor by all light; {} where illuminance.json is missing or damaged."""
    try:
        rows = document["rooms"]
        return {str(r["room"]): float(r["outdoor_lx"]) + float(r["indoor_lx"]) for r in rows}
    except (ValueError, KeyError, TypeError):
        return {}


CHECKS = (
    Check("light developed", "view", check_developed, 23, ("radiance",)),
    Check("darkness", "view", check_darkness, 22, ("radiance",)),
)
