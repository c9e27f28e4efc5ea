"""Faults that a person sees in pictures: `make bench NAME=look` -> out/bench/look.json.

Prepares homes by the recipe `fast`, the generated ones also dressed, and renders some views with panes or
mirrors at night.

Noise is the error relative to the local contrast, and that of the surroundings is what nine tenths of them
stay below. The plain error is largest at outlines, of which panes have more than walls: twice its median was
exceeded by .26 of the pixels in panes, but also by .14 of their surroundings, where a picture is as it
should be. By this definition .002 of the surroundings are noisy, and .12 of panes with a tenth of their
pixels 30 steps off.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.ndimage import binary_dilation, uniform_filter

import pbrs_farm as pf
from benchmarks.figures import write_report
from benchmarks.homes.variety import effective, model_of
from pbrs_farm.assets import furniture_package, homes_package
from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.house import House, MaterialKind
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.run.steps import camera_seed
from pbrs_farm.sample.house_sampler import sample_cameras
from pbrs_farm.sample.photo_choice import share_distance
from pbrs_farm.sample.photo_score import item_roles

MADE: Final = tuple(f"made:{seed}" for seed in range(1, 11))
DRESS_SEED: Final = 1
VIEWS_PER_HOME: Final = 5
PANE_VIEWS, PANE_SHARE = 6, 0.03  # views rendered, least share of glass and mirrors in one
SPP, REFERENCE_SPP = 16, 160
LEAST_ITEMS: Final = 24  # of a class whose models count
_CUT_SHARE, _CUT_NEAR_M = 1 / 8, 1.0
_LEAST_CONTRAST: Final = 4.0  # steps of a byte
_SIZE: Final = (160, 120)
_GLASS: Final = (MaterialKind.PANE, MaterialKind.GLASS, MaterialKind.MIRROR)
UNITS: Final = {
    "look.views": "views",
    "look.cut_share": "of views: an item cut by the edge within 1 m covers more than 1/8",
    "look.made_distance": "L1 distance of NYU13 shares to NYUv2's, dressed generated homes",
    "look.example_distance": "L1 distance of NYU13 shares to NYUv2's, bare example homes",
    "look.added_balls": "added lamps that are bulbs alone",
    "look.added_lamps": "added lamps",
    "look.noisy_panes": "of pixels behind panes: noise above twice that of their surroundings",
    "look.models_per_class": f"effective models, fewest of classes with {LEAST_ITEMS} items and more",
}


@dataclass(frozen=True, slots=True)
class _Look:
    """Findings in one home. shares: (N, 14) pixel shares of NYU13 classes; panes: views with panes."""

    home: pf.Home
    n_cut: int
    shares: F64
    n_added: int
    n_balls: int
    panes: tuple[Camera, ...]


def main() -> None:
    """Measure and write out/bench/look.json."""
    homes_package.fetch()
    furniture_package.fetch()
    made = [_look(pf.load(word, recipe="fast").dress(DRESS_SEED)) for word in MADE]
    examples = [*(home.name for home in homes_package.example_homes()), "builtin"]
    bare = [_look(pf.load(name, recipe="fast")) for name in examples]
    looks = [*made, *bare]
    n_views = sum(len(look.shares) for look in looks)
    figures = {
        "look.views": n_views,
        "look.cut_share": round(sum(look.n_cut for look in looks) / n_views, 3),
        "look.made_distance": _distance(made),
        "look.example_distance": _distance(bare),
        "look.added_balls": sum(look.n_balls for look in looks),
        "look.added_lamps": sum(look.n_added for look in looks),
        "look.noisy_panes": _noisy_panes(looks),
        "look.models_per_class": _models_per_class([look.home.house for look in made]),
    }
    write_report("look", figures, UNITS)


def _look(home: pf.Home) -> _Look:
    house, recipe = home.house, recipe_from_name("fast")
    caster = Caster.of_house(house)
    seed = camera_seed(house.id, recipe)
    views = sample_cameras(
        house, recipe.cameras, seed, caster.item_counts, caster.item_pictures
    ).views
    evenly = np.linspace(0, len(views) - 1, min(VIEWS_PER_HOME, len(views))).round().astype(int)
    cameras = [views[k].camera.with_size(*_SIZE) for k in evenly]
    nyu13 = item_roles(house).nyu13
    shares = [
        np.bincount(nyu13[caster.item_buffer(camera).ravel()], minlength=14) for camera in cameras
    ]
    added = [item for item in house.items if "added" in item.tags]
    bulbs = {k for k, material in enumerate(house.materials) if material.kind is MaterialKind.BULB}
    look = _Look(
        home,
        sum(_is_cut(caster, house, camera) for camera in cameras),
        np.array(shares, np.float64).reshape(-1, 14) / (_SIZE[0] * _SIZE[1]),
        len(added),
        sum({s.material for s in item.surfaces} <= bulbs for item in added),
        tuple(c for c in cameras if _glass_mask(caster, house, c).mean() > PANE_SHARE),
    )
    print(f"{house.id}: {len(cameras)} views, {look.n_cut} cut, {look.n_balls} balls", flush=True)
    return look


def _distance(looks: Sequence[_Look]) -> float:
    return round(float(share_distance(np.concatenate([look.shares for look in looks]).mean(0))), 3)


def _is_cut(caster: Caster, house: House, camera: Camera) -> bool:
    hit = caster.hit_record(camera)
    edge = np.concatenate([hit.item[0], hit.item[-1], hit.item[:, 0], hit.item[:, -1]])
    return any(
        (hit.item == k).mean() > _CUT_SHARE and hit.depth_z[hit.item == k].min() < _CUT_NEAR_M
        for k in np.unique(edge).tolist()
        if k and not house.items[k - 1].kind.is_structure
    )


def _glass_mask(caster: Caster, house: House, camera: Camera) -> Bools:
    is_glass = np.array([material.kind in _GLASS for material in house.materials])
    face = caster.hit_record(camera).face
    return np.asarray((face >= 0) & is_glass[caster.geometry.face_material[face]])


def _noisy_panes(looks: Sequence[_Look]) -> float:
    """Share of pixels behind panes with noise above twice that of their surroundings, at night."""
    views = [(look.home, camera) for look in looks for camera in look.panes]
    n_noisy = n_pixels = 0
    for home, camera in views[:: max(-(-len(views) // PANE_VIEWS), 1)]:
        mask = _glass_mask(Caster.of_house(home.house), home.house, camera)
        night = home.set(**{"sky.time": "night"})
        picture, reference = (
            pf.render(night.set(**{"light.spp": spp}), camera, size=_SIZE).colour.astype(float)
            for spp in (SPP, REFERENCE_SPP)
        )
        noise = _noise(picture, reference)
        around = binary_dilation(mask, iterations=12) & ~binary_dilation(mask, iterations=2)
        is_noisy = noise[mask] > 2 * np.quantile(noise[around], 0.9)
        print(f"{home.id}: glass {mask.mean():.3f}, noisy {is_noisy.mean():.3f}", flush=True)
        n_noisy, n_pixels = n_noisy + int(is_noisy.sum()), n_pixels + len(is_noisy)
    return round(n_noisy / max(n_pixels, 1), 4)


def _noise(picture: F64, reference: F64) -> F64:
    """(H, W) error in windows of 5 px over the contrast of the reference there; both (H, W, 3) in steps."""
    mean, squares, errors = (
        uniform_filter(image, (5, 5, 0))
        for image in (reference, reference**2, (picture - reference) ** 2)
    )
    contrast = np.sqrt(np.maximum(squares - mean**2, 0).mean(-1))
    return np.asarray(np.sqrt(np.maximum(errors.mean(-1), 0)) / (_LEAST_CONTRAST + contrast))


def _models_per_class(houses: Sequence[House]) -> float:
    counts: dict[str, Counter[str]] = {}
    for house in houses:
        for item in house.items:
            if item.n_faces and not item.kind.is_structure:
                counts.setdefault(NYU40_NAMES[item.nyu40], Counter())[model_of(house, item)] += 1
    common = {k: effective(v) for k, v in counts.items() if v.total() >= LEAST_ITEMS}
    print(*(f"   {name}: {n:.1f} models" for name, n in common.items()), sep="\n")
    return round(min(common.values()), 1)


if __name__ == "__main__":
    main()
