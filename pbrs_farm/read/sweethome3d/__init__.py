"""Sweet Home 3D homes: .sh3d archives, .sh3x of its web version, bare Home.xml. No effects before `read`."""

from __future__ import annotations

import re

from pbrs_farm.read.common.format import Format, deferred

# fmt: off
FORMAT = Format(
    kind="sweethome3d", title="Sweet Home 3D", files=".sh3d, .sh3x or Home.xml", order=10,
    brings="walls, rooms, furniture, lamps", where="sweethome3d.com, or your own",
    licence="of each home", suffixes=(".sh3d", ".sh3x", ".xml", ".zip"), shared_suffixes=frozenset({".xml", ".zip"}),
    contains=re.compile(rb"\A\s*(<\?xml[^>]*>\s*)?<home\b|\APK.{28}(Home|ContentDigests)", re.DOTALL),
    read=deferred("pbrs_farm.read.sweethome3d.packaged_home:read_packaged_home"),
    companions=deferred("pbrs_farm.read.sweethome3d.packaged_home:companions_of_home"), uses_packages=True,
)
# fmt: on
