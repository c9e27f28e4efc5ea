"""A house's histograms in one small object, the input of scoring (thousands a second); no effects.

A pack is a line of JSON, then the counts of all its views, compressed. It is made from the
histogram.json files of a house and contains all their data for one scored mode per view.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.checked_json import checked
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.recipe import HistogramFields
from pbrs_farm.formats.histogram_json import SCORED_MODE, ViewRecord

_FORMAT: Final = "pbrs_farm pack 3"
_TEXTS: Final = ("views", "rooms", "room_types", "modes", "faults", "classes", "black")  # columns

_OF_PICTURE: Final = ("brightness", "blown")
_OF_SCENE: Final = ("surface", "near", "n_objects", "noise", "missing_textures")
# Median luma of a picture that counts as black, whatever the thresholds.
BLACK: Final = 1.5 / 255
# Columns of HistogramPack.quality: attributes of PictureQuality and SceneQuality.
QUALITIES: Final = (*_OF_PICTURE, *_OF_SCENE)


@dataclass(frozen=True, slots=True, eq=False)
class HistogramPack:
    """The n views of one house as columns."""

    house: str
    source: str  # digest of the pack's sources
    settings: HistogramFields
    views: tuple[str, ...]
    rooms: tuple[str, ...]
    room_types: tuple[str, ...]
    modes: tuple[str, ...]  # scored lighting mode, "" = not scored
    faults: tuple[str, ...]  # reason for a missing score, "" = no fault
    classes: tuple[str, ...]  # "1:0.53 2:0.21": share of the picture of each NYU40 class
    black: tuple[str, ...]  # "mlt_ol opengl_dl": modes whose picture is black
    colour: NDArray[np.uint32]  # (n, colour bins) counts, all zero for views without any
    depth: NDArray[np.uint32]  # (n, depth bins) the same
    quality: F32  # (n, len(QUALITIES)), NaN if unknown


def pack_house(
    house: str,
    source: str,
    settings: HistogramFields,
    records: Sequence[ViewRecord],
    *,
    failed: dict[str, str] | None = None,
    score_mode: Mode = SCORED_MODE,
) -> HistogramPack:
    """The pack of a house's records and failures (id -> reason); ValueError for other settings."""
    rows = sorted(records, key=lambda r: r.view)
    if any(r.settings != settings for r in rows):
        raise ValueError("records of different settings cannot be packed together")
    lost = sorted((failed or {}).items())
    # Fill the columns of numbers; those of lost views stay zero and NaN.
    n = len(rows) + len(lost)
    colour = np.zeros((n, settings.colour_bins**3), np.uint32)
    depth = np.zeros((n, settings.depth_bins), np.uint32)
    quality = np.full((n, len(QUALITIES)), np.nan, np.float32)
    modes = [_mode(r, score_mode) for r in rows]
    for i, (record, mode) in enumerate(zip(rows, modes, strict=True)):
        depth[i] = record.depth.dense()
        values = [getattr(record.scene, name) for name in _OF_SCENE]
        quality[i, len(_OF_PICTURE) :] = [np.nan if v is None else v for v in values]
        if mode is not None:
            colour[i] = record.colour[mode].dense()
            picture = record.picture[mode]
            quality[i, : len(_OF_PICTURE)] = [getattr(picture, name) for name in _OF_PICTURE]
    blank = ("",) * len(lost)
    return HistogramPack(
        house,
        source,
        settings,
        views=(*(r.view for r in rows), *(view for view, _fault in lost)),
        rooms=(*(r.room for r in rows), *blank),
        room_types=(*(r.room_type for r in rows), *blank),
        modes=(*(str(m or "") for m in modes), *blank),
        faults=(*("" if m else "unscored" for m in modes), *(fault for _view, fault in lost)),
        classes=(*(_class_text(r) for r in rows), *blank),
        black=(*(_black(r) for r in rows), *blank),
        colour=colour,
        depth=depth,
        quality=quality,
    )


def _class_text(record: ViewRecord) -> str:
    return " ".join(f"{nyu40}:{share:g}" for nyu40, share in record.scene.classes.items())


def _black(record: ViewRecord) -> str:
    # Records before version 3 of the step have only the scored modes.
    black = (m for m, q in record.picture.items() if q.brightness <= BLACK)
    return " ".join(sorted(str(mode) for mode in black))


def _mode(record: ViewRecord, score_mode: Mode) -> Mode | None:
    return next((mode for mode in (SCORED_MODE, score_mode) if mode in record.colour), None)


def bytes_from_pack(pack: HistogramPack) -> bytes:
    """The pack as one object: a line of JSON, three compressed tables; equal for equal packs."""
    head: dict[str, Any] = {"format": _FORMAT, "settings": pack.settings.model_dump(mode="json")}
    head |= {name: getattr(pack, name) for name in ("house", "source", *_TEXTS)}
    body = b"".join(
        np.ascontiguousarray(a, kind).tobytes()
        for a, kind in ((pack.colour, "<u4"), (pack.depth, "<u4"), (pack.quality, "<f4"))
    )
    line = json.dumps(head, sort_keys=True, separators=(",", ":")).encode()
    return line + b"\n" + zlib.compress(body, 1)


def pack_from_bytes(data: bytes, name: str) -> HistogramPack:
    """The pack in an object; raises BadInput naming it if it is damaged.

    The lengths of all tables are checked against the settings stored with them. BadInput also for
    another version of the format. Does not check if the pack is up to date: compare `source`.
    The arrays are read-only.
    """
    try:
        line, _, rest = data.partition(b"\n")
        head = json.loads(line)
        if head.pop("format") != _FORMAT:
            raise ValueError("another format")
        # Check that texts and numbers have as many views as the line says.
        settings = checked(HistogramFields, head.pop("settings"), name, "settings")
        body = zlib.decompress(rest)
        text = {k: tuple(head[k]) for k in _TEXTS}
        n = len(text["views"])
        widths = settings.colour_bins**3, settings.depth_bins, len(QUALITIES)
        if len(body) != 4 * n * sum(widths) or any(len(t) != n for t in text.values()):
            raise ValueError("lengths differ")
        # Split the bytes into the three tables of numbers.
        ends = np.cumsum([4 * n * w for w in widths])
        return HistogramPack(
            head["house"],
            head["source"],
            settings,
            **text,
            colour=np.frombuffer(body[: ends[0]], "<u4").reshape(n, widths[0]),
            depth=np.frombuffer(body[ends[0] : ends[1]], "<u4").reshape(n, widths[1]),
            quality=np.frombuffer(body[ends[1] :], "<f4").reshape(n, widths[2]),
        )
    except (ValueError, KeyError, TypeError, zlib.error) as error:
        raise BadInput(name, "", f"not a pack of histograms: {error}") from None


def pack_source(data: bytes) -> str:
    """The `source`, on its first line, of a pack's object; "" if damaged, so that it is rebuilt."""
    try:
        return str(json.loads(data.partition(b"\n")[0])["source"])
    except (ValueError, KeyError, TypeError):
        return ""
