"""The reference photographs of a selection as histograms: a small .npz by content alone; no effects."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.checked_json import checked
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

_EPOCH: Final = (1980, 1, 1, 0, 0, 0)  # earliest time in a ZIP: equal content, equal bytes

# A pixel of the registration border has all channels at least WHITE, or at most BLACK.
WHITE: Final = 245
BLACK: Final = 10
_BORDER_SHARE: Final = 0.97  # minimum share of border pixels in a border row or column
_MAX_BORDER: Final = 1 / 8  # maximum share of the picture, at each side


class ReferenceFacts(Record):
    """Metadata of a reference file."""

    format: Literal["pbrs_farm reference 1"] = "pbrs_farm reference 1"
    source: str  # name of the folder or file of photographs
    source_sha256: str
    settings: HistogramFields
    binning: Binning  # bins of the comparison
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
        """Digest of everything that a score depends on, so not of the table of tested binnings."""
        facts = self.facts.model_dump(mode="json", exclude={"table"})
        return keys.digest(facts, keys.sha256(self.colour.tobytes() + self.depth.tobytes()))

    def colour_shares(self) -> Shares:
        """(n, bins) normalised colour histograms at the chosen binning, computed each time."""
        return normalised(coarser_colour(self.colour, self.facts.binning.colour))

    def depth_shares(self) -> Shares:
        """(n, bins) normalised histograms of known depth at the chosen binning, computed each time."""
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

    selection: the thresholds they must pass. source: name and sha256 of their folder or file.
    Raises BadInput for an empty set, for a single image, and for an image without known depth.
    """
    if len(ids) < 2:
        problem = "has no image" if not ids else "has a single image"
        raise BadInput(source[0], "", f"{problem}; a reference needs two at least")
    colour = np.stack([h.colour for h in histograms]).astype(np.uint32)
    depth = np.stack([h.depth for h in histograms]).astype(np.uint32)
    # Reject a photograph without depth: it would resemble nothing.
    blind = np.nonzero(depth.sum(axis=1) == 0)[0]
    if len(blind):
        raise BadInput(source[0], ids[int(blind[0])], "no pixel has a known depth")
    # Choose the finest binning at which the photographs pass their own test.
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
    """The reference file, a zip of .npy and JSON, without times or paths."""
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
    """The Reference of a file, its tables as long as its settings say; BadInput names it."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            text, hint = archive.read("reference.json"), "build the reference again"
            facts = checked(ReferenceFacts, text, name, hint=hint)
            colour, depth = (_counts_array(archive.read(f"{k}.npy")) for k in ("colour", "depth"))
    except (zipfile.BadZipFile, KeyError, ValueError, OSError, EOFError):
        hint = "`pbrs-farm reference build` makes one"
        raise BadInput(name, "", "not a reference file, or damaged", hint=hint) from None
    # Check that the tables have a row per photograph and the bins of the settings.
    n = len(facts.ids)
    shapes = (n, facts.settings.colour_bins**3), (n, facts.settings.depth_bins)
    if n == 0 or (colour.shape, depth.shape) != shapes:
        raise BadInput(name, "", f"expected histograms {shapes}, got {colour.shape}, {depth.shape}")
    return Reference(facts, colour, depth)


def _counts_array(data: bytes) -> Counts:
    array: NDArray[Any] = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    if array.dtype != np.dtype("<u4") or array.ndim != 2:
        raise ValueError("not a table of counts")
    return array.astype(np.uint32, copy=False)


def check_comparable(reference: Reference, settings: HistogramFields, name: str) -> None:
    """Raise BadInput, naming the file, unless colour space and depth range equal the settings'."""
    facts = reference.facts
    # Collect all differences for one message.
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


def sun_rgbd_depth(stored: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Depth in mm, 0 unknown, from SUN RGB-D's raw files, whose 16 bits are rotated left by 3."""
    return (stored >> np.uint16(3)) | (stored << np.uint16(13))


def depth_mm_from_units(depth: NDArray[Any], units_per_m: float) -> NDArray[np.uint16]:
    """(H, W) uint16 mm, 0 = unknown (zero and below), 65535 the most; ValueError for NaN and infinity."""
    if np.issubdtype(depth.dtype, np.floating) and not np.isfinite(depth).all():
        raise ValueError(f"{int((~np.isfinite(depth)).sum())} pixels of depth are not finite")
    mm = np.rint(np.asarray(depth, np.float64) * (1000.0 / units_per_m))
    return np.clip(mm, 0, 65535).astype(np.uint16)


def registration_border(rgb_srgb8: Srgb8Image) -> tuple[slice, slice]:
    """Rows and columns inside the white or black border (97 %, an eighth at most) of a warped photo."""
    # Mark the pixels that may be border.
    light, dark = (rgb_srgb8 >= WHITE).all(axis=2), (rgb_srgb8 <= BLACK).all(axis=2)
    plain = np.asarray(light | dark)
    height, width = plain.shape
    top, bottom, left, right = 0, height, 0, width  # remaining area, half-open
    most_rows, most_columns = int(height * _MAX_BORDER), int(width * _MAX_BORDER)
    # Remove one row or column per side and turn until nothing changes.
    changed = True
    while changed:
        before = (top, bottom, left, right)
        if top < most_rows and plain[top, left:right].mean() >= _BORDER_SHARE:
            top += 1
        if height - bottom < most_rows and plain[bottom - 1, left:right].mean() >= _BORDER_SHARE:
            bottom -= 1
        if left < most_columns and plain[top:bottom, left].mean() >= _BORDER_SHARE:
            left += 1
        if width - right < most_columns and plain[top:bottom, right - 1].mean() >= _BORDER_SHARE:
            right -= 1
        changed = (top, bottom, left, right) != before
    return slice(top, bottom), slice(left, right)
