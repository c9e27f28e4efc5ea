"""Labels of what opens: the part that each pixel shows, and a view's table of joints; no effects."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.core.arrays import HitRecord
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import opencv_world_from_camera
from pbrs_farm.core.house import Geometry, House, Item
from pbrs_farm.core.joints import Joint

MAX_PARTS = 65535


def numbered_joints(house: House) -> list[tuple[int, Item, Joint]]:
    """(instance id, item, joint) of every joint in the house's order; the part id of the k-th is k + 1."""
    joints = [(k, item, j) for k, item in enumerate(house.items, 1) for j in item.joints]
    if len(joints) > MAX_PARTS:
        text = f"{len(joints)} joints, a 16-bit layer holds {MAX_PARTS}"
        raise BadHouse(house.source.file, "joints", text)
    return joints


def part_label(hit: HitRecord, house: House, geometry: Geometry) -> NDArray[np.uint16]:
    """(H, W) id of the visible part, as in numbered_joints; 0 for static surfaces."""
    if not len(geometry.faces):
        return np.zeros(hit.face.shape, np.uint16)
    number = {
        (instance, joint.part): k
        for k, (instance, _item, joint) in enumerate(numbered_joints(house), 1)
    }
    of_surface = np.array(
        [number.get((instance, s.part), 0) for instance, _item, _j, s in house.surfaces()],
        np.uint16,
    )
    return np.where(hit.valid, of_surface[geometry.face_surface[hit.face]], 0).astype(np.uint16)


def articulation_table(parts: NDArray[np.uint16], house: House, camera: Camera) -> dict[str, Any]:
    """Contents of a view's articulation.json: a row for each part in its layer `part`.

    Axes and points on them are in the camera's frame with OpenCV's axes (x right, y down, z forward),
    metres; values and limits are radians or metres from closed.
    """
    world_from_camera = opencv_world_from_camera(camera.world_from_camera)
    turn, eye = world_from_camera[:3, :3], world_from_camera[:3, 3]
    counts = np.bincount(parts.reshape(-1), minlength=1)
    boxes = ndimage.find_objects(parts.astype(np.int32))
    rows = []
    for number, (instance, item, joint) in enumerate(numbered_joints(house), 1):
        if number >= len(counts) or not counts[number]:
            continue
        ys, xs = boxes[number - 1]
        rows.append(
            {
                "id": number,
                "instance": instance,
                "item": item.id,
                "part": joint.part,
                "kind": str(joint.kind),
                "value": joint.value,
                "lower": joint.lower,
                "upper": joint.upper,
                "mass_kg": joint.mass_kg,
                "axis_opencv": (turn.T @ np.array(joint.axis)).tolist(),
                "point_opencv": (turn.T @ (np.array(joint.point) - eye)).tolist(),
                "pixels": int(counts[number]),
                "box2d": [int(xs.start), int(ys.start), int(xs.stop), int(ys.stop)],
            }
        )
    return {"parts": rows}


def motion_table(house: House, time_s: float) -> dict[str, Any]:
    """Poses of moving items, for view.json.

    house: at that time, seconds. Joints have their values, radians or metres from closed; whole items a
    (4, 4) matrix from their pose in house.glb to the current one, world axes, metres.
    """
    instance = {item.id: k for k, item in enumerate(house.items, 1)}
    joints, bodies = [], []
    for motion in house.motions:
        row: dict[str, Any] = {"instance": instance[motion.item], "item": motion.item}
        if motion.is_of_joint:
            joints.append({**row, "part": motion.part, "value": motion.value_at(time_s)})
        else:
            bodies.append({**row, "world_from_rest": motion.matrix_at(time_s).tolist()})
    return {"joints": joints, "bodies": bodies}
