"""sceneState files: HSSD-200, Rent3D++, text-to-scene generators. No effects before `read`."""

from __future__ import annotations

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.format import Format, GivenFile
from pbrs_farm.read.common.source_files import SourceFiles


def _read_scenestate(given: GivenFile, fields: ReadFields) -> House:
    from pbrs_farm.read.scenestate import scene_state

    return scene_state.read_scenestate(given, fields)


def _companions_of_scenestate(given: GivenFile, files: SourceFiles) -> str:
    from pbrs_farm.read.scenestate import scene_state

    return scene_state.companions_of_scenestate(given, files)


# fmt: off
FORMAT = Format(
    kind="scenestate", title="sceneState", files="*.scenestate.json or *.scene.json", order=40,
    brings="walls, floors, holes, furniture by --models", where="HSSD-200: huggingface.co/datasets/hssd",
    licence="CC BY-NC 4.0", keys=(("scene", "object", "arch"), ("format", "scene")), has_box_only_items=True,
    read=_read_scenestate, companions=_companions_of_scenestate,
)
# fmt: on
