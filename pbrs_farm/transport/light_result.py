"""The result of a light render, and the estimate of its noise; pure numpy, no effects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, Mask, RadianceImage, UnitVectors
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.frames import LM_PER_W, LUMINANCE
from pbrs_farm.core.lighting import GROUPS_OF_MODE, Group, Mode

BLACK_CD_M2 = 0.05  # what 1 lx makes of a surface that reflects a sixth
_TILES = 8  # along each side of the picture


@dataclass(frozen=True, slots=True, eq=False)
class LightResult:
    """The linear AOVs (arbitrary output variables) of one view, raw, not denoised; (H, W, 3) float32.

    A mode's picture is a sum of light groups (`mode`); `develop` makes displayable pictures
    of it. Metropolis and `path` give the same fields, so readers need not know which it was.
    """

    outdoor: RadianceImage  # W m-2 sr-1, finite, >= 0
    indoor: RadianceImage
    albedo: RadianceImage  # 0..1, of the first surface other than mirror and glass
    normal: UnitVectors  # of the same surface, in the world frame
    noise: dict[str, float]  # relative error of each group and of their sum, from two half buffers
    spp: int  # samples per pixel of `path`; 0 of Metropolis, whose facts have its own numbers
    n_nonfinite: int  # contributions that were not finite, left out
    facts: dict[str, Any] = field(default_factory=dict)  # of view.json: integrator, seed, weights
    lamps: Mapping[int, RadianceImage] = field(
        default_factory=dict
    )  # layers of light.groups "lamps"
    diffuse: Mapping[str, RadianceImage] = field(default_factory=dict)  # images of `diffuse_images`

    def group(self, group: Group) -> RadianceImage:
        """The radiance of one light group."""
        return self.outdoor if group is Group.OUTDOOR else self.indoor

    def mode(self, mode: Mode) -> RadianceImage:
        """The sum of a mode's groups, not to be written into; ValueError for an OpenGL mode."""
        groups = GROUPS_OF_MODE[mode]
        if not groups:
            raise ValueError(f"{mode} is not a sum of light groups")
        total = self.group(groups[0])
        for group in groups[1:]:
            total = total + self.group(group)
        return total


def blacken(result: LightResult, mask: Mask) -> LightResult:
    """A copy of the result with every image 0 where the mask (H, W) is: pixels that a lens does not see."""

    def cleared(image: F32) -> F32:
        return np.where(mask[..., None], np.float32(0), image)

    return replace(
        result,
        outdoor=cleared(result.outdoor),
        indoor=cleared(result.indoor),
        albedo=cleared(result.albedo),
        normal=cleared(result.normal),
        lamps={number: cleared(image) for number, image in result.lamps.items()},
        diffuse={name: cleared(image) for name, image in result.diffuse.items()},
    )


def darkness_of_picture(result: LightResult) -> str:
    """A line when all light leaves nine tenths of the picture black, by tiles' means, else ""."""
    level = (result.outdoor + result.indoor) @ LUMINANCE * np.float32(LM_PER_W)
    is_hit = np.any(result.normal != 0, -1) | (level > 0)
    tiles = [
        float(tile[hit].mean())
        for rows, row_hits in zip(
            np.array_split(level, _TILES), np.array_split(is_hit, _TILES), strict=True
        )
        for tile, hit in zip(
            np.array_split(rows, _TILES, 1), np.array_split(row_hits, _TILES, 1), strict=True
        )
        if hit.any()
    ]
    if not tiles or np.quantile(tiles, 0.9) >= BLACK_CD_M2:
        return ""
    return f"black: nine tenths of the picture have less than {BLACK_CD_M2:g} cd/m2 by all light"


def relative_noise(half_a: NDArray[np.floating], half_b: NDArray[np.floating]) -> float:
    """Relative error of the mean of two independent halves, (H, W, 3) each; 0 for black pictures.

    The root mean square over pixels of |a - b| / 2 against the pixel's luminance plus a tenth of
    the picture's mean, so that dark pixels do not dominate; the largest 0.1 % of the squares are
    left out, as fireflies would make the estimate itself noise.
    """
    a, b = half_a @ LUMINANCE, half_b @ LUMINANCE
    mean = 0.5 * (a + b)
    level = float(mean.mean())
    if level <= 0:
        return 0.0
    # Half the difference of two halves estimates the standard error of their mean.
    error = np.sort(((0.5 * (a - b)) / (mean + 0.1 * level)).ravel() ** 2)
    without_fireflies = error[: max(int(len(error) * 0.999), 1)]
    return float(np.sqrt(without_fireflies.mean()))


class GroupSums(Protocol):
    """Sums over the samples of each pixel, row by row, (N, 3); *_even: of every second sample."""

    @property
    def outdoor(self) -> F32: ...
    @property
    def indoor(self) -> F32: ...
    @property
    def outdoor_even(self) -> F32: ...
    @property
    def indoor_even(self) -> F32: ...
    @property
    def albedo(self) -> F32: ...
    @property
    def normal(self) -> F32: ...
    @property
    def n_bad(self) -> int:
        """Paths that were not finite."""
        ...


def result_from_sums(
    sums: GroupSums, camera: Camera, spp: int, facts: dict[str, Any]
) -> LightResult:
    """The result of sums over spp samples per pixel, with the noise estimated from even and odd samples.

    sums: of W * H lanes, row by row. facts: what view.json says of the render. With one
    sample the two halves cannot be separated and the noise is meaningless.
    """
    shape = (camera.intrinsics.height_px, camera.intrinsics.width_px, 3)
    n_even = max((spp + 1) // 2, 1)
    n_odd = max(spp - n_even, 1)

    def picture(values: F32, n: int) -> F32:
        return np.ascontiguousarray((values / np.float32(n)).reshape(shape))

    # Divide each half buffer by its own number of samples.
    even = picture(sums.outdoor_even, n_even), picture(sums.indoor_even, n_even)
    odd = (
        picture(sums.outdoor - sums.outdoor_even, n_odd),
        picture(sums.indoor - sums.indoor_even, n_odd),
    )
    # Normalise the mean normal; it is zero where no sample met a surface.
    normal = picture(sums.normal, spp)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    return LightResult(
        picture(sums.outdoor, spp),
        picture(sums.indoor, spp),
        np.clip(picture(sums.albedo, spp), 0, 1),
        np.where(length > 0, normal / np.maximum(length, 1e-6), 0).astype(np.float32),
        _noises(even, odd),
        spp,
        sums.n_bad,
        facts,
    )


def join_results(
    direct: LightResult | None,
    guides: LightResult,
    halves: Mapping[Group, tuple[RadianceImage, ...]],
    n_bad: int,
    facts: dict[str, Any],
    *,
    spp: int = 0,
) -> LightResult:
    """The mean of two half buffers of each group, plus direct light when it is separate.

    guides: whose albedo and normal are kept. The noise is that of the half buffers; direct light's
    own is left out (it has many more samples).
    """
    # Add direct light to both half buffers, then average them.
    base = {
        Group.OUTDOOR: direct.outdoor if direct else np.float32(0),
        Group.INDOOR: direct.indoor if direct else np.float32(0),
    }
    a = [np.asarray(base[g] + halves[g][0], np.float32) for g in Group]
    b = [np.asarray(base[g] + halves[g][1], np.float32) for g in Group]
    outdoor, indoor = (np.float32(0.5) * (x + y) for x, y in zip(a, b, strict=True))
    return LightResult(
        outdoor,
        indoor,
        guides.albedo,
        guides.normal,
        _noises((a[0], a[1]), (b[0], b[1])),
        spp,
        n_bad,
        facts,
    )


def _noises(
    a: tuple[RadianceImage, RadianceImage], b: tuple[RadianceImage, RadianceImage]
) -> dict[str, float]:
    return {
        "outdoor": relative_noise(a[0], b[0]),
        "indoor": relative_noise(a[1], b[1]),
        "sum": relative_noise(a[0] + a[1], b[0] + b[1]),
    }
