"""OpenUSD stages: .usd, .usda, .usdc, .usdz. No effects before `read`."""

from __future__ import annotations

import re
from typing import Any, Final

from pbrs_farm.installation import need
from pbrs_farm.read.common.format import Format, GivenFile, deferred

SUFFIXES: Final = (".usd", ".usda", ".usdc", ".usdz")


def scan_of_stage(given: GivenFile) -> dict[str, Any]:
    """The rooms of a scan with RoomPlan as its JSON export has them. Raises BadHouse."""
    need("pxr")
    from pbrs_farm.read.usd import scanned_rooms

    return scanned_rooms.scan_of_stage(given)


_NO_SCAN: Final = re.compile(rb"\A(?!.*\bArch_grp\b)", re.DOTALL)  # scans of RoomPlan are plans

# fmt: off
FORMAT = Format(
    kind="usd", title="OpenUSD", files=".usd .usda .usdc .usdz", order=70,
    brings="meshes, materials, labels, lights", where="GRScenes, InteriorAgent, SimReady homes",
    licence="of each data set", needs="the extra usd", library="pxr",
    suffixes=SUFFIXES, shared_suffixes=frozenset(SUFFIXES), contains=_NO_SCAN,
    beside=("*.classes.json", "*.rooms.json", "rooms.json"),
    read=deferred("pbrs_farm.read.usd.stage:read_usd"),
    companions=deferred("pbrs_farm.read.usd.stage:companions_of_usd"),
)
# fmt: on
