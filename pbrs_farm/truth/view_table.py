"""Tables of view.json (docs/formats/view_json.md): the camera, and each visible instance; no effects."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import ndimage

from pbrs_farm.core.arrays import F32, ItemBuffer
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.classes import NYU13_FROM_NYU40, NYU13_NAMES, NYU40_NAMES
from pbrs_farm.core.cutouts import CutOuts
from pbrs_farm.core.frames import opencv_world_from_camera
from pbrs_farm.core.house import House, Item
from pbrs_farm.truth.coverage import coverage
from pbrs_farm.truth.standard_layers import nyu40_of_instance


def camera_table(camera: Camera) -> dict[str, Any]:
    """Size, K, both poses, and for other lenses than pin-holes "lens" and "depth", for view.json."""
    i = camera.intrinsics
    lens: dict[str, Any] = {}
    if not i.lens.is_pinhole:
        depth = "planar" if i.lens.depth_is_planar else "distance"
        lens = {"lens": i.lens.table(), "depth": depth}
    return {
        **lens,
        "width_px": i.width_px,
        "height_px": i.height_px,
        "K": i.k.tolist(),
        "world_from_camera_opengl": camera.world_from_camera.tolist(),
        "world_from_camera_opencv": opencv_world_from_camera(camera.world_from_camera).tolist(),
    }


def view_table(
    item_buffer: ItemBuffer,
    house: House,
    camera: Camera,
    *,
    with_visible_fraction: bool = True,
    cut_outs: CutOuts | None = None,
) -> dict[str, Any]:
    """The part of view.json that labels need: the camera's table and "instances".

    cut_outs: holes of the house's materials, of the caster; items do not cover pixels through their holes.

    instances: a row for each instance id in item_buffer (H, W), by id: id, item, name, kind, nyu40, class, nyu13,
    class13, source_class, room, pixels, fraction (of the picture), visible_fraction (pixels / pixels when alone in this
    picture; None unless with_visible_fraction), truncated (see is_truncated), box2d (x0, y0, x1, y1 in px, right and
    bottom exclusive, of the visible pixels) and box3d (centre, half, axes: rows are unit axes; world, metres). Items in
    the air have floating, true.
    """
    classes = nyu40_of_instance(house)
    counts = np.bincount(item_buffer.reshape(-1), minlength=len(house.items) + 1)
    visible = [int(i) for i in np.nonzero(counts)[0] if i > 0]
    slices = ndimage.find_objects(item_buffer.astype(np.int32), max_label=len(house.items))

    rows = []
    for instance in visible:
        item, pixels = house.items[instance - 1], int(counts[instance])
        alone = coverage(item, camera, cut_outs) if with_visible_fraction else None
        rows.append(
            {
                "id": instance,
                **_item_facts(item, int(classes[instance])),
                **({"floating": True} if item.is_floating else {}),
                "pixels": pixels,
                "fraction": pixels / item_buffer.size,
                "visible_fraction": None
                if alone is None
                else pixels / max(int(alone.sum()), pixels),
                "truncated": is_truncated(item, camera),
                "box2d": _box2d(slices[instance - 1]),
                "box3d": _box3d(item),
                **_pose_facts(item, camera),
            }
        )
    return {**camera_table(camera), "instances": rows}


def _item_facts(item: Item, nyu40: int) -> dict[str, Any]:
    nyu13 = int(NYU13_FROM_NYU40[nyu40])
    return {
        "item": item.id,
        "name": item.name,
        "kind": str(item.kind),
        "nyu40": nyu40,
        "class": NYU40_NAMES[nyu40],
        "nyu13": nyu13,
        "class13": NYU13_NAMES[nyu13],
        "source_class": item.source_class,
        "room": item.room_id,
    }


def _pose_facts(item: Item, camera: Camera) -> dict[str, Any]:
    """The 6-D pose of an item that is a model's instance: nothing of others."""
    if item.pose is None:
        return {}
    world_from_model = np.array(item.pose.world_from_model)
    camera_from_world = np.linalg.inv(opencv_world_from_camera(camera.world_from_camera))
    return {
        "model": item.pose.model,
        "world_from_model": world_from_model.tolist(),
        "camera_from_model_opencv": (camera_from_world @ world_from_model).tolist(),
    }


def _box2d(slices: tuple[slice, ...]) -> list[int]:
    rows, columns = slices
    return [int(columns.start), int(rows.start), int(columns.stop), int(rows.stop)]


def _box3d(item: Item) -> dict[str, Any]:
    box = item.oriented_box
    return {"centre": box.centre.tolist(), "half": box.half.tolist(), "axes": box.axes.T.tolist()}


def is_truncated(item: Item, camera: Camera) -> bool:
    """True if part of the item is outside the picture: behind the camera, or beyond an edge.

    Exact for a pin-hole: the view pyramid is convex, so triangles are inside when their vertices are; for other lenses
    all vertices are tested. A panorama sees everything.
    """
    if camera.intrinsics.lens.is_panorama:
        return False
    return any(not _inside(s.positions, camera) for s in item.surfaces if len(s.positions))


def _inside(points: F32, camera: Camera) -> bool:
    i = camera.intrinsics
    if not i.lens.is_pinhole:
        x, y = camera.pixels_of(points).T
        inside = (x >= 0) & (x <= i.width_px) & (y >= 0) & (y <= i.height_px)
        return bool(inside.all())  # NaN, what the lens does not see, is not inside
    # Move into the camera's frame, in float32 as the mesh is.
    rotation = camera.world_from_camera[:3, :3].astype(np.float32)
    p = (points - camera.eye.astype(np.float32)) @ rotation
    z = -p[:, 2]
    if z.min() <= 0:
        return False
    # Project and compare with the picture's edges.
    x, y = i.fx * p[:, 0] / z + i.cx, -i.fy * p[:, 1] / z + i.cy
    return bool(x.min() >= 0 and x.max() <= i.width_px and y.min() >= 0 and y.max() <= i.height_px)
