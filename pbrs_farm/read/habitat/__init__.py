"""Scenes of data sets in the layout of Habitat. No effects before `read`."""

from __future__ import annotations

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.format import Format, GivenFile
from pbrs_farm.read.common.source_files import SourceFiles


def _read_habitat(given: GivenFile, fields: ReadFields) -> House:
    from pbrs_farm.read.habitat import scene_instance

    return scene_instance.read_habitat(given, fields)


def _companions_of_habitat(given: GivenFile, files: SourceFiles) -> str:
    from pbrs_farm.read.habitat import scene_instance

    return scene_instance.companions_of_habitat(given, files)


# fmt: off
FORMAT = Format(
    kind="habitat", title="Habitat", files="*.scene_instance.json", order=60,
    brings="a stage, objects, regions", where="HSSD-hab, ReplicaCAD, ai2thor-hab",
    licence="of each data set", needs="the extra gltf for compressed files",
    keys=(("stage_instance",),), has_box_only_items=True,
    read=_read_habitat, companions=_companions_of_habitat,
)
# fmt: on
