"""OpenUSD stages: .usd, .usda, .usdc, .usdz. No effects before `read`."""

from __future__ import annotations

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.format import Format, GivenFile
from pbrs_farm.read.common.source_files import SourceFiles


def _read_usd(given: GivenFile, fields: ReadFields) -> House:
    from pbrs_farm.read.usd import stage

    return stage.read_usd(given, fields)


def _companions_of_usd(given: GivenFile, files: SourceFiles) -> str:
    from pbrs_farm.read.usd import stage

    return stage.companions_of_usd(given, files)


# fmt: off
FORMAT = Format(
    kind="usd", title="OpenUSD", files=".usd .usda .usdc .usdz", order=70,
    brings="meshes, materials, labels, lights", where="GRScenes, InteriorAgent, SimReady homes",
    licence="of each data set", needs="the extra usd", library="pxr",
    suffixes=(".usd", ".usda", ".usdc", ".usdz"), beside=("*.classes.json", "*.rooms.json", "rooms.json"),
    read=_read_usd, companions=_companions_of_usd,
)
# fmt: on
