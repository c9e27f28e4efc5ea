"""Quality numbers of a picture and its scene, for rejecting useless views; no effects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.house import ItemKind
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.recipe import HistogramFields
from pbrs_farm.formats.histogram_json import (
    SCORED_MODE,
    PictureQuality,
    SceneQuality,
    SparseCounts,
    ViewRecord,
)
from pbrs_farm.selection.histograms import colour_counts, depth_counts

_SATURATED: Final = 254  # of 255: a channel at or above it is blown

# Place of a view: ids of house, view and room, and the room's name.
ViewPlace = Mapping[Literal["house", "view", "room", "room_type"], str]


def picture_quality(rgb_srgb8: Srgb8Image) -> PictureQuality:
    """Median luma and saturation, 0..1, and blown share, of a developed (H, W, 3) uint8."""
    # Every second pixel is enough for a median, and fast.
    r, g, b = (rgb_srgb8[::2, ::2, k].astype(np.uint32) for k in range(3))
    # Find the median by counting, with BT.709 weights in 1/256.
    luma = np.bincount(((54 * r + 183 * g + 19 * b) >> 8).reshape(-1), minlength=256)
    median = int(np.searchsorted(np.cumsum(luma), (luma.sum() + 1) // 2))
    brightest = np.maximum(np.maximum(rgb_srgb8[..., 0], rgb_srgb8[..., 1]), rgb_srgb8[..., 2])
    blown = np.count_nonzero(brightest >= _SATURATED) / brightest.size
    return PictureQuality(brightness=round(median / 255, 5), blown=round(blown, 5))


def scene_quality(
    depth_mm: NDArray[np.integer],
    instances: Iterable[Mapping[str, Any]],
    settings: HistogramFields,
    *,
    noise: float | None = None,
    missing_textures: int = 0,
) -> SceneQuality:
    """Quality by depth (H, W) in mm and view.json's "instances" (kind, fraction, nyu40 if any)."""
    # Sum the shares of each class; keep those of each item by its kind.
    classes: dict[int, float] = {}
    rows = []  # (kind, share of the picture)
    for row in instances:
        share, nyu40 = float(row["fraction"]), int(row.get("nyu40", 0))
        rows.append((str(row["kind"]), share))
        if 0 < nyu40 < len(NYU40_NAMES):
            classes[nyu40] = classes.get(nyu40, 0.0) + share
    objects = [share for kind, share in rows if not ItemKind(kind).is_structure]
    near = (depth_mm > 0) & (depth_mm < settings.near_m * 1000.0)
    return SceneQuality(
        surface=round(max((share for _kind, share in rows), default=0.0), 5),
        near=round(float(near.mean()), 5),
        n_objects=sum(share >= settings.object_fraction for share in objects),
        noise=None if noise is None else round(noise, 5),
        missing_textures=missing_textures,
        classes={nyu40: round(classes[nyu40], 4) for nyu40 in sorted(classes)},
    )


def view_record(
    place: ViewPlace,
    pictures: Mapping[Mode, Srgb8Image],
    depth_mm: NDArray[np.integer],
    scene: SceneQuality,
    settings: HistogramFields,
) -> ViewRecord:
    """The record of a view: colour in the selection's mode (else all), brightness in all, depth."""
    modes = [SCORED_MODE] if SCORED_MODE in pictures else sorted(pictures)
    return ViewRecord(
        settings=settings,
        house=place["house"],
        view=place["view"],
        room=place["room"],
        room_type=place["room_type"],
        depth=SparseCounts.of(depth_counts(depth_mm, settings)),
        colour={m: SparseCounts.of(colour_counts(pictures[m], settings)) for m in modes},
        picture={m: picture_quality(pictures[m]) for m in sorted(pictures)},
        scene=scene,
    )
