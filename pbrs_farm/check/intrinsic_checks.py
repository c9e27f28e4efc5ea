"""Shading and residual against albedo, light and materials, by docs/formats/layer_rules.md; no effects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from pbrs_farm.check.cases import ViewCase
from pbrs_farm.check.certificate import Expect
from pbrs_farm.check.checks import Check
from pbrs_farm.check.colours import has_channels, linear_from_srgb, rgb_of
from pbrs_farm.check.denoised_light import Planes, denoised_light, stored_light
from pbrs_farm.check.developing import tile_means
from pbrs_farm.check.lit_checks import LitScene
from pbrs_farm.check.radiance_checks import is_amid
from pbrs_farm.core.arrays import F64

_GROUPS: Final = {
    "": ("outdoor", "indoor"), "_outdoor": ("outdoor",), "_indoor": ("indoor",),
}  # fmt: skip
LAYERS: Final = tuple(f"{name}{e}" for e in _GROUPS for name in ("shading", "residual"))

_STEP = 2.0**-11  # half a step of a half float, relative
_LEAST = 2.0**-14  # below which its steps are equal
_SINGLE = 1e-5  # relative error of sums: single precision, and another processor's denoiser
_DENOISED_SHARE = 0.99  # of denoised values
_DENOISED = 0.02  # relative error of the others
_MOST = 65000.0  # about the largest half float
_TILE = 0.15  # change of a tile's mean by the denoiser, beside its noise
_FLOOR = 0.1  # of the picture's mean, added to the light that differences are relative to
_TILES = 0.8  # share of tiles
_DIRECT = 0.02  # relative difference of diffuse light and all light of a matte surface
_BELOW = 0.1  # most negative residual of a matte surface over its light: noise, bytes of albedo
_GUIDE = 0.1  # between means over a pixel and its middle
_SCATTERED = 0.00101  # largest diffuse albedo of mirrors and glass
_SHARE = 0.8  # of pixels amid one surface
_FEW = 50  # fewer pixels are not judged


def check_intrinsic(case: ViewCase) -> None:
    """Albedo x shading + residual is radiance; shading is arriving light; matte surfaces have no residual.

    At half the size light is not denoised again, but compared by tiles, up to its noise.
    """
    view, channels, arrays = case.view, case.light, case.arrays
    modes = view.table.get("modes", {})
    expect = case.expect("intrinsic layers")
    stated = sorted(modes.get("develop", {}).get("layers", []))
    layers = sorted(name for name in LAYERS if name in arrays)
    expect(stated == layers, f"view.json lists {stated}, there are {layers}")
    split = sorted(modes.get("light", {}).get("layers", []))
    is_split = any(name.startswith("diffuse_") for name in channels)
    expect(bool(split) == is_split, f"its light is marked as split for {split}")
    needed = "diffuse_outdoor diffuse_indoor diffuse_albedo"
    if not layers or not has_channels(channels, view.size, needed, "normal"):
        expect(not layers, "radiance.exr has no diffuse light")
        return
    raw = {name: rgb_of(channels, name) for name in f"outdoor indoor {needed}".split()}
    noise = float(modes.get("light", {}).get("noise", {}).get("sum", 0.0))
    is_denoised = view.recipe is not None and view.recipe.light.denoise
    light = shading = None
    if not (case.is_halved and is_denoised):
        light = stored_light(view, channels, False, case.tally)
        shading = denoised_light(view, _divided(case, raw), case.tally)
    for ending, groups in _GROUPS.items():
        for name, planes in (("shading", shading), ("residual", light)):
            if f"{name}{ending}" not in arrays:
                continue
            judge = _Judge(case, f"{name}{ending}", groups, planes, is_denoised, noise)
            if name == "shading":
                _check_shading(judge, raw)
            else:
                _check_sum(judge, ending, raw)
    _check_surfaces(case, raw, noise=noise if is_denoised else 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Judge:
    """Compares a layer with radiance.exr."""

    case: ViewCase
    layer: str
    groups: tuple[str, ...]
    planes: Planes | None  # of each group, developed again; None = not again
    is_denoised: bool
    noise: float  # of its light

    @property
    def stored(self) -> F64:
        """The layer."""
        return self.case.arrays[self.layer].astype(np.float64)

    @property
    def total(self) -> F64 | None:
        """The sum of its groups."""
        if self.planes is None:
            return None
        planes = [np.asarray(self.planes[g], np.float64) for g in self.groups]
        return np.asarray(np.sum(planes, axis=0))

    def expect(self, check: str) -> Expect:
        """Reports facts of the layer."""
        return self.case.expect(check, f"{self.layer}.exr")

    def near(self, check: str, name: str, values: F64, total: F64, slack: F64) -> None:
        """Values are the total up to slack; a denoiser may differ a little more, for a few."""
        off = np.abs(values - total) - slack
        share = float((off <= 0).mean())
        is_near = bool((off <= _DENOISED * (np.abs(total) + total.mean())).all())
        right = share >= _DENOISED_SHARE and is_near if self.is_denoised else share == 1
        self.expect(check)(right, f"{name} is that of radiance.exr at {share:.1%} of its values")

    def tiles(self, check: str, name: str, values: F64, expected: F64) -> None:
        """Most tiles of the values have the expected mean, up to noise."""
        a, b = tile_means(values).sum(axis=-1), tile_means(expected).sum(axis=-1)
        near = np.abs(a - b) <= (_TILE + self.noise) * (b + _FLOOR * b.mean())
        fault = f"{name} is that of radiance.exr in {near.mean():.0%} of its tiles"
        self.expect(check)(float(near.mean()) >= _TILES, fault)


def _divided(case: ViewCase, raw: Mapping[str, F64]) -> Planes:
    """Diffuse light over its albedo, and the guides of its denoiser: grey, and the normals."""
    albedo = raw["diffuse_albedo"]
    planes = {
        group: np.divide(raw[f"diffuse_{group}"], albedo, out=np.zeros_like(albedo), where=albedo > 0)
        for group in ("outdoor", "indoor")
    }  # fmt: skip
    planes["albedo"] = np.where(albedo > 0, 0.5, 0.0)
    planes["normal"] = rgb_of(case.light, "normal", "XYZ")
    return {name: plane.astype(np.float32) for name, plane in planes.items()}


def _check_sum(judge: _Judge, ending: str, raw: Mapping[str, F64]) -> None:
    """Albedo x shading + residual is radiance: to half a step if developed again, else by tiles."""
    arrays = judge.case.arrays
    if not {"albedo", f"shading{ending}"} <= arrays.keys():
        judge.expect("intrinsic sum")(False, "lacks its albedo or shading")
        return
    shading = arrays[f"shading{ending}"].astype(np.float64)
    diffuse = linear_from_srgb(arrays["albedo"] / 255) * shading
    residual, total, name = judge.stored, judge.total, "albedo x shading + residual"
    if total is None:
        light = np.sum([raw[g] for g in judge.groups], axis=0)
        judge.tiles("intrinsic sum", name, diffuse + residual, light)
        return
    slack = _STEP * np.maximum(np.abs(residual), _LEAST) + _SINGLE * (total + diffuse)
    judge.near("intrinsic sum", name, diffuse + residual, total, slack)


def _check_shading(judge: _Judge, raw: Mapping[str, F64]) -> None:
    """Shading is diffuse light over its albedo, denoised as light is; 0 where nothing scatters light."""
    stored, total, expect = judge.stored, judge.total, judge.expect("shading")
    is_light = (np.isfinite(stored) & (stored >= 0)).all()
    expect(is_light, "is negative or not finite")
    albedo = raw["diffuse_albedo"]
    is_dark = (stored[albedo <= 0] == 0).all()
    expect(is_dark, "is not 0 where no surface scatters light")
    if total is None:
        lit = albedo.min(axis=-1, keepdims=True) > 0.02  # noise decides about darker surfaces
        light = np.sum([raw[f"diffuse_{g}"] for g in judge.groups], axis=0)
        judge.tiles("shading", "diffuse light", stored * albedo * lit, light * lit)
        return
    slack = 2 * _STEP * np.maximum(total, _LEAST) + _SINGLE
    judge.near("shading", "shading", np.where(total > _MOST, total, stored), total, slack)


def _check_surfaces(case: ViewCase, raw: Mapping[str, F64], *, noise: float) -> None:
    """Mirrors and glass have no shading, matte surfaces no residual, at pixels amid one surface."""
    view, arrays, triangles = case.view, case.arrays, case.now.triangles
    if view.recipe is None or view.recipe.materials.preset != "physical":
        return
    rows, columns = np.nonzero(is_amid(arrays["instance"], arrays["normal"]))
    face = case.cast(rows, columns).face
    kinds = triangles.kinds_of(face)
    clear = np.isin(kinds, ("mirror", "glass", "pane"))
    if clear.sum() >= _FEW:
        lit = raw["diffuse_albedo"][rows[clear], columns[clear]].max(axis=-1)
        share = float((lit < _SCATTERED).mean())
        fault = f"mirrors and glass scatter no light at {share:.0%} of {clear.sum()} pixels"
        case.expect("shading", "radiance.exr")(share >= _SHARE, fault)
    # The last entry of each table is for rays that hit nothing.
    alpha = np.append(triangles.finishes.alpha, 0.0)
    has_coat = np.append(triangles.finishes.f0.any(axis=-1), False)
    is_outside = np.append(case.now.shared(LitScene).is_outside, True)
    material = np.where(face >= 0, triangles.material[face], -1)
    matte = (kinds == "opaque") & (alpha[material] == 1) & ~has_coat[material] & ~is_outside[face]
    if "albedo" not in arrays or matte.sum() < _FEW:
        return
    pixels = rows[matte], columns[matte]
    label = linear_from_srgb(arrays["albedo"][pixels] / 255)
    total = (raw["outdoor"] + raw["indoor"])[pixels]
    diffuse = (raw["diffuse_outdoor"] + raw["diffuse_indoor"])[pixels]
    floor = _FLOOR * float(total.mean())
    albedo = np.abs(raw["diffuse_albedo"][pixels] - label).max(axis=-1) <= _GUIDE
    same = np.abs(total - diffuse).sum(axis=-1) <= _DIRECT * (total.sum(axis=-1) + floor)
    right = {"diffuse_albedo is the albedo": albedo, "light is diffuse": same}
    for ending, groups in _GROUPS.items():
        if f"residual{ending}" in arrays:
            residual = arrays[f"residual{ending}"][pixels].astype(np.float64).sum(axis=-1)
            lit = np.sum([raw[g][pixels] for g in groups], axis=0).sum(axis=-1)
            least = -(_BELOW + noise) * (lit + _FLOOR * float(lit.mean()))
            right[f"residual{ending} is not negative"] = residual >= least
    for name, holds in right.items():
        share = float(holds.mean())
        fault = f"{name} at {share:.0%} of {len(holds)} pixels of matte surfaces"
        case.expect("matte surfaces", "radiance.exr")(share >= _SHARE, fault)


CHECKS = (Check("intrinsic", "view", check_intrinsic, 25, ("radiance",)),)
