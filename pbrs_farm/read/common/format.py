"""Description of an input format: the entry `FORMAT` of its package or of a plugin. No effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Final, NamedTuple

from pbrs_farm.core.data_format import DataFormat
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.source_files import RootFolder, SourceFiles

PLAN: Final = "plan"
"""Kind of all floor-plan sources, in any format."""


class GivenFile(NamedTuple):
    """A file to read, or the folder of a format with one folder per home, and its options."""

    path: Path
    models: str = ""  # folder of the models that the file names, "" = where its format keeps them
    part: str = ""  # selected part of a plan's file; "" = the whole file


def root_of(given: GivenFile) -> tuple[RootFolder, str]:
    """The folder below which all files lie, and the file's name there; BadHouse where it is not."""
    root = Path(given.models) if given.models else given.path.parent
    try:
        name = given.path.resolve().relative_to(root.resolve()).as_posix()
    except ValueError:
        raise BadHouse(given.path, "", f"is not below --models {root}") from None
    return RootFolder(root), name


def data_of(given: GivenFile, max_bytes: int) -> tuple[RootFolder, bytes]:
    """The folder of the file, which records all reads, and the bytes of the file; BadHouse if it is missing."""
    folder = RootFolder(given.path.parent)
    data = folder.read(given.path.name, max_bytes=max_bytes)
    if data is None:
        raise BadHouse(given.path, "", "no such file")
    return folder, data


def deferred(place: str) -> Callable[..., Any]:
    """A function that imports `module:function` when it is called, and calls it."""
    module, _colon, name = place.partition(":")
    return lambda *args: getattr(import_module(module), name)(*args)


def no_companions(_given: GivenFile, _files: SourceFiles) -> str:
    """Of formats that read nothing beside their file."""
    return ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Format(DataFormat):
    """A format whose files become houses.

    The package of a format is imported to ask for this entry, so that it stays light: `read` and
    `companions` import the reader when they are called.

        FORMAT = Format(kind="usd", read=deferred("pbrs_farm.read.usd.stage:read_usd"), ...)
    """

    kind: str  # of the SourceRef that names such a file
    read: Callable[[GivenFile, ReadFields], House]
    """The house, placed in the world: metres, y up. Raises BadHouse naming file and place."""
    companions: Callable[[GivenFile, SourceFiles], str] = no_companions
    """Digest of all other files that the reader opens, "" if there are none, or if it raises BadHouse."""
    main_file: str = ""  # that makes a folder a home; its id is then the folder's name
    has_parts: bool = False  # FILE#part names a part of the file
    has_box_only_items: bool = False  # may have items with only class and box, without a mesh
    travels: bool = True  # a file that has no companions goes to the store of a farm
    uses_packages: bool = False  # its companions are Debian packages, which go there by themselves
