"""Homes as Wavefront OBJ, with an object or group for each item. No effects before `read`."""

from __future__ import annotations

import re

from pbrs_farm.read.common.format import Format, deferred

# fmt: off
FORMAT = Format(
    kind="obj-home", title="OBJ", files=".obj", order=35,
    brings="what its groups are named", where="any modeller exports it", licence="of each home",
    suffixes=(".obj",), shared_suffixes=frozenset({".obj"}), beside=("*.mtl",),
    # a floor and a wall among its groups, wherever in the file; other files are single models
    lines=(b"g ", b"o "),
    contains=re.compile(rb"\A(?=[\s\S]*^[go] .*floor)(?=[\s\S]*^[go] .*wall)", re.IGNORECASE | re.MULTILINE),
    read=deferred("pbrs_farm.read.obj_home.home:read_obj_home"),
    companions=deferred("pbrs_farm.read.obj_home.home:companions_of_obj_home"),
)
# fmt: on
