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
from pbrs_farm.export.coco import write_coco
from pbrs_farm.export.hdf5 import write_hdf5
from pbrs_farm.export.new_folder import new_folder
from pbrs_farm.export.released_layout import write_released
from pbrs_farm.export.webdataset import write_webdataset
from pbrs_farm.formats.output_folder import ViewEntry, views_of
from pbrs_farm.regular_files import fault_of, read_regular

Writer = Callable[[list[ViewEntry], Path], int]  # (views, new folder) -> files written

FORMS: Final[Mapping[str, Writer]] = {
    "coco": write_coco,
    "hdf5": write_hdf5,
    "webdataset": write_webdataset,
    "released": write_released,
}


def export(folder: Path, out: Path, form: str, *, selection: str | None = None) -> tuple[int, int]:
    """Write the finished views of folder to out in a form of FORMS: (views, files written).

    out must not exist, or be empty. selection: only the views that selection/<selection>.jsonl
    keeps. Views without labels are left out. Raises BadInput for an unknown form, a folder without
    finished views, a selection that does not exist, or an out that holds something.
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
    with new_folder(out) as scratch:
        return len(views), FORMS[form](views, scratch)


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
