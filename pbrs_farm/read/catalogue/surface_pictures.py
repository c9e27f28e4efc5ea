"""Photographed surfaces of libraries: textures of the packages' models, and texture libraries.

surface_groups.csv: words of each group, the first match wins. surface-pictures.csv: reviewed seamless pictures with the size of one repeat. Grain runs along u.
Effects: reads the libraries.
"""

from __future__ import annotations

import hashlib
import io
import posixpath
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

from PIL import Image, ImageOps

from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import PRINTS, Picture
from pbrs_farm.core.errors import BadHouse, PbrsError
from pbrs_farm.core.house import Texture
from pbrs_farm.read.catalogue.library_files import (
    OpenedLibrary,
    licence_of,
    numbered_entries,
    opened_library,
)
from pbrs_farm.read.catalogue.library_shapes import small_texture
from pbrs_farm.read.common.furniture_classes import plain, rows_of_table
from pbrs_farm.read.common.material_library import texture_from_bytes
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.source_files import Resources
from pbrs_farm.regular_files import read_regular

TEXTURES: Final = "PluginTexturesCatalog.properties"
JAR_TEXTURES: Final = "com/eteks/sweethome3d/io/DefaultTexturesCatalog.properties"
MOST_OF_A_GROUP: Final = 24  # maximum pictures of a group per library
_EDGE_PX: Final = 1024
_PLACES: Final = ("floor", "wall", "sky")  # categories that do not describe the surface
MOST_PICTURES: Final = 200  # of one folder; the rest, by name, is left out
_SUFFIXES: Final = (".jpg", ".jpeg", ".png")
_PHOTOGRAPH_EDGE_PX: Final = 800
_MAX_BYTES: Final = 64 * 2**20
_WIDTH_M: Final = 0.6  # of a print; walls scale it


@dataclass(frozen=True, slots=True)
class _Seen:
    # A row of surface-pictures.csv.
    image: str
    group: str
    is_turned: bool  # a quarter, so that its grain runs along u
    size: tuple[float, float]


def pictures_of_models(
    library: str, contents: Resources, licence: str, notes: Notes
) -> tuple[Picture, ...]:
    """The surface pictures that a library of the packages holds among its models."""
    pictures = []
    for row in _seen_pictures().get(library, ()):
        texture = _read_texture(contents, row.image, f"{library}#{row.image}", notes)
        if texture is not None:
            texture = _turn_texture(texture) if row.is_turned else texture
            pictures.append(Picture(texture, row.group, row.size, library, licence))
    return tuple(pictures)


def texture_library(
    path: Path, notes: Notes, catalogue: str = TEXTURES
) -> tuple[str, tuple[Picture, ...]] | None:
    """(sha256, pictures) of a .sh3t; None, with a note, if it is damaged.

    At most MOST_OF_A_GROUP pictures of a kind are kept, in the library's order. Undecodable pictures
    become notes; unknown kinds are ignored. BadInput: no such file.
    """
    opened = opened_library(path, catalogue, notes)
    if opened is None:
        return None
    pictures = tuple(_pictures_of_library(opened, path.stem, notes))
    if not pictures:
        notes.add("no-classes", path.name, "no picture of the library has a known name")
    return opened.sha256, pictures


def _pictures_of_library(opened: OpenedLibrary, library: str, notes: Notes) -> Iterator[Picture]:
    licence, count = licence_of(opened.properties), Counter[str]()
    for row in numbered_entries(opened.properties):
        group = surface_group(row.get("name", ""), row.get("category", ""))
        if not group or count[group] >= MOST_OF_A_GROUP:
            continue
        picture = _picture_of_row(row, group, opened.contents, library, licence, notes)
        if picture is not None:
            count[group] += 1
            yield picture


@cache
def _words_of_groups() -> dict[str, frozenset[str]]:
    rows = rows_of_table("surface_groups.csv", "catalogue")
    return {row["group"]: frozenset(row["words"].split("|")) for row in rows}


def surface_group(name: str, category: str) -> str:
    """Group of a surface, by whole English words of its name, then of its category; "" = unknown."""
    for text in (name, category if plain(category) not in _PLACES else ""):
        words = set(plain(text).replace("-", " ").replace("_", " ").split())
        words |= {w.removesuffix("s") for w in words}
        for group, words_of_group in _words_of_groups().items():
            if words & words_of_group:
                return group
    return ""


def _picture_of_row(
    row: dict[str, str], group: str, contents: Resources, library: str, licence: str, notes: Notes
) -> Picture | None:
    place = f"{library}#{row.get('id', row.get('name', ''))}"
    try:
        width, height = (float(row[key]) / 100 for key in ("width", "height"))
        if not (0 < width < 100 and 0 < height < 100):
            raise ValueError("its size is not between 0 and 100 m")
    except (KeyError, ValueError) as error:
        notes.add("unreadable-entry", place, f"{error}: left out")
        return None
    texture = _read_texture(contents, row.get("image", "").lstrip("/"), place, notes)
    if texture is None:
        return None
    texture = small_texture(texture, _EDGE_PX)
    return Picture(texture, group, (width, height), row.get("creator", library), licence)


def _read_texture(contents: Resources, image: str, place: str, notes: Notes) -> Texture | None:
    try:
        data = contents.read(image)
        if data is None:
            raise ValueError(f"no {image[:80]!r} in the library")
        return texture_from_bytes(data, posixpath.basename(image)).texture
    except (ValueError, BadHouse) as error:
        notes.add("unreadable-texture", place, f"{error}: left out")
        return None


def _turn_texture(texture: Texture) -> Texture:
    picture = Image.open(io.BytesIO(texture.data)).convert("RGB")
    buffer = io.BytesIO()
    picture.transpose(Image.Transpose.ROTATE_90).save(buffer, "JPEG", quality=92)
    return texture_from_bytes(buffer.getvalue(), texture.name).texture


@cache
def _seen_pictures() -> dict[str, list[_Seen]]:
    rows_of_library: dict[str, list[_Seen]] = {}
    for r in rows_of_table("surface-pictures.csv", "catalogue"):
        size = (float(r["width_cm"]) / 100, float(r["height_cm"]) / 100)
        row = _Seen(r["image"], r["group"], r["turned"] == "1", size)
        rows_of_library.setdefault(r["library"], []).append(row)
    return rows_of_library


def picture_folder(path: Path, notes: Notes) -> tuple[str, tuple[Picture, ...]]:
    """(digest, upright pictures of the group `prints`) of a folder's JPEG and PNG files; faults become notes."""
    digest, pictures = hashlib.sha256(), []
    files = sorted(p for p in path.rglob("*") if p.suffix.lower() in _SUFFIXES)
    for file in files[:MOST_PICTURES]:
        place = f"{path.name}/{file.relative_to(path).as_posix()}"
        try:
            data = read_regular(file, _MAX_BYTES)
            texture, aspect = _bounded_picture(data, file.name)
        except (OSError, ValueError, PbrsError, Image.DecompressionBombError) as error:
            notes.add("unreadable-texture", place, f"{error}: left out")
            continue
        digest.update(keys.sha256(data).encode())
        pictures.append(Picture(texture, PRINTS, (_WIDTH_M, _WIDTH_M / aspect)))
    if len(files) > MOST_PICTURES:
        notes.add("many-pictures", path.name, f"{len(files)} pictures, {MOST_PICTURES} are used")
    return digest.hexdigest(), tuple(pictures)


def _bounded_picture(data: bytes, name: str) -> tuple[Texture, float]:
    """The picture at most _EDGE_PX wide and high, and its width over its height."""
    source: Image.Image = Image.open(io.BytesIO(data))
    source.draft(
        "RGB", (2 * _PHOTOGRAPH_EDGE_PX, 2 * _PHOTOGRAPH_EDGE_PX)
    )  # a JPEG is decoded at about the size wanted
    picture = ImageOps.exif_transpose(source).convert("RGB")
    picture.thumbnail((_PHOTOGRAPH_EDGE_PX, _PHOTOGRAPH_EDGE_PX), Image.Resampling.LANCZOS)
    aspect = picture.width / picture.height
    if not 0.2 < aspect < 5:
        raise ValueError(f"{picture.width} x {picture.height} pixels cannot be a picture on a wall")
    file = io.BytesIO()
    picture.save(file, "JPEG", quality=90)
    return Texture(keys.sha256(file.getvalue())[:16], name, "image/jpeg", file.getvalue()), aspect
