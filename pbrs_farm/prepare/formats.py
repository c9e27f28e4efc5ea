"""The table of supported formats: ours, floor plans, plugins'. Effects: reads the head of a file.

Each package of read/ ends with its entry FORMAT, each module of generate/plans with a PlanFormat.
"""

from __future__ import annotations

import pkgutil
import re
from collections.abc import Iterator
from dataclasses import fields as fields_of
from fnmatch import fnmatch
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path
from typing import Final

from pbrs_farm import read
from pbrs_farm.core.checked_json import utf8_of_json
from pbrs_farm.core.data_format import DataFormat
from pbrs_farm.core.errors import BadHouse, MachineFailed
from pbrs_farm.core.house import House
from pbrs_farm.core.plugins import plugin, plugins
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.installation import install_command, is_installed
from pbrs_farm.prepare.home_kinds import HOME_KIND
from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.read.common.format import PLAN, Format, GivenFile
from pbrs_farm.read.common.source_files import RootFolder, SourceFiles
from pbrs_farm.read.usd import FORMAT as STAGE
from pbrs_farm.read.usd import SUFFIXES
from pbrs_farm.regular_files import MAX_SCENE_BYTES, fault_of, open_regular

_HEAD_BYTES: Final = 4 * 2**20
_MOST_BYTES: Final = 2**40
_NAMES: Final = re.compile(rb'"([A-Za-z_]{3,40})"\s*:')


def formats() -> Iterator[Format]:
    """All supported formats, each imported when it is tried: packages of read/, then plans."""
    yield from formats_of_packages()
    yield from _formats_of_plans()


def formats_of_plugins() -> tuple[Format, ...]:
    """The entries that installed plugins bring."""
    return tuple(format_of_plugin(name) for name in plugins("readers"))


def format_of_kind(kind: str) -> Format | None:
    """The format of the sources of a kind, the first of several; None for a kind without files."""
    return next((entry for entry in formats() if entry.kind == kind), None)


def format_of_source(source: SourceRef) -> Format | None:
    """The format that reads a source; None for a source of HOME_KINDS."""
    if source.kind in HOME_KIND:
        return None
    if source.kind == "reader":
        return format_of_plugin(source.location.partition(":")[0])
    return format_of_kind(source.kind)


def format_of_plugin(name: str) -> Format:
    """The entry of a plugin, whose code is loaded; MachineFailed if it is not installed or has another type."""
    reader = plugin("readers", name)
    entry = reader.load()
    if not isinstance(entry, Format):
        raise MachineFailed(f"plugin {reader.mark} has no Format", hint="docs/plugins.md")
    return entry


def plugin_of_file(path: Path) -> str | None:
    """Name of the plugin that reads a path, after loading plugins one by one; None without one."""
    names = plugins("readers")
    if not names or not path.exists():
        return None
    look = _Look(path)
    return next((name for name in names if look.is_of(format_of_plugin(name))), None)


def format_of_file(path: Path, *, surely: bool = False) -> Format | None:
    """The format of a file or a home's folder, or None; surely: not by a suffix that other files share."""
    look = _Look(path)
    match = next((entry for entry in formats() if look.is_of(entry)), None)
    if match is None and not surely and path.is_file():
        suffix = path.suffix.lower()
        match = next((entry for entry in formats() if suffix in entry.suffixes), None)
    return match


def is_beside_homes(path: Path) -> bool:
    """True if a file name, in any case, belongs to a home beside it."""
    patterns = [pattern for entry in formats() for pattern in entry.beside]
    return any(fnmatch(path.name.lower(), pattern) for pattern in patterns)


def summary() -> str:
    """All supported formats in one line, for hints."""
    entries = list(formats())
    suffixes = dict.fromkeys(suffix for entry in entries for suffix in entry.suffixes)
    titles = dict.fromkeys(entry.title for entry in entries if entry.keys)
    folders = [f"{entry.files} of {entry.title}" for entry in entries if entry.main_file]
    return f"{' '.join(suffixes)}, .json of {', '.join(titles)}, {', '.join(folders)}"


def missing_library(entry: DataFormat) -> str:
    """The command that installs a format's missing library; "" if nothing is missing."""
    if not entry.library or is_installed(entry.library):
        return ""
    return install_command(entry.needs.removeprefix("the extra "))


class _Look:
    """A path to identify; its head is read once, when a format asks for it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._suffix = path.suffix.lower()

    def is_of(self, entry: Format) -> bool:
        """True if it is of a format, by its suffix, its keys or the file that makes it a home."""
        if entry.main_file:
            is_main = self._path.name == entry.main_file
            return is_main or (self._path / entry.main_file).is_file()
        if not self._path.is_file():
            return False
        if self._suffix == ".json":
            return bool(entry.keys) and entry.has_keys(self._names)
        if self._suffix not in entry.shared_suffixes:
            return entry.is_sure_of(self._suffix, b"")
        text = self._lines(entry.lines) if entry.lines else self._head
        return entry.is_sure_of(self._suffix, text)

    def _lines(self, beginnings: tuple[bytes, ...]) -> bytes:
        """The lines of the file that begin so; a file beyond the limit of scenes has none."""
        try:
            with open_regular(self._path, MAX_SCENE_BYTES) as file:
                return b"".join(line for line in file if line.startswith(beginnings))
        except OSError:
            return b""

    @cached_property
    def _names(self) -> set[str]:
        return {name.decode("ascii") for name in _NAMES.findall(self._head)}

    @cached_property
    def _head(self) -> bytes:
        try:
            with open_regular(self._path, _MOST_BYTES) as file:
                head = file.read(_HEAD_BYTES)
            return utf8_of_json(head) if self._suffix == ".json" else head
        except OSError as error:
            raise BadHouse(self._path, "", fault_of(error)) from None


@cache
def formats_of_packages() -> tuple[Format, ...]:
    names = [module.name for module in pkgutil.iter_modules(read.__path__) if module.ispkg]
    packages = [import_module(f"{read.__name__}.{name}") for name in names]
    entries = [p.FORMAT for p in packages if isinstance(getattr(p, "FORMAT", None), Format)]
    return tuple(sorted(entries, key=lambda one: one.order))


@cache
def _formats_of_plans() -> tuple[Format, ...]:
    from pbrs_farm.generate.plans.plan_files import plan_formats

    names = [field.name for field in fields_of(DataFormat)]
    return tuple(
        Format(
            **{name: getattr(field, name) for name in names},
            kind=PLAN,
            read=_read_plan,
            companions=_companions_of_plan,
            has_parts=True,
            has_box_only_items=True,
        )
        for field in plan_formats()
    )


def _read_plan(given: GivenFile, fields: ReadFields) -> House:
    from pbrs_farm.prepare.plan_house import house_of_plan

    return house_of_plan(given, fields)


def _companions_of_plan(given: GivenFile, files: SourceFiles) -> str:
    """Digest of the tables beside a plan, of the files that a scan's stage refers to."""
    if given.path.suffix.lower() in SUFFIXES:
        return STAGE.companions(given, files)
    if given.path.suffix.lower() != ".json":
        return ""
    folder = given.path.parent
    names = dict.fromkeys(name for entry in _formats_of_plans() for name in entry.beside)
    beside = [name for name in names if (folder / name).is_file()]
    return files.digest(RootFolder(folder), beside) if beside else ""
