"""The layout of the published PBRS data: <kind>_v2/<house>/<6 digits>_<kind>.png (docs/spec/suncg.md, 5).

Effects: reads views, writes files. Every label is stored in that form already, so files are copied.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import Content, Files, Line, write_files
from pbrs_farm.export.form import Convention, ViewForm
from pbrs_farm.export.sequences import by_house

# Layer -> its path in the published data.
FILES: Final = {
    "mlt_il_ol": "mlt_v2/{house}/{id}_mlt.png",
    "opengl_il": "opengl_ver2/{house}/{id}_color.png",
    "depth": "depth_v2/{house}/{id}_depth.png",
    "normal": "normal_v2/{house}/{id}_norm_camera.png",
    "valid": "normal_v2/{house}/{id}_valid.png",
    "semantic": "category_v2/{house}/{id}_category40.png",
    "boundary": "boundary_v2/{house}/{id}_instance_boundary.png",
}


def write_released(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """Every view's files, camera_v2/<house>/room_camera*.txt and data_goodlist_v2.txt.

    id is the view's number in its house, 0-based: its line in room_camera.txt.
    """
    tables = (_files(k, v) for of_house in by_house(views).values() for k, v in enumerate(of_house))
    write_files(out, tables)


def _files(number: int, view: ChosenView) -> Files:
    """The files of a view, and its lines in the lists of cameras and of good views."""
    place = {"house": view.house.id, "id": f"{number:06d}"}
    files: dict[str, Content] = {
        path.format(**place): view.data(layer) for layer, path in FILES.items() if view.has(layer)
    }
    cameras = f"camera_v2/{view.house.id}/room_camera"
    return files | {
        f"{cameras}.txt": Line(camera_line(view)),
        f"{cameras}_name.txt": Line(f"Room#{view.entry.room_id}_{view.facts.get('sector', 0)}"),
        "data_goodlist_v2.txt": Line("{house}/{id}".format(**place)),
    }


def camera_line(view: ChosenView) -> str:
    """`vx vy vz  tx ty tz  ux uy uz  xf yf  value`: eye, towards, up, half angles in rad, score.

    A view without a score has 0. World axes and metres as in view.json.
    """
    pose, (width, height) = view.opengl_pose, view.size
    k = np.array(view.facts["K"], np.float64)
    # Half the fields of view, horizontal and vertical.
    half = (math.atan(width / 2 / k[0, 0]), math.atan(height / 2 / k[1, 1]))
    groups = (pose[:3, 3], -pose[:3, 2], pose[:3, 1], half, (view.facts.get("score") or 0.0,))
    return "  ".join(" ".join(f"{x:g}" for x in group) for group in groups)


FORM = ViewForm(
    "released",
    write_released,
    "the published PBRS layout: `mlt_v2`, `opengl_ver2`, `depth_v2`, `normal_v2`, `category_v2`, `boundary_v2`, `camera_v2`, `data_goodlist_v2.txt`",
    lenses=("pinhole",),
    convention=Convention(
        None, axes="eye, towards, up; world y up, m; half angles", depth="mm, along the axis"
    ),
)
