"""Shading and residual against albedo, radiance.exr and materials. Effects: none.

Formulas are written again here from docs/formats/layer_rules.md; the stages' code is not used.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.embree_caster import Floats, Rays
from pbrs_farm.check.light_checks import denoised_light, stored_light
from pbrs_farm.check.lit_checks import LitScene
from pbrs_farm.check.radiance_checks import Channels, is_amid
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.check.stored_view import StoredView

_GROUPS: Final = {
    "": ("outdoor", "indoor"), "_outdoor": ("outdoor",), "_indoor": ("indoor",),
}  # fmt: skip
LAYERS: Final = tuple(f"{name}{e}" for e in _GROUPS for name in ("shading", "residual"))

_STEP = 2.0**-11  # half a step of a half float, of its value
_LEAST = 2.0**-14  # below which its steps are all alike
_SINGLE = 1e-5  # of what is summed: single precision, and another processor's denoiser
_DENOISED_SHARE = 0.99  # of values, where a denoiser was at work
_DENOISED = 0.02  # of light, by which the others differ
_MOST = 65000.0  # about what half floats hold
_TILE_PX = 16
_TILE = 0.15  # of a tile's mean, by which the denoiser may change it beside its noise
_FLOOR = 0.1  # of the picture's mean, that is added to what light is compared by
_TILES = 0.8  # share of tiles
_DIRECT = 0.02  # of light, by which diffuse light may differ from all light of a matte surface
_BELOW = (
    0.1  # of light, by which a matte surface's residual may be negative: noise, bytes of albedo
)
_GUIDE = 0.1  # between means over a pixel and its middle
_SHARE = 0.8  # of pixels amid one surface
_FEW = 50  # pixels that tell nothing


def check_intrinsic(
    view: StoredView,
    channels: Channels,
    arrays: Mapping[str, NDArray[Any]],
    scene: LitScene,
    rays: Rays,
    tally: Tally,
    *,
    denoise: bool,
) -> None:
    """Albedo x shading + residual is radiance; shading is what arrives; matte surfaces have no residual.

    rays: of all triangles. denoise: whether light that was denoised is denoised again; else it is
    compared by tiles, as well as its noise lets.
    """
    modes = view.table.get("modes", {})
    told = sorted(modes.get("develop", {}).get("layers", []))
    there = sorted(name for name in LAYERS if name in arrays)
    what = f"view.json tells of {told}, there are {there}"
    tally.expect("intrinsic layers", view.place, told == there, what)
    split = sorted(modes.get("light", {}).get("layers", []))
    is_split = any(name.startswith("diffuse_") for name in channels)
    what = f"its light is told to be split for {split}"
    tally.expect("intrinsic layers", view.place, bool(split) == is_split, what)
    needed = [f"diffuse_{n}.{c}" for n in ("outdoor", "indoor", "albedo") for c in "RGB"]
    needed += [f"normal.{c}" for c in "XYZ"]
    if not there or not all(n in channels and channels[n].shape == view.size for n in needed):
        tally.expect("intrinsic layers", view.place, not there, "radiance.exr has no diffuse light")
        return
    names = ("outdoor", "indoor", "diffuse_outdoor", "diffuse_indoor", "diffuse_albedo")
    raw = {name: _image(channels, name) for name in names}
    noise = float(modes.get("light", {}).get("noise", {}).get("sum", 0.0))
    is_denoised = view.recipe is not None and view.recipe.light.denoise
    light = shading = None
    if denoise or not is_denoised:
        light = stored_light(view, channels, False, tally)
        shading = denoised_light(view, _divided(channels, raw), tally)
    for ending, groups in _GROUPS.items():
        own = _Expected(f"{view.place}/shading{ending}.exr", groups, shading, is_denoised, noise)
        if f"shading{ending}" in arrays:
            _check_shading(own, arrays[f"shading{ending}"].astype(np.float64), raw, tally)
        own = _Expected(f"{view.place}/residual{ending}.exr", groups, light, is_denoised, noise)
        if f"residual{ending}" in arrays:
            _check_sum(own, ending, arrays, raw, tally)
    _check_surfaces(view, arrays, raw, scene, rays, tally, noise=noise if is_denoised else 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Expected:
    """What a layer is held against."""

    place: str
    groups: tuple[str, ...]
    planes: Mapping[str, NDArray[Any]] | None  # of each group as it was developed; None = not again
    is_denoised: bool
    noise: float  # of its light

    @property
    def total(self) -> Floats | None:
        """The sum of its groups."""
        if self.planes is None:
            return None
        planes = [np.asarray(self.planes[g], np.float64) for g in self.groups]
        return np.asarray(np.sum(planes, axis=0))


def _divided(channels: Channels, raw: Mapping[str, Floats]) -> dict[str, NDArray[np.float32]]:
    """Diffuse light over its albedo, and the guides of its denoiser: grey, and the normals."""
    albedo = raw["diffuse_albedo"]
    planes = {
        group: np.divide(
            raw[f"diffuse_{group}"], albedo, out=np.zeros_like(albedo), where=albedo > 0
        )
        for group in ("outdoor", "indoor")
    }
    planes["albedo"] = np.where(albedo > 0, 0.5, 0.0)
    planes["normal"] = np.stack([channels[f"normal.{c}"] for c in "XYZ"], axis=-1)
    return {name: plane.astype(np.float32) for name, plane in planes.items()}


def _image(channels: Channels, name: str) -> Floats:
    return np.stack([channels[f"{name}.{c}"] for c in "RGB"], axis=-1).astype(np.float64)


def _linear(srgb8: NDArray[Any]) -> Floats:
    c = srgb8 / 255
    return np.asarray(np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4))


def _check_sum(
    own: _Expected, ending: str, arrays: Mapping[str, NDArray[Any]], raw: Mapping[str, Floats],
    tally: Tally,
) -> None:  # fmt: skip
    """Albedo x shading + residual is radiance: to half a step where it was developed again, else by tiles."""
    if not {"albedo", f"shading{ending}"} <= arrays.keys():
        tally.expect("intrinsic sum", own.place, False, "has no albedo or no shading beside it")
        return
    shading = arrays[f"shading{ending}"].astype(np.float64)
    residual = arrays[f"residual{ending}"].astype(np.float64)
    diffuse = _linear(arrays["albedo"]) * shading
    name = "albedo x shading + residual"
    if own.total is None:
        light = np.sum([raw[g] for g in own.groups], axis=0)
        _expect_tiles(own, "intrinsic sum", name, diffuse + residual, light, tally)
        return
    slack = _STEP * np.maximum(np.abs(residual), _LEAST) + _SINGLE * (own.total + diffuse)
    _expect_near(own, "intrinsic sum", name, diffuse + residual, slack, tally)


def _check_shading(own: _Expected, stored: Floats, raw: Mapping[str, Floats], tally: Tally) -> None:
    """Shading is diffuse light over its albedo, denoised as light is; 0 where nothing scatters light."""
    ok = bool((np.isfinite(stored) & (stored >= 0)).all())
    tally.expect("shading", own.place, ok, "is negative or not finite")
    albedo = raw["diffuse_albedo"]
    dark = bool((stored[albedo <= 0] == 0).all())
    tally.expect("shading", own.place, dark, "is not 0 where no surface scatters light")
    if own.total is None:
        lit = albedo.min(axis=-1, keepdims=True) > 0.02  # elsewhere noise decides
        light = np.sum([raw[f"diffuse_{g}"] for g in own.groups], axis=0)
        _expect_tiles(own, "shading", "diffuse light", stored * albedo * lit, light * lit, tally)
        return
    slack = 2 * _STEP * np.maximum(own.total, _LEAST) + _SINGLE
    _expect_near(
        own, "shading", "shading", np.where(own.total > _MOST, own.total, stored), slack, tally
    )


def _expect_near(
    own: _Expected, check: str, name: str, found: Floats, slack: Floats, tally: Tally
) -> None:
    total = own.total
    assert total is not None
    off = np.abs(found - total) - slack
    share = float((off <= 0).mean())
    near = bool((off <= _DENOISED * (np.abs(total) + total.mean())).all())
    right = share >= _DENOISED_SHARE and near if own.is_denoised else share == 1
    what = f"{name} is that of radiance.exr at {share:.1%} of its values"
    tally.expect(check, own.place, right, what)


def _expect_tiles(
    own: _Expected, check: str, name: str, found: Floats, expected: Floats, tally: Tally
) -> None:
    a, b = _tiles(found), _tiles(expected)
    near = np.abs(a - b) <= (_TILE + own.noise) * (b + _FLOOR * b.mean())
    what = f"{name} is that of radiance.exr in {near.mean():.0%} of its tiles"
    tally.expect(check, own.place, float(near.mean()) >= _TILES, what)


def _tiles(picture: Floats) -> Floats:
    n = min(_TILE_PX, *picture.shape[:2])
    rows, columns = (k // n for k in picture.shape[:2])
    cut = picture[: rows * n, : columns * n].sum(axis=-1)
    return np.asarray(cut.reshape(rows, n, columns, n).mean(axis=(1, 3)))


def _check_surfaces(
    view: StoredView, arrays: Mapping[str, NDArray[Any]], raw: Mapping[str, Floats],
    scene: LitScene, rays: Rays, tally: Tally, *, noise: float,
) -> None:  # fmt: skip
    """What materials say: mirrors and glass have no shading, matte surfaces no residual.

    At pixels amid one surface, by rays of the checker's own. noise: that a denoiser was at.
    """
    if view.recipe is None or view.recipe.materials.preset != "physical":
        return
    triangles = scene.triangles
    rows, columns = np.nonzero(is_amid(arrays["instance"], arrays["normal"]))
    origin, directions = view.rays(rows, columns)
    face = rays.first(origin, directions)
    kinds = triangles.kinds_of(face)
    place = f"{view.place}/radiance.exr"
    clear = np.isin(kinds, ("mirror", "glass", "pane"))
    if clear.sum() >= _FEW:
        lit = raw["diffuse_albedo"][rows[clear], columns[clear]].max(axis=-1)
        share = float((lit < 0.5 * 0.002 * 1.01).mean())
        what = f"mirrors and glass scatter no light at {share:.0%} of {clear.sum()} pixels"
        tally.expect("shading", place, share >= _SHARE, what)
    alpha = np.concatenate([triangles.finishes.alpha(), [0.0]])
    own = np.where(face >= 0, triangles.material[face], -1)
    matte = (kinds == "opaque") & (alpha[own] == 1) & ~_has_coat(triangles)[own]
    matte &= ~np.concatenate([scene.is_outside, [True]])[face]
    if "albedo" not in arrays or matte.sum() < _FEW:
        return
    at = rows[matte], columns[matte]
    label = _linear(arrays["albedo"])[at]
    total = (raw["outdoor"] + raw["indoor"])[at]
    diffuse = (raw["diffuse_outdoor"] + raw["diffuse_indoor"])[at]
    floor = _FLOOR * float(total.mean())
    albedo = np.abs(raw["diffuse_albedo"][at] - label).max(axis=-1) <= _GUIDE
    same = np.abs(total - diffuse).sum(axis=-1) <= _DIRECT * (total.sum(axis=-1) + floor)
    found = [("diffuse_albedo is the albedo", albedo), ("light is diffuse", same)]
    for ending, groups in _GROUPS.items():
        if f"residual{ending}" in arrays:
            left = arrays[f"residual{ending}"][at].astype(np.float64).sum(axis=-1)
            lit = np.sum([raw[g][at] for g in groups], axis=0).sum(axis=-1)
            least = -(_BELOW + noise) * (lit + 3 * _FLOOR * float(lit.mean() / 3))
            found.append((f"residual{ending} is not negative", left >= least))
    for name, right in found:
        share = float(right.mean())
        what = f"{name} at {share:.0%} of {len(right)} pixels of matte surfaces"
        tally.expect("matte surfaces", place, share >= _SHARE, what)


def _has_coat(triangles: Triangles) -> NDArray[np.bool_]:
    """(M + 1,) whether a material mirrors anything; the last is nothing."""
    return np.concatenate([triangles.finishes.f0().any(axis=-1), [False]])
