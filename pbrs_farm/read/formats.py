"""Which format a file is in, by its suffix or by the keys of its JSON; and what each format brings.

Effects: reads the first bytes of a .json or .txt file.
"""

from __future__ import annotations

import csv
import re
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Final, NamedTuple

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.regular_files import fault_of, open_regular

PLAN: Final = "plan"
_HEAD_BYTES: Final = 4 * 2**20
_MOST_BYTES: Final = 2**40


class Format(NamedTuple):
    """A row of formats.csv beside this file: what `pbrs-farm inputs` lists."""

    kind: str  # of the SourceRef that reads it
    title: str
    files: str  # how its files are called
    brings: str
    needs: str  # what is installed for it, "" = nothing
    where: str  # one gets the data
    licence: str  # of the data


@cache
def formats() -> tuple[Format, ...]:
    """Every format that is read."""
    text = files("pbrs_farm.read").joinpath("formats.csv").read_text("utf-8")
    return tuple(Format(**row) for row in csv.DictReader(text.splitlines()))


_SUFFIXES: Final = {
    ".usd": "usd", ".usda": "usd", ".usdc": "usd", ".usdz": "usd", ".ifc": "ifc", ".ifczip": "ifc",
    ".glb": "gltf", ".gltf": "gltf", ".csv": PLAN, ".svg": PLAN, ".geojson": PLAN,
}  # fmt: skip

# Keys that tell a JSON file's format, in the order in which they are asked for: (kind, title, keys).
_KEYS: Final = (
    ("scenestate", "sceneState", ("scene", "object", "arch")),
    ("scenestate", "sceneState", ("format", "scene")),
    ("front3d", "3D-FRONT", ("furniture", "mesh")),
    ("habitat", "Habitat scene instance", ("stage_instance",)),
    (PLAN, "ProcTHOR", ("rooms", "walls", "objects")),
    (PLAN, "RoomPlan", ("walls", "doors", "windows", "objects")),
    (PLAN, "ZInD", ("redraw",)),
    (PLAN, "react-planner", ("layers", "unit")),
    (PLAN, "GeoJSON", ("features",)),
    (PLAN, "plan", ("rooms",)),
)
_SPATIALLM: Final = re.compile(rb"^\s*\w+\s*=\s*Wall\(", re.MULTILINE)


def kind_of_file(path: Path) -> str:
    """The kind of the source that a file is, "" where no format here is known by its name or keys.

    Raises BadHouse for a file that cannot be opened.
    """
    suffix = path.suffix.lower()
    if suffix == ".json":
        return json_format(path)[0]
    if suffix == ".txt":
        return PLAN if _SPATIALLM.search(_head(path)) else ""
    return _SUFFIXES.get(suffix, "")


def json_format(path: Path) -> tuple[str, str]:
    """(kind, title) of a JSON file by its keys; ("", "") where they say nothing."""
    names = {name.decode("ascii") for name in _NAMES.findall(_head(path))}
    return next(((kind, title) for kind, title, keys in _KEYS if names.issuperset(keys)), ("", ""))


_NAMES: Final = re.compile(rb'"([A-Za-z_]{3,40})"\s*:')


def _head(path: Path) -> bytes:
    try:
        with open_regular(path, _MOST_BYTES) as file:
            return file.read(_HEAD_BYTES)
    except OSError as error:
        raise BadHouse(path, "", fault_of(error)) from None
