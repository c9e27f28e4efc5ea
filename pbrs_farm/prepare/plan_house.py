"""A House from a plan, with items to be filled by prepare/stand_ins.py, or a home's file. Reads the file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import EMPTY, Catalogue
from pbrs_farm.core.house import House, Item, Source
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.generate.floor_plan import PlacedPiece, Storey
from pbrs_farm.generate.generated_home import GeneratedHome, furnish_storeys
from pbrs_farm.generate.home_file import home_contents
from pbrs_farm.generate.plans.plan_files import PlanFile, PlanStorey, plan_from_file, upright
from pbrs_farm.generate.plans.plan_format import Part, part_of
from pbrs_farm.prepare.stand_ins import with_stand_ins
from pbrs_farm.read.common.format import PLAN, GivenFile
from pbrs_farm.read.common.given_classes import box_only_item
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.sweethome3d.home import read_home
from pbrs_farm.read.usd import SUFFIXES, scan_of_stage
from pbrs_farm.regular_files import digest_of_regular

LEFT_OUT = "plan-left-out"
"""Kind of the notes about parts of a machine-made plan that do not fit."""


def house_of_plan(given: GivenFile, fields: ReadFields) -> House:
    """The house of a plan with an item (or note) for each piece of furniture; BadInput names the place."""
    path = given.path
    file = upright(plan_of_file(given, part_of(given.part)))
    notes = Notes(str(path), strict=fields.strict)
    for line in file.left_out:
        notes.add(LEFT_OUT, "", line)
    house = _walls_of_plan(file, path.stem, fields)
    items = box_only_items(house, file.storeys)
    n_lost = sum(len(s.things) for s in file.storeys) - len(items)
    if n_lost:
        notes.add(
            "box-only-left-out", "", f"{n_lost} named items are dropped, by class or without a box"
        )
    its_source = Source(PLAN, path.name, digest_of_regular(path))
    return replace(
        house,
        name=path.stem,
        source=its_source,
        cameras=(),
        items=(*house.items, *items),
        notes=(*house.notes, *notes.all()),
    )


def plan_of_file(given: GivenFile, part: Part) -> PlanFile:
    """The plan of a file in any format. Raises BadInput; BadHouse for a stage of USD."""
    is_stage = given.path.suffix.lower() in SUFFIXES
    return plan_from_file(given.path, part, scan_of_stage(given) if is_stage else None)


def _walls_of_plan(file: PlanFile, name: str, fields: ReadFields) -> House:
    """The walls, floors, doors and windows of the storeys."""
    storeys = [Storey(s.plan, ()) for s in file.storeys]
    rng = np.random.default_rng(keys.seed("plan", repr([s.plan.walls for s in file.storeys])))
    data = home_contents(storeys, EMPTY, rng, name=name).archive()
    return read_home(data, f"{name}.sh3d", fields=fields)


def box_only_items(house: House, storeys: Sequence[PlanStorey]) -> tuple[Item, ...]:
    """An item for each drawable piece of furniture, numbered by storey; one storey per level, from below."""
    levels = sorted(house.levels, key=lambda level: level.elevation)
    items = []
    for number, (level, storey) in enumerate(zip(levels, storeys, strict=True)):
        for k, t in enumerate(storey.things):
            centre = (t.x, level.elevation + t.low + t.height / 2, t.z)
            item = box_only_item(
                f"box_{number}_{k}",
                t.vocabulary,
                t.name,
                centre,
                (t.width, t.height, t.depth),
                t.turn_rad,
                is_front_given=t.is_front_given,
                level_id=level.id,
            )
            if item is not None:
                items.append(item)
    return tuple(items)


def furnish_plan_file(
    file: PlanFile, catalogue: Catalogue, *, seed: int, style: str = "", name: str = "home"
) -> GeneratedHome:
    """A plan as a home's file, its other rooms furnished by a seed; the file's name has no effect."""
    plans = [s.plan for s in file.storeys]
    key = repr(plans[0]) if len(plans) == 1 else repr(plans)
    file = upright(file)
    pieces_of_storeys = _pieces_of_things(file, catalogue)
    return furnish_storeys(
        [s.plan for s in file.storeys],
        pieces_of_storeys,
        catalogue,
        key,
        seed=seed,
        style=style,
        name=name,
    )


def _pieces_of_things(file: PlanFile, catalogue: Catalogue) -> list[list[PlacedPiece]]:
    """Catalogue pieces for a plan's furniture, a list per storey."""
    placed: list[list[PlacedPiece]] = [[] for _ in file.storeys]
    if not catalogue.pieces or not any(s.things for s in file.storeys):
        return placed
    house = _walls_of_plan(file, "home", ReadFields())
    items = box_only_items(house, file.storeys)
    furnished = with_stand_ins(replace(house, items=(*house.items, *items)), catalogue, "pieces")
    pieces = {f"piece:{p.id}": p for p in catalogue.pieces}
    levels = sorted(house.levels, key=lambda level: level.elevation)
    number = {level.id: k for k, level in enumerate(levels)}
    for item in furnished.items:
        piece = next((pieces[tag] for tag in item.tags if tag in pieces), None)
        if piece is None or item.box is None:
            continue
        level = number[item.level_id]
        (x, z), front = item.box.centre[[0, 2]], item.box.axes[:, 2]
        plan = file.storeys[level].plan
        room = next((k for k, r in enumerate(plan.rooms) if r.contains((float(x), float(z)))), None)
        if room is None:
            continue
        width, height, depth = (float(v) for v in 2 * item.box.half)
        low = float(item.bounds[0, 1]) - levels[level].elevation
        placed[level].append(
            PlacedPiece(
                piece,
                float(x),
                float(z),
                max(low, 0.0),
                math.atan2(-float(front[0]), float(front[2])),
                width,
                depth,
                height,
                room,
            )
        )
    return placed
