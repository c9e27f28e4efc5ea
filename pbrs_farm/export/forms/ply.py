"""Point clouds: a binary PLY a view, a point for each pixel with a surface.

    <house>/<view>.ply

Effects: reads views, writes files. A vertex has x y z in metres of the home's world (y up) and, if the
view has them, red green blue of its picture, nx ny nz in world axes, label and instance.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, Mask
from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.chosen_view import Choice, ChosenView, intrinsics_of
from pbrs_farm.export.form import Convention, ViewForm
from pbrs_farm.export.sequences import pose_opencv

_FARTHEST_MM: Final = 65535  # value of depth.png for this depth or more
_TYPES: Final = {"float32": "float", "uint8": "uchar", "uint16": "ushort"}  # PLY's names


def write_ply(views: list[ChosenView], out: Path, choice: Choice) -> None:
    """Write <house>/<view>.ply of every view.

    Points are those of the layer `position` if the view has it, else of `depth` and K. label is the NYU40
    class, or that of choice.classes; comments name the classes. Raises BadInput for a view without
    `position` whose lens is not a pinhole.
    """
    for view in views:
        (out / view.house.id).mkdir(exist_ok=True)
        vertices = point_cloud(view)
        data = _header(view, choice, vertices) + vertices.tobytes()
        (out / view.house.id / f"{view.id}.ply").write_bytes(data)


def point_cloud(view: ChosenView) -> NDArray[np.void]:
    """(N,) records of the pixels with a surface, row by row: x y z float32, and if available red green blue,
    nx ny nz, label, instance.
    """
    points, is_seen = _seen_points(view)
    columns: dict[str, NDArray[Any]] = dict(zip("xyz", points.astype(np.float32).T, strict=True))
    if view.has("normal"):
        normals = _world_normals(view)[is_seen].astype(np.float32)
        columns |= dict(zip(("nx", "ny", "nz"), normals.T, strict=True))
    if view.picture is not None:
        colours = view.array(view.picture)[is_seen]
        columns |= dict(zip(("red", "green", "blue"), colours.T, strict=True))
    if view.has("semantic"):
        columns["label"] = view.array("semantic")[is_seen].astype(np.uint16)
    if view.has("instance"):
        columns["instance"] = view.array("instance")[is_seen]
    # One record a point, its properties side by side without gaps.
    fields = [(name, values.dtype.newbyteorder("<")) for name, values in columns.items()]
    records = np.empty(len(points), fields)
    for name, values in columns.items():
        records[name] = values
    return records


def _header(view: ChosenView, choice: Choice, vertices: NDArray[np.void]) -> bytes:
    dtype = vertices.dtype
    labels = np.unique(vertices["label"]) if "label" in (dtype.names or ()) else ()
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment {view.house.id}/{view.id}, metres, y up",
        *([f"comment {view.house.attribution}"] if view.house.attribution else []),
        *(f"comment label {k} {choice.class_names[int(k)]}" for k in labels if k),
        f"element vertex {len(vertices)}",
        *(f"property {_TYPES[dtype[name].name]} {name}" for name in dtype.names or ()),
        "end_header",
    ]
    return ("\n".join(lines) + "\n").encode("utf-8")


def _seen_points(view: ChosenView) -> tuple[F64, Mask]:
    """(N, 3) points in the world, metres, and the (H, W) mask of their pixels."""
    if view.has("position"):
        position = view.array("position")
        is_seen = np.asarray(view.array("depth") > 0) & np.isfinite(position).all(-1)
        return position[is_seen].astype(np.float64), is_seen
    intrinsics = intrinsics_of(view.facts)
    if not intrinsics.lens.is_pinhole:
        problem = f"lens.model {intrinsics.lens.model} needs the layer position"
        raise BadInput(f"{view.house.id}/{view.id}", "", problem, hint="run with --layers position")
    depth = view.array("depth")
    # The farthest value is that depth or any beyond it.
    is_seen = np.asarray((depth > 0) & (depth < _FARTHEST_MM))
    rows, columns = np.nonzero(is_seen)
    rays = intrinsics.directions(np.stack([columns + 0.5, rows + 0.5], axis=1))
    pose = pose_opencv(view)
    local = rays * (depth[is_seen] / 1000)[:, None]
    return local @ pose[:3, :3].T + pose[:3, 3], is_seen


def _world_normals(view: ChosenView) -> F64:
    """(H, W, 3) unit normals in the world, (0, 0, 0) for nothing."""
    # Published axes are x right, y forward, z up; OpenCV's are x right, y down, z forward.
    published = view.array("normal") * (2 / 65535) - 1
    local = np.stack([published[..., 0], -published[..., 2], published[..., 1]], axis=-1)
    length = np.linalg.norm(local, axis=-1, keepdims=True)
    world = local / np.where(length > 0, length, 1) @ pose_opencv(view)[:3, :3].T
    return np.where((view.array("valid") > 0)[..., None], world, 0)


FORM = ViewForm(
    "ply",
    write_ply,
    "`<house>/<view>.ply`, binary: a vertex for each pixel with a depth: `x y z` in metres of the"
    " world (y up), `nx ny nz` in its axes, `red green blue` of the picture, `label` (NYU40, or"
    " yours) and `instance`; from the layer `position` if present, else from depth and K of"
    " a pin-hole",
    has_classes=True,
    convention=Convention(None, axes="world y up, m"),
)
