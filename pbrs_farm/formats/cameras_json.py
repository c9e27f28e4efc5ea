"""cameras.json: the views of a house and the sampler's report, written and read; no effects."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np

from pbrs_farm.core.camera import Camera, Intrinsics, RigPlace, View
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.lenses import PINHOLE, lens_from_table
from pbrs_farm.formats.serialise import json_bytes

_RIGHT: Final = ("stereo", "right")  # the rig of --stereo, and its other camera


def cameras_document(views: Iterable[View], report: Mapping[str, Any]) -> dict[str, Any]:
    """Contents of cameras.json, views in order; report: reasons for rejected candidates."""
    return {"views": [_json_of_view(view) for view in views], "report": report}


def cameras_json(views: Iterable[View], report: Mapping[str, Any]) -> bytes:
    """The file, written by the step `cameras`; equal views and reports give equal bytes."""
    return json_bytes(cameras_document(views, report))


def _json_of_view(view: View) -> dict[str, Any]:
    """A view as JSON values; the pose keeps every bit (repr of float64)."""
    i = view.camera.intrinsics
    # Views of no sequence and no pair are written as they always were.
    sequence = {} if view.frame is None else {"frame": view.frame, "time_s": view.time_s}
    return {
        **sequence,
        **rig_table(view),
        "id": view.id,
        "room": view.room_id,
        "sector": view.sector,
        "origin": view.origin,
        "score": view.score,
        # JSON keys are text.
        "objects": {str(k): n for k, n in sorted(view.objects.items())},
        "intrinsics": {
            "width_px": i.width_px,
            "height_px": i.height_px,
            "fx": i.fx,
            "fy": i.fy,
            "cx": i.cx,
            "cy": i.cy,
            # Without a lens it is a pin-hole's, as all were before there were others.
            **({} if i.lens.is_pinhole else {"lens": i.lens.table()}),
        },
        "world_from_camera_opengl": view.camera.world_from_camera.tolist(),
    }


def rig_table(view: View) -> dict[str, Any]:
    """The rig of a view for cameras.json and view.json; {} without one.

    "rig": its name, the camera's, the instant (the id of its first camera's view) and the transform to the
    rig, 4 x 4, metres, both frames x right, y down, z forward. The right view of a stereo pair also has
    "left", the other's id.
    """
    if view.rig is None:
        return {}
    rig = view.rig
    table = {
        "name": rig.name,
        "camera": rig.camera,
        "instant": rig.instant,
        "rig_from_camera_opencv": rig.rig_from_camera.tolist(),
    }
    return {"rig": table, **({"left": rig.instant} if (rig.name, view.shot.eye) == _RIGHT else {})}


def _rig_place(row: Mapping[str, Any] | None) -> RigPlace | None:
    if row is None:
        return None
    pose = np.array(row["rig_from_camera_opencv"], np.float64)
    return RigPlace(row["name"], row["camera"], row["instant"], pose)


def _view_from_json(row: dict[str, Any]) -> View:
    """Inverse of _json_of_view; KeyError or ValueError for any other value."""
    pose = np.array(row["world_from_camera_opengl"], np.float64)
    if pose.shape != (4, 4):
        raise ValueError(f"a pose has (4, 4) numbers, got {pose.shape}")
    stored = dict(row["intrinsics"])
    lens = lens_from_table(stored.pop("lens")) if "lens" in stored else PINHOLE
    # Objects are by instance id, which JSON turned into text.
    return View(
        id=row["id"],
        room_id=row["room"],
        sector=row["sector"],
        camera=Camera(Intrinsics(**stored, lens=lens), pose),
        origin=row["origin"],
        score=row["score"],
        objects={int(k): n for k, n in row["objects"].items()},
        frame=row.get("frame"),
        time_s=row.get("time_s"),
        rig=_rig_place(row.get("rig")),
    )


def views_from_json(data: bytes, key: str) -> dict[str, View]:
    """View id -> view of a cameras.json, in its order; BadInput, naming the key, for any other content."""
    try:
        return {v["id"]: _view_from_json(v) for v in json.loads(data)["views"]}
    except (KeyError, TypeError, ValueError) as error:
        raise BadInput(key, "views", f"not a cameras.json: {error}") from None
