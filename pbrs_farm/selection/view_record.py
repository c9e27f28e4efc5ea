"""A view's pictures and depth -> what selection needs of them (formats/histogram_json.py); pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.recipe import HistogramFields
from pbrs_farm.formats.histogram_json import SCORED_MODE, SceneQuality, SparseCounts, ViewRecord
from pbrs_farm.selection.histograms import colour_counts, depth_counts
from pbrs_farm.selection.quality import picture_quality

# Where a view was taken: ids of house, view and room, and the room's name.
ViewPlace = Mapping[Literal["house", "view", "room", "room_type"], str]


def view_record(
    place: ViewPlace,
    pictures: Mapping[Mode, Srgb8Image],
    depth_mm: NDArray[np.integer],
    scene: SceneQuality,
    settings: HistogramFields,
) -> ViewRecord:
    """The record of a view from its pictures by mode, (H, W, 3) uint8, and depth (H, W) in mm."""
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
