"""The figures in the paper's tables, by task.

Zhang et al. 2017, tables 1 to 3, NYUv2's test split. They are not comparable with ours: other
pictures, other truth, 568,793 views and days of a GPU.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

_PAPER_CLASSES: Final = 40  # of segmentation

# Lighting mode -> its name in the paper.
_NAMES: Final = {
    "mlt_il_ol": "MLT-IL/OL",
    "mlt_ol": "MLT-OL",
    "opengl_il": "OpenGL-IL",
    "opengl_dl": "OpenGL-DL",
}


@dataclass(frozen=True, slots=True)
class PaperRow:
    """A row of the paper: its training sets, and its figures in the order of StudyTask.figures."""

    pretrained: str
    tuned: str
    figures: tuple[float, ...]


PAPER: Final[dict[str, tuple[PaperRow, ...]]] = {
    # Mean, median, and shares below 11.25, 22.5, 30 degrees.
    "normals": (
        PaperRow("NYUv2 only", "", (27.30, 21.12, 0.2721, 0.5261, 0.6472)),
        PaperRow("MLT object", "", (48.78, 47.49, 0.0356, 0.1279, 0.2135)),
        PaperRow("MLT-OL", "", (49.33, 42.30, 0.0747, 0.2324, 0.3409)),
        PaperRow("MLT-IL/OL", "", (27.90, 21.29, 0.2676, 0.5221, 0.6375)),
        PaperRow("OpenGL-DL", "", (34.02, 28.00, 0.1856, 0.4114, 0.5290)),
        PaperRow("OpenGL-IL", "", (33.06, 26.68, 0.2089, 0.4346, 0.5466)),
        PaperRow("OpenGL-IL", "NYUv2", (23.38, 16.12, 0.3598, 0.6293, 0.7317)),
        PaperRow("MLT-IL/OL", "NYUv2", (21.74, 14.75, 0.3937, 0.6625, 0.7606)),
    ),
    # The paper reports mean IoU only.
    "segmentation": (
        PaperRow("ImageNet (Yu et al.)", "NYUv2", (0.317,)),
        PaperRow("ImageNet + OpenGL", "NYUv2", (0.328,)),
        PaperRow("ImageNet + MLT", "NYUv2", (0.332,)),
    ),
    # ODS, OIS, AP, R50; the R50 of the first row cannot go with its ODS and AP.
    "boundaries": (
        PaperRow("NYUv2 only", "", (0.713, 0.725, 0.711, 0.267)),
        PaperRow("OpenGL-IL", "", (0.523, 0.555, 0.511, 0.504)),
        PaperRow("MLT-IL/OL", "", (0.604, 0.621, 0.587, 0.749)),
        PaperRow("OpenGL-IL", "NYUv2", (0.716, 0.729, 0.715, 0.893)),
        PaperRow("MLT-IL/OL", "NYUv2", (0.725, 0.736, 0.720, 0.887)),
    ),
}


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
