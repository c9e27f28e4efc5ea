"""IFC buildings: .ifc, .ifczip. No effects before `read`."""

from __future__ import annotations

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.format import Format, GivenFile


def _read_ifc(given: GivenFile, fields: ReadFields) -> House:
    from pbrs_farm.installation import need
    from pbrs_farm.read.common.own_process import read_apart

    need("ifcopenshell")
    return read_apart("pbrs_farm.read.ifc.building:read_ifc", given, fields)


# fmt: off
FORMAT = Format(
    kind="ifc", title="IFC", files=".ifc or .ifczip", order=80,
    brings="storeys, spaces, walls, doors, windows, fittings", where="any BIM program exports it",
    licence="of each building", needs="the extra ifc", library="ifcopenshell", suffixes=(".ifc", ".ifczip"),
    read=_read_ifc,
)
# fmt: on
