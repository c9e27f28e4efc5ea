"""`pbrs-farm export`: a finished output folder in the forms other tools read.

Effects: reads an output folder, writes a new folder; it appears whole or not at all. Each form has
a module here; docs/formats.md describes them.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import SPLITS, SplitShares, split_of_house
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.coco import write_coco
from pbrs_farm.export.colmap import write_colmap
from pbrs_farm.export.hdf5 import write_hdf5
from pbrs_farm.export.kitti import write_kitti
from pbrs_farm.export.nerfstudio import write_nerfstudio
from pbrs_farm.export.new_folder import new_folder
from pbrs_farm.export.released_layout import write_released
from pbrs_farm.export.tum import write_tum
from pbrs_farm.export.webdataset import write_webdataset
from pbrs_farm.export.yolo import write_data_yaml, write_yolo
from pbrs_farm.formats.output_folder import ViewEntry, views_of
from pbrs_farm.regular_files import fault_of, read_regular

Writer = Callable[[list[ChosenView], Path, Choice], int]  # -> files written to the new folder

FORMS: Final[Mapping[str, Writer]] = {
    "coco": write_coco,
    "hdf5": write_hdf5,
    "webdataset": write_webdataset,
    "released": write_released,
    "yolo": write_yolo,
    "nerfstudio": write_nerfstudio,
    "colmap": write_colmap,
    "tum": write_tum,
    "kitti": write_kitti,
}


def export(
    folder: Path,
    out: Path,
    form: str,
    *,
    selection: str | None = None,
    choice: Choice | None = None,
    shares: SplitShares | None = None,
) -> tuple[int, int]:
    """Write the finished views of folder to out in a form of FORMS: (views, files written).

    out must not exist, or be empty. selection: only the views that selection/<selection>.jsonl
    keeps. choice: which layers and modes, at which size. shares: a folder for each split that has
    views (train, val, test, by home), each whole in itself. Views without labels are left out.
    Raises BadInput for an unknown form, a folder without finished views, a selection that does not
    exist, or an out that holds something.
    """
    if form not in FORMS:
        raise BadInput("--to", form, "no such form", hint=f"of {', '.join(FORMS)}")
    # A view is finished when its labels are there.
    views = [v for v in views_of(folder) if "instances" in v.facts and v.file("instance.png")]
    # Leave out views that the selection does not keep.
    if selection is not None:
        kept = _kept(folder, selection)
        views = [v for v in views if (v.house.id, v.id) in kept]
    if not views:
        raise BadInput(folder, "", "no finished view to export")
    choice = choice or Choice()
    with new_folder(out) as scratch:
        n_files = 0
        by_split = _by_split(views, shares)
        for split, own in by_split.items():
            part = scratch / split
            part.mkdir(exist_ok=True)
            n_files += FORMS[form]([ChosenView(v, choice) for v in own], part, choice)
        if form == "yolo":
            n_files += write_data_yaml(scratch, tuple(filter(None, by_split)))
    return len(views), n_files


def _by_split(views: list[ViewEntry], shares: SplitShares | None) -> dict[str, list[ViewEntry]]:
    """Split -> its views, in the order train, val, test; all under "" without shares."""
    if shares is None:
        return {"": views}
    split_of = {v.house.id: split_of_house(v.house.id, shares) for v in views}
    parts = {name: [v for v in views if split_of[v.house.id] == name] for name in SPLITS}
    return {name: own for name, own in parts.items() if own}


def _kept(folder: Path, run: str) -> set[tuple[str, str]]:
    file = folder / keys.selection_key(run, "jsonl")
    if not file.is_file():
        raise BadInput(file, "", "no such selection", hint="pbrs-farm select makes one")
    try:
        # A line per view says whether it is kept.
        rows = [json.loads(line) for line in read_regular(file).splitlines()]
        return {(row["house"], row["view"]) for row in rows if row["kept"]}
    except OSError as error:
        raise BadInput(file, "", fault_of(error)) from None
    except (ValueError, KeyError, TypeError):
        raise BadInput(file, "", "not a selection", hint="pbrs-farm select makes one") from None
