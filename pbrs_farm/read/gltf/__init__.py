"""Furnished scenes as glTF 2.0: .glb, .gltf. No effects before `read`."""

from __future__ import annotations

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.format import Format, GivenFile
from pbrs_farm.read.common.source_files import SourceFiles


def _read_gltf(given: GivenFile, fields: ReadFields) -> House:
    from pbrs_farm.read.gltf import scene

    return scene.read_given_gltf(given, fields)


def _companions_of_gltf(given: GivenFile, files: SourceFiles) -> str:
    from pbrs_farm.read.gltf import scene

    return scene.companions_of_gltf(given, files)


# fmt: off
FORMAT = Format(
    kind="gltf", title="glTF", files=".glb or .gltf", order=30,
    brings="what its nodes and their names say", where="any modeller exports it", licence="of each scene",
    needs="the extra gltf for compressed files", suffixes=(".glb", ".gltf"),
    beside=("*.classes.json", "*.rooms.json"),
    read=_read_gltf, companions=_companions_of_gltf,
)
# fmt: on
