"""Views of packed shards. Effects: reads a folder or a store, maps files."""

from __future__ import annotations

import json
import mmap
from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import SplitShares, split_of_house
from pbrs_farm.regular_files import fault_of, open_regular
from pbrs_farm.store import Store
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.views.dataset_json import DATASET_JSON, WHOLE, Dataset, Shard, dataset_from_json
from pbrs_farm.views.shard_parts import arrays_of_part, part_of_array
from pbrs_farm.views.shard_tar import Buffer, OpenShard
from pbrs_farm.views.stored_layers import (
    Stored,
    ViewFacts,
    array_names,
    check_array,
    facts_from_json,
    sample_of_stored,
)
from pbrs_farm.views.view_sample import Sample, SampleRequest
from pbrs_farm.views.views import ViewRef, Views

_N_OPEN: Final = 8  # maximum number of open shards


class ShardSet:
    """Packed shards in a folder or a store; a ViewSource, and readable by shard and index.

    Files in a folder are memory-mapped; shards from elsewhere are downloaded whole, and some are cached.
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self._place = str(store.root) if isinstance(store, FolderStore) else store.url
        place = f"{self._place}/{DATASET_JSON}"
        self.dataset: Dataset = dataset_from_json(store.get(DATASET_JSON), place)
        self._open: OrderedDict[str, OpenShard] = OrderedDict()
        self._at: dict[ViewRef, tuple[Shard, int]] = {}  # filled by the first access by name
        for shard in self.dataset.shards:
            self._check_size(shard)

    def __getstate__(self) -> dict[str, Any]:
        # A map cannot be sent to another process, which opens the shards again.
        return {**self.__dict__, "_open": OrderedDict()}

    @property
    def url(self) -> str:
        return self._place

    def shards_of(self, split: str | None) -> tuple[Shard, ...]:
        """The shards of a split, all for None; raises BadInput for an unknown split."""
        shards = tuple(s for s in self.dataset.shards if split is None or s.split == split)
        if not shards:
            splits = dict.fromkeys(s.split for s in self.dataset.shards)
            raise BadInput(
                self.url, "", f"no shard of split {split}", hint=f"of {', '.join(splits)}"
            )
        return shards

    def check(self, request: SampleRequest) -> None:
        """Raise BadInput if the shards lack a requested layer or mode."""
        dataset = self.dataset
        for layer in request.layers:
            if layer != "colour" and layer not in dataset.layers:
                hint = f"packed: {', '.join(dataset.layers)}"
                raise BadInput(self.url, "", f"no layer {layer} in these shards", hint=hint)
        if "colour" in request.layers and request.mode not in dataset.modes:
            hint = f"packed: {', '.join(dataset.modes)}"
            raise BadInput(self.url, "", f"no pictures of the mode {request.mode}", hint=hint)

    def read_at(self, shard: Shard, view: int, request: SampleRequest) -> Sample:
        """The Sample of a view by its index in a shard.

        The fast way to read shards in order; `read`, by name, needs the list of all views. BadInput for
        an index beyond the views, or if a requested array was not packed.
        """
        opened = self._opened(shard)
        if view >= len(opened.views):
            text = f"{len(opened.views)} views, {shard.n_views} were packed"
            raise BadInput(opened.place, "", text, hint="copy or pack it again")
        facts = self._facts_at(opened, view)
        # A part may hold several arrays: read it once.
        packed_view = opened.views[view]
        names_of: dict[str, list[str]] = {}
        for name in array_names(request.layers):
            names_of.setdefault(part_of_array(name, request.mode, packed_view), []).append(name)
        arrays: Stored = {}
        for part, names in names_of.items():
            arrays |= self._arrays(opened, view, part, names, facts)
        return sample_of_stored(facts, arrays, request)

    def refs(self) -> tuple[ViewRef, ...]:
        """All views by name: opens every shard once.

        Sorted, houses before objects; cached. Slow over a network, since each shard is opened; `read_at`
        does not need it.
        """
        if not self._at:
            for shard in self.dataset.shards:
                opened = self._opened(shard)
                for view in range(len(opened.views)):
                    facts = self._facts_at(opened, view)
                    self._at[ViewRef(facts.house, facts.view)] = (shard, view)
        return tuple(sorted(self._at, key=lambda ref: (ref.is_object, ref)))

    def lacks(self, ref: ViewRef, request: SampleRequest) -> str:
        self.check(request)
        return ""

    def modes(self, ref: ViewRef) -> tuple[str, ...]:
        return self.dataset.modes

    def layers(self, ref: ViewRef) -> tuple[str, ...]:
        return (*self.dataset.modes, *(n for n in self.dataset.layers if n != "colour"))

    def layer(self, ref: ViewRef, name: str) -> NDArray[Any]:
        text = "shards hold samples: read them with sample()"
        raise BadInput(self.url, "", text, hint="open the output folder itself for stored layers")

    def kept_by(self, run: str) -> frozenset[ViewRef]:
        hint = "pack them with --selection"
        raise BadInput(self.url, "", f"shards have no selection {run}", hint=hint)

    def save(self, refs: Sequence[ViewRef], place: str | Path) -> None:
        hint = "save frames of the output folder itself"
        raise BadInput(self.url, "", "shards hold samples, not all files of a view", hint=hint)

    def facts(self, ref: ViewRef) -> ViewFacts:
        shard, view = self._at[ref]
        return self._facts_at(self._opened(shard), view)

    def table(self, ref: ViewRef) -> dict[str, Any]:
        shard, view = self._at[ref]
        return self._table_at(self._opened(shard), view)

    def read(self, ref: ViewRef, request: SampleRequest) -> Sample:
        self.check(request)
        return self.read_at(*self._at[ref], request)

    def shard_of(self, ref: ViewRef) -> Shard:
        """The shard of a view."""
        return self._at[ref][0]

    def split_of(self, ref: ViewRef, shares: SplitShares | None) -> str:
        packed = self._at[ref][0].split
        return split_of_house(ref.house, shares) if shares or packed == WHOLE else packed

    def _arrays(
        self, opened: OpenShard, view: int, part: str, names: list[str], facts: ViewFacts
    ) -> Stored:
        place = f"{opened.place}: {facts.id}.{part}"
        arrays = arrays_of_part(names, part, opened.bytes_of(view, part), place)
        return {name: check_array(name, arrays[name], facts.size, place) for name in names}

    def _facts_at(self, opened: OpenShard, view: int) -> ViewFacts:
        return facts_from_json(self._table_at(opened, view), f"{opened.place}: view {view}")

    def _table_at(self, opened: OpenShard, view: int) -> dict[str, Any]:
        try:
            row: dict[str, Any] = json.loads(opened.bytes_of(view, "json"))
        except (ValueError, RecursionError):
            raise BadInput(opened.place, f"view {view}", "not JSON: damaged") from None
        return row

    def _opened(self, shard: Shard) -> OpenShard:
        if shard.file in self._open:
            self._open.move_to_end(shard.file)
            return self._open[shard.file]
        opened = OpenShard(self._bytes(shard), f"{self._place}/{shard.file}")
        self._open[shard.file] = opened
        # Close the least recently used shard.
        if len(self._open) > _N_OPEN:
            self._open.popitem(last=False)
        return opened

    def _bytes(self, shard: Shard) -> Buffer:
        store = self._store
        if not isinstance(store, FolderStore):
            return store.get(shard.file)
        path = store.root / shard.file
        try:
            with open_regular(path, 2**40) as file:
                return memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
        except OSError as error:
            raise BadInput(path, "", fault_of(error)) from None

    def _check_size(self, shard: Shard) -> None:
        head = self._store.head(shard.file)
        place = f"{self._place}/{shard.file}"
        if head is None:
            raise BadInput(place, "", "no such shard, though dataset.json names it")
        if head.n_bytes != shard.n_bytes:
            text = f"{head.n_bytes} of {shard.n_bytes} bytes: truncated or another file"
            raise BadInput(place, "", text, hint="copy or pack it again")


def views_of_shards(store: Store) -> Views:
    """The views of shards by name.

    Opens every shard once. Splits are as packed.
    """
    shards = ShardSet(store)
    return Views(shards, shards.refs(), {})
