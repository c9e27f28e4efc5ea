"""The pass `swap`: replace furniture by other models of its group within the old footprint; no effects.

Sets are replaced together: equal models in one room (chairs round a table, both bedside tables).
Contents of the old piece are moved to the top of the new one.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue, Piece, Place, Shape
from pbrs_farm.core.classes import CHAIR
from pbrs_farm.core.house import Item, ItemKind, LightPart
from pbrs_farm.dress.fitting_pieces import Scale, common_scale, is_lit_alike, own_or_all
from pbrs_farm.dress.models import GENERATED
from pbrs_farm.dress.mutable_house import MutableHouse, moved_item
from pbrs_farm.dress.neighbours import (
    ALIKE_HELD,
    Neighbours,
    drop_onto,
    height_above_floor,
    held_by,
    things_on,
)
from pbrs_farm.dress.old_place import (
    HELD,
    HeldBy,
    OldPlace,
    at_wall,
    before_boards,
    group_of_item,
    old_place,
    pieces_by_plain_id,
    plain_id,
)
from pbrs_farm.dress.style import Style
from pbrs_farm.dress.surfaces.skirting import BASEBOARD
from pbrs_farm.geometry.surface_points import item_triangles
from pbrs_farm.home.room_use import is_outdoors

PASS: Final = "swap"
# 2 cm cubes that a new piece may share with neighbours beyond what the old one shared.
FREE_CUBES: Final = 6
_TRIES: Final = 5  # pieces to try for a set
_MOST_LIFT_M: Final = 0.3  # maximum vertical move of a replaced piece's contents, metres
_ON_FLOOR_M: Final = 0.005  # what the source draws less than this above a floor is set on it
_ON_WALLS: Final = frozenset({"radiator", "wall_lamp"})
_NEAR_WALL_M: Final = 0.05
_CHILDS: Final = re.compile(r"child|junior|(?<![a-z])(kid|baby)", re.IGNORECASE)
_UNDER_TABLES: Final = frozenset({"dining_table", "desk", "coffee_table"})


@dataclass(frozen=True, slots=True, eq=False)
class _Member:
    # One item of a set.
    index: int
    item: Item
    place: OldPlace
    on: tuple[int, ...]  # its contents
    held_by: Place


def swap_furniture(house: MutableHouse, catalogue: Catalogue, style: Style, share: float) -> None:
    """Replace a share of the source's furniture by other models of the catalogue.

    Each side of the new model is 75 to 100 % of the old one's, its height within 15 %; its back and
    its axis stay. Contents are moved to the new one; if one has no place there, if the new model would
    overlap its neighbours, or if items are inside the old one, the old one stays. Furniture on
    balconies and terraces stays too.
    """
    around = Neighbours(house.items)
    for key, indices in _sets_of_models(house, catalogue).items():
        group = key[0]
        rng = house.rng(PASS, *key)
        if rng.random() >= share:
            continue
        members = _members_of_set(house, indices, group, around)
        if members is None:
            continue
        _swap_set(house, catalogue, group, members, around, rng)


def _sets_of_models(house: MutableHouse, catalogue: Catalogue) -> dict[tuple[str, ...], list[int]]:
    # Items of one model in one room, by group, room, level and model.
    by_id = pieces_by_plain_id(catalogue)
    # Catalogues are for indoors: an upholstered armchair would get wet.
    outdoors = {r.id for r in house.source.rooms if is_outdoors(r)}
    indices_of_key: dict[tuple[str, ...], list[int]] = {}
    for index, item in enumerate(house.items[: len(house.source.items)]):
        group = "" if item.kind.is_structure else group_of_item(item, by_id)
        if group in HELD and item.room_id not in outdoors:
            key = (group, item.level_id, item.room_id or "", item.source_class or item.name)
            indices_of_key.setdefault(key, []).append(index)
    return indices_of_key


def _members_of_set(
    house: MutableHouse, indices: Sequence[int], group: str, around: Neighbours
) -> list[_Member] | None:
    members = []
    for index in indices:
        item = house.items[index]
        place = old_place(item, group)
        if place is None:
            house.refused[f"{PASS}: which way it faces is not known"] += 1
            return None
        on, inside = things_on(around, index)
        if group in _UNDER_TABLES:
            inside = [k for k in inside if house.items[k].nyu40 != CHAIR]
        if inside:
            house.refused[f"{PASS}: things stand in it or under it"] += 1
            return None
        if HELD[group] is HeldBy.BACK:
            place = before_boards(place, _boards_near(house, item))
        if group in _ON_WALLS:
            place = at_wall(place, _walls_near(house, item))
        by = held_by(house, around, index, group)
        members.append(
            _Member(index, item, place, tuple(on), Place.WALL if group in _ON_WALLS else by)
        )
    return members


def _boards_near(house: MutableHouse, item: Item) -> list[F64]:
    """(N, 3) points of each skirting board that the item's bounds meet."""
    low, high = item.bounds
    boards = []
    for board in house.items:
        if BASEBOARD not in board.tags or not board.n_faces:
            continue
        least, most = board.bounds
        if (least < high).all() and (most > low).all():
            points = np.concatenate([s.positions for s in board.surfaces])
            boards.append(points.astype(np.float64))
    return boards


def _walls_near(house: MutableHouse, item: Item) -> list[F64]:
    """(F, 3, 3) triangles of each wall whose bounds come near the item's."""
    low, high = item.bounds + np.array([[-_NEAR_WALL_M], [_NEAR_WALL_M]])
    triangles = []
    for wall in house.items:
        if wall.kind is ItemKind.WALL and BASEBOARD not in wall.tags and wall.n_faces:
            least, most = wall.bounds
            if (least < high).all() and (most > low).all():
                triangles.append(item_triangles(wall))
    return triangles


def _swap_set(
    house: MutableHouse,
    catalogue: Catalogue,
    group: str,
    members: list[_Member],
    around: Neighbours,
    rng: np.random.Generator,
) -> None:
    places, items = [m.place for m in members], [m.item for m in members]
    old = plain_id(items[0].source_class)
    is_childs = _is_childs(f"{items[0].source_class} {items[0].name}")
    candidates = [
        (piece, scale)
        for piece in catalogue.of(group)
        if plain_id(piece.id) != old
        and _is_childs(f"{piece.id} {piece.name}") == is_childs
        and (scale := common_scale(piece, places)) is not None
    ]
    if not candidates:
        house.refused[f"{PASS}: no other model fits"] += 1
        return
    # Replace furniture with joints only by models with joints; most library models have a single
    # front.
    opens = any(item.joints for item in items)
    if opens:
        candidates = [c for c in candidates if c[0].id.startswith(GENERATED)]
    # Keep the kind of support: hung or from below.
    candidates = [
        (piece, scale)
        for piece, scale in candidates
        if all(piece.held_by in ALIKE_HELD[m.held_by] for m in members)
    ]
    if not candidates:
        house.refused[f"{PASS}: no other model is held as the old one is"] += 1
        return
    why = "no other model can be used"
    order = rng.permutation(len(candidates)).tolist()
    first = own_or_all([piece for piece, _ in candidates], catalogue.own, house.own_share, rng)
    liked = {piece.id for piece in first}
    order.sort(key=lambda k: candidates[k][0].id not in liked)
    for k in order[:_TRIES]:
        piece, scale = candidates[k]
        shape = catalogue.shape(piece)
        if shape is None or not is_lit_alike(bool(shape.lights), items):
            continue
        if opens and not shape.joints:
            continue
        new = [_item_at_old_place(house, piece, shape, scale, group, m) for m in members]
        lifts = _lifts(around, members, new)
        if lifts is None:
            why = "a thing on it would find no place"
        elif not _fits_between_neighbours(around, members, new):
            why = "it would reach into its neighbours"
        else:
            _put_set(house, group, piece, members, new, lifts)
            return
    house.refused[f"{PASS}: {why}"] += 1


def _is_childs(words: str) -> bool:
    """Whether a piece is made for a child, by its id and name: no grown-up dines on its chair."""
    return bool(_CHILDS.search(words))


def _item_at_old_place(
    house: MutableHouse, piece: Piece, shape: Shape, scale: Scale, group: str, member: _Member
) -> Item:
    """The piece as the member's item: same id, room, kind and tags of its source."""
    held_by, place, item = HELD[group], member.place, member.item
    held_by = HeldBy.BACK if member.held_by is Place.WALL else held_by
    low, high = shape.bounds * np.array(scale)
    # Align the fixed point with that of the old piece.
    anchor = np.array(
        [
            (low[0] + high[0]) / 2,
            high[1] if held_by is HeldBy.TOP else low[1],
            low[2] if held_by is HeldBy.BACK else (low[2] + high[2]) / 2,
        ]
    )
    position = place.turn @ (place.held_at(held_by) - anchor)
    if held_by is not HeldBy.TOP:
        position[1] -= _above_floor_m(house, item, float(place.low[1]))
    new = house.placed(
        piece,
        shape,
        position,
        place.turn_rad,
        item_id=item.id,
        room_id=item.room_id,
        level_id=item.level_id,
        scale=np.array(scale),
    )
    new = replace(new, nyu40=item.nyu40 or piece.nyu40, kind=item.kind)
    return replace(new, lights=_lights_like(item.lights, new.lights))


def _above_floor_m(house: MutableHouse, item: Item, low_y: float) -> float:
    """Gap of a few millimetres between a piece and its room's floor; else 0."""
    above = height_above_floor(house, item, low_y)
    return above if 0 < above <= _ON_FLOOR_M else 0.0


def _lights_like(old: tuple[LightPart, ...], new: tuple[LightPart, ...]) -> tuple[LightPart, ...]:
    # A lamp keeps its power and colour; one that was off stays off.
    if not old:
        return ()
    total = sum(light.share for light in new) or 1.0
    whole = sum(light.share for light in old)
    first = old[0]
    return tuple(
        replace(
            light,
            power=first.power,
            unit=first.unit,
            share=light.share / total * whole,
            rgb_linear=first.rgb_linear,
        )
        for light in new
    )


def _fits_between_neighbours(around: Neighbours, members: list[_Member], new: list[Item]) -> bool:
    # The new ones may reach into their neighbours no farther than the old ones did.
    set_indices = {m.index for m in members} | {k for m in members for k in m.on}
    return all(
        (n := around.n_shared(item, set_indices)) <= FREE_CUBES
        or n <= around.n_shared(m.item, set_indices) + FREE_CUBES
        for m, item in zip(members, new, strict=True)
    )


def _lifts(around: Neighbours, members: list[_Member], new: list[Item]) -> dict[int, float] | None:
    # Vertical offset of each item on the old ones, with its own contents; None if one has no place.
    lifts: dict[int, float] = {}
    for member, item in zip(members, new, strict=True):
        corners = item_triangles(item)
        for index in member.on:
            up = drop_onto(around.items[index], corners)
            if up is None or abs(up) > _MOST_LIFT_M:
                return None
            on, inside = things_on(around, index)
            lifts.update({k: up for k in (index, *on, *inside) if k != member.index})
    return lifts


def _put_set(
    house: MutableHouse,
    group: str,
    piece: Piece,
    members: list[_Member],
    new: list[Item],
    lifts: dict[int, float],
) -> None:
    for member, item in zip(members, new, strict=True):
        house.change(member.index, item, PASS)
        house.done[f"{PASS}: {group}"] += 1
    for index, up in lifts.items():
        step = np.array([0.0, up, 0.0])
        house.change(index, moved_item(house.items[index], step), PASS)
    house.used[piece.id] = piece
