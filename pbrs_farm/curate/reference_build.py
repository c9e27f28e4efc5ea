"""`pbrs-farm reference build`: photographs -> a reference file. Effects: reads files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.recipe import HistogramFields, SelectionFields
from pbrs_farm.curate.photographs import NyuMat, Photo, pairs_in, photo_from_pair, sha256_of_files
from pbrs_farm.regular_files import read_given
from pbrs_farm.selection.histograms import Histogram, histogram
from pbrs_farm.selection.reference_set import (
    Reference,
    reference_from_bytes,
    reference_from_histograms,
    registration_border,
)


@dataclass(frozen=True, slots=True)
class PhotoOptions:
    """Options for reading photographs."""

    depth_scale: float | None = None  # depth units per metre, None = by the file's kind
    sun_rgbd: bool = False  # undo SUN RGB-D's rotation of depth bits
    crop: bool = True  # peel off the registration border


def build_reference(
    source: Path,
    settings: HistogramFields,
    selection: SelectionFields,
    options: PhotoOptions | None = None,
) -> Reference:
    """The reference of pairs (docs/selection.md) or of NYUv2's .mat; BadInput names the file."""
    options = options or PhotoOptions()
    if options.depth_scale is not None and not options.depth_scale > 0:
        raise BadInput("--depth-scale", "", f"{options.depth_scale} is not above 0")
    if not source.exists():
        raise BadInput(source, "", "no such file or folder")
    # Count the photographs of a .mat or of a folder of pairs, one at a time.
    if source.is_file():
        with NyuMat(source) as mat:
            counted = _counted(mat.photos(), settings, options)
            digest = sha256_of_files([source])
    else:
        pairs = pairs_in(source)
        read = partial(photo_from_pair, depth_scale=options.depth_scale, sun_rgbd=options.sun_rgbd)
        counted = _counted(map(read, pairs), settings, options)
        digest = sha256_of_files([path for pair in pairs for path in (pair.rgb, pair.depth)])
    return reference_from_histograms(
        list(counted), list(counted.values()), settings, selection, source=(source.name, digest)
    )


def _counted(
    photos: Iterator[Photo], settings: HistogramFields, options: PhotoOptions
) -> dict[str, Histogram]:
    counted: dict[str, Histogram] = {}
    for photo in photos:
        # Count pixels inside the border; the picture itself is not stored.
        rows, columns = registration_border(photo.rgb) if options.crop else (slice(None),) * 2
        rgb, depth = photo.rgb[rows, columns], photo.depth_mm[rows, columns]
        counted[photo.id] = histogram(rgb, depth, settings)
    return counted


def read_reference(path: Path) -> Reference:
    """Read a reference file; BadInput, naming it, if it is missing, invalid or of another version."""
    hint = "`pbrs-farm reference build` makes one"
    return reference_from_bytes(read_given(path, hint=hint), str(path))
