"""Whether radiance.exr shows what the labels show: its guides against surfaces, its light against their albedo.

Effects: none. Light is albedo times what arrives, so that steps of its logarithm follow those of albedo's,
in this place of the picture and in no other, whatever the noise.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.embree_caster import Floats, Rays
from pbrs_farm.check.pixel_checks import albedo_of_faces
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.check.stored_view import StoredView

Channels = Mapping[str, NDArray[np.float32]]

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear sRGB
_GUIDE_DEG = 25.0  # a normal map may bend a guide, and a pixel is not flat
_GUIDE_ALBEDO = 0.1  # of 1, in linear light: a texture's mean over the pixel against its middle
_BESIDE = (-0.3, 0.3)  # px from a pixel's middle: fine cloth and print are other colours there
COAT = 0.04  # of light that comes upright, what a coat reflects: glass of index 1.5
_VARNISH = 0.3  # of 1, as stored: .07 in linear light
_GUIDE_SHARE = 0.8  # of pixels amid one surface; blur and depth of field cost the rest
_GUIDE_PX = 1  # by which the guides' edges may lie beside the labels': a few samples against one
_FEW_GUIDES = 50  # pixels amid surfaces that tell nothing
_FAINT = 0.05  # of albedo, and of the mean light: darker steps count less
_MOST_STEP = 1.0  # of a logarithm: one firefly is not a picture
_EDGE = 0.1  # step of albedo's logarithm that counts as an edge
_FEW_EDGES = 300  # pixels with one that tell nothing
_BLUR_PX = 0.7  # of both before they are compared: noise goes, edges stay within a pixel
_BRIGHT_KINDS = {"bulb", "glass", "mirror", "pane", "shade"}  # whose light is not their albedo's
_BRIGHT_PX = 2  # beside them, which the blur reaches
_NOISY = 0.09  # error of the slope above which noise hides all
_LEAST_SLOPE = 0.15  # of steps of light over those of albedo, whose logarithms rise alike
_LEAST_SIGMAS = 3.0  # of the slope where the picture stands
_TIE_SIGMAS = 2.0  # by which another place may fit better by chance
_GROUP_SIGMAS = 5.0  # the same of a light group alone, which may reach few of the edges


def check_guides(
    view: StoredView,
    channels: Channels,
    pixels: tuple[NDArray[np.int64], NDArray[np.int64]],
    arrays: Mapping[str, NDArray[Any]],
    scene: tuple[Triangles, Rays],
    house: StoredHouse,
    tally: Tally,
) -> None:
    """The guides that radiance.exr holds, mean albedo and normal, are those of the surfaces seen there.

    pixels: rows and columns to look at; only those amid one surface count, of no glass and no mirror,
    nor of things that shine like varnish: their guide holds what they mirror, too.
    """
    names = [*(f"albedo.{c}" for c in "RGB"), *(f"normal.{c}" for c in "XYZ")]
    if not all(name in channels and channels[name].shape == view.size for name in names):
        return
    _check_place(view, channels, arrays["normal"], tally)
    triangles, rays = scene
    rows, columns = pixels
    origin, directions = view.rays(rows, columns)
    face = rays.first(origin, directions)
    kinds = triangles.kinds_of(face)
    flat = is_amid(arrays["instance"], arrays["normal"])[rows, columns]
    keep = (face >= 0) & flat & ~np.isin(kinds, ("glass", "pane", "mirror", "bulb"))
    # What lies outside is a picture of its own, and no surface of the home.
    keep &= np.isin(triangles.instance[face], matte_items(house))
    if keep.sum() < _FEW_GUIDES:
        return
    rows, columns, face, directions = rows[keep], columns[keep], face[keep], directions[keep]
    point = origin + directions * rays.distance(face, origin, directions)[:, None]
    srgb = [albedo_of_faces(view, face, point, triangles) / 255]
    for dy, dx in itertools.product(_BESIDE, repeat=2):
        _, beside = view.rays(rows + dy, columns + dx)
        met = rays.first(origin, beside)
        met = np.where(met >= 0, met, face)
        point = origin + beside * rays.distance(met, origin, beside)[:, None]
        point = np.where(np.isfinite(point), point, 0.0)
        srgb.append(albedo_of_faces(view, met, point, triangles) / 255)
    linear = np.mean(
        [np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4) for s in srgb], axis=0
    )
    # Light of the published materials takes their plain colours as they are (docs/spec/suncg.md).
    if _is_released(house):
        is_plain = np.array([m["texture_id"] is None for m in house.house["materials"]], bool)
        linear = np.where(is_plain[triangles.material[face]][:, None], srgb[0], linear)
    # The guide is of all light that comes back, a coat's, too.
    linear += np.where(coated_materials(house)[triangles.material[face]], COAT, 0.0)[:, None]
    stored = np.stack([channels[n][rows, columns] for n in names], axis=1).astype(np.float64)
    close = np.abs(stored[:, :3] - linear).max(axis=1) <= _GUIDE_ALBEDO
    normal = rays.normal(face, directions)
    length = np.maximum(np.linalg.norm(stored[:, 3:], axis=1), 1e-9)
    cosine = np.einsum("ni,ni->n", normal, stored[:, 3:]) / length
    turned = cosine >= np.cos(np.radians(_GUIDE_DEG))
    for name, right in (("albedo", close), ("normal", turned)):
        share = float(right.mean())
        what = f"its {name} is that of the surface at {share:.0%} of {len(right)} pixels"
        tally.expect("light guides", f"{view.place}/radiance.exr", share >= _GUIDE_SHARE, what)


def matte_items(house: StoredHouse) -> list[int]:
    """Instances of the home, not of what lies outside, whose guides hold their albedo and no more.

    The guide of what shines like varnish holds what it mirrors, too.
    """
    colours = [material["specular"] or (0.0,) for material in house.house["materials"]]
    return [
        n
        for n, row in house.items.items()
        if row["nyu40"] and all(max(colours[s["material"]]) <= _VARNISH for s in row["surfaces"])
    ]


def _is_released(house: StoredHouse) -> bool:
    """Whether light is made with the published materials."""
    return bool(house.recipe.get("materials", {}).get("preset") == "released")


def coated_materials(house: StoredHouse) -> NDArray[np.bool_]:
    """(M,) whether a material shines at all, be it ever so rough (docs/light_methods.md); the published ones never do."""
    rows = house.house["materials"]
    if _is_released(house):
        return np.zeros(len(rows), bool)
    is_rough = [r["roughness"] is not None or r["roughness_texture_id"] is not None for r in rows]
    shines = [r["shininess"] > 1 and max(r["specular"] or (0.0,)) > 0 for r in rows]
    return np.asarray(np.array(is_rough, bool) | np.array(shines, bool))


def _check_place(view: StoredView, channels: Channels, normal: NDArray[Any], tally: Tally) -> None:
    """The mean normal turns where the label's does, and a few pixels beside it less so."""
    decoded = normal * (2 / 65535) - 1
    # Published axes are x right, y forward, z up; the pose's are x right, y down, z forward.
    facing = np.stack([decoded[..., 0], -decoded[..., 2], decoded[..., 1]], axis=-1)
    world = facing @ view.world_from_camera[:3, :3].T
    total = np.zeros(view.size)
    n_edges = 0
    for k, c in enumerate("XYZ"):
        found, _energy = _correlation(channels[f"normal.{c}"], _Transformed.of(world[..., k]))
        total += found
        n_edges += int((np.hypot(*_steps(world[..., k])) > _EDGE).sum())
    if n_edges < _FEW_EDGES:
        return
    best = np.unravel_index(int(total.argmax()), total.shape)
    moved = tuple(
        int(k) if k <= n // 2 else int(k) - n for k, n in zip(best, total.shape, strict=True)
    )
    what = f"its normal fits the label's best {moved[1]} px to the right and {moved[0]} px below"
    same = max(abs(m) for m in moved) <= _GUIDE_PX
    tally.expect("light guides", f"{view.place}/radiance.exr", same, what)


def is_amid(instance: NDArray[Any], normal: NDArray[Any]) -> NDArray[np.bool_]:
    """(H, W) whether a pixel and its neighbours show one instance with one normal."""
    flat = ndimage.minimum_filter(instance, 3) == ndimage.maximum_filter(instance, 3)
    for axis in range(3):
        plane = normal[..., axis].astype(np.int64)
        flat &= ndimage.maximum_filter(plane, 3) - ndimage.minimum_filter(plane, 3) < 600
    return np.asarray(flat, bool)


def check_fit(
    view: StoredView, channels: Channels, bright: NDArray[np.bool_], tally: Tally
) -> None:
    """The light of radiance.exr fits its albedo as it stands, and mirrored, turned or moved no better.

    All light together must fit; a light group alone may reach few edges, and must not fit another
    place much better. bright: (H, W) pixels of what shines, mirrors or lies outside, whose steps do
    not count: a bright window is no bright wall. Pictures with few edges, or more noise than light,
    are a note.
    """
    needed = [f"{name}.{c}" for name in ("outdoor", "indoor", "albedo") for c in "RGB"]
    if not all(n in channels and channels[n].shape == view.size for n in needed):
        return
    level = {
        name: ndimage.gaussian_filter(
            sum(channels[f"{name}.{c}"] * w for c, w in zip("RGB", LUMINANCE, strict=True)),
            _BLUR_PX,
        )
        for name in ("outdoor", "indoor", "albedo")
    }
    bright = ndimage.binary_dilation(bright, iterations=_BRIGHT_PX)
    logs_of_albedo = _filled(np.log(level.pop("albedo") + _FAINT), bright)
    across, down = _steps(logs_of_albedo)
    if int((np.hypot(across, down) > _EDGE).sum()) < _FEW_EDGES:
        tally.note(f"{view.place}/radiance.exr has too few edges to compare")
        return
    surface = _Transformed.of(logs_of_albedo)
    level["all light"] = level["outdoor"] + level["indoor"]
    place = f"{view.place}/radiance.exr"
    for name, light in level.items():
        if not (light > 0).any():
            continue
        logs = _filled(np.log(light + _FAINT * float(light[light > 0].mean())), bright)
        own, error, elsewhere = _slopes(logs, surface)
        if error > _NOISY:
            if name == "all light":
                tally.note(f"{place} has more noise than edges: {name} is not compared")
            continue
        others = {"moved": elsewhere}
        for what, turned in (
            ("mirrored", logs[:, ::-1]),
            ("upside down", logs[::-1]),
            ("turned", logs[::-1, ::-1]),
        ):
            others[what] = _slopes(turned, surface)[0]
        slack = (_TIE_SIGMAS if name == "all light" else _GROUP_SIGMAS) * error
        for what, other in others.items():
            text = f"{name} fits the albedo better {what} ({other:.2f}) than as it is ({own:.2f})"
            tally.expect("light edges", place, other <= own + slack, text)
        if name == "all light":
            text = f"{name} does not follow the albedo: {own:.2f} +- {error:.2f}"
            least = max(_LEAST_SIGMAS * error, _LEAST_SLOPE)
            tally.expect("light edges", place, own >= least, text)


def bright_pixels(instance: NDArray[Any], house: StoredHouse) -> NDArray[np.bool_]:
    """(H, W) pixels of things that have a surface which shines, mirrors or is seen through, and of no thing."""
    kinds = [material["kind"] for material in house.house["materials"]]
    dull = [
        n
        for n, row in house.items.items()
        if "outside" not in row["tags"]
        and _BRIGHT_KINDS.isdisjoint(kinds[s["material"]] for s in row["surfaces"])
    ]
    return ~np.isin(instance, dull)


def _filled(picture: NDArray[Any], hole: NDArray[np.bool_]) -> NDArray[Any]:
    """The picture whose pixels in a hole are those of the nearest outside it, so that no step leads across."""
    if not hole.any() or hole.all():
        return picture
    nearest = ndimage.distance_transform_edt(hole, return_distances=False, return_indices=True)
    return np.asarray(picture[tuple(nearest)])


def _steps(picture: NDArray[Any]) -> tuple[Floats, Floats]:
    across = np.diff(picture, axis=1, append=picture[:, -1:])
    down = np.diff(picture, axis=0, append=picture[-1:])
    return tuple(np.clip(s.astype(np.float64), -_MOST_STEP, _MOST_STEP) for s in (across, down))  # type: ignore[return-value]


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


def _slopes(light: NDArray[Any], surface: _Transformed) -> tuple[float, float, float]:
    """Steps of light over those of the surface: the slope here, its error, and the largest elsewhere.

    The error is the spread over all other places, which a Fourier transform compares at once.
    """
    found, energy = _correlation(light, surface)
    found /= max(energy, 1e-12)
    own = float(found[0, 0])
    found[0, 0] = -np.inf
    rest = found[np.isfinite(found)]
    return own, float(rest.std()), float(rest.max())


def _correlation(light: NDArray[Any], surface: _Transformed) -> tuple[Floats, float]:
    """(H, W) products of steps of light with those of the surface moved by so much; squares of the latter."""
    products = sum(
        np.fft.rfft2(s) * other for s, other in zip(_steps(light), surface.steps, strict=True)
    )
    return np.asarray(np.fft.irfft2(products, light.shape)), surface.energy
