"""3D-FRONT houses. No effects before `read`."""

from __future__ import annotations

from pbrs_farm.read.common.format import Format, deferred

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
    read=deferred("pbrs_farm.read.front3d.front_house:read_front3d"),
    companions=deferred("pbrs_farm.read.front3d.front_house:companions_of_front3d"),
)
