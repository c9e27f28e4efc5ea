"""Generated homes as files of a folder, with a page of their plans. Effects: reads and writes it.

Existing homes are kept: their files record seed and options, so that an interrupted command resumes
and later edits by a person survive.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from pbrs_farm.core.errors import BadInput, PbrsError
from pbrs_farm.core.made_home import MadeHome
from pbrs_farm.gallery.html_page import page
from pbrs_farm.gallery.plan_svg import plan_svg
from pbrs_farm.generate.generated_home import GeneratedHome, generate_home, origin_of_home
from pbrs_farm.generate.programme import Programme
from pbrs_farm.prepare.dress_catalogue import GENERATED, catalogue_of_words

PAGE = "plans.html"
_XML_BYTES = 4096  # length of the start of Home.xml that holds its properties


@dataclass(frozen=True, slots=True)
class Done:
    """The result for one home."""

    home: MadeHome
    is_new: bool
    fault: str = ""


def make_homes(
    homes: Sequence[MadeHome], folder: Path, programme: Programme | None = None, *, n_jobs: int = 1
) -> Iterator[Done]:
    """Write <name>.sh3d and <name>.svg of each home into folder, and plans.html at the end.

    homes: seeds and families. programme: requirements for every home, None for the family's own. n_jobs:
    processes. Yields the result for each home: new, existing, or failed with the reason in `fault`; a
    failure does not stop the others.
    """
    make_one = partial(_make, folder, programme)
    # Write the page of plans even if the run is interrupted.
    try:
        if n_jobs > 1:
            with ProcessPoolExecutor(n_jobs, get_context("spawn")) as pool:
                yield from pool.map(make_one, homes)
        else:
            yield from map(make_one, homes)
    finally:
        _write_home_file(folder / PAGE, plans_page(folder).encode())


def _make(folder: Path, programme: Programme | None, home: MadeHome) -> Done:
    path = folder / f"{home.name}.sh3d"
    catalogue = catalogue_of_words("" if home.furniture else GENERATED)
    try:
        if path.exists() and path.with_suffix(".svg").exists():
            _check_same(path, origin_of_home(home, catalogue, programme))
            return Done(home, is_new=False)
        write_home(path, generate_home(home, catalogue, programme))
    except PbrsError as error:
        return Done(home, is_new=False, fault=str(error))
    return Done(home, is_new=True)


def write_home(path: Path, home: GeneratedHome) -> None:
    """Write (or keep) a home's file, and its plan's .svg; BadInput if path has a different home."""
    if path.exists():
        _check_same(path, home.origin)
    else:
        _write_home_file(path, home.data)
    picture = plan_svg(home.storeys, path.stem, home.stair)
    _write_home_file(path.with_suffix(".svg"), picture.encode())


def plans_page(folder: Path) -> str:
    """The HTML page of every .svg with an .sh3d in a folder, by length of name, then name."""
    names = [p.stem for p in folder.glob("*.svg") if p.with_suffix(".sh3d").exists()]
    names.sort(key=lambda name: (len(name), name))
    return page("pbrs_farm.gallery", "plans.html", names=names)


def _check_same(path: Path, expected: str) -> None:
    """Raise BadInput if a file has a different origin."""
    try:
        with zipfile.ZipFile(path) as archive, archive.open("Home.xml") as file:
            head = file.read(_XML_BYTES)
    except (OSError, KeyError, zipfile.BadZipFile):
        head = b""
    if expected.encode() not in head:
        raise BadInput(
            path,
            "",
            "already exists and differs from this home",
            hint="another --out, or delete the file",
        )


def _write_home_file(path: Path, data: bytes) -> None:
    """Write a file atomically."""
    scratch = path.with_name(f".{path.name}.part")
    try:
        scratch.write_bytes(data)
        scratch.replace(path)
    except OSError as error:
        raise BadInput(path, "", f"cannot be written: {error.strerror}") from None
