"""The layout of the Hypersim data set (Roberts et al. 2021), a common input for training on depth and light.

    ai_VVV_NNN/images/scene_cam_XX_{final_hdf5,final_preview,geometry_hdf5}/frame.IIII.<what>
    ai_VVV_NNN/_detail/{metadata_scene.csv,metadata_cameras.csv,cam_XX,mesh}
    metadata_images_split_scene_v1.csv  metadata_camera_parameters.csv  index.csv  README.md

Effects: reads views, writes files. formats/hypersim.py describes its cameras and files.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import write_files
from pbrs_farm.export.form import Convention, ViewForm
from pbrs_farm.export.intrinsic_parts import parts_without_negatives, picture_radiance
from pbrs_farm.formats import hypersim

_MOST_SCENES: Final = 999  # scenes of a volume
_MOST_LIGHT: Final = 65504.0  # maximum of a half float
_INDEX: Final = "index.csv"  # not in Hypersim: the view of each frame
_CREDITS: Final = "ATTRIBUTION.txt"


def write_hypersim(views: list[ChosenView], out: Path, choice: Choice) -> None:
    """Write the layout above.

    A scene is a home seen by one pinhole; a camera has the frames of a walk, or all single views, by eye.
    A unit is a metre, the world has z up. `depth_meters` is the distance along the ray, NaN for pixels
    without a surface. Raises BadInput for a lens other than a pinhole, and for a size other than the views'.
    """
    if choice.size is not None:
        raise BadInput("--size", "", "hypersim contains radiance, which cannot be resized")
    tables: dict[str, list[dict[str, Any]]] = {
        name: [] for name in (hypersim.SPLIT_CSV, hypersim.CAMERAS_CSV, _INDEX)
    }
    for number, scene_views in enumerate(_scenes(views)):
        scene = _scene_name(number)
        _write_scene(out / scene, scene_views, tables, scene)
    for name, rows in tables.items():
        _write_table(out / name, rows)
    _write_credits(out, dict.fromkeys(v.house.attribution for v in views if v.house.attribution))


def _write_credits(out: Path, credits: Iterable[str]) -> None:
    """Write ATTRIBUTION.txt, unless nobody must be named."""
    if text := "".join(f"{line}\n" for line in credits):
        (out / _CREDITS).write_text(text, "utf-8")


def _scene_name(number: int) -> str:
    """`ai_VVV_NNN` of a scene by its number, from 0."""
    volume, number_in_volume = divmod(number, _MOST_SCENES)
    return f"ai_{volume + 1:03d}_{number_in_volume + 1:03d}"


def _scenes(views: Iterable[ChosenView]) -> list[list[ChosenView]]:
    """The views by home and pin-hole: a scene has one projection."""
    scenes: dict[tuple[Any, ...], list[ChosenView]] = {}
    for view in views:
        i = view.intrinsics
        key = (view.house.id, i.width_px, i.height_px, i.fx, i.fy, i.cx, i.cy)
        scenes.setdefault(key, []).append(view)
    return list(scenes.values())


def _trajectories(views: Iterable[ChosenView]) -> list[list[ChosenView]]:
    """The views by camera: single views, frames of a walk; each camera of a rig apart."""
    by_camera: dict[tuple[bool, str], list[ChosenView]] = {}
    for view in views:
        key = ("frame" in view.facts, view.shot.eye)
        by_camera.setdefault(key, []).append(view)
    for (is_frame, _eye), camera_views in by_camera.items():
        if is_frame:
            camera_views.sort(key=lambda view: int(view.facts["frame"]))
    return [by_camera[key] for key in sorted(by_camera)]


def _write_scene(
    folder: Path, views: list[ChosenView], tables: Mapping[str, list[dict[str, Any]]], scene: str
) -> None:
    detail, parts = folder / "_detail", dict[str, dict[str, NDArray[Any]]]()
    cameras = {f"cam_{k:02d}": camera_views for k, camera_views in enumerate(_trajectories(views))}
    for camera, camera_views in cameras.items():
        for frame, view in enumerate(camera_views):
            files = {hypersim.frame_file(camera, frame, *at): c for at, c in _frame(view).items()}
            write_files(folder, [files])
            place: dict[str, Any] = {"scene_name": scene, "camera_name": camera, "frame_id": frame}
            tables[_INDEX].append(place | {"house": view.house.id, "view": view.id})
            split = {"included_in_public_release": True, "exclude_reason": ""}
            tables[hypersim.SPLIT_CSV].append(place | split | {"split_partition_name": "train"})
        parts[camera] = _trajectory(camera_views)
    parts["mesh"] = _boxes(views)
    write_files(
        detail, ({f"{part}/{n}.hdf5": a for n, a in of.items()} for part, of in parts.items())
    )
    _write_table(detail / "metadata_cameras.csv", [{"camera_name": name} for name in cameras])
    row = {"parameter_name": "meters_per_asset_unit", "parameter_value": 1.0}
    _write_table(detail / "metadata_scene.csv", [row])
    tables[hypersim.CAMERAS_CSV].append(_parameters(scene, views[0]))


def _trajectory(views: Sequence[ChosenView]) -> dict[str, NDArray[Any]]:
    poses = np.array([view.facts["world_from_camera_opengl"] for view in views], np.float64)
    turn = hypersim.Z_UP
    return {
        "camera_keyframe_positions": poses[:, :3, 3] @ turn.T,
        "camera_keyframe_orientations": turn @ poses[:, :3, :3],
        "camera_keyframe_frame_indices": np.arange(len(views)),
    }


def _boxes(views: Iterable[ChosenView]) -> dict[str, NDArray[Any]]:
    """Boxes of visible instances, a row an id, NaN for hidden ones; z is the most upright axis."""
    rows = {r["id"]: r["box3d"] for v in views for r in v.facts["instances"] if r.get("box3d")}
    n = max(rows, default=-1) + 1
    centre, size, turn = (
        np.full((n, 3), np.nan),
        np.full((n, 3), np.nan),
        np.full((n, 3, 3), np.nan),
    )
    for number, box in rows.items():
        centre[number], size[number], turn[number] = upright_box(box)
    name = "metadata_semantic_instance_bounding_box_object_aligned_2d"
    return {f"{name}_positions": centre, f"{name}_extents": size, f"{name}_orientations": turn}


def upright_box(box: Mapping[str, Any]) -> tuple[F64, F64, F64]:
    """Centre (3,), size (3,) and axes (3, 3; columns) of a box3d in the world with z up, z the most upright axis."""
    axes = hypersim.Z_UP @ np.array(box["axes"], np.float64).T
    up = int(np.abs(axes[2]).argmax())
    order = [(up + 1) % 3, (up + 2) % 3, up]
    upright = axes[:, order] * np.where(axes[2, up] < 0, -1.0, 1.0)
    upright[:, 1] *= np.sign(np.linalg.det(upright)) or 1.0
    centre = hypersim.Z_UP @ np.array(box["centre"], np.float64)
    return centre, 2 * np.array(box["half"], np.float64)[order], upright


def _parameters(scene: str, view: ChosenView) -> dict[str, Any]:
    i = view.intrinsics
    row: dict[str, Any] = {
        "scene_name": scene,
        "settings_output_img_height": i.height_px,
        "settings_output_img_width": i.width_px,
        "settings_units_info_meters_scale": 1.0,
        "use_camera_physical": False,
        "settings_camera_fov": float(2 * np.arctan(i.width_px / 2 / i.fx)),
    }
    for name, matrix in (
        ("M_cam_from_uv", hypersim.cam_from_uv(i)),
        ("M_proj", hypersim.projection(i)),
    ):
        row |= {f"{name}_{r}{c}": float(value) for (r, c), value in np.ndenumerate(matrix)}
    return row


def _frame(view: ChosenView) -> dict[tuple[str, str], NDArray[Any] | bytes]:
    """(folder, name) -> the content of a frame's file: an array for HDF5, or a JPEG."""
    light, geometry = light_layers(view), _geometry(view)
    files: dict[tuple[str, str], NDArray[Any] | bytes] = {}
    for name, array in light.items():
        files["final_hdf5", f"{name}.hdf5"] = array
    for name, array in geometry.items():
        files["geometry_hdf5", f"{name}.hdf5"] = array
    if view.picture is not None:
        files["final_preview", "tonemap.jpg"] = view.colours
    if "color" in light:
        colour = light["color"].astype(np.float32)
        shown = hypersim.preview(colour, geometry["render_entity_id"] >= 0)
        files["final_preview", "color.jpg"] = shown
    return files


def _geometry(view: ChosenView) -> dict[str, NDArray[Any]]:
    z, instance = view.depth_m, view.array("instance")
    i, is_visible = view.intrinsics, z > 0
    along = np.where(is_visible, z * hypersim.ray_lengths(i), np.nan)
    semantic = view.array("semantic") if view.choice.classes is None else None
    pose, turn = view.pose, hypersim.Z_UP
    local = view.opengl_normals()
    arrays: dict[str, NDArray[Any]] = {
        "depth_meters": along.astype(np.float32),
        "position": _positions(z, i, pose, turn),
        "normal_cam": local,
        "normal_world": _in_world(local, pose, turn),
        "semantic_instance": hypersim.signed_ids(instance),
        "render_entity_id": np.where(instance > 0, instance.astype(np.int32), np.int32(-1)),
    }
    if semantic is not None:
        arrays["semantic"] = np.where(semantic > 0, semantic.astype(np.int16), np.int16(-1))
    if view.has("normal_shading"):
        bent = view.opengl_normals("normal_shading")
        arrays |= {"normal_bump_cam": bent, "normal_bump_world": _in_world(bent, pose, turn)}
    return arrays


def _positions(z: F64, i: Any, pose: F64, turn: F64) -> F32:
    x, y = np.meshgrid(np.arange(i.width_px) + 0.5, np.arange(i.height_px) + 0.5)
    rays = i.directions(np.stack([x.ravel(), y.ravel()], axis=1)).reshape(*z.shape, 3)
    world = ((rays * z[..., None]) @ pose[:3, :3].T + pose[:3, 3]) @ turn.T
    return np.where((z > 0)[..., None], world, 0).astype(np.float32)


def _in_world(local: F32, pose: F64, turn: F64) -> F32:
    opengl = pose[:3, :3] * [1, -1, -1]
    return np.asarray(local @ (turn @ opengl).T, np.float32)


def light_layers(view: ChosenView) -> dict[str, NDArray[np.float16]]:
    """color and the available intrinsic layers; with all of them, color == reflectance x illumination + residual.

    No residual is negative (`parts_without_negatives`).
    """
    light_arrays: dict[str, NDArray[np.float16]] = {}
    if view.has("albedo"):
        light_arrays["diffuse_reflectance"] = _half(linear_from_srgb(view.array("albedo") / 255))
    parts = parts_without_negatives(view)
    if parts is not None:
        names = "diffuse_reflectance", "diffuse_illumination", "residual"
        light_arrays |= {name: _half(part) for name, part in zip(names, parts, strict=True)}
        light, shading, rest = (light_arrays[name].astype(np.float32) for name in names)
        return light_arrays | {"color": _half(light * shading + rest)}
    colour = picture_radiance(view)
    return light_arrays if colour is None else light_arrays | {"color": _half(colour)}


def _half(array: NDArray[Any]) -> NDArray[np.float16]:
    return np.asarray(np.clip(array, -_MOST_LIGHT, _MOST_LIGHT), np.float16)


def _write_table(file: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("w", encoding="utf-8", newline="") as opened:
        writer = csv.DictWriter(opened, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def join_splits(out: Path, splits: tuple[str, ...], _choice: Choice) -> None:
    """Join the splits to one root, as in Hypersim, and write the card."""
    names = (hypersim.SPLIT_CSV, hypersim.CAMERAS_CSV, _INDEX)
    tables: dict[str, list[dict[str, Any]]] = {name: [] for name in names}
    credits: dict[str, None] = {}
    n_scenes = 0
    for split in splits:
        part = out / split
        names_of = {
            scene.name: _scene_name(n_scenes + k)
            for k, scene in enumerate(sorted(part.glob("ai_*")))
        }
        n_scenes += len(names_of)
        for name in names:
            for row in hypersim.table_rows(part / name):
                row["scene_name"] = names_of[row["scene_name"]]
                if "split_partition_name" in row:
                    row["split_partition_name"] = split
                tables[name].append(row)
        if (part / _CREDITS).is_file():
            credits |= dict.fromkeys((part / _CREDITS).read_text("utf-8").splitlines())
        for scene, name in names_of.items():
            (part / scene).rename(out / name)
        for file in (*names, _CREDITS):
            (part / file).unlink(missing_ok=True)
        part.rmdir()
    for name, rows in tables.items():
        if rows:
            _write_table(out / name, rows)
    if splits:
        _write_credits(out, credits)
    (out / "README.md").write_text(_card(out), "utf-8")


def _card(out: Path) -> str:
    rows, frames = (
        hypersim.table_rows(out / hypersim.CAMERAS_CSV),
        len(hypersim.table_rows(out / _INDEX)),
    )
    usual = hypersim.cam_from_uv(hypersim.usual_intrinsics(hypersim.WIDTH_PX, hypersim.HEIGHT_PX))
    unusual = [row["scene_name"] for row in rows if not _is_usual(row, usual)]
    camera = (
        "holds for every scene" if not unusual else f"does NOT hold for {', '.join(unusual[:9])}"
    )
    camera += "" if len(unusual) <= 9 else f" and {len(unusual) - 9} more"
    has_light = any(out.glob("ai_*/images/*_final_hdf5/*.color.hdf5"))
    has_parts = any(out.glob("ai_*/images/*_final_hdf5/*.diffuse_illumination.hdf5"))
    light = (
        "`color` = `diffuse_reflectance` x `diffuse_illumination` + `residual`, in half floats; where"
        " reflectance times irradiance over pi is more than the light, illumination is less"
    )
    if not has_parts:
        light = (
            "`color` is radiance; there is no `diffuse_illumination` and no `residual`"
            if has_light
            else "there is no `color`: the views have no traced light"
        )
    credits = f", `{_CREDITS}` whom to name" if (out / _CREDITS).is_file() else ""
    return f"""# Views of pbrs_farm in the layout of Hypersim

Frames: {frames}. Scenes: {len(rows)}. `index.csv` says which view each is{credits}.

- The camera that readers assume (1024 x 768, 886.81 px) {camera}; `{hypersim.CAMERAS_CSV}` has the right one of each.
- `depth_meters` is the distance along the ray, NaN where nothing is; `position` and normals are 0 there, `semantic`, `semantic_instance` and `render_entity_id` -1.
- One unit is a metre (`meters_per_asset_unit` 1); the world has z up.
- Light: {light}.
- `tonemap.jpg` is the developed picture, `color.jpg` Hypersim's own tone of `color`.
- Left out of the original's files: `tex_coord`, `metadata_nodes.csv` and the meshes.
"""


def _is_usual(row: Mapping[str, str], usual: F64) -> bool:
    size = int(row["settings_output_img_width"]), int(row["settings_output_img_height"])
    matrix = np.array([[float(row[f"M_cam_from_uv_{r}{c}"]) for c in range(3)] for r in range(3)])
    return size == (hypersim.WIDTH_PX, hypersim.HEIGHT_PX) and bool(
        np.allclose(matrix, usual, atol=1e-5)
    )


FORM = ViewForm(
    "hypersim",
    write_hypersim,
    "[Hypersim's layout](../howto/trainers.md#hypersims-layout) (extra `selection`), with our `index.csv` and `README.md`;"
    " with `--split` one root whose table has the splits",
    finish=join_splits,
    lenses=("pinhole",),
    reads_radiance=True,
    convention=Convention(0.5, axes="OpenGL's; world z up, m", depth="m, along the ray"),
)
