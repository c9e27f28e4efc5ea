"""dataset.json of packed shards: contents, units, splits and sizes; no effects."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import SplitShares
from pbrs_farm.views.view_sample import LAYERS, MODES, Size

DATASET_JSON: Final = "dataset.json"
WHOLE: Final = "all"  # name of the only split of an unsplit set
_FORM: Final = "pbrs_farm shards 1"


@dataclass(frozen=True, slots=True)
class Shard:
    """One tar of a dataset."""

    file: str
    split: str  # train, val, test, or all
    n_views: int
    n_bytes: int
    sha256: str


@dataclass(frozen=True, slots=True)
class Dataset:
    """The part of dataset.json that a reader of shards needs."""

    size: Size | None  # None: each view at its rendered size
    modes: tuple[str, ...]
    layers: tuple[str, ...]
    shards: tuple[Shard, ...]
    shares: SplitShares | None  # None: unsplit
    classes: tuple[str, ...] = ()  # names of ids 0..40


def dataset_json(dataset: Dataset, also: Mapping[str, Any]) -> bytes:
    """The file's bytes. also: entries for people: arrays, class colours, credits, card.

    also must be JSON values. Shards keep the given order, which is the order of reading.
    """
    row = {
        "form": _FORM,
        "size": dataset.size,
        "modes": dataset.modes,
        "layers": dataset.layers,
        "split": dataset.shares and asdict(dataset.shares),
        "classes": dataset.classes,
        **also,
        "shards": [asdict(shard) for shard in dataset.shards],
    }
    return (json.dumps(row, indent=1, ensure_ascii=False) + "\n").encode()


def dataset_from_json(data: bytes, place: str) -> Dataset:
    """The Dataset that dataset_json wrote; BadInput, naming place, for anything else.

    Entries for people are ignored. Files of another version, with unknown modes or layers, or without
    shards are refused.
    """
    try:
        row = json.loads(data)
        if row["form"] != _FORM:
            raise BadInput(place, "form", f"{row['form']!r}, expected {_FORM!r}")
        size = None if row["size"] is None else (int(row["size"][0]), int(row["size"][1]))
        shards = tuple(Shard(**shard) for shard in row["shards"])
        modes, layers = tuple(row["modes"]), tuple(row["layers"])
        shares = None if row["split"] is None else SplitShares(**row["split"])
        if not set(modes) <= set(MODES) or not set(layers) <= set(LAYERS) or not shards:
            raise ValueError
        return Dataset(size, modes, layers, shards, shares, tuple(row["classes"]))
    except (ValueError, KeyError, TypeError, IndexError, RecursionError):
        text = "not the dataset.json of shards"
        raise BadInput(place, "", text, hint="`pbrs-farm pack` writes one") from None
