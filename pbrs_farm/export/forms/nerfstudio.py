"""nerfstudio's transforms.json, a folder for each house. Effects: reads views, writes files."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import Z_UP_FROM_Y_UP
from pbrs_farm.core.lenses import COEFFICIENTS
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import Content, Files, rgb_planes, write_files
from pbrs_farm.export.form import Convention, ViewForm
from pbrs_farm.export.intrinsic_parts import picture_radiance
from pbrs_farm.export.sequences import by_house

_RADIANCE: Final = "radiance_file_path"  # of a frame
_MODELS: Final = {
    "pinhole": "PINHOLE",
    "radtan": "OPENCV",
    "fisheye": "OPENCV_FISHEYE",
    "equirect": "EQUIRECTANGULAR",
}
"""Names of the lens models in nerfstudio; a transforms.json has one."""


def write_nerfstudio(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """<house>/transforms.json, images/<view>.png, depth/<view>.png (mm) and normals/<view>.png.

    Poses are camera to world with OpenGL axes in a world with z up; applied_transform is the turn
    from the home's y up. Normals are 16 bit, (n + 1) / 2 in the camera's OpenGL axes, 0 for nothing. With `radiance`
    also radiance/<view>.exr, linear, and transforms_radiance.json, whose pictures they are. Views without a
    picture are an error.
    """
    for house, house_views in by_house(views).items():
        models = {view.intrinsics.lens.model for view in house_views}
        if len(models) > 1:
            text = f"needs one lens model per house, got {' and '.join(sorted(models))}"
            raise BadInput("--to", "nerfstudio", text)
        frames: list[dict[str, Any]] = []
        write_files(out / house, (_files(view, frames) for view in house_views))
        transforms: dict[str, Any] = {
            "camera_model": _MODELS[models.pop()],
            "orientation_override": "none",
            "depth_unit_scale_factor": 0.001,
            "applied_transform": Z_UP_FROM_Y_UP[:3].tolist(),
            "frames": frames,
        }
        documents = {"transforms.json": transforms}
        linear = [frame | {"file_path": frame[_RADIANCE]} for frame in frames if _RADIANCE in frame]
        if linear:
            documents["transforms_radiance.json"] = transforms | {"frames": linear}
        write_files(out / house, [documents])


def _files(view: ChosenView, frames: list[dict[str, Any]]) -> Files:
    """The files of a view; adds its row to frames."""
    (width, height), k = view.size, np.array(view.facts["K"], np.float64)
    row: dict[str, Any] = {
        "file_path": f"images/{view.id}.png",
        "transform_matrix": (Z_UP_FROM_Y_UP @ view.opengl_pose).tolist(),
        "w": width,
        "h": height,
        "fl_x": k[0, 0],
        "fl_y": k[1, 1],
        "cx": k[0, 2],
        "cy": k[1, 2],
    }
    # Coefficients have OpenCV's names.
    lens = view.intrinsics.lens
    row |= dict(zip(COEFFICIENTS[lens.model], lens.coefficients, strict=True))
    files: dict[str, Content] = {row["file_path"]: view.shown}

    def add(name: str, path: str, content: Content) -> None:
        row[name] = path
        files[path] = content

    if view.has("depth"):
        add("depth_file_path", f"depth/{view.id}.png", view.data("depth"))
    if view.has("normal"):
        add("normal_file_path", f"normals/{view.id}.png", view.opengl_normals_png)
    light = picture_radiance(view) if view.has("radiance") else None
    if light is not None:
        add(_RADIANCE, f"radiance/{view.id}.exr", rgb_planes(light))
    if view.facts.get("time_s") is not None:
        row["time"] = view.facts["time_s"]
    frames.append(row)
    return files


FORM = ViewForm(
    "nerfstudio",
    write_nerfstudio,
    "`transforms.json` (z up, OpenGL axes), pictures, depth in mm, `normals` (OpenGL axes); with `--layers radiance` linear EXR and `transforms_radiance.json`",
    lenses=tuple(_MODELS),
    convention=Convention(
        0.5,
        axes="OpenGL's; world z up, m",
        depth="mm, along the axis (of a fisheye or panorama along the ray)",
    ),
)
