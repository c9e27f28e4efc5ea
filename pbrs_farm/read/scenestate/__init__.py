"""sceneState files: HSSD-200, Rent3D++, text-to-scene generators. No effects before `read`."""

from __future__ import annotations

from pbrs_farm.read.common.format import Format, deferred

# fmt: off
FORMAT = Format(
    kind="scenestate", title="sceneState", files="*.scenestate.json or *.scene.json", order=40,
    brings="walls, floors, holes, furniture by --models", where="HSSD-200: huggingface.co/datasets/hssd",
    licence="CC BY-NC 4.0", keys=(("scene", "object", "arch"), ("format", "scene")), has_box_only_items=True,
    read=deferred("pbrs_farm.read.scenestate.scene_state:read_scenestate"),
    companions=deferred("pbrs_farm.read.scenestate.scene_state:companions_of_scenestate"),
)
# fmt: on
