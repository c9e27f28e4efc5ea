"""The layout of the published PBRS data: <kind>_v2/<house>/<6 digits>_<kind>.png (docs/spec/suncg.md, 5).

Effects: reads views, writes files. Every label is stored in that form already, so files are copied.
"""

from __future__ import annotations

import math
from collections import defaultdict
from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.export.chosen_view import Choice, ChosenView, require_lens
from pbrs_farm.export.form import Convention, ViewForm, write_file

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
    houses: dict[str, list[ChosenView]] = defaultdict(list)
    for view in views:
        houses[view.house.id].append(view)
    good = []  # lines of the list of good views
    for house, house_views in houses.items():
        for number, view in enumerate(house_views):
            place = {"house": house, "id": f"{number:06d}"}
            for layer, published in FILES.items():
                if view.has(layer):
                    write_file(out / published.format(**place), view.data(layer))
            good.append("{house}/{id}\n".format(**place))
        _write_cameras(out / "camera_v2" / house, house_views)
    (out / "data_goodlist_v2.txt").write_text("".join(good), "utf-8")


def _write_cameras(folder: Path, views: list[ChosenView]) -> None:
    # A line of both camera files for each view, in the order of the views' numbers.
    folder.mkdir(parents=True)
    (folder / "room_camera.txt").write_text("".join(camera_line(v) for v in views), "utf-8")
    names = "".join(f"Room#{v.entry.room_id}_{v.facts.get('sector', 0)}\n" for v in views)
    (folder / "room_camera_name.txt").write_text(names, "utf-8")


def camera_line(view: ChosenView) -> str:
    """`vx vy vz  tx ty tz  ux uy uz  xf yf  value`: eye, towards, up, half angles in rad, score.

    Raises BadInput for a lens other than a pinhole, as the format has no place for it. A view without a
    score has 0. World axes and metres as in view.json.
    """
    require_lens(view, "released", *FORM.lenses)
    pose = np.array(view.facts["world_from_camera_opengl"], np.float64)
    width, height = view.facts["width_px"], view.facts["height_px"]
    k = np.array(view.facts["K"], np.float64)
    # Half the fields of view, horizontal and vertical.
    half = (math.atan(width / 2 / k[0, 0]), math.atan(height / 2 / k[1, 1]))
    groups = (pose[:3, 3], -pose[:3, 2], pose[:3, 1], half, (view.facts.get("score") or 0.0,))
    return "  ".join(" ".join(f"{x:g}" for x in group) for group in groups) + "\n"


FORM = ViewForm(
    "released",
    write_released,
    "the published PBRS layout: `mlt_v2`, `opengl_ver2`, `depth_v2`, `normal_v2`, `category_v2`, `boundary_v2`, `camera_v2`, `data_goodlist_v2.txt`",
    lenses=("pinhole",),
    convention=Convention(
        None, axes="eye, towards, up; world y up, m; half angles", depth="mm, along the axis"
    ),
)
