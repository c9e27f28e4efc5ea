"""Material libraries (MTL) below a root folder. Effect: reads them."""

from __future__ import annotations

import posixpath
from dataclasses import replace

from pbrs_farm.read.common.root_folder import RootFolder
from pbrs_farm.read.mesh.mtl import ObjMaterial, parse_mtl

_MAX_MTL_BYTES = 4_000_000


def read_mtl(folder: RootFolder, name: str) -> tuple[ObjMaterial, ...] | None:
    """The library's materials, map_kd as a name below the root; None if there is no such file.

    Raises BadHouse for a picture that lies outside the folder.
    """
    data = folder.read(name, max_bytes=_MAX_MTL_BYTES)
    if data is None:
        return None
    at = posixpath.dirname(name)
    return tuple(
        replace(m, map_kd=folder.name_from(at, m.map_kd)) if m.map_kd else m
        for m in parse_mtl(data)
    )
