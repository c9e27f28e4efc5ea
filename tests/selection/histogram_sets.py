"""Small sets of histograms, built in code."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.recipe import HistogramFields, SelectionFields
from pbrs_farm.formats.histogram_json import PictureQuality, SceneQuality, SparseCounts, ViewRecord
from pbrs_farm.selection.histogram_pack import HistogramPack, pack_house
from pbrs_farm.selection.histograms import Histogram
from pbrs_farm.selection.reference_set import Reference, reference_from_histograms

FIELDS = HistogramFields(colour_bins=4, depth_bins=16)
GOOD = SceneQuality(surface=0.4, near=0.0, n_objects=5, noise=0.1, missing_textures=0)
PICTURE = PictureQuality(brightness=0.5, blown=0.01)


def random_histogram(rng: np.random.Generator, fields: HistogramFields = FIELDS) -> Histogram:
    colour = rng.gamma(0.15, 1000, fields.colour_bins**3).astype(np.uint32)
    depth = rng.gamma(0.5, 1000, fields.depth_bins).astype(np.uint32)
    colour[0] += 1
    depth[0] += 1
    return Histogram(colour, depth)


def reference(n: int = 9, seed: int = 0, fields: HistogramFields = FIELDS) -> Reference:
    rng = np.random.default_rng(seed)
    histograms = [random_histogram(rng, fields) for _ in range(n)]
    ids = [f"photo {i}" for i in range(n)]
    return reference_from_histograms(
        ids, histograms, fields, SelectionFields(), source=("photos", "0" * 64)
    )


def record(
    house: str,
    view: str,
    rng: np.random.Generator,
    *,
    modes: tuple[Mode, ...] = (Mode.MLT_IL_OL,),
    scene: SceneQuality = GOOD,
    histogram: Histogram | None = None,
) -> ViewRecord:
    h = histogram or random_histogram(rng)
    return ViewRecord(
        settings=FIELDS,
        house=house,
        view=view,
        room=view.rpartition("_")[0],
        room_type="Kitchen",
        depth=SparseCounts.of(h.depth),
        colour=dict.fromkeys(modes, SparseCounts.of(h.colour)),
        picture=dict.fromkeys(modes, PICTURE),
        scene=scene,
    )


def pack(house: str, n_views: int, seed: int = 1) -> HistogramPack:
    rng = np.random.default_rng([seed, *house.encode()])
    records = [record(house, f"0_{k // 3}_{k % 3}", rng) for k in range(n_views)]
    return pack_house(house, f"digest of {house}", FIELDS, records)
