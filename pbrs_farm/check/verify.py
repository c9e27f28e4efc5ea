"""`pbrs-farm verify`: check a finished folder from its stored files alone.

Effects: reads files. Uses no House and no code of the stages: triangles come from house.glb, cameras from view.json,
hits from Embree.
"""

from __future__ import annotations

import functools
import itertools
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pbrs_farm.check.cases import (
    SAMPLE,
    HouseCase,
    RootCase,
    ScenesInTime,
    SeenView,
    Tracer,
    ViewCase,
)
from pbrs_farm.check.certificate import Certificate, Tally
from pbrs_farm.check.checks import Subject, checks
from pbrs_farm.check.fields import stored_fields
from pbrs_farm.check.file_checks import unfinished_houses
from pbrs_farm.check.light_checks import may_be_halved
from pbrs_farm.check.methods import looked_at, not_looked_at
from pbrs_farm.check.stored_files import BadFile, stored_bytes
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import BadGlb, triangles_from_glb
from pbrs_farm.check.stored_view import StoredView, read_labels, read_radiance, views_of_house
from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput

DENOISED = 8  # denoising costs most: of this many views, one is denoised at its full size
# Errors of reading a document that lacks a field or has one of another type.
FAULTS = (KeyError, TypeError, ValueError, IndexError, AttributeError, np.linalg.LinAlgError)
MAX_TIES = 0.0002  # share of pixels whose instance may be the other of two right answers


def verify(
    folder: Path,
    *,
    sample: int | None = None,
    all_pixels: bool = False,
    tracer: Tracer | None = None,
    tell: Callable[[int, int], None] = lambda _n, _of: None,
) -> Certificate:
    """Check every house and view below folder (an output root) and report how much was checked.

    sample: pixels of each view to recompute by rays (SAMPLE when None); all_pixels: every
    one. Checks on files, tables and whole pictures are always complete. tracer: traces light again, which
    is compared with the stored light; None = it is listed as not checked. tell: called after each
    view with the number of views checked and their total. Raises BadInput if folder is no output root.
    """
    folders = [p for name in keys.FOLDERS for p in (folder / name).glob("*") if p.is_dir()]
    houses = sorted(folders, key=lambda p: p.name)
    if not houses:
        text = "no houses here" if folder.is_dir() else "no such folder"
        raise BadInput(folder, "", text, hint="give the output folder of a run")
    tally, views, n_halved = Tally(), list[StoredView](), 0
    # None is every pixel.
    n_pixels = None if all_pixels else (SAMPLE if sample is None else sample)
    n_views = sum(1 for house in houses for _file in house.glob("views/*/view.json"))
    checked = itertools.count(1)
    tell(0, n_views)
    _run("root", RootCase(folder, tuple(houses), tally))
    for house in houses:
        _run("files", RootCase(folder, (house,), tally))
        of_house, halved = _check_house(
            house, n_pixels, tally, tracer, lambda: tell(next(checked), n_views)
        )
        views, n_halved = views + of_house, n_halved + halved
    _judge_ties(tally)
    rendered = unfinished_houses(folder, houses)
    fields = stored_fields(folder, houses)
    return tally.certificate(
        str(folder), len(houses), len(views), all_pixels=all_pixels,
        unfinished=tuple(rendered.values()), looked_at=looked_at(views, fields), not_looked_at=not_looked_at(folder, houses, views, fields, n_halved, is_traced=tracer is not None),
    )  # fmt: skip


def _run(of: Subject, case: Any) -> None:
    """Run every check of a subject that has anything to do."""
    for check in checks(of):
        if check.is_needed(case):
            check.function(case)


def _run_each(of: Subject, case: HouseCase, fault_check: str = "") -> None:
    """The same, where a check that stumbles over a document fails and the next ones go on."""
    for check in checks(of):
        try:
            if check.is_needed(case):
                check.function(case)
        except FAULTS as error:
            place = f"{case.house.id}/{check.needs[0]}" if check.needs else case.house.id
            case.tally.expect(fault_check or check.name, place, False, _fault(error))


def _fault(error: Exception) -> str:
    return f"{error} is missing" if isinstance(error, KeyError) else f"does not fit: {error}"


def _check_house(
    folder: Path,
    n_pixels: int | None,
    tally: Tally,
    tracer: Tracer | None,
    tell: Callable[[], None],
) -> tuple[list[StoredView], int]:
    """Check a house; returns its readable views, and the number of those whose light is halved.

    tell: called after each view.
    """
    views, faults = views_of_house(folder)
    for file, fault in faults.items():
        place = f"{folder.name}/{file.parent.name}/view.json"
        tally.expect("layers", place, False, fault)
    house = StoredHouse(folder)
    try:
        glb = stored_bytes(folder / "house.glb")
        triangles = triangles_from_glb(glb).with_finishes(house.house.get("materials", []))
    except (BadFile, BadGlb) as error:
        tally.expect("layers", house.id, False, f"house.glb {error}")
        return [], 0
    case = HouseCase(house, glb, ScenesInTime(house, triangles), tally, tracer=tracer)
    _run_each("house", case, "layers")
    # A damaged view fails and the next ones go on.
    checked: list[SeenView] = []
    halved = {view.place for view in views[1:] if _is_halved(view, n_pixels)}
    for view in views:
        try:
            checked += _check_view(view, case, n_pixels, is_halved=view.place in halved)
        except FAULTS as error:
            tally.expect("layers", f"{view.place}/view.json", False, _fault(error))
        tell()
    _run_each("views", replace(case, views=tuple(checked)))
    return views, len(halved)


def _check_view(
    view: StoredView, house: HouseCase, n_pixels: int | None, *, is_halved: bool
) -> list[SeenView]:
    """Check a view; returns it with its labels, [] if these cannot be read."""
    now = house.times.at(view.table.get("time_s"))
    radiance = functools.cache(lambda: read_radiance(view, house.tally))
    case = ViewCase(
        view, now, house.times, n_pixels, house.tally, radiance, is_halved, tracer=house.tracer
    )
    _run("camera", case)
    arrays = read_labels(view, house.tally)
    if arrays is None:
        return []
    _run("view", replace(case, arrays=arrays))
    moves = np.isin(arrays["instance"], list(now.moved.instances))
    return [SeenView(view, arrays["depth"], arrays["normal"], moves)]


def _is_halved(view: StoredView, n_pixels: int | None) -> bool:
    """True if a view's light is denoised again at half its size; never with every pixel.

    The first view of a house is denoised at its full size, and so is one in DENOISED, chosen by name.
    """
    if n_pixels is None or zlib.crc32(view.place.encode()) % DENOISED == 0:
        return False
    try:
        return may_be_halved(view)
    except FAULTS:
        return False  # a damaged view: its checks report it


def _judge_ties(tally: Tally) -> None:
    checked, ties = tally.totals("ray: instance")
    if checked and ties > max(2, MAX_TIES * checked):
        fault = f"{ties} of {checked} pixels have a second correct answer"
        tally.expect("ties", "all views", False, fault)
