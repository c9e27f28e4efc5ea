"""The figures in the paper's tables, by task.

Zhang et al. 2017, tables 1 to 3, NYUv2's test split. They are not comparable with ours: other
pictures, other truth, 568,793 views and days of a GPU.
"""

from __future__ import annotations

from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import Final

from pbrs_farm.core.record import Record, Several, read_csv

_PAPER_CLASSES: Final = 40  # of segmentation

# Lighting mode -> its name in the paper.
_NAMES: Final = {
    "mlt_il_ol": "MLT-IL/OL",
    "mlt_ol": "MLT-OL",
    "opengl_il": "OpenGL-IL",
    "opengl_dl": "OpenGL-DL",
}


class PaperRow(Record):
    """A row of paper_figures.csv: its training sets, and its figures in the order of StudyTask.figures."""

    task: str
    pretrained: str
    tuned: str = ""
    figures: Several[float]


_ROWS: Final = read_csv(Path(__file__).with_suffix(".csv"), PaperRow)
PAPER: Final = {task: tuple(rows) for task, rows in groupby(_ROWS, attrgetter("task"))}


def paper_row(task: str, mode: str, n_classes: int = _PAPER_CLASSES) -> PaperRow | None:
    """The paper's row for a light without fine-tuning, or else its best row with MLT.

    None for tasks that are not in the paper: depth, and classes other than NYU40.
    """
    if task not in PAPER or n_classes != _PAPER_CLASSES:
        return None
    name = _NAMES.get(mode, "MLT-IL/OL")
    rows = PAPER[task]
    return next((row for row in rows if row.pretrained == name and not row.tuned), rows[-1])


def tuned_row(task: str, pretrained: str) -> PaperRow:
    """The paper's row tuned on NYUv2 after a light; without a light, trained on NYUv2 alone.

    If the paper has no row for the light, one of the same kind, MLT or OpenGL; KeyError for a task
    that is not in the paper.
    """
    name = _NAMES.get(pretrained)
    rows = PAPER[task]
    tuned = [row for row in rows if row.tuned and name is not None]
    # Rows of segmentation name the kind only, MLT or OpenGL.
    same = [row for row in tuned if row.pretrained == name]
    kind = "MLT" if name and name.startswith("MLT") else "OpenGL"
    return next(iter(same or [row for row in tuned if kind in row.pretrained]), rows[0])
