"""HDF5 in BlenderProc's form: a file a view, its keys and conventions. Effects: reads views, writes files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.export.chosen_view import PICTURES, Choice, ChosenView
from pbrs_farm.export.content import Line, write_files
from pbrs_farm.export.form import Convention, ViewForm
from pbrs_farm.installation import need


def write_hdf5(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """<n>.hdf5 per view, n counted from 0, and index.jsonl.

    colors (H, W, 3) uint8 (the first of PICTURES there is; every mode also by its name), depth
    (H, W) float32 planar metres (0 = nothing), normals (H, W, 3) float32 (n + 1) / 2 with OpenGL
    camera axes, category_id_segmaps uint8 (uint16 of a user's classes), instance_segmaps uint16, and as JSON text
    instance_attribute_maps and campose (the OpenGL pose, and cam_K as BlenderProc means it: the centre
    of the first pixel is (0, 0), so that cx is (W - 1) / 2; where no pin-hole, also lens and depth as
    view.json has them). Raises MachineFailed without h5py.
    """
    need("h5py")
    import h5py

    for number, view in enumerate(views):
        with h5py.File(out / f"{number}.hdf5", "w") as file:
            for name, value in _datasets(view).items():
                if isinstance(value, str):  # JSON: a scalar, which HDF5 cannot compress
                    file.create_dataset(name, data=np.bytes_(value.encode()))
                else:
                    file.create_dataset(name, data=value, compression="gzip")
    rows = (
        {"file": f"{number}.hdf5", "house": view.house.id, "view": view.id}
        for number, view in enumerate(views)
    )
    write_files(out, ({"index.jsonl": Line(json.dumps(row))} for row in rows))


def _datasets(view: ChosenView) -> dict[str, NDArray[Any] | str]:
    data: dict[str, NDArray[Any] | str] = {}
    # The first of PICTURES is written last.
    for mode in reversed(PICTURES):
        if view.has(mode):
            data[str(mode)] = data["colors"] = view.array(mode)
    # Labels keep their numbers; depth is in metres, nothing is 0.
    if view.has("depth"):
        data["depth"] = view.array("depth").astype(np.float32) / np.float32(1000)
    if view.has("normal"):
        data["normals"] = _blenderproc_normals(view.array("normal"), view.array("valid") > 0)
    for layer, name in (("semantic", "category_id_segmaps"), ("instance", "instance_segmaps")):
        if view.has(layer):
            data[name] = view.array(layer)
    rows = view.facts["instances"]
    maps = [{"idx": r["id"], "name": r["name"], "category_id": view.class_of(r)} for r in rows]
    data["instance_attribute_maps"] = json.dumps(maps)
    pose = view.facts["world_from_camera_opengl"]
    lens = {name: view.facts[name] for name in ("lens", "depth") if name in view.facts}
    data["campose"] = json.dumps(
        {"cam_K": view.k_of_whole_centres, "cam2world_matrix": pose} | lens
    )
    return data


def _blenderproc_normals(png: NDArray[Any], valid: NDArray[np.bool_]) -> NDArray[np.float32]:
    # Published axes are x right, y forward, z up; OpenGL's are x right, y up, z backward.
    published = png * np.float32(2 / 65535) - np.float32(1)
    opengl = np.stack([published[..., 0], published[..., 2], -published[..., 1]], axis=-1)
    # -1..1 to 0..1, and nothing to 0
    return np.where(valid[..., None], (opengl + 1) / 2, 0).astype(np.float32)


FORM = ViewForm(
    "hdf5",
    write_hdf5,
    "`<n>.hdf5` per view with BlenderProc's keys: `colors`, `depth`, `normals` ((n + 1) / 2),"
    " `category_id_segmaps`, `instance_segmaps`, `instance_attribute_maps`, `campose` (with `cam_K`); `index.jsonl`",
    has_classes=True,
    convention=Convention(
        0, axes="OpenGL's; world y up, m", depth="m, along the axis (`depth` unless pin-hole)"
    ),
)
