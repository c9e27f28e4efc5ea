"""Contents of radiance.exr against the labels: its guides against surfaces, its light against their albedo.

Effects: none. Light is albedo times the arriving light, so that steps of its logarithm follow those of albedo's,
in this place of the picture and in no other, whatever the noise.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.check.axes import dot, world_normals
from pbrs_farm.check.cases import SAMPLE, ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.colours import has_channels, linear_from_srgb, luminance_of, rgb_of
from pbrs_farm.check.developing import tile_means
from pbrs_farm.check.finishes import has_roughness
from pbrs_farm.check.pixel_checks import albedo_of
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.view_checks import moved_copies
from pbrs_farm.core.arrays import F64, Bools

COAT = 0.04  # reflectance of a coat at normal incidence: glass of index 1.5
_FLAT_STEPS = 600  # of 65535: range of a normal's component amid a surface
_GUIDE_DEG = 25.0  # a normal map may bend a guide, and a pixel is not flat
_GUIDE_ALBEDO = 0.1  # of 1, in linear light: a texture's mean over the pixel against its middle
_BESIDE = (-0.3, 0.3)  # px from a pixel's middle: fine cloth and print have other colours there
_VARNISH = 0.3  # of 1, as stored: .07 in linear light
_GUIDE_SHARE = 0.8  # of pixels amid one surface; blur and depth of field cost the rest
_GUIDE_PX = 1  # distance of the guides' edges from the labels': a few samples against one
_FEW_GUIDES = 50  # fewer pixels amid surfaces are not judged
_FAINT = 0.05  # of albedo, and of the mean light: darker steps count less
_MOST_STEP = 1.0  # of a logarithm: one firefly is not a picture
_EDGE = 0.1  # step of albedo's logarithm that counts as an edge
_FEW_EDGES = 300  # fewer pixels with one are not judged
_BLUR_PX = 0.7  # of both before they are compared: noise goes, edges stay within a pixel
_BRIGHT_KINDS = {"bulb", "glass", "mirror", "pane", "shade"}  # whose light is not their albedo's
_BRIGHT_PX = 2  # around them, which the blur reaches
_NOISY = 0.09  # error of the slope above which noise hides everything
_LEAST_SLOPE = 0.15  # of steps of light over those of albedo, whose logarithms rise alike
_LEAST_SIGMAS = 3.0  # of the slope at the stored place
_TIE_SIGMAS = 2.0  # by which another place may fit better by chance
_LIT = 0.1  # of all light, below which a group does not light an edge
_GROUP_SIGMAS = 5.0  # the same of a light group alone, which may reach few of the edges
_TILE_SIGMAS = 3.5  # of the mean gain of tiles, by which another place fits better all over
_PAIR_SIGMAS = 3.0  # the same of pairs exchanged, which are four places and not all
_EXCHANGED_SIGMAS = 4.0  # of a slope below 0: one in 30,000 by chance


def check_radiance(case: ViewCase) -> None:
    """Every group of light is present, finite and not negative."""
    channels, place, tally = case.light, case.place, case.tally
    names = {f"{g}.{c}" for g in ("outdoor", "indoor", "albedo") for c in "RGB"}
    lacking = names - channels.keys()
    tally.expect("radiance", place, not lacking, f"lacks {lacking}")
    # Normals may be negative; light and albedo may not.
    names |= {name for name in channels if name.startswith(("lamp", "diffuse_"))}
    for name in sorted(names & channels.keys()):
        plane = channels[name]
        bad = int((~(np.isfinite(plane) & (plane >= 0))).sum())
        tally.add("radiance", plane.size)
        if bad or plane.shape != case.view.size:
            fault = f"{bad} pixels negative or not finite"
            tally.fail("radiance", f"{place} {name}", fault, max(bad, 1))


def check_guides(case: ViewCase) -> None:
    """Mean albedo and normal of radiance.exr, amid matte surfaces, are those of the visible surfaces."""
    view, channels, house = case.view, case.light, case.house
    if not has_channels(channels, view.size, "albedo", "normal"):
        return
    _check_alignment(case)
    triangles = case.now.triangles
    cast = case.cast(*case.sample(SAMPLE))
    flat = is_amid(case.arrays["instance"], case.arrays["normal"])[cast.rows, cast.columns]
    is_guided = ~np.isin(triangles.kinds_of(cast.face), ("glass", "pane", "mirror", "bulb"))
    # The outdoors is a picture, and no surface of the home.
    is_guided &= np.isin(triangles.instance[cast.face], matte_items(house))
    cast = cast.some((cast.face >= 0) & flat & is_guided)
    if len(cast) < _FEW_GUIDES:
        return
    face, middle = cast.face, albedo_of(view, cast) / 255
    linear = [linear_from_srgb(middle)]
    for dy, dx in itertools.product(_BESIDE, repeat=2):
        beside = case.cast(cast.rows + dy, cast.columns + dx)
        beside = beside.at(np.where(beside.hit, beside.face, face))
        linear.append(linear_from_srgb(albedo_of(view, beside) / 255))
    albedo = np.mean(linear, axis=0)
    # Light of the published materials takes their plain colours without conversion (docs/spec/suncg.md).
    if _is_released(house):
        is_plain = np.array([m["texture_id"] is None for m in house.house["materials"]], bool)
        albedo = np.where(is_plain[triangles.material[face]][:, None], middle, albedo)
    # The guide contains all reflected light, also that of a coat.
    albedo += np.where(coated_materials(house)[triangles.material[face]], COAT, 0.0)[:, None]
    guides = [
        rgb_of(channels, g, axes)[cast.rows, cast.columns]
        for g, axes in (("albedo", "RGB"), ("normal", "XYZ"))
    ]
    close = np.abs(guides[0] - albedo).max(axis=1) <= _GUIDE_ALBEDO
    length = np.maximum(np.linalg.norm(guides[1], axis=1), 1e-9)
    cosine = dot(cast.normal, guides[1]) / length
    aligned = cosine >= np.cos(np.radians(_GUIDE_DEG))
    for name, right in (("albedo", close), ("normal", aligned)):
        share = float(right.mean())
        fault = f"its {name} is that of the surface at {share:.0%} of {len(right)} pixels"
        case.expect("light guides", "radiance.exr")(share >= _GUIDE_SHARE, fault)


def matte_items(house: StoredHouse) -> list[int]:
    """Instances of the home whose guides hold only their albedo: without the outdoors and varnished items."""
    colours = [material["specular"] or (0.0,) for material in house.house["materials"]]
    return [
        n
        for n, row in house.items.items()
        if row["nyu40"] and all(max(colours[s["material"]]) <= _VARNISH for s in row["surfaces"])
    ]


def _is_released(house: StoredHouse) -> bool:
    """True if light is made with the published materials."""
    return bool(house.recipe.get("materials", {}).get("preset") == "released")


def coated_materials(house: StoredHouse) -> Bools:
    """(M,) materials with a coat, however rough (docs/light_methods.md); without the published ones."""
    rows = house.house["materials"]
    if _is_released(house):
        return np.zeros(len(rows), bool)
    is_shiny = [r["shininess"] > 1 and max(r["specular"] or (0.0,)) > 0 for r in rows]
    return np.array([has_roughness(r) or s for r, s in zip(rows, is_shiny, strict=True)], bool)


def _check_alignment(case: ViewCase) -> None:
    """Edges of the mean normal are at those of the label, and fit less well a few pixels beside them."""
    world = world_normals(case.arrays["normal"], case.view.world_from_camera)
    total = np.zeros(case.view.size)
    n_edges = 0
    for k, c in enumerate("XYZ"):
        products, _energy = _correlation(case.light[f"normal.{c}"], _Transformed.of(world[..., k]))
        total += products
        n_edges += int((np.hypot(*_steps(world[..., k])) > _EDGE).sum())
    if n_edges < _FEW_EDGES:
        return
    best = np.unravel_index(int(total.argmax()), total.shape)
    down, right = (
        int(k) if k <= n // 2 else int(k) - n for k, n in zip(best, total.shape, strict=True)
    )
    fault = f"its normal fits the label's best {right} px to the right and {down} px below"
    is_aligned = max(abs(down), abs(right)) <= _GUIDE_PX
    case.expect("light guides", "radiance.exr")(is_aligned, fault)


def is_amid(instance: NDArray[Any], normal: NDArray[Any], size: int = 3) -> Bools:
    """(H, W) the window of pixels around each shows one instance with one normal."""
    flat = ndimage.minimum_filter(instance, size) == ndimage.maximum_filter(instance, size)
    for axis in range(3):
        plane = normal[..., axis].astype(np.int64)
        low, high = ndimage.minimum_filter(plane, size), ndimage.maximum_filter(plane, size)
        flat &= high - low < _FLAT_STEPS
    return np.asarray(flat, bool)


def check_fit(case: ViewCase) -> None:
    """The light of radiance.exr fits its albedo, and mirrored, turned or moved no better.

    All light together must fit; a light group alone may reach few edges, and must not fit another
    place much better. Luminous, mirroring and outdoor pixels do not count: a bright window is no
    bright wall. Pictures with few edges, or more noise than light, are noted.
    """
    channels = case.light
    if not has_channels(channels, case.view.size, "outdoor indoor albedo"):
        return
    sharp = {name: luminance_of(channels, name) for name in ("outdoor", "indoor", "albedo")}
    level = {name: ndimage.gaussian_filter(plane, _BLUR_PX) for name, plane in sharp.items()}
    bright = _bright_pixels(case.arrays["instance"], case.house)
    bright = ndimage.binary_dilation(bright, iterations=_BRIGHT_PX)
    logs_of_albedo = _filled(np.log(level.pop("albedo") + _FAINT), bright)
    place = f"{case.place}/radiance.exr"
    edges = np.hypot(*_steps(logs_of_albedo)) > _EDGE
    if int(edges.sum()) < _FEW_EDGES:
        case.tally.note(f"{place} has too few edges to compare")
        return
    _check_exchanged(case, sharp, bright)
    surface, albedo_steps = _Transformed.of(logs_of_albedo), _steps(logs_of_albedo)
    level["all light"] = level["outdoor"] + level["indoor"]
    for name, light in level.items():
        # The few edges that a group lights, as lamps do from outside, say nothing of its place.
        is_lit = light > _LIT * level["all light"]
        if int((edges & is_lit).sum()) < _FEW_EDGES:
            continue
        logs = _filled(_logs(light), bright)
        slope, error, elsewhere, shift = _slopes(logs, surface)
        if error > _NOISY:
            if name == "all light":
                case.tally.note(f"{place} has more noise than edges: {name} is not compared")
            continue
        steps = _steps(logs)
        own = _products(steps, albedo_steps)
        moved = {"moved": (elsewhere, [np.roll(s, shift, (0, 1)) for s in steps])}
        for word, copy in moved_copies(logs).items():
            moved[word] = _slopes(copy, surface)[0], _steps(copy)
        slack = (_TIE_SIGMAS if name == "all light" else _GROUP_SIGMAS) * error
        expect = case.expect("light edges", "radiance.exr")
        for word, (moved_slope, moved_steps) in moved.items():
            fault = f"{name} fits the albedo better {word} ({moved_slope:.2f}) than in place ({slope:.2f})"  # fmt: skip
            is_near = moved_slope <= slope + slack
            gain = _products(moved_steps, albedo_steps) - own
            expect(is_near or not _is_all_over(gain), fault)
        if name == "all light":
            fault = f"{name} does not follow the albedo: {slope:.2f} +- {error:.2f}"
            least = max(_LEAST_SIGMAS * error, _LEAST_SLOPE)
            lack = least * _products(albedo_steps, albedo_steps) - own
            expect(slope >= least or not _is_all_over(lack), fault)


def _logs(light: NDArray[Any]) -> NDArray[Any]:
    return np.log(light + _FAINT * float(light[light > 0].mean()))


def _check_exchanged(case: ViewCase, level: dict[str, NDArray[Any]], bright: Bools) -> None:
    """Steps of light between adjacent rows or columns do not run against those of albedo (White 1980)."""
    total = level["outdoor"] + level["indoor"]
    if not (total > 0).any():
        return
    logs = [_filled(a, bright) for a in (_logs(total), np.log(level["albedo"] + _FAINT))]
    for axis, first in itertools.product((0, 1), (0, 1)):
        light, albedo = (_steps_of_pairs(plane, axis, first) for plane in logs)
        if int((np.abs(albedo) > _EDGE).sum()) < _FEW_EDGES:
            continue
        energy = float((albedo**2).sum())
        slope = float((light * albedo).sum()) / energy
        error = float(np.sqrt((((light - slope * albedo) * albedo) ** 2).sum())) / energy
        name = ("rows", "columns")[axis]
        fault = f"all light fits the albedo better with {name} exchanged in pairs: {slope:.2f} +- {error:.2f} as stored"  # fmt: skip
        is_right = slope > -_EXCHANGED_SIGMAS * error or not _is_all_over(
            -light * albedo, _PAIR_SIGMAS
        )
        case.expect("light edges", "radiance.exr")(is_right, fault)


def _steps_of_pairs(picture: NDArray[Any], axis: int, first: int) -> F64:
    """Steps from the first row (or column) of each pair to its second; pairs begin at `first`."""
    rows = np.moveaxis(picture, axis, 0)[first:]
    rows = rows[: len(rows) // 2 * 2]
    steps = (rows[1::2] - rows[::2]).astype(np.float64)
    return np.asarray(np.clip(steps, -_MOST_STEP, _MOST_STEP))


def _bright_pixels(instance: NDArray[Any], house: StoredHouse) -> Bools:
    """(H, W) pixels of the outdoors, of no item, and of items with a luminous, mirroring or clear surface."""
    kinds = [material["kind"] for material in house.house["materials"]]
    dull = [
        n
        for n, row in house.items.items()
        if "outside" not in row["tags"]
        and _BRIGHT_KINDS.isdisjoint(kinds[s["material"]] for s in row["surfaces"])
    ]
    return ~np.isin(instance, dull)


def _filled(picture: NDArray[Any], hole: Bools) -> NDArray[Any]:
    """The picture with pixels in a hole replaced by the nearest outside it, so that no step is added."""
    if not hole.any() or hole.all():
        return picture
    nearest = ndimage.distance_transform_edt(hole, return_distances=False, return_indices=True)
    return np.asarray(picture[tuple(nearest)])


def _steps(picture: NDArray[Any]) -> list[F64]:
    """Steps of a picture across and down."""
    across = np.diff(picture, axis=1, append=picture[:, -1:])
    down = np.diff(picture, axis=0, append=picture[-1:])
    return [np.clip(s.astype(np.float64), -_MOST_STEP, _MOST_STEP) for s in (across, down)]


@dataclass(frozen=True, slots=True, eq=False)
class _Transformed:
    """A picture's steps across and down, transformed once to be compared with many."""

    steps: tuple[NDArray[np.complex128], ...]  # conjugate
    energy: float  # sum of their squares

    @staticmethod
    def of(picture: NDArray[Any]) -> _Transformed:
        steps = _steps(picture)
        energy = sum(float((s**2).sum()) for s in steps)
        return _Transformed(tuple(np.conj(np.fft.rfft2(s)) for s in steps), energy)


def _products(steps: list[F64], others: list[F64]) -> F64:
    """(H, W) products of steps, across and down together."""
    return np.asarray(sum(a * b for a, b in zip(steps, others, strict=True)))


def _is_all_over(gain: F64, sigmas: float = _TILE_SIGMAS) -> bool:
    """True if a gain (H, W) is that of most tiles, not of a few lines such as the edge of a shadow."""
    tiles = tile_means(gain[..., None]).ravel()
    return bool(tiles.mean() > sigmas * tiles.std() / len(tiles) ** 0.5)


def _slopes(
    light: NDArray[Any], surface: _Transformed
) -> tuple[float, float, float, tuple[int, int]]:
    """Steps of light over those of the surface: the slope, its error, the largest elsewhere, the shift to there.

    The error is the spread over all other places, which a Fourier transform compares together.
    """
    slopes, energy = _correlation(light, surface)
    slopes /= max(energy, 1e-12)
    slope = float(slopes[0, 0])
    slopes[0, 0] = -np.inf
    rest = slopes[np.isfinite(slopes)]
    down, right = np.unravel_index(int(slopes.argmax()), slopes.shape)
    return slope, float(rest.std()), float(rest.max()), (-int(down), -int(right))


def _correlation(light: NDArray[Any], surface: _Transformed) -> tuple[F64, float]:
    """(H, W) products of steps of light with those of the moved surface; sum of squares of the latter."""
    products = sum(
        np.fft.rfft2(s) * step for s, step in zip(_steps(light), surface.steps, strict=True)
    )
    return np.asarray(np.fft.irfft2(products, light.shape)), surface.energy


CHECKS = (
    Check("radiance", "view", check_radiance, 20, ("radiance",)),
    Check("light guides", "view", check_guides, 24, ("radiance",)),
    Check("light edges", "view", check_fit, 26, ("radiance",)),
)
