"""Rows of posed pictures with boxes, as OpenSpatial's engine asks questions from them (VINHYU/OpenSpatial).

    singleview.parquet  multiview.parquet
    {image,depth_map}/<house>/<view>.png  {pose,intrinsic}/<house>/<view>.txt  masks/<house>/<view>/<instance>.png

Effects: reads views, writes files.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import Z_UP_FROM_Y_UP, affine
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import Content, Files, parquet_bytes, write_files
from pbrs_farm.export.form import PICTURES, Convention, ViewForm
from pbrs_farm.export.forms.hypersim import upright_box
from pbrs_farm.export.nouns import noun_of

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
    rows: list[dict[str, Any]] = []
    write_files(out, (_files(view, rows) for view in views))
    of_views = {name: pa.list_(kind) for name, kind in _OF_VIEW.items()}
    scenes: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        scenes.setdefault(row["scene_id"], []).append(row)
    together = [
        scene[0] | {name: [row[name] for row in scene] for name in _OF_VIEW}
        for scene in scenes.values()
    ]
    tables = {"singleview": (rows, _OF_VIEW), "multiview": (together, of_views)}
    schemas = {
        name: pa.schema(list((kinds | _OF_SCENE).items()))
        for name, (_rows, kinds) in tables.items()
    }
    write_files(
        out,
        [
            {
                f"{name}.parquet": parquet_bytes(of, schemas[name])
                for name, (of, _kinds) in tables.items()
            }
        ],
    )


def _files(view: ChosenView, rows: list[dict[str, Any]]) -> Files:
    """The files of a view; adds its row to rows."""
    place = f"{view.house.id}/{view.id}"
    k = affine(view.k_of_whole_centres)
    files: dict[str, Content] = {
        f"image/{place}.png": view.shown,
        f"depth_map/{place}.png": view.depth_mm,
        f"pose/{place}.txt": _text(Z_UP_FROM_Y_UP @ view.pose),
        f"intrinsic/{place}.txt": _text(k),
    }
    things = [row for row in view.facts["instances"] if row.get("box3d") and view.class_of(row)]
    instance = view.array("instance")
    masks: dict[str, Content] = {
        f"masks/{place}/{row['id']}.png": np.where(
            instance == row["id"], np.uint8(255), np.uint8(0)
        )
        for row in things
    }
    rows.append(
        {
            **dict(zip(_TEXTS[1:], files, strict=True)),
            "id": place,
            "scene_id": view.house.id,
            "obj_tags": [noun_of(view, row) or row["class"] for row in things],
            "bboxes_3d_world_coords": [_box(row["box3d"]) for row in things],
            "bboxes_2d": [
                [*row["box2d"][:2], *(n - 1 for n in row["box2d"][2:])] for row in things
            ],
            "masks": list(masks),
            "depth_scale": 1000,
            "is_metric_depth": True,
        }
    )
    return files | masks


def _box(box: dict[str, Any]) -> list[float]:
    centre, size, axes = upright_box(box)
    return [*centre.tolist(), *size.tolist(), *Rotation.from_matrix(axes).as_euler("zxy").tolist()]


def _text(matrix: F64) -> str:
    return "".join(" ".join(f"{v:.12g}" for v in row) + "\n" for row in matrix)


FORM = ViewForm(
    "openspatial",
    write_openspatial,
    "OpenSpatial: `singleview.parquet`, `multiview.parquet` (a row a home), `image`, `depth_map`, `pose`, `intrinsic`, `masks`",
    takes=PICTURES,
    has_classes=True,
    lenses=("pinhole",),
    convention=Convention(0, axes="OpenCV's; world z up, m", depth="mm, along the axis"),
)
