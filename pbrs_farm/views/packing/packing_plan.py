"""The content and order of packed shards: views by split, mixed by seed; no effects."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pbrs_farm.core.checked_calls import as_words, check_fields
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import SPLITS, SplitShares, split_of_house
from pbrs_farm.core.shown_text import hint_of_choice
from pbrs_farm.views.dataset_json import WHOLE
from pbrs_farm.views.view_sample import LAYERS, MODES, SampleRequest, Size
from pbrs_farm.views.views import ViewRef

COLOURS = ("png", "jpeg")
FORMS = ("shards", "parquet")
_WHOLE_OF = {"shards": WHOLE, "parquet": "train"}  # `datasets` refuses a split named "all"


@dataclass(frozen=True, slots=True)
class Packing:
    """The layers, size, splits and encoding of packed views. Raises BadInput for impossible ones.

    size: (width, height), None as rendered. shares: of each split, None for a single split. colour:
    "png" keeps every bit, "jpeg" is a quarter as large.
    """

    size: Size | None = None
    layers: tuple[str, ...] = LAYERS
    modes: tuple[str, ...] = MODES
    shares: SplitShares | None = None
    views_per_shard: int = 200
    colour: str = "png"
    quality: int = 95  # of JPEG
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("layers", "modes"):
            object.__setattr__(self, name, as_words(getattr(self, name)))
        check_fields(self)
        if not self.layers:
            raise BadInput("pack", "layers", "give at least one")
        for mode in self.modes:
            SampleRequest(self.layers, mode, size=self.size)  # raises BadInput for invalid values
        if self.colour not in COLOURS:
            raise BadInput(
                "colour", self.colour, "no such format", hint=hint_of_choice(self.colour, COLOURS)
            )
        if self.views_per_shard < 1 or not 1 <= self.quality <= 100:
            text = f"{self.views_per_shard} views a shard, quality {self.quality}"
            raise BadInput("pack", "", text, hint="1 or more views, a quality of 1 to 100")

    def requests(self) -> tuple[SampleRequest, ...]:
        """A request for the labels, and one for each mode's colour."""
        labels = tuple(layer for layer in self.layers if layer != "colour")
        modes = self.modes if "colour" in self.layers else ()
        return (SampleRequest(labels), *(SampleRequest(("colour",), mode) for mode in modes))


@dataclass(frozen=True, slots=True)
class ShardPlan:
    """The views of one shard to write."""

    split: str
    number: int  # among those of its split, from 0
    n_shards: int  # of its split
    refs: tuple[ViewRef, ...]


def shard_plans(
    refs: tuple[ViewRef, ...], packing: Packing, form: str = "shards"
) -> Iterator[ShardPlan]:
    """The shards of all splits; each view is in one, and views of a home are far apart.

    Without shares there is one split: "all" of shards, "train" of Parquet.
    """
    whole = _WHOLE_OF[form]
    by_split: dict[str, list[ViewRef]] = {name: [] for name in (whole, *SPLITS)}
    for ref in refs:
        split = split_of_house(ref.house, packing.shares) if packing.shares else whole
        by_split[split].append(ref)
    for split, split_refs in by_split.items():
        # The order follows from the seed and the number of views.
        order = np.random.default_rng(packing.seed).permutation(len(split_refs))
        mixed = [split_refs[k] for k in order]
        starts = range(0, len(mixed), packing.views_per_shard)
        for number, start in enumerate(starts):
            part = tuple(mixed[start : start + packing.views_per_shard])
            yield ShardPlan(split, number, len(starts), part)
