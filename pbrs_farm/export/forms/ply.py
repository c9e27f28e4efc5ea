"""Point clouds: a binary PLY a view, a point for each pixel with a surface.

    <house>/<view>.ply

Effects: reads views, writes files. A vertex has x y z in metres of the home's world (y up) and, if the
view has them, red green blue of its picture, nx ny nz in world axes, label and instance.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, Mask
from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.chosen_view import ChosenView
from pbrs_farm.export.content import Files, each_view
from pbrs_farm.export.form import Convention, ViewForm
from pbrs_farm.formats.ply import ply_bytes, records_of

_FARTHEST_MM: Final = 65535  # value of depth.png for this depth or more


def _files(view: ChosenView) -> Files:
    """<house>/<view>.ply of a view.

    Points are those of the layer `position` if the view has it, else of `depth` and K. label is the NYU40
    class, or that of the user's classes; comments name the classes. Raises BadInput for a view without
    `position` whose lens is not a pinhole.
    """
    vertices, place = point_cloud(view), f"{view.house.id}/{view.id}"
    comments = [f"{place}, metres, y up", view.house.attribution]
    if view.has("semantic"):
        used = np.unique(vertices["label"])
        comments += [f"label {k} {view.choice.class_names[int(k)]}" for k in used if k]
    return {f"{place}.ply": ply_bytes(vertices, comments)}


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
    return records_of(columns)


def _seen_points(view: ChosenView) -> tuple[F64, Mask]:
    """(N, 3) points in the world, metres, and the (H, W) mask of their pixels."""
    if view.has("position"):
        position = view.array("position")
        is_seen = np.asarray(view.array("depth") > 0) & np.isfinite(position).all(-1)
        return position[is_seen].astype(np.float64), is_seen
    lens = view.intrinsics.lens
    if not lens.is_pinhole:
        problem = f"lens.model {lens.model} needs the layer position"
        raise BadInput(f"{view.house.id}/{view.id}", "", problem, hint="run with --layers position")
    depth = view.array("depth")
    # The farthest value is that depth or any beyond it.
    is_seen = np.asarray((depth > 0) & (depth < _FARTHEST_MM))
    rows, columns = np.nonzero(is_seen)
    pixels = np.stack([columns + 0.5, rows + 0.5], axis=1)
    return view.in_world(pixels, depth[is_seen] / 1000), is_seen


def _world_normals(view: ChosenView) -> F64:
    """(H, W, 3) unit normals in the world, (0, 0, 0) for nothing."""
    # Published axes are x right, y forward, z up; OpenCV's are x right, y down, z forward.
    published = view.array("normal") * (2 / 65535) - 1
    local = np.stack([published[..., 0], -published[..., 2], published[..., 1]], axis=-1)
    length = np.linalg.norm(local, axis=-1, keepdims=True)
    world = local / np.where(length > 0, length, 1) @ view.pose[:3, :3].T
    return np.where((view.array("valid") > 0)[..., None], world, 0)


FORM = ViewForm(
    "ply",
    each_view(_files),
    "`<house>/<view>.ply`, binary: a vertex for each pixel with a depth: `x y z` in metres of the"
    " world (y up), `nx ny nz` in its axes, `red green blue` of the picture, `label` (NYU40, or"
    " yours) and `instance`; from the layer `position` if present, else from depth and K of"
    " a pin-hole",
    has_classes=True,
    convention=Convention(None, axes="world y up, m"),
)
