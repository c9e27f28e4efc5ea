"""Rows of posed pictures with boxes, as OpenSpatial's engine asks questions from them (VINHYU/OpenSpatial).

    singleview.parquet  multiview.parquet
    {image,depth_map}/<house>/<view>.png  {pose,intrinsic}/<house>/<view>.txt  masks/<house>/<view>/<instance>.png

Effects: reads views, writes files.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.export.chosen_view import (
    Choice,
    ChosenView,
    depth_within_png,
    k_of_whole_centres,
    require_lens,
)
from pbrs_farm.export.form import (
    Convention,
    ViewForm,
    name_left_out,
    views_with_picture,
    write_file,
)
from pbrs_farm.export.forms.hypersim import upright_box
from pbrs_farm.export.forms.nerfstudio import Z_UP_FROM_Y_UP
from pbrs_farm.export.nouns import noun_of
from pbrs_farm.export.sequences import pose_opencv
from pbrs_farm.images import png_from_array

_TEXTS: Final = ("id", "image", "depth_map", "pose", "intrinsic")
_LISTS: Final[dict[str, pa.DataType]] = {
    "obj_tags": pa.list_(pa.string()),
    "bboxes_3d_world_coords": pa.list_(pa.list_(pa.float64())),
    "bboxes_2d": pa.list_(pa.list_(pa.int64())),
    "masks": pa.list_(pa.string()),
}
_OF_VIEW: Final = dict.fromkeys(_TEXTS, pa.string()) | _LISTS
_OF_SCENE: Final = {
    "scene_id": pa.string(), "depth_scale": pa.int64(), "is_metric_depth": pa.bool_(),
}  # fmt: skip


def write_openspatial(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """Write the files above: a row a view in singleview.parquet, a row a house with lists in multiview.parquet.

    Paths are relative to this folder, from which the engine must run. Depth is uint16 mm, 0 for nothing and for
    65.535 m or more. pose: camera (OpenCV's axes) to world, z up, metres. A box is centre, size and three angles
    of scipy's "zxy" in the world; obj_tags are the nouns of captions. left_out.txt names views without a picture.
    """
    rows = [_row(view, out) for view in views_with_picture(views)]
    scenes: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        scenes.setdefault(row["scene_id"], []).append(row)
    schema = pa.schema(list((_OF_VIEW | _OF_SCENE).items()))
    pq.write_table(pa.Table.from_pylist(rows, schema), out / "singleview.parquet")
    of_views = {name: pa.list_(kind) for name, kind in _OF_VIEW.items()}
    together = [
        of_house[0] | {name: [row[name] for row in of_house] for name in _OF_VIEW}
        for of_house in scenes.values()
    ]
    schema = pa.schema(list((of_views | _OF_SCENE).items()))
    pq.write_table(pa.Table.from_pylist(together, schema), out / "multiview.parquet")
    name_left_out(out, [view for view in views if view.picture is None], "has no picture")


def _row(view: ChosenView, out: Path) -> dict[str, Any]:
    """The row of a view; writes its files."""
    require_lens(view, "openspatial", *FORM.lenses)
    place = f"{view.house.id}/{view.id}"
    k = np.eye(4)
    k[:3, :3] = k_of_whole_centres(view.facts["K"])
    files = {
        "image": (f"image/{place}.png", view.data(view.picture or "")),
        "depth_map": (f"depth_map/{place}.png", png_from_array(depth_within_png(view))),
        "pose": (f"pose/{place}.txt", _text(Z_UP_FROM_Y_UP @ pose_opencv(view))),
        "intrinsic": (f"intrinsic/{place}.txt", _text(k)),
    }
    for path, data in files.values():
        write_file(out / path, data)
    things = [row for row in view.facts["instances"] if row.get("box3d") and view.class_of(row)]
    return {name: path for name, (path, _data) in files.items()} | {
        "id": place,
        "scene_id": view.house.id,
        "obj_tags": [noun_of(view, row) or row["class"] for row in things],
        "bboxes_3d_world_coords": [_box(row["box3d"]) for row in things],
        "bboxes_2d": [[*row["box2d"][:2], *(n - 1 for n in row["box2d"][2:])] for row in things],
        "masks": list(_masks(view, things, out)),
        "depth_scale": 1000,
        "is_metric_depth": True,
    }


def _masks(view: ChosenView, rows: Iterable[dict[str, Any]], out: Path) -> Iterator[str]:
    instance = view.array("instance")
    for row in rows:
        path = f"masks/{view.house.id}/{view.id}/{row['id']}.png"
        mask = np.where(instance == row["id"], np.uint8(255), np.uint8(0))
        write_file(out / path, png_from_array(mask))
        yield path


def _box(box: dict[str, Any]) -> list[float]:
    centre, size, axes = upright_box(box)
    return [*centre.tolist(), *size.tolist(), *Rotation.from_matrix(axes).as_euler("zxy").tolist()]


def _text(matrix: F64) -> bytes:
    return "".join(" ".join(f"{v:.12g}" for v in row) + "\n" for row in matrix).encode()


FORM = ViewForm(
    "openspatial",
    write_openspatial,
    "OpenSpatial: `singleview.parquet`, `multiview.parquet` (a row a home), `image`, `depth_map`, `pose`, `intrinsic`, `masks`",
    has_classes=True,
    lenses=("pinhole",),
    convention=Convention(0, axes="OpenCV's; world z up, m", depth="mm, along the axis"),
)
