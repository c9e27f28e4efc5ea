"""Views of packed shards. Effects: reads a folder or a store, maps files."""

from __future__ import annotations

import io
import json
import mmap
import zipfile
import zlib
from collections import OrderedDict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import SplitShares, split_of_house
from pbrs_farm.regular_files import fault_of, open_regular
from pbrs_farm.store import Store
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.views.dataset_json import DATASET_JSON, WHOLE, Dataset, Shard, dataset_from_json
from pbrs_farm.views.png_rows import array_of_rows, png_of_rows
from pbrs_farm.views.stored_layers import (
    Stored,
    ViewFacts,
    array_names,
    checked_array,
    facts_from_json,
    sample_of_stored,
)
from pbrs_farm.views.view_sample import Sample, SampleRequest
from pbrs_farm.views.views import ViewRef, Views

# Arrays <-> deflated .npz bytes without a clock, as webdataset and numpy read them.


_DATE: Final = (1980, 1, 1, 0, 0, 0)  # the first a zip file can hold
_LEVEL: Final = 6


def npz_of_arrays(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """.npz bytes; equal arrays give equal bytes."""
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED, compresslevel=_LEVEL) as archive:
        for name, array in arrays.items():
            member = zipfile.ZipInfo(f"{name}.npy", _DATE)
            member.compress_type = zipfile.ZIP_DEFLATED
            part = io.BytesIO()
            np.lib.format.write_array(part, np.ascontiguousarray(array), allow_pickle=False)
            archive.writestr(member, part.getbuffer())
    return whole.getvalue()


def arrays_of_npz(data: bytes, place: str) -> dict[str, NDArray[Any]]:
    """Name -> array; BadInput, naming place, where data is no .npz or is damaged."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (
        OSError,
        ValueError,
        KeyError,
        EOFError,
        AttributeError,
        zipfile.BadZipFile,
        zlib.error,
    ):
        raise BadInput(place, "", "not an .npz of arrays, or damaged") from None


# The parts of a packed view: which file of a shard holds which array, written and read.
# Arrays of 8 bits are PNGs that zlib and numpy undo, colour a JPEG where it was packed so; arrays
# of 16 bits are .npz, which no picture decoder can make 8 bits of.


# Array -> the part that holds it; colour is <mode>.png or <mode>.jpg.
_PARTS: Final = {
    "normal": "normal.npz",
    "valid": "normal.npz",
    "depth": "depth.npz",
    "class40": "class40.png",
    "instance": "instance.npz",
    "boundary": "boundary.png",
}


def label_parts(stored: Stored) -> dict[str, bytes]:
    """Part -> bytes of a view's labels, in a fixed order."""
    parts: dict[str, bytes] = {}
    for part in dict.fromkeys(_PARTS.values()):
        arrays = {n: stored[n] for n, own in _PARTS.items() if own == part and n in stored}
        if arrays:
            is_npz = part.endswith(".npz")
            parts[part] = npz_of_arrays(arrays) if is_npz else png_of_rows(*arrays.values())
    return parts


def part_of_array(name: str, mode: str, parts: Collection[str]) -> str:
    """The part that holds an array of a view that has these parts."""
    if name != "colour":
        return _PARTS[name]
    return f"{mode}.jpg" if f"{mode}.jpg" in parts else f"{mode}.png"


def arrays_of_part(names: Sequence[str], part: str, data: bytes, place: str) -> Stored:
    """The arrays of those names in a part; BadInput, naming place, where it is damaged."""
    if part.endswith(".npz"):
        arrays = arrays_of_npz(data, place)
        for name in names:
            if name not in arrays:
                raise BadInput(place, "", f"has no array {name}")
        return {name: arrays[name] for name in names}
    array = _jpeg_array(data, place) if part.endswith(".jpg") else array_of_rows(data, place)
    if array is None:
        raise BadInput(place, "", "a PNG of another program", hint="`pbrs-farm pack` writes shards")
    return dict.fromkeys(names, array)


def _jpeg_array(data: bytes, place: str) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 of a JPEG, by Pillow: one decoder, the same bits on every machine."""
    from PIL import Image  # a shard of PNGs is read without it

    try:
        with Image.open(io.BytesIO(data), formats=["JPEG"]) as picture:
            return np.asarray(picture.convert("RGB"))
    except (OSError, ValueError, SyntaxError):
        raise BadInput(place, "", "cannot be read as a JPEG: damaged") from None


# Tar shards written without a clock and read by offset, with numpy's memory at most.
# The form is POSIX ustar with plain files only, which webdataset, tar and Python's tarfile read.


_BLOCK: Final = 512
_MAX_NAME: Final = 100  # bytes, of ustar without a prefix
Buffer = bytes | memoryview


@dataclass(frozen=True, slots=True)
class Member:
    """A file of a tar: where its bytes lie."""

    name: str
    at: int
    n_bytes: int


def tar_member(name: str, data: bytes) -> bytes:
    """Header, bytes and padding of one file: mode 644, no owner, time 0."""
    encoded = name.encode()
    if len(encoded) > _MAX_NAME:
        raise BadInput(name, "", f"a name in a shard has at most {_MAX_NAME} bytes")
    header = bytearray(_BLOCK)
    header[: len(encoded)] = encoded
    numbers = (b"0000644\0", b"0000000\0", b"0000000\0", b"%011o\0" % len(data), b"%011o\0" % 0)
    header[100:148] = b"".join(numbers)
    header[148:156] = b" " * 8  # the checksum is taken with spaces in its place
    header[156:157] = b"0"
    header[257:265] = b"ustar\x0000"
    header[148:156] = b"%06o\0 " % sum(header)
    return bytes(header) + data + bytes(-len(data) % _BLOCK)


def tar_end() -> bytes:
    """What ends a tar: two empty blocks."""
    return bytes(2 * _BLOCK)


def members_of_tar(tar: Buffer, place: str) -> Iterator[Member]:
    """The files of a tar in its order; BadInput, naming place, where it is damaged or cut short."""
    at = 0
    while at + _BLOCK <= len(tar):
        header = bytes(tar[at : at + _BLOCK])
        if not any(header):
            return
        if header[257:262] != b"ustar" or header[156:157] not in (b"0", b"\0"):
            raise BadInput(place, f"byte {at}", "not a shard of plain files: damaged")
        name = header[:_MAX_NAME].rstrip(b"\0").decode("utf-8", "replace")
        try:
            n_bytes = int(header[124:136].rstrip(b"\0 "), 8)
        except ValueError:
            raise BadInput(place, f"byte {at}", "not a shard: damaged") from None
        yield Member(name, at + _BLOCK, n_bytes)
        at += _BLOCK + n_bytes + (-n_bytes % _BLOCK)
    # Two empty blocks were to come.
    raise BadInput(place, "", "ends too soon: truncated", hint="copy or pack it again")


_N_OPEN: Final = 8  # shards that are kept open
Parts = dict[str, Member]  # a view's parts by what follows its key


class OpenShard:
    """One tar, mapped or in memory, and where each view's parts lie."""

    def __init__(self, tar: Buffer, place: str) -> None:
        self._tar = tar
        self.place = place
        self.views: list[Parts] = []  # in the tar's order
        key = None
        for member in members_of_tar(tar, place):
            # The parts of a view stand together; its key ends at the first dot.
            own, _, part = member.name.partition(".")
            if own != key:
                self.views.append({})
                key = own
            self.views[-1][part] = member

    def bytes_of(self, view: int, part: str) -> bytes:
        """The bytes of a part of the view at that place; BadInput where it has none."""
        member = self.views[view].get(part)
        if member is None:
            raise BadInput(self.place, f"view {view}", f"has no {part}")
        return bytes(self._tar[member.at : member.at + member.n_bytes])


class ShardSet:
    """Packed shards in a folder or a store; a ViewSource, and readable by shard and place.

    Files are mapped in a folder; from elsewhere a shard comes whole and some are kept.
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self._place = str(store.root) if isinstance(store, FolderStore) else store.url
        place = f"{self._place}/{DATASET_JSON}"
        self.dataset: Dataset = dataset_from_json(store.get(DATASET_JSON), place)
        self._open: OrderedDict[str, OpenShard] = OrderedDict()
        self._at: dict[ViewRef, tuple[Shard, int]] = {}  # filled when views are asked for by name
        for shard in self.dataset.shards:
            self._check_size(shard)

    def __getstate__(self) -> dict[str, Any]:
        # A map cannot be sent to a process: shards are opened again there.
        return {**self.__dict__, "_open": OrderedDict()}

    @property
    def url(self) -> str:
        return self._place

    def shards_of(self, split: str | None) -> tuple[Shard, ...]:
        """The shards of a split, all for None; BadInput where there is none of that name."""
        found = tuple(s for s in self.dataset.shards if split is None or s.split == split)
        if not found:
            splits = dict.fromkeys(s.split for s in self.dataset.shards)
            raise BadInput(
                self.url, "", f"no shard of split {split}", hint=f"of {', '.join(splits)}"
            )
        return found

    def check(self, request: SampleRequest) -> None:
        """Raise BadInput where the shards do not hold what request asks for."""
        held = self.dataset
        for layer in request.layers:
            if layer != "colour" and layer not in held.layers:
                hint = f"packed: {', '.join(held.layers)}"
                raise BadInput(self.url, "", f"no layer {layer} in these shards", hint=hint)
        if "colour" in request.layers and request.mode not in held.modes:
            hint = f"packed: {', '.join(held.modes)}"
            raise BadInput(self.url, "", f"no pictures in {request.mode} light", hint=hint)

    def read_at(self, shard: Shard, view: int, request: SampleRequest) -> Sample:
        """The Sample of a view by its place in a shard."""
        opened = self._opened(shard)
        if view >= len(opened.views):
            text = f"{len(opened.views)} views, {shard.n_views} were packed"
            raise BadInput(opened.place, "", text, hint="copy or pack it again")
        facts = self._facts_at(opened, view)
        # A part may hold several arrays: read it once.
        held = opened.views[view]
        names_of: dict[str, list[str]] = {}
        for name in array_names(request.layers):
            names_of.setdefault(part_of_array(name, request.mode, held), []).append(name)
        arrays: Stored = {}
        for part, names in names_of.items():
            arrays |= self._arrays(opened, view, part, names, facts)
        return sample_of_stored(facts, arrays, request)

    def refs(self) -> tuple[ViewRef, ...]:
        """All views by name: opens every shard once."""
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
        raise BadInput(self.url, "", f"shards know of no selection {run}", hint=hint)

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
        """The shard that holds a view."""
        return self._at[ref][0]

    def split_of(self, ref: ViewRef, shares: SplitShares | None) -> str:
        packed = self._at[ref][0].split
        return split_of_house(ref.house, shares) if shares or packed == WHOLE else packed

    def _arrays(
        self, opened: OpenShard, view: int, part: str, names: list[str], facts: ViewFacts
    ) -> Stored:
        place = f"{opened.place}: {facts.id}.{part}"
        arrays = arrays_of_part(names, part, opened.bytes_of(view, part), place)
        return {name: checked_array(name, arrays[name], facts.size, place) for name in names}

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
        # Let go of the one that was not used for longest.
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
    """The views of shards by name."""
    shards = ShardSet(store)
    return Views(shards, shards.refs(), {})
