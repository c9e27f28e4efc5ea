"""Homes as models of MuJoCo: RoboCasa, MolmoSpaces, SceneSmith, our own. No effects before `read`."""

from __future__ import annotations

import re

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.format import Format, GivenFile
from pbrs_farm.read.common.source_files import SourceFiles


def _read_mjcf(given: GivenFile, fields: ReadFields) -> House:
    from pbrs_farm.read.mjcf import model_file

    return model_file.read_mjcf(given, fields)


def _companions_of_mjcf(given: GivenFile, files: SourceFiles) -> str:
    from pbrs_farm.read.mjcf import model_files

    return model_files.companions_of_mjcf(given, files)


# fmt: off
FORMAT = Format(
    kind="mjcf", title="MuJoCo", files=".xml that begins with <mujoco>", order=75,
    brings="meshes, materials, joints as a keyframe has them", where="RoboCasa, MolmoSpaces, SceneSmith",
    licence="of each data set", needs="the extra physics", library="mujoco",
    suffixes=(".xml", ".mjcf"), shared_suffixes=frozenset({".xml"}), contains=re.compile(rb"<mujoco\b"),
    beside=("*.classes.json", "*.rooms.json"), read=_read_mjcf, companions=_companions_of_mjcf,
)
# fmt: on
