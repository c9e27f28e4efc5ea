"""BOP: pictures, masks and 6-D poses of placed models, in the layout of the BOP challenge.

    camera.json  models/obj_<6 digits>.ply  models/models_info.json
    train_pbr/<6 digits>/rgb depth mask mask_visib
                         scene_camera.json scene_gt.json scene_gt_info.json scene_gt_coco.json

Effects: reads views and their house.glb, writes files. A scene is a house, an image a view. Poses
are model to camera (x right, y down, z forward) in millimetres; K counts from the centre of the
first pixel. `mask` is the model alone, as rays at pixel centres meet its triangles.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.distance import pdist

from pbrs_farm.core.arrays import F64, I32
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.cutouts import CutOuts
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import House, Item
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import Content, Files, write_files
from pbrs_farm.export.export_homes import stored_house
from pbrs_farm.export.form import Convention, ViewForm
from pbrs_farm.export.masks import compressed_runs
from pbrs_farm.export.sequences import by_house
from pbrs_farm.formats.ply import ply_bytes, records_of
from pbrs_farm.raycast.caster import cut_outs_of_house
from pbrs_farm.truth.coverage import coverage

_SPLIT: Final = "train_pbr"
_MM: Final = 1000.0
_OWN_NUMBER: Final = re.compile(r"obj[_-]0*([1-9]\d{0,5})")


@dataclass(frozen=True, slots=True, eq=False)
class _ModelMesh:
    """A model in its own frame, millimetres."""

    points: F64  # (V, 3)
    faces: I32  # (F, 3)
    rgb: NDArray[np.uint8]  # (V, 3)


def write_bop(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """The layout above of views of homes with placed models.

    A model called obj_<number> or obj-<number> keeps its number; others follow in the order of their names.
    Raises BadInput if no house of the views has a placed model, and for a lens other than a pinhole.
    """
    folders = {view.house.id: view.entry.folder.parent.parent for view in views}
    houses = {house: stored_house(folder) for house, folder in folders.items()}
    meshes: dict[str, _ModelMesh] = {}
    for house in houses.values():
        for item in house.items:
            if item.pose is not None and item.pose.model not in meshes:
                meshes[item.pose.model] = _mesh_of(item, house)
    if not meshes:
        hint = "place or scatter models first: docs/python.md"
        raise BadInput("--to bop", "", "no home of these views has a placed model", hint=hint)
    numbers = _object_numbers(sorted(meshes))
    write_files(out, [{"camera.json": _camera_json(views[0])}, _model_files(meshes, numbers)])
    for scene, (house_id, house_views) in enumerate(by_house(views).items()):
        folder = out / _SPLIT / f"{scene:06d}"
        _write_scene(folder, house_views, houses[house_id], numbers)


def _object_numbers(models: list[str]) -> dict[str, int]:
    """Model -> its obj_id."""
    ids = {m: int(match[1]) for m in models if (match := _OWN_NUMBER.fullmatch(m))}
    free = (
        k for k in range(1, len(models) + max(ids.values(), default=0) + 1) if k not in ids.values()
    )
    return {m: ids[m] if m in ids else next(free) for m in models}


def _mesh_of(item: Item, house: House) -> _ModelMesh:
    """The model of a placed item, back in its own frame, a colour a surface."""
    assert item.pose is not None
    model_from_world = np.linalg.inv(np.array(item.pose.world_from_model))
    points, faces, rgb, n = [], [], [], 0
    for surface in item.surfaces:
        points.append(surface.positions.astype(np.float64))
        faces.append(surface.faces + n)
        n += len(surface.positions)
        diffuse = np.rint(np.array(house.materials[surface.material].diffuse) * 255)
        rgb.append(np.tile(diffuse.astype(np.uint8), (len(surface.positions), 1)))
    world = np.concatenate(points)
    local = world @ model_from_world[:3, :3].T + model_from_world[:3, 3]
    return _ModelMesh(local * _MM, np.concatenate(faces).astype(np.int32), np.concatenate(rgb))


def _model_files(meshes: dict[str, _ModelMesh], numbers: dict[str, int]) -> Files:
    files: dict[str, Content] = {}
    info = {}
    for model, number in sorted(numbers.items(), key=lambda pair: pair[1]):
        mesh = meshes[model]
        files[f"models/obj_{number:06d}.ply"] = _ply(mesh)
        low, size = mesh.points.min(0), np.ptp(mesh.points, axis=0)
        info[str(number)] = {
            "diameter": _diameter(mesh.points),
            "name": model,
            **{f"min_{axis}": float(v) for axis, v in zip("xyz", low)},
            **{f"size_{axis}": float(v) for axis, v in zip("xyz", size)},
        }
    return files | {"models/models_info.json": info}


def _diameter(points: F64) -> float:
    """The largest distance between two vertices."""
    try:
        points = points[ConvexHull(points).vertices]
    except QhullError:
        points = np.unique(points, axis=0)[:2000]  # flat: use the vertices themselves
    return float(pdist(points).max())


def _ply(mesh: _ModelMesh) -> bytes:
    columns: dict[str, NDArray[Any]] = {
        **dict(zip("xyz", mesh.points.astype(np.float32).T, strict=True)),
        **dict(zip(("red", "green", "blue"), mesh.rgb.T, strict=True)),
    }
    return ply_bytes(records_of(columns), triangles=mesh.faces)


def _write_scene(
    folder: Path, views: list[ChosenView], house: House, numbers: dict[str, int]
) -> None:
    for name in ("rgb", "depth", "mask", "mask_visib"):
        (folder / name).mkdir(parents=True)
    cut_outs = cut_outs_of_house(house)
    documents: dict[str, dict[str, Any]] = {
        name: {} for name in ("scene_camera", "scene_gt", "scene_gt_info", "scene_gt_coco")
    }
    camera, poses, info, coco = documents.values()
    categories = [{"id": n, "name": m, "supercategory": "bop"} for m, n in numbers.items()]
    coco |= {"images": [], "annotations": [], "categories": categories}
    for image, view in enumerate(views):
        rows = [row for row in view.facts["instances"] if row.get("model") in numbers]
        camera[str(image)] = _scene_camera(view)
        poses[str(image)] = [_pose_row(row, numbers) for row in rows]
        info[str(image)] = []
        files: dict[str, Content] = {f"depth/{image:06d}.png": view.data("depth")}
        if view.picture is not None:
            files[f"rgb/{image:06d}.png"] = view.shown
        size = dict(zip(("width", "height"), view.size, strict=True))
        coco["images"].append({"id": image, "file_name": f"rgb/{image:06d}.png", **size})
        for k, row in enumerate(rows):
            alone, visible = _masks(view, house.items[row["id"] - 1], row["id"], cut_outs)
            for name, mask in (("mask", alone), ("mask_visib", visible)):
                files[f"{name}/{image:06d}_{k:06d}.png"] = mask.astype(np.uint8) * np.uint8(255)
            facts = _mask_facts(alone, visible, view.array("depth") > 0)
            info[str(image)].append(facts)
            coco["annotations"].append(
                {
                    "id": len(coco["annotations"]) + 1,
                    "image_id": image,
                    "category_id": numbers[row["model"]],
                    "iscrowd": 0,
                    "ignore": False,
                    "area": facts["px_count_visib"],
                    "bbox": facts["bbox_visib"],
                    "segmentation": compressed_runs(visible),
                    **size,
                }
            )
        write_files(folder, [files])
    write_files(folder, [{f"{name}.json": document for name, document in documents.items()}])


def _masks(
    view: ChosenView, item: Item, instance: int, cut_outs: CutOuts
) -> tuple[NDArray[Any], NDArray[Any]]:
    """(H, W) bool masks of the item alone, and of its visible part."""
    camera = Camera(view.intrinsics, view.opengl_pose)
    visible = view.array("instance") == instance
    return coverage(item, camera, cut_outs) | visible, visible


def _mask_facts(alone: NDArray[Any], visible: NDArray[Any], valid: NDArray[Any]) -> dict[str, Any]:
    n_all, n_seen = int(alone.sum()), int(visible.sum())
    return {
        "bbox_obj": _box(alone),
        "bbox_visib": _box(visible),
        "px_count_all": n_all,
        "px_count_valid": int((alone & valid).sum()),
        "px_count_visib": n_seen,
        "visib_fract": n_seen / n_all if n_all else 0.0,
    }


def _box(mask: NDArray[Any]) -> list[int]:
    """x, y, width, height of the mask's pixels; -1 for an empty mask, as in BOP."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    if not len(rows):
        return [-1, -1, -1, -1]
    x, y = int(columns[0]), int(rows[0])
    return [x, y, int(columns[-1]) - x + 1, int(rows[-1]) - y + 1]


def _pose_row(row: dict[str, Any], numbers: dict[str, int]) -> dict[str, Any]:
    pose = np.array(row["camera_from_model_opencv"])
    return {
        "obj_id": numbers[row["model"]],
        "cam_R_m2c": pose[:3, :3].ravel().tolist(),
        "cam_t_m2c": (pose[:3, 3] * _MM).tolist(),
    }


def _scene_camera(view: ChosenView) -> dict[str, Any]:
    camera_from_world = np.linalg.inv(view.pose)
    return {
        "cam_K": [v for line in view.k_of_whole_centres for v in line],
        "depth_scale": 1.0,
        "cam_R_w2c": camera_from_world[:3, :3].ravel().tolist(),
        "cam_t_w2c": (camera_from_world[:3, 3] * _MM).tolist(),
    }


def _camera_json(view: ChosenView) -> dict[str, Any]:
    (fx, _skew, cx), (_zero, fy, cy), _last = view.k_of_whole_centres
    width, height = view.size
    named = {"fx": fx, "fy": fy, "cx": cx, "cy": cy, "width": width, "height": height}
    return named | {"depth_scale": 1.0}


FORM = ViewForm(
    "bop",
    write_bop,
    "poses of placed models in the layout of the BOP challenge: `models` in mm, `camera.json`, `train_pbr/<scene>/`"
    " with `rgb`, `depth`, `mask`, `mask_visib`, `scene_*.json`; a scene is a home",
    lenses=("pinhole",),
    convention=Convention(0, axes="OpenCV's; mm", depth="mm, along the axis"),
)
