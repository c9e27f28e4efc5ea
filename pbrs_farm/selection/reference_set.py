"""The photographs that views are compared with, as histograms: a small file that can be shared.

No effects: bytes in, bytes out. The file is an .npz whose bytes depend on its content alone.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.recipe import HistogramFields, SelectionFields
from pbrs_farm.core.record import Record
from pbrs_farm.selection.binning import Binning, BinningRow, binning_table, finest_passing
from pbrs_farm.selection.histograms import (
    Counts,
    Histogram,
    coarser_colour,
    coarser_depth,
    normalised,
)
from pbrs_farm.selection.similarity import Shares

_EPOCH: Final = (1980, 1, 1, 0, 0, 0)  # the earliest a ZIP can say: equal content, equal bytes


class ReferenceFacts(Record):
    """What a reference file says of itself."""

    format: Literal["pbrs_farm reference 1"] = "pbrs_farm reference 1"
    source: str  # name of what it was built from
    source_sha256: str
    settings: HistogramFields
    binning: Binning  # the bins that are compared
    table: tuple[BinningRow, ...]  # how the binning was chosen
    ids: tuple[str, ...]  # of the photographs


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """Histograms of n photographs."""

    facts: ReferenceFacts
    colour: NDArray[np.uint32]  # (n, colour bins) counts
    depth: NDArray[np.uint32]  # (n, depth bins) counts

    @property
    def digest(self) -> str:
        """Digest of everything a score depends on."""
        facts = self.facts.model_dump(mode="json", exclude={"table"})
        return keys.digest(facts, keys.sha256(self.colour.tobytes() + self.depth.tobytes()))

    def colour_shares(self) -> Shares:
        """(n, bins) normalised colour histograms at the chosen binning."""
        return normalised(coarser_colour(self.colour, self.facts.binning.colour))

    def depth_shares(self) -> Shares:
        """(n, bins) normalised depth histograms at the chosen binning."""
        return normalised(coarser_depth(self.depth, self.facts.binning.depth))


def reference_from_histograms(
    ids: Sequence[str],
    histograms: Sequence[Histogram],
    settings: HistogramFields,
    selection: SelectionFields,
    *,
    source: tuple[str, str],
) -> Reference:
    """A reference of the photographs ids, with the finest binning 95 % of them pass.

    selection: the thresholds they must pass. source: name and sha256 of what they were read from.
    Raises BadInput for an empty set, for a single image, and for an image without known depth.
    """
    if len(ids) < 2:
        what = "holds no image" if not ids else "holds a single image"
        raise BadInput(source[0], "", f"{what}; a reference needs two at least")
    colour = np.stack([h.colour for h in histograms]).astype(np.uint32)
    depth = np.stack([h.depth for h in histograms]).astype(np.uint32)
    # Reject a photograph without depth: it would resemble nothing.
    blind = np.nonzero(depth.sum(axis=1) == 0)[0]
    if len(blind):
        raise BadInput(source[0], ids[int(blind[0])], "no pixel has a known depth")
    # Choose the finest binning at which the photographs pass themselves.
    table = binning_table(
        colour, depth, min_colour=selection.min_colour, min_depth=selection.min_depth
    )
    facts = ReferenceFacts(
        source=source[0],
        source_sha256=source[1],
        settings=settings,
        binning=finest_passing(table),
        table=table,
        ids=tuple(ids),
    )
    return Reference(facts, colour, depth)


def bytes_from_reference(reference: Reference) -> bytes:
    """The reference file: equal references give equal bytes."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        _add(archive, "reference.json", reference.facts.model_dump_json(indent=1).encode() + b"\n")
        for name, array in (("colour", reference.colour), ("depth", reference.depth)):
            data = io.BytesIO()
            np.lib.format.write_array(data, array.astype("<u4"), version=(1, 0))
            _add(archive, f"{name}.npy", data.getvalue())
    return file.getvalue()


def _add(archive: zipfile.ZipFile, name: str, data: bytes) -> None:
    entry = zipfile.ZipInfo(name, _EPOCH)
    entry.compress_type = zipfile.ZIP_DEFLATED
    archive.writestr(entry, data, compresslevel=6)


def reference_from_bytes(data: bytes, name: str) -> Reference:
    """The Reference of a file; BadInput naming it when it is damaged or none of this version."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            facts = ReferenceFacts.model_validate_json(archive.read("reference.json"))
            colour, depth = (_array(archive.read(f"{k}.npy")) for k in ("colour", "depth"))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise BadInput(name, where, first["msg"], hint="build the reference again") from None
    except (zipfile.BadZipFile, KeyError, ValueError, OSError, EOFError):
        hint = "`pbrs-farm reference build` makes one"
        raise BadInput(name, "", "not a reference file, or damaged", hint=hint) from None
    # Check that the tables have a row a photograph and the bins of the settings.
    n = len(facts.ids)
    wanted = (n, facts.settings.colour_bins**3), (n, facts.settings.depth_bins)
    if n == 0 or (colour.shape, depth.shape) != wanted:
        raise BadInput(name, "", f"expected histograms {wanted}, got {colour.shape}, {depth.shape}")
    return Reference(facts, colour, depth)


def _array(data: bytes) -> Counts:
    array: NDArray[Any] = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    if array.dtype != np.dtype("<u4") or array.ndim != 2:
        raise ValueError("not a table of counts")
    return array.astype(np.uint32, copy=False)


def check_comparable(reference: Reference, settings: HistogramFields, name: str) -> None:
    """Raise BadInput, naming the reference file, unless histograms of settings can be compared.

    Colour space and depth range must be equal; the bins may be finer than the reference compares.
    """
    facts = reference.facts
    # Collect what differs, to name it all at once.
    differing = [
        f"{field}: {getattr(facts.settings, field)} there, {getattr(settings, field)} here"
        for field in ("colour_space", "depth_min_m", "depth_max_m")
        if getattr(facts.settings, field) != getattr(settings, field)
    ]
    if any(settings.colour_bins % k for k in facts.binning.colour):
        bins = "x".join(str(k) for k in facts.binning.colour)
        differing.append(f"colour bins: {bins} there, {settings.colour_bins} per channel here")
    if settings.depth_bins % facts.binning.depth:
        differing.append(f"depth bins: {facts.binning.depth} there, {settings.depth_bins} here")
    if differing:
        text = f"built with other settings than the views: {'; '.join(differing)}"
        hint = "build the reference with the views' --set histogram..."
        raise BadInput(name, "settings", text, hint=hint)
