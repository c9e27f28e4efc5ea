"""A folder of the user's own photographs -> pictures for the walls. Effects: reads the folder."""

from __future__ import annotations

import hashlib
import io
from pathlib import Path
from typing import Final

from PIL import Image, ImageOps

from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import PRINTS, Picture
from pbrs_farm.core.errors import PbrsError
from pbrs_farm.core.house import Texture
from pbrs_farm.read.catalogue.library_files import LibraryNotes
from pbrs_farm.regular_files import read_regular

MOST_PICTURES: Final = 200  # of one folder; the rest, by name, is left out
_SUFFIXES: Final = (".jpg", ".jpeg", ".png")
_EDGE_PX: Final = 800
_MAX_BYTES: Final = 64 * 2**20
_WIDTH_M: Final = 0.6  # of a print; walls scale it


def picture_folder(path: Path, notes: LibraryNotes) -> tuple[str, tuple[Picture, ...]]:
    """(digest, pictures of the group `prints`) of the JPEG and PNG files below a folder, by name.

    Turned as their camera noted. What is no picture becomes a note.
    """
    digest, found = hashlib.sha256(), []
    files = sorted(p for p in path.rglob("*") if p.suffix.lower() in _SUFFIXES)
    for file in files[:MOST_PICTURES]:
        place = f"{path.name}/{file.relative_to(path).as_posix()}"
        try:
            data = read_regular(file, _MAX_BYTES)
            texture, aspect = _upright(data, file.name)
        except (OSError, ValueError, PbrsError, Image.DecompressionBombError) as error:
            notes.add("unreadable-texture", place, f"{error}: left out")
            continue
        digest.update(keys.sha256(data).encode())
        found.append(Picture(texture, PRINTS, (_WIDTH_M, _WIDTH_M / aspect)))
    if len(files) > MOST_PICTURES:
        notes.add("many-pictures", path.name, f"{len(files)} pictures: {MOST_PICTURES} are used")
    return digest.hexdigest(), tuple(found)


def _upright(data: bytes, name: str) -> tuple[Texture, float]:
    """The picture at most _EDGE_PX wide and high, and its width over its height."""
    source: Image.Image = Image.open(io.BytesIO(data))
    source.draft("RGB", (2 * _EDGE_PX, 2 * _EDGE_PX))  # a JPEG is decoded at about the size wanted
    picture = ImageOps.exif_transpose(source).convert("RGB")
    picture.thumbnail((_EDGE_PX, _EDGE_PX), Image.Resampling.LANCZOS)
    aspect = picture.width / picture.height
    if not 0.2 < aspect < 5:
        raise ValueError(f"{picture.width} x {picture.height} pixels are no picture for a wall")
    file = io.BytesIO()
    picture.save(file, "JPEG", quality=90)
    return Texture(keys.sha256(file.getvalue())[:16], name, "image/jpeg", file.getvalue()), aspect
