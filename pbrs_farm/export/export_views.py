"""`pbrs-farm export`: a finished output folder in the forms other tools read.

Effects: reads an output folder, writes a new folder; it appears whole or not at all. Each form has
a module here; docs/formats.md describes them.
"""

from __future__ import annotations

import io
import json
import math
import tarfile
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrs_farm.core import keys
from pbrs_farm.core.classes import CEILING, FLOOR, WALL
from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.core.house_split import SPLITS, SplitShares, split_of_house
from pbrs_farm.core.plugins import plugins
from pbrs_farm.export.bop import write_bop
from pbrs_farm.export.captions import write_captions
from pbrs_farm.export.chosen_view import (
    LEFT_OUT,
    PICTURES,
    Choice,
    ChosenView,
    blenderproc_k,
    name_left_out,
    new_folder,
    require_lens,
)
from pbrs_farm.export.coco import write_coco
from pbrs_farm.export.point_clouds import write_ply
from pbrs_farm.export.sequences import write_colmap, write_kitti, write_nerfstudio, write_tum
from pbrs_farm.formats.output_folder import ViewEntry, views_of
from pbrs_farm.installation import install_command
from pbrs_farm.regular_files import fault_of, read_regular

# WebDataset: tar shards of samples, equal bytes for equal views.
# Effects: reads views, writes files.


def write_webdataset(views: list[ChosenView], out: Path, choice: Choice) -> int:
    """shard-<6 digits>.tar of choice.views_per_shard views each; the number of files.

    A sample's key is <house>__<view>; its parts are json (view.json) and every layer that is
    exported, by name: "mlt_il_ol.png", "depth.png". No clock, no owner.
    """
    n_shards = 0
    for start in range(0, len(views), choice.views_per_shard):
        shard = out / f"shard-{n_shards:06d}.tar"
        with tarfile.open(shard, "w", format=tarfile.USTAR_FORMAT) as tar:
            for view in views[start : start + choice.views_per_shard]:
                _add_sample(tar, view)
        n_shards += 1
    return n_shards


def _add_sample(tar: tarfile.TarFile, view: ChosenView) -> None:
    # A dot would end the key.
    key = f"{view.house.id}__{view.id}".replace(".", "_")
    parts = {"json": view.facts_json}
    for layer in view.layers:
        parts[f"{layer.name}{Path(layer.file).suffix}"] = view.data(layer.name)
    for part, data in parts.items():
        # TarInfo's own defaults: time 0, no owner.
        member = tarfile.TarInfo(f"{key}.{part}")
        member.size = len(data)
        tar.addfile(member, io.BytesIO(data))


# HDF5 in BlenderProc's form: one file per view, its keys and conventions.
# Effects: reads views, writes files.


def write_hdf5(views: list[ChosenView], out: Path, _choice: Choice) -> int:
    """<n>.hdf5 per view, n counted from 0, and index.jsonl; the number of files.

    colors (H, W, 3) uint8 (the first of PICTURES there is; every mode also by its name), depth
    (H, W) float32 planar metres (0 = nothing), normals (H, W, 3) float32 (n + 1) / 2 with OpenGL
    camera axes, category_id_segmaps uint8 (uint16 of a user's classes), instance_segmaps uint16, and as JSON text
    instance_attribute_maps and campose (the OpenGL pose, and cam_K as BlenderProc means it: the centre
    of the first pixel is (0, 0), so that cx is (W - 1) / 2; where no pin-hole, also lens and depth as
    view.json has them). Raises MachineFailed without h5py.
    """
    h5py = _h5py()
    index = []
    for number, view in enumerate(views):
        with h5py.File(out / f"{number}.hdf5", "w") as file:
            for name, value in _datasets(view).items():
                if isinstance(value, str):  # JSON: a scalar, which HDF5 cannot compress
                    file.create_dataset(name, data=np.bytes_(value.encode()))
                else:
                    file.create_dataset(name, data=value, compression="gzip")
        row = {"file": f"{number}.hdf5", "house": view.house.id, "view": view.id}
        index.append(json.dumps(row))
    # Say which view each file holds.
    (out / "index.jsonl").write_text("\n".join(index) + "\n")
    return len(views) + 1


def _h5py() -> Any:
    try:
        import h5py
    except ImportError:
        hint = install_command("selection")
        raise MachineFailed("writing HDF5 needs h5py", hint=hint) from None
    return h5py


def _datasets(view: ChosenView) -> dict[str, NDArray[Any] | str]:
    data: dict[str, NDArray[Any] | str] = {}
    # The last written is the first of PICTURES.
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
        {"cam_K": blenderproc_k(view.facts["K"]), "cam2world_matrix": pose} | lens
    )
    return data


def _blenderproc_normals(png: NDArray[Any], valid: NDArray[np.bool_]) -> NDArray[np.float32]:
    # Published axes are x right, y forward, z up; OpenGL's are x right, y up, z backward.
    published = png * np.float32(2 / 65535) - np.float32(1)
    opengl = np.stack([published[..., 0], published[..., 2], -published[..., 1]], axis=-1)
    # Bring -1..1 to 0..1, and what is nothing to 0.
    return np.where(valid[..., None], (opengl + 1) / 2, 0).astype(np.float32)


# YOLO: pictures, a text file of boxes or of polygons for each, data.yaml. Effects: reads views,
# writes files.


# What surrounds the whole picture is no object: it has no boxes.
_NO_BOX: Final = (0, WALL, FLOOR, CEILING)
_YOLO_FORMS: Final = ("yolo", "yolo-seg")


def write_yolo(views: list[ChosenView], out: Path, _choice: Choice) -> int:
    """images/<house>__<view>.png and labels/<house>__<view>.txt; the number of files.

    A line is a box: class (NYU40 id - 1; of a user's table its place among the ids), centre x, y,
    width, height, as shares of the picture. Views without a picture are left out, and named in
    left_out.txt.
    """
    return _write_yolo(views, out, _box_lines)


def write_yolo_seg(views: list[ChosenView], out: Path, _choice: Choice) -> int:
    """As write_yolo; a line is a polygon: class, then x and y of each corner as shares.

    Every connected part of an item's visible mask is a polygon, see mask_polygons.
    """
    return _write_yolo(views, out, _polygon_lines)


def _write_yolo(
    views: list[ChosenView], out: Path, lines_of: Callable[[ChosenView], Iterable[str]]
) -> int:
    shown = [view for view in views if view.picture is not None]
    for folder in ("images", "labels"):
        (out / folder).mkdir()
    for view in shown:
        name = f"{view.house.id}__{view.id}"
        (out / "images" / f"{name}.png").write_bytes(view.data(view.picture or ""))
        (out / "labels" / f"{name}.txt").write_text("".join(lines_of(view)))
    without = [view for view in views if view.picture is None]
    return 2 * len(shown) + name_left_out(out, without, "has no picture")


def _box_lines(view: ChosenView) -> Iterable[str]:
    width, height = view.facts["width_px"], view.facts["height_px"]
    for number, row in _numbered(view):
        x0, y0, x1, y1 = row["box2d"]
        box = ((x0 + x1) / 2 / width, (y0 + y1) / 2 / height, (x1 - x0) / width, (y1 - y0) / height)
        yield f"{number} " + " ".join(f"{share:.6f}" for share in box) + "\n"


def _numbered(view: ChosenView) -> Iterable[tuple[int, dict[str, Any]]]:
    """The instances that count as objects, each with its class's number."""
    numbers = {k: number for number, k in enumerate(view.choice.class_names)}
    # Of a user's classes every one counts: the table says which.
    none = _NO_BOX if view.choice.classes is None else (0,)
    for row in view.facts["instances"]:
        class_id = view.class_of(row)
        if class_id not in none:
            yield numbers[class_id], row


def _polygon_lines(view: ChosenView) -> Iterable[str]:
    instance = view.array("instance")
    height, width = instance.shape
    for number, row in _numbered(view):
        # The mask fills its box: look nowhere else.
        x0, y0, x1, y1 = row["box2d"]
        for ring in mask_polygons(instance[y0:y1, x0:x1] == row["id"]):
            shares = (ring + np.array([x0, y0])) / np.array([width, height])
            yield f"{number} " + " ".join(f"{x:.6f}" for x in shares.ravel()) + "\n"


_TOLERANCE_PX: Final = 0.75  # of a polygon's outline: flattens the steps of a slanting edge


def mask_polygons(mask: NDArray[np.bool_]) -> list[NDArray[np.float64]]:
    """(N, 2) x, y in px from the corner of mask (H, W), of each of its parts, the largest first.

    Pixels that share an edge are one part. The outline keeps within a pixel of the mask's. Holes
    are cut: the ring goes to a hole, around it and back the same way.
    """
    # Runs of each row as boxes, joined.
    steps = np.diff(np.pad(mask.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    (y, x0), (_y, x1) = np.nonzero(steps > 0), np.nonzero(steps < 0)
    parts = shapely.get_parts(shapely.union_all(shapely.box(x0, y, x1, y + 1))).tolist()
    parts = [shapely.simplify(part, _TOLERANCE_PX) for part in sorted(parts, key=_minus_area)]
    return [_one_ring(part) for part in parts if isinstance(part, shapely.Polygon)]


def _minus_area(part: shapely.Polygon) -> float:
    return -float(part.area)


def _one_ring(part: shapely.Polygon) -> NDArray[np.float64]:
    ring = shapely.get_coordinates(part.exterior)
    for interior in part.interiors:
        hole = shapely.get_coordinates(interior)[:-1]
        # Cross where they are nearest.
        gaps = np.linalg.norm(ring[:, None] - hole[None], axis=-1)
        i, j = np.unravel_index(int(gaps.argmin()), gaps.shape)
        ring = np.concatenate([ring[: i + 1], hole[j:], hole[: j + 1], ring[i:]])
    # The last corner is the first again.
    return np.asarray(ring[:-1])


def write_data_yaml(out: Path, splits: tuple[str, ...], choice: Choice) -> int:
    """data.yaml of an export with these splits, or none; the number of files, 1.

    Folders count from data.yaml's own. Ultralytics wants train and val: one that has no home is
    the other's, and a comment says so.
    """
    folders = {name: f"{name}/images" for name in splits} or {"train": "images", "val": "images"}
    remarks = [] if splits else ["# without --split, train and val are all views"]
    for name, other in (("train", "val"), ("val", "train")):
        if name not in folders:
            other = other if other in folders else next(iter(folders))
            folders[name] = folders[other]
            remarks.append(f"# no home is in {name}: it is {other}")
    lines = [*remarks, *(f"{name}: {folders[name]}" for name in SPLITS if name in folders)]
    names = choice.class_names.values()
    # A user's name may be anything: JSON's text is YAML's, too.
    said = names if choice.classes is None else map(json.dumps, names)
    lines += ["names:", *(f"  {k}: {name}" for k, name in enumerate(said))]
    (out / "data.yaml").write_text("\n".join(lines) + "\n")
    return 1


def remarks_of(out: Path) -> list[str]:
    """What a user should know of an export: its data.yaml's comments, which views are left out."""
    files = [out / "data.yaml", out / LEFT_OUT, *(out / split / LEFT_OUT for split in SPLITS)]
    lines = [line for file in files if file.is_file() for line in file.read_text().splitlines()]
    return [
        line.removeprefix("# ") for line in lines if line.startswith("# ") or ": has no " in line
    ]


# The layout of the published PBRS data (docs/spec/suncg.md section 5): <kind>_v2/<house>/<6
# digits>_<kind>.png.
# Effects: reads views, writes files. Every label is stored in that form already, so files are
# copied.


# Layer -> where the published data has it.
FILES: Final = {
    "mlt_il_ol": "mlt_v2/{house}/{id}_mlt.png",
    "opengl_il": "opengl_ver2/{house}/{id}_color.png",
    "depth": "depth_v2/{house}/{id}_depth.png",
    "normal": "normal_v2/{house}/{id}_norm_camera.png",
    "valid": "normal_v2/{house}/{id}_valid.png",
    "semantic": "category_v2/{house}/{id}_category40.png",
    "boundary": "boundary_v2/{house}/{id}_instance_boundary.png",
}


def write_released(views: list[ChosenView], out: Path, _choice: Choice) -> int:
    """Every view's files, camera_v2/<house>/room_camera*.txt and data_goodlist_v2.txt; the number.

    id is the view's number in its house, 0-based: its line in room_camera.txt.
    """
    houses: dict[str, list[ChosenView]] = defaultdict(list)
    for view in views:
        houses[view.house.id].append(view)
    n_files, good = 0, []  # files written, lines of the list of good views
    for house, own in houses.items():
        for number, view in enumerate(own):
            place = {"house": house, "id": f"{number:06d}"}
            for layer, published in FILES.items():
                if view.has(layer):
                    _write(out / published.format(**place), view.data(layer))
                    n_files += 1
            good.append("{house}/{id}\n".format(**place))
        n_files += _write_cameras(out / "camera_v2" / house, own)
    (out / "data_goodlist_v2.txt").write_text("".join(good))
    return n_files + 1


def _write_cameras(folder: Path, views: list[ChosenView]) -> int:
    # A line of both camera files for each view, in the order of the views' numbers.
    folder.mkdir(parents=True)
    (folder / "room_camera.txt").write_text("".join(camera_line(v) for v in views))
    names = "".join(f"Room#{v.entry.room_id}_{v.facts.get('sector', 0)}\n" for v in views)
    (folder / "room_camera_name.txt").write_text(names)
    return 2


def _write(target: Path, data: bytes) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_bytes(data)


def camera_line(view: ChosenView) -> str:
    """`vx vy vz  tx ty tz  ux uy uz  xf yf  value`: eye, towards, up, half angles in rad, score."""
    require_lens(view, "released")
    pose = np.array(view.facts["world_from_camera_opengl"], np.float64)
    width, height = view.facts["width_px"], view.facts["height_px"]
    k = np.array(view.facts["K"], np.float64)
    # Half the fields of view, horizontal and vertical.
    half = (math.atan(width / 2 / k[0, 0]), math.atan(height / 2 / k[1, 1]))
    groups = (pose[:3, 3], -pose[:3, 2], pose[:3, 1], half, (view.facts.get("score") or 0.0,))
    return "  ".join(" ".join(f"{x:g}" for x in group) for group in groups) + "\n"


# `pbrs-farm export`.


Writer = Callable[[list[ChosenView], Path, Choice], int]  # -> files written to the new folder

FORMS: Final[Mapping[str, Writer]] = {
    "coco": write_coco,
    "hdf5": write_hdf5,
    "webdataset": write_webdataset,
    "released": write_released,
    "yolo": write_yolo,
    "yolo-seg": write_yolo_seg,
    "nerfstudio": write_nerfstudio,
    "colmap": write_colmap,
    "tum": write_tum,
    "kitti": write_kitti,
    "bop": write_bop,
    "ply": write_ply,
    "captions": write_captions,
}

# Forms that can tell a user's own classes; those of plugins may.
_BY_CLASS: Final = ("coco", "hdf5", "webdataset", *_YOLO_FORMS, "ply", "captions")


def known_forms() -> tuple[str, ...]:
    """The forms, those of plugins last."""
    return (*FORMS, *(name for name in plugins("exports") if name not in FORMS))


def export(
    folder: Path,
    out: Path,
    form: str,
    *,
    selection: str | None = None,
    choice: Choice | None = None,
    shares: SplitShares | None = None,
) -> tuple[int, int]:
    """Write the finished views of folder to out in a form of FORMS: (views, files written).

    out must not exist, or be empty. selection: only the views that selection/<selection>.jsonl
    keeps. choice: which layers and modes, at which size. shares: a folder for each split that has
    views (train, val, test, by home), each whole in itself. Views without labels are left out.
    Raises BadInput for an unknown form, classes of the user's for a form without classes, a folder without finished views, a selection that does not
    exist, or an out that holds something.
    """
    if form not in known_forms():
        raise BadInput("--to", form, "no such form", hint=f"of {', '.join(known_forms())}")
    choice = choice or Choice()
    if choice.classes is not None and form in FORMS and form not in _BY_CLASS:
        hint = f"--to {', '.join(_BY_CLASS)}"
        raise BadInput("--classes", "", f"{form} has no classes of your own", hint=hint)
    write = FORMS[form] if form in FORMS else plugins("exports")[form].load()
    # A view is finished when its labels are there.
    views = [v for v in views_of(folder) if "instances" in v.facts and v.file("instance.png")]
    # Leave out views that the selection does not keep.
    if selection is not None:
        kept = _kept(folder, selection)
        views = [v for v in views if (v.house.id, v.id) in kept]
    if not views:
        raise BadInput(folder, "", "no finished view to export")
    with new_folder(out) as scratch:
        n_files = 0
        by_split = _by_split(views, shares)
        for split, own in by_split.items():
            part = scratch / split
            part.mkdir(exist_ok=True)
            n_files += write([ChosenView(v, choice) for v in own], part, choice)
        if form in _YOLO_FORMS:
            n_files += write_data_yaml(scratch, tuple(filter(None, by_split)), choice)
    return len(views), n_files


def _by_split(views: list[ViewEntry], shares: SplitShares | None) -> dict[str, list[ViewEntry]]:
    """Split -> its views, in the order train, val, test; all under "" without shares."""
    if shares is None:
        return {"": views}
    split_of = {v.house.id: split_of_house(v.house.id, shares) for v in views}
    parts = {name: [v for v in views if split_of[v.house.id] == name] for name in SPLITS}
    return {name: own for name, own in parts.items() if own}


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
