"""histogram.json: all that selection needs of a view, so that no picture is opened again; pure."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.recipe import HistogramFields
from pbrs_farm.selection.histograms import Counts, colour_counts, depth_counts
from pbrs_farm.selection.quality import PictureQuality, SceneQuality, picture_quality

SCORED_MODE: Final = Mode.MLT_IL_OL
"""The mode whose picture decides for the view in all modes (paper section 3.3)."""


class SparseCounts(BaseModel):
    """Counts of the bins that are not empty; bins ascend. size: number of all bins."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    size: int
    bins: tuple[int, ...]
    counts: tuple[int, ...]

    @model_validator(mode="after")
    def _fits(self) -> SparseCounts:
        if len(self.bins) != len(self.counts):
            raise ValueError("as many counts as bins are needed")
        if self.bins and not (self.bins[0] >= 0 and max(self.bins) < self.size):
            raise ValueError(f"a bin is not in 0..{self.size - 1}")
        if any(not 0 <= n < 2**32 for n in self.counts):
            raise ValueError("a count is not in 0..2^32 - 1")
        return self

    @staticmethod
    def of(counts: Counts) -> SparseCounts:
        """The bins of counts that are not empty."""
        bins = np.nonzero(counts)[0]
        return SparseCounts(
            size=len(counts), bins=tuple(bins.tolist()), counts=tuple(counts[bins].tolist())
        )

    def dense(self) -> Counts:
        """(size,) uint32."""
        counts = np.zeros(self.size, np.uint32)
        counts[list(self.bins)] = self.counts
        return counts


class ViewRecord(BaseModel):
    """A view as selection sees it. room_type: the room's name or type, for the report.

    colour, picture: by lighting mode. Only SCORED_MODE where the view has it, else every mode it
    has, so that `--score-mode` can choose.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")
    format: Literal["pbrs_farm histogram 1"] = "pbrs_farm histogram 1"
    settings: HistogramFields
    house: str
    view: str
    room: str
    room_type: str
    depth: SparseCounts
    colour: dict[Mode, SparseCounts]
    picture: dict[Mode, PictureQuality]
    scene: SceneQuality

    @model_validator(mode="after")
    def _fits(self) -> ViewRecord:
        sizes = {c.size for c in self.colour.values()} - {self.settings.colour_bins**3}
        if sizes or self.depth.size != self.settings.depth_bins:
            raise ValueError("the histograms do not have the bins that settings say")
        if self.colour.keys() != self.picture.keys():
            raise ValueError("colour and picture must hold the same modes")
        return self

    def json_bytes(self) -> bytes:
        """The record as canonical JSON: equal records give equal bytes."""
        plain = self.model_dump(mode="json")
        return (json.dumps(plain, sort_keys=True, separators=(",", ":")) + "\n").encode()


def view_record(
    place: Mapping[Literal["house", "view", "room", "room_type"], str],
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
        picture={m: picture_quality(pictures[m]) for m in modes},
        scene=scene,
    )


def record_from_json(data: bytes | str, name: str) -> ViewRecord:
    """The record in a histogram.json; BadInput naming the file when it is none."""
    try:
        return ViewRecord.model_validate_json(data)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise BadInput(name, where, first["msg"], hint="render the view again") from None
