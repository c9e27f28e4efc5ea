"""nerfstudio's transforms.json, a folder for each house. Effects: reads views, writes files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.lenses import COEFFICIENTS
from pbrs_farm.export.chosen_view import (
    Choice,
    ChosenView,
    intrinsics_of,
    opengl_normals_png,
    require_lens,
)
from pbrs_farm.export.form import Convention, ViewForm, write_file
from pbrs_farm.export.intrinsic_parts import picture_radiance
from pbrs_farm.export.sequences import required_picture
from pbrs_farm.images import exr_from_layers, png_from_array

_RADIANCE: Final = "radiance_file_path"  # of a frame
# z up, as nerfstudio has it  <-  y up.
Z_UP_FROM_Y_UP: Final[F64] = np.array(
    [[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]], np.float64
)


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
    for house in dict.fromkeys(view.house.id for view in views):
        house_views = [view for view in views if view.house.id == house]
        models = {intrinsics_of(view.facts).lens.model for view in house_views}
        if len(models) > 1:
            text = f"needs one lens model per house, got {' and '.join(sorted(models))}"
            raise BadInput("--to", "nerfstudio", text)
        transforms: dict[str, Any] = {
            "camera_model": _MODELS[intrinsics_of(house_views[0].facts).lens.model],
            "orientation_override": "none",
            "depth_unit_scale_factor": 0.001,
            "applied_transform": Z_UP_FROM_Y_UP[:3].tolist(),
            "frames": [_frame(view, out / house) for view in house_views],
        }
        _write_json(out / house / "transforms.json", transforms)
        frames = [frame for frame in transforms["frames"] if _RADIANCE in frame]
        if frames:
            linear = [frame | {"file_path": frame[_RADIANCE]} for frame in frames]
            _write_json(out / house / "transforms_radiance.json", transforms | {"frames": linear})


def _write_json(file: Path, transforms: dict[str, Any]) -> None:
    file.write_text(json.dumps(transforms, indent=1) + "\n", "utf-8")


def _frame(view: ChosenView, folder: Path) -> dict[str, Any]:
    # Write the picture and, where it is exported, the depth.
    require_lens(view, "nerfstudio", *FORM.lenses)
    picture = required_picture(view, "nerfstudio")
    facts = view.facts
    pose = Z_UP_FROM_Y_UP @ np.array(facts["world_from_camera_opengl"], np.float64)
    k = np.array(facts["K"], np.float64)
    row: dict[str, Any] = {
        "file_path": f"images/{view.id}.png",
        "transform_matrix": pose.tolist(),
        "w": facts["width_px"],
        "h": facts["height_px"],
        "fl_x": k[0, 0],
        "fl_y": k[1, 1],
        "cx": k[0, 2],
        "cy": k[1, 2],
    }
    # Coefficients have OpenCV's names.
    lens = intrinsics_of(facts).lens
    row |= dict(zip(COEFFICIENTS[lens.model], lens.coefficients, strict=True))
    files = {row["file_path"]: view.data(picture)}
    if view.has("depth"):
        row["depth_file_path"] = f"depth/{view.id}.png"
        files[row["depth_file_path"]] = view.data("depth")
    if view.has("normal"):
        row["normal_file_path"] = f"normals/{view.id}.png"
        files[row["normal_file_path"]] = png_from_array(opengl_normals_png(view))
    light = picture_radiance(view) if view.has("radiance") else None
    if light is not None:
        row[_RADIANCE] = f"radiance/{view.id}.exr"
        planes = dict(zip("RGB", np.moveaxis(light, -1, 0), strict=True))
        files[row[_RADIANCE]] = exr_from_layers(planes)
    if facts.get("time_s") is not None:
        row["time"] = facts["time_s"]
    for name, data in files.items():
        write_file(folder / name, data)
    return row


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
