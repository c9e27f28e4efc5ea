"""SUNCG houses: v1, and v2 by its arch.json. No effects before `read`."""

from __future__ import annotations

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.format import Format, GivenFile
from pbrs_farm.read.common.source_files import RootFolder, SourceFiles


def _read_suncg(given: GivenFile, fields: ReadFields) -> House:
    from pbrs_farm.read.suncg.suncg_house import read_suncg

    return read_suncg(given.path.parent.parent, given.path.name, fields)


def _companions_of_suncg(given: GivenFile, files: SourceFiles) -> str:
    from pbrs_farm.read.suncg.suncg_house import suncg_companions

    root = RootFolder(given.path.parent.parent)
    return files.digest(root, suncg_companions(root, given.path.name, files))


# fmt: off
FORMAT = Format(
    kind="suncg", title="SUNCG", files="ROOT/house/ID", order=20,
    brings="walls, rooms, furniture, lamps", where="no longer published",
    licence="of the copy you have", main_file="house.json", travels=False,
    read=_read_suncg, companions=_companions_of_suncg,
)
# fmt: on
