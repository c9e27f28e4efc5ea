"""Furnished scenes as glTF 2.0: .glb, .gltf. No effects before `read`."""

from __future__ import annotations

from pbrs_farm.read.common.format import Format, deferred

# fmt: off
FORMAT = Format(
    kind="gltf", title="glTF", files=".glb or .gltf", order=30,
    brings="what its nodes and their names say", where="any modeller exports it", licence="of each scene",
    needs="the extra gltf for compressed files", suffixes=(".glb", ".gltf"),
    beside=("*.classes.json", "*.rooms.json"),
    read=deferred("pbrs_farm.read.gltf.scene:read_given_gltf"),
    companions=deferred("pbrs_farm.read.gltf.scene:companions_of_gltf"),
)
# fmt: on
