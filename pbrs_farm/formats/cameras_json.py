"""cameras.json: views and the sampler's report as plain values, and back; pure."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from pydantic import BaseModel

from pbrs_farm.core.camera import Camera, Intrinsics, View
from pbrs_farm.core.errors import BadInput


def json_bytes(value: Any) -> bytes:
    """Readable JSON, keys sorted: equal values give equal bytes."""
    if isinstance(value, BaseModel):
        value = value.model_dump(mode="json")
    return (json.dumps(value, sort_keys=True, indent=1, ensure_ascii=False) + "\n").encode()


def plain_from_view(view: View) -> dict[str, Any]:
    """A view as JSON values; the pose keeps every bit (repr of float64)."""
    i = view.camera.intrinsics
    return {
        "id": view.id,
        "room": view.room_id,
        "sector": view.sector,
        "origin": view.origin,
        "score": view.score,
        "objects": {str(k): n for k, n in sorted(view.objects.items())},
        "intrinsics": {
            "width_px": i.width_px, "height_px": i.height_px,
            "fx": i.fx, "fy": i.fy, "cx": i.cx, "cy": i.cy,
        },
        "world_from_camera_opengl": view.camera.world_from_camera.tolist(),
    }  # fmt: skip


def view_from_plain(plain: dict[str, Any]) -> View:
    """The view that plain_from_view wrote; KeyError or ValueError when it is none."""
    pose = np.array(plain["world_from_camera_opengl"], np.float64)
    if pose.shape != (4, 4):
        raise ValueError(f"a pose has (4, 4) numbers, got {pose.shape}")
    return View(
        id=plain["id"],
        room_id=plain["room"],
        sector=plain["sector"],
        camera=Camera(Intrinsics(**plain["intrinsics"]), pose),
        origin=plain["origin"],
        score=plain["score"],
        objects={int(k): n for k, n in plain["objects"].items()},
    )


def views_from_json(data: bytes, key: str) -> dict[str, View]:
    """View id -> view of a cameras.json, in its order; BadInput names the key."""
    try:
        return {v["id"]: view_from_plain(v) for v in json.loads(data)["views"]}
    except (KeyError, TypeError, ValueError) as error:
        raise BadInput(key, "views", f"not a cameras.json: {error}") from None
