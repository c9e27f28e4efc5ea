"""Furniture libraries on disk: catalogue entries, and the archives with their models.

Catalogues are Java property files. Effects: opens `.sh3f` files and the program's jar; reads their
catalogues, and models on demand.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pbrs_farm.core.errors import BadHouse, BadInput
from pbrs_farm.core.shown_text import MAX_PLACE, shown
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.source_files import ZipResources
from pbrs_farm.read.sweethome3d.home_file.home_xml import DoorFrame, Paint, PlanLight, PlanPiece
from pbrs_farm.read.sweethome3d.home_file.parse_home import FULL_CUT_OUT
from pbrs_farm.regular_files import digest_of_regular, fault_of, naming_kind, text_from_bytes

_ESCAPE: Final = re.compile(r"\\(u[0-9a-fA-F]{4}|.)", re.DOTALL)
_LETTERS: Final = {"t": "\t", "n": "\n", "r": "\r", "f": "\f"}
_ENTRY: Final = re.compile(r"((?:\\.|[^\s\\:=])+)\s*[:=]?\s*(.*)", re.DOTALL)


def parse_properties(data: bytes) -> dict[str, str]:
    """Parse a Java properties file, UTF-8 or Latin-1; later lines first, malformed lines ignored."""
    try:
        text = text_from_bytes(data)
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    properties = {}
    whole = ""
    for raw in text.splitlines():
        line = raw.lstrip()
        if not whole and (not line or line[0] in "#!"):
            continue
        # Join continued lines: an odd number of backslashes ends them.
        n_slashes = len(line) - len(line.rstrip("\\"))
        whole += line[:-1] if n_slashes % 2 else line
        if n_slashes % 2:
            continue
        match = _ENTRY.fullmatch(whole)
        whole = ""
        if match is not None:
            properties[_unescape(match[1])] = _unescape(match[2]).strip()
    return properties


def numbered_entries(properties: dict[str, str]) -> list[dict[str, str]]:
    """The entries `key#1`, `key#2`, ... (at most six digits) of a catalogue, by their numbers."""
    rows: dict[int, dict[str, str]] = {}
    for key, value in properties.items():
        name, mark, number = key.partition("#")
        if mark and number.isascii() and number.isdigit() and len(number) < 7:
            rows.setdefault(int(number), {})[name] = value
    return [rows[k] for k in sorted(rows)]


def numbers(text: str) -> list[float]:
    """The numbers in a value, separated by spaces; ValueError for any other word."""
    return [float(word) for word in text.split()]


def _unescape(text: str) -> str:
    def letter(match: re.Match[str]) -> str:
        code = match[1]
        if len(code) == 5:
            return chr(int(code[1:], 16))
        return _LETTERS.get(code, code)

    return _ESCAPE.sub(letter, text)


FURNITURE: Final = "PluginFurnitureCatalog.properties"
JAR_FURNITURE: Final = "com/eteks/sweethome3d/io/DefaultFurnitureCatalog.properties"
_MAX_M: Final = 50.0  # no piece is larger
_POWER: Final = 0.5  # power of every lamp, as the program places it
_WHOLE: Final = DoorFrame(FULL_CUT_OUT, 1.0, 0.0, 1.0, 0.0, False)
_KNOWN_LICENCES: Final = (
    (r"public domain|\bcc.?0\b|cc-zero", "CC0"),
    (r"attribution 3\.0 united states|cc-by-3\.0-us", "CC-BY 3.0 US"),
    (r"attribution 3\.0|attribution 3\b|cc-by.3\.0", "CC-BY 3.0"),
    (r"attribution 4\.0|cc-by.4\.0", "CC-BY 4.0"),
)


@dataclass(frozen=True, slots=True)
class Entry:
    """One entry of a library's catalogue, as written."""

    id: str  # `<library>#<id>`
    category: str
    creator: str
    piece: PlanPiece  # as a home places it that turns and paints nothing
    file: str = ""  # path of the model, for a folder


@dataclass(frozen=True, slots=True, eq=False)
class Library:
    """A furniture library that could be opened."""

    name: str
    licence: str
    entries: tuple[Entry, ...]
    contents: ZipResources
    sha256: str


def opened_archive(path: Path) -> tuple[ZipResources, str]:
    """The archive at path, its entries unread, and its sha256; BadInput without it, BadHouse for damage."""
    try:
        sha256 = digest_of_regular(path)
        with naming_kind(path):
            return ZipResources(path, path.name), sha256
    except FileNotFoundError:
        raise BadInput(path, "", "no such file or folder") from None
    except OSError as error:
        raise BadHouse(path, "", fault_of(error)) from None


@dataclass(frozen=True, slots=True, eq=False)
class OpenedLibrary:
    """A library's archive, its entries unread, and what its catalogue says."""

    contents: ZipResources
    sha256: str
    properties: dict[str, str]


def opened_library(path: Path, catalogue: str, notes: Notes) -> OpenedLibrary | None:
    """The library at path; None, with a note, where it is damaged or holds no such catalogue.

    catalogue: the property file in the archive. Raises BadInput for a path that does not exist.
    """
    try:
        contents, sha256 = opened_archive(path)
        data = contents.read(catalogue)
    except BadHouse as error:
        notes.add("damaged-library", path.name, error.message)
        return None
    if data is None:
        notes.add("damaged-library", path.name, f"has no {catalogue}")
        return None
    return OpenedLibrary(contents, sha256, parse_properties(data))


def furniture_library(path: Path, notes: Notes, catalogue: str = FURNITURE) -> Library | None:
    """The library in a .sh3f (or the program's jar); None and BadInput as opened_library.

    notes: receives omissions and their reasons. Entries without a model in the archive are left out
    with a note. Models are not read yet.
    """
    opened = opened_library(path, catalogue, notes)
    if opened is None:
        return None
    # Call the library by its file: its own name changes with the language.
    name = path.stem if catalogue == FURNITURE else "eTeks"
    archived = set(opened.contents.names())
    entries = []
    for row in numbered_entries(opened.properties):
        entry = _entry(row, name, notes)
        if entry is not None and entry.piece.model not in archived:
            notes.add(
                "missing-model", entry.id, f"no {entry.piece.model[:80]!r} in the library: left out"
            )
        elif entry is not None:
            entries.append(entry)
    return Library(
        name, licence_of(opened.properties), tuple(entries), opened.contents, opened.sha256
    )


def licence_of(properties: Mapping[str, str]) -> str:
    """A library's licence in short: "CC0", "CC-BY 3.0", else as written; "" without one."""
    text = properties.get("license", "")
    for pattern, short in _KNOWN_LICENCES:
        if re.search(pattern, text, re.IGNORECASE):
            return short
    return shown(text, MAX_PLACE)


def _entry(row: dict[str, str], library: str, notes: Notes) -> Entry | None:
    inner = row.get("id") or row.get("name", "")
    inner = inner.partition("#")[2] or inner
    place = f"{library}#{inner}"
    try:
        width, depth, height = (float(row[key]) / 100 for key in ("width", "depth", "height"))
        if not (0 < width < _MAX_M and 0 < depth < _MAX_M and 0 < height < _MAX_M):
            raise ValueError(f"a size is not between 0 and {_MAX_M:.0f} m")
        is_opening = row.get("doorOrWindow", "").lower() == "true"
        rotation = numbers(row.get("modelRotation", ""))
        if len(rotation) not in (0, 9):
            raise ValueError(f"modelRotation has {len(rotation)} numbers, not 9")
        lights = _lights_of_row(row, (width, depth, height))
        elevation = float(row.get("elevation") or 0) / 100
    except (KeyError, ValueError) as error:
        notes.add("unreadable-entry", place, f"{error}: left out")
        return None
    piece = PlanPiece(
        tag="light" if lights else "pieceOfFurniture",
        place=place,
        level="",
        catalogue_id=place,
        name=row.get("name", inner),
        model=row.get("model", "").lstrip("/"),
        centre=(0.0, 0.0),
        elevation=elevation,
        angle=0.0,
        pitch=0.0,
        roll=0.0,
        size=(width, depth, height),
        height_in_plan=None,
        is_mirrored=False,
        rotation=tuple(rotation) or None,
        paint=Paint(),
        materials=(),
        frame=_WHOLE if is_opening else None,
        lights=lights,
        power=_POWER if lights else 0.0,
    )
    return Entry(place, row.get("category", ""), row.get("creator", ""), piece)


def _lights_of_row(row: dict[str, str], size: tuple[float, float, float]) -> tuple[PlanLight, ...]:
    # Each source as fractions of the piece's width, depth and height, its colour, its diameter.
    places = [numbers(row.get(f"lightSource{axis}", "")) for axis in "XYZ"]
    colours = row.get("lightSourceColor", "").split()
    diameters = numbers(row.get("lightSourceDiameter", ""))
    width, depth, height = (100 * s for s in size)
    return tuple(
        PlanLight(
            (x / width, y / depth, z / height),
            rgb_from_hex(colours[k]) if k < len(colours) else (1.0, 1.0, 1.0),
            diameters[k] / width if k < len(diameters) else None,
        )
        for k, (x, y, z) in enumerate(zip(*places, strict=False))
    )


def rgb_from_hex(text: str) -> tuple[float, float, float]:
    """`#RRGGBB` (or `#AARRGGBB`, alpha ignored) as sRGB 0..1; ValueError for anything else."""
    digits = text.removeprefix("#")
    if not re.fullmatch(r"([0-9a-fA-F]{2})?[0-9a-fA-F]{6}", digits):
        raise ValueError(f"{text[:20]!r} is not a colour")
    return int(digits[-6:-4], 16) / 255, int(digits[-4:-2], 16) / 255, int(digits[-2:], 16) / 255
