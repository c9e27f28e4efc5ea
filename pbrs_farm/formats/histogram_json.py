"""histogram.json, by the step `view`: all that `select` needs of a view instead of its pictures; no effects."""

from __future__ import annotations

import json
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from pbrs_farm.core.checked_json import checked
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.recipe import HistogramFields
from pbrs_farm.core.record import Record

# The mode whose picture decides for the view in all modes (paper section 3.3).
SCORED_MODE: Final = Mode.MLT_IL_OL


class PictureQuality(Record):
    """Of one lighting mode."""

    brightness: float  # median sRGB luma, 0..1
    blown: float  # share of pixels with a channel >= 254


class SceneQuality(Record):
    """Of a view, whatever its light. All shares are of the picture."""

    surface: float  # share of the largest instance
    near: float  # share nearer than near_m: a camera inside an object sees little else
    n_objects: int  # of object_fraction or more; walls, floors and ceilings apart
    noise: float | None = None  # relative error of the raw light, None where none was traced
    missing_textures: int = 0  # of the house
    classes: dict[int, float] = Field(default_factory=dict)  # NYU40 id (1..40) -> its share


class SparseCounts(Record):
    """Counts of the bins that are not empty."""

    size: int  # number of all bins
    bins: tuple[int, ...]  # ascending
    counts: tuple[int, ...]  # of each of them

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
    def of(counts: NDArray[np.uint32]) -> SparseCounts:
        """The bins of counts (bins,) uint32 that are not empty."""
        bins = np.nonzero(counts)[0]
        filled = tuple(counts[bins].tolist())
        return SparseCounts(size=len(counts), bins=tuple(bins.tolist()), counts=filled)

    def dense(self) -> NDArray[np.uint32]:
        """(size,) uint32 counts; the inverse of SparseCounts.of."""
        counts = np.zeros(self.size, np.uint32)
        counts[list(self.bins)] = self.counts
        return counts


class ViewRecord(Record):
    """A view as selection sees it."""

    format: Literal["pbrs_farm histogram 1"] = "pbrs_farm histogram 1"
    settings: HistogramFields
    house: str
    view: str
    room: str
    room_type: str  # the room's name or type, for the report
    depth: SparseCounts
    # Only SCORED_MODE where the view has it, else every mode it has, for `--score-mode` to choose.
    colour: dict[Mode, SparseCounts]
    # Every mode the view has; of views stored before version 3 of the step, those of colour.
    picture: dict[Mode, PictureQuality]
    scene: SceneQuality

    @model_validator(mode="after")
    def _fits(self) -> ViewRecord:
        # Colour bins are a cube of bins per channel.
        sizes = {c.size for c in self.colour.values()} - {self.settings.colour_bins**3}
        if sizes or self.depth.size != self.settings.depth_bins:
            raise ValueError("the histograms do not have the bins that settings say")
        if not self.colour.keys() <= self.picture.keys():
            raise ValueError("picture lacks a mode of colour")
        return self

    def json_bytes(self) -> bytes:
        """The record as canonical JSON: equal records give equal bytes."""
        plain = self.model_dump(mode="json")
        return (json.dumps(plain, sort_keys=True, separators=(",", ":")) + "\n").encode()


def record_from_json(data: bytes, name: str) -> ViewRecord:
    """The record in a histogram.json of that name; BadInput, with advice, for any other content."""
    return checked(ViewRecord, data, name, hint="render the view again")
