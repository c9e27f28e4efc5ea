"""3D-FRONT houses. No effects before `read`."""

from __future__ import annotations

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.format import Format, GivenFile
from pbrs_farm.read.common.source_files import SourceFiles


def _read_front3d(given: GivenFile, fields: ReadFields) -> House:
    from pbrs_farm.read.front3d import front_house

    return front_house.read_front3d(given, fields)


def _companions_of_front3d(given: GivenFile, files: SourceFiles) -> str:
    from pbrs_farm.read.front3d import front_house

    return front_house.companions_of_front3d(given, files)


FORMAT = Format(
    kind="front3d",
    title="3D-FRONT",
    files="<uid>.json",
    order=50,
    brings="walls, floors, ceilings, holes, furniture by --models, lamps",
    where="mirrors; the publisher's pages no longer answer",
    licence="research only",
    keys=(("furniture", "mesh"),),
    has_box_only_items=True,
    read=_read_front3d,
    companions=_companions_of_front3d,
)
