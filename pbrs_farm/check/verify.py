"""`pbrs-farm verify`: check a folder from its stored files alone, without the stages' code; reads files."""

from __future__ import annotations

import functools
import itertools
import tarfile
import zlib
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pbrs_farm.check.cases import (
    SAMPLE,
    FormCase,
    HouseCase,
    RootCase,
    ScenesInTime,
    SeenView,
    SetCase,
    Tracer,
    ViewCase,
)
from pbrs_farm.check.certificate import Certificate, Tally
from pbrs_farm.check.checks import Subject, checks
from pbrs_farm.check.fields import set_lines, stored_fields
from pbrs_farm.check.file_checks import unfinished_houses
from pbrs_farm.check.light_checks import may_be_halved
from pbrs_farm.check.methods import looked_at, not_looked_at
from pbrs_farm.check.stored_files import BadFile, stored_bytes
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import BadGlb, triangles_from_glb
from pbrs_farm.check.stored_set import PACKED, SUMS, StoredForm, StoredSet, stored_set
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
    tracer: Callable[[Path], Tracer] | None = None,
    tell: Callable[[int, int], None] = lambda _n, _of: None,
) -> Certificate:
    """Check every house and view below folder, an output root or a set, and report how much was checked.

    sample: pixels of each view to recompute by rays (SAMPLE when None); all_pixels: every
    one. Checks on files, tables and whole pictures are always complete. tracer: makes of a root what traces
    its light again, for comparison with the stored light; None = it is listed as not checked. tell: called after each
    view with the number of views checked and their total. Raises BadInput if folder is no output root.
    """
    stored = stored_set(folder)
    roots = {"": folder} if stored is None else {f"parts/{p}/": r for p, r in stored.roots.items()}
    houses = {root: _houses(root) for root in roots.values()}
    if stored is None and not houses[folder]:
        text = "no houses here" if folder.is_dir() else "no such folder"
        raise BadInput(folder, "", text, hint="give the output folder of a run")
    tally, views, n_halved, unfinished = Tally(), list[StoredView](), 0, list[str]()
    # None is every pixel.
    n_pixels = None if all_pixels else (SAMPLE if sample is None else sample)
    all_houses = [house for folders in houses.values() for house in folders]
    n_views = sum(1 for house in all_houses for _file in house.glob("views/*/view.json"))
    checked = itertools.count(1)
    tell(0, n_views)
    if stored is not None:
        check_set(stored, tally)
        unfinished = [] if stored.sums else [f"{SUMS} is not written"]
    for below, root in roots.items():
        tally.below = below
        _run("root", RootCase(root, tuple(houses[root]), tally))
        of_root = None if tracer is None else tracer(root)
        for house in houses[root]:
            _run("files", RootCase(root, (house,), tally))
            of_house, halved = _check_house(
                house, n_pixels, tally, of_root, lambda: tell(next(checked), n_views)
            )
            views, n_halved = views + of_house, n_halved + halved
        unfinished += unfinished_houses(root, houses[root]).values()
    tally.below = ""
    _judge_ties(tally)
    fields = sum((stored_fields(r, folders) for r, folders in houses.items()), Counter[Any]())
    looked, omitted = ([], []) if stored is None else set_lines(stored)
    if stored is None:
        omitted.append(
            "exports and sets made from it: `pbrs-farm verify SET` checks a set's folder"
        )
    return tally.certificate(
        str(folder), len(all_houses), len(views) if stored is None else len(stored.views), all_pixels=all_pixels,
        unfinished=tuple(unfinished), looked_at=(*looked_at(views, fields), *looked),
        not_looked_at=(*not_looked_at([*houses, *all_houses], views, fields, n_halved, is_traced=tracer is not None), *omitted),
    )  # fmt: skip


def _houses(root: Path) -> list[Path]:
    folders = [p for name in keys.FOLDERS for p in (root / name).glob("*") if p.is_dir()]
    return sorted(folders, key=lambda p: p.name)


def check_set(stored: StoredSet, tally: Tally) -> None:
    """Check a set's own files, and its forms of the parts at hand; not the parts themselves."""
    _run_each("set", SetCase(stored, tally), stored.file)
    for form in stored.forms():
        check_form(stored, form, tally)


def check_form(stored: StoredSet, form: StoredForm, tally: Tally) -> None:
    """Check a form of a part by the part's files; nothing if these are not at hand."""
    root = stored.roots.get(form.part)
    if root is None:
        return
    by_split: dict[str, set[tuple[str, str]]] = {}
    for house, view in stored.kept(form.part):
        split = "" if form.to in PACKED else stored.split_of(house)
        by_split.setdefault(split, set()).add((house, view))
    for split, kept in sorted(by_split.items()):
        case = FormCase(form, split, frozenset(kept), root, stored.split_of, tally)
        _run_each("form", case, case.place())


def _run(of: Subject, case: Any) -> None:
    """Run every check of a subject that has anything to do."""
    for check in checks(of):
        if check.is_needed(case):
            check.function(case)


def _run_each(of: Subject, case: Any, place: str, fault_check: str = "") -> None:
    """The same, where a check that stumbles over a document fails and the next ones go on."""
    for check in checks(of):
        try:
            if check.is_needed(case):
                check.function(case)
        except (*FAULTS, OSError, tarfile.TarError, BadInput) as error:
            file = f"{place}/{check.needs[0]}" if of == "house" and check.needs else place
            case.tally.expect(fault_check or check.name, file, False, _fault(error))


def _fault(error: Exception) -> str:
    return f"{error} is missing" if isinstance(error, KeyError) else f"does not fit: {error}"


def _check_house(
    folder: Path,
    n_pixels: int | None,
    tally: Tally,
    tracer: Tracer | None,
    tell: Callable[[], None],
) -> tuple[list[StoredView], int]:
    """Check a house; its readable views, and how many have halved light. tell: called after each view."""
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
    _run_each("house", case, house.id, "layers")
    # A damaged view fails and the next ones go on.
    checked: list[SeenView] = []
    halved = {view.place for view in views[1:] if _is_halved(view, n_pixels)}
    for view in views:
        try:
            checked += _check_view(view, case, n_pixels, is_halved=view.place in halved)
        except FAULTS as error:
            tally.expect("layers", f"{view.place}/view.json", False, _fault(error))
        tell()
    _run_each("views", replace(case, views=tuple(checked)), house.id)
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
