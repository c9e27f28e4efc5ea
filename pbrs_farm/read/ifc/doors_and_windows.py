"""Doors and windows of an IFC building: kind, hole, operation, glass; no effects."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.classes import DOOR, WINDOW
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import Item, ItemKind, Opening
from pbrs_farm.home.names import words_of
from pbrs_farm.read.common.doors_and_windows import Hole
from pbrs_farm.read.common.furniture_classes import words_of_list
from pbrs_farm.read.common.name_classes import class_of_node_name
from pbrs_farm.read.common.openings import Void
from pbrs_farm.read.ifc.model_file import ProductMesh

_THIN_M: Final = 0.045  # maximum thickness of a window part that may be glass, metres
_THRESHOLD_M: Final = 0.3  # above the storey: a door begins lower
_SILL_M: Final = 0.5  # above the storey: what begins higher may be a window
_DOOR_HEIGHT_M: Final = 1.7  # least height of a door
_BEFORE_M: Final = 0.1  # maximum distance of a window's middle from its hole
_SLIDING: Final = frozenset({"sliding", "slider", "bifold", "fold", "bypass", "pocket"})
_GARAGE: Final = frozenset({"overhead", "garage"})


def kind_of_opening(
    product: Any, kind: ItemKind, names: Sequence[str], foot_m: float, height_m: float
) -> ItemKind:
    """Door or window. kind: by the entity, which is wrong in some exports.

    names: of the product and its type. foot_m: above the storey's floor. A window with a door's type,
    or with a door's name and on the floor, is a door; a door with a window's name and above a sill is
    a window.
    """
    import ifcopenshell.util.element as element

    row = element.get_type(product)
    typed = row.is_a() if row is not None else ""
    says_door = any(_says(n, DOOR, "door family") for n in names)
    says_window = any(_says(n, WINDOW, "window family") for n in names)
    is_standing = foot_m < _THRESHOLD_M and height_m > _DOOR_HEIGHT_M
    if kind is ItemKind.WINDOW and is_standing:
        is_door = typed.startswith("IfcDoor") or (says_door and not says_window)
        return ItemKind.DOOR if is_door else kind
    if kind is ItemKind.DOOR and foot_m > _SILL_M:
        is_window = typed.startswith("IfcWindow") or (says_window and not says_door)
        return ItemKind.WINDOW if is_window else kind
    return kind


def _says(name: str, nyu40: int, families: str) -> bool:
    words = words_of(name)
    classes = (class_of_node_name(word) for word in words)
    return any(c is not None and c.nyu40 == nyu40 for c in classes) or any(
        words.issuperset(family.split()) for family in words_of_list(families)
    )


def tags_of_name(names: Sequence[str]) -> tuple[str, ...]:
    """Tags for a door's operation from its family name, for entities without one."""
    words = frozenset().union(*(words_of(name) for name in names))
    if words & _GARAGE:
        return ("garage",)
    return ("sliding",) if words & _SLIDING else ()


def voids_of_walls(
    model: Any,
    meshes: Mapping[int, ProductMesh],
    world: F64,
    items: Mapping[str, Item],
    level_of: Callable[[float], str],
) -> Iterator[Void]:
    """The holes in walls and roofs, each with its door or window if any; world: (4, 4) from z up."""
    loose = _without_records(model, items)
    for relation in model.by_type("IfcRelVoidsElement"):
        opening = relation.RelatedOpeningElement
        mesh = meshes.get(opening.id())
        fillings = [r.RelatedBuildingElement for r in opening.HasFillings or ()]
        walls = _parts(relation.RelatingBuildingElement, items, ItemKind.WALL)
        around = walls or _parts(relation.RelatingBuildingElement, items, ItemKind.CEILING)
        if mesh is None or not around:
            continue
        if not fillings and getattr(opening, "PredefinedType", None) == "RECESS":
            continue
        points = transform_points(world, mesh.world)
        if fillings:
            inside = [items[f.GlobalId] for f in fillings if f.GlobalId in items]
        else:
            bounds = [items[i].bounds for i in around]
            inside = [i for i in loose if _holds(points, i) and any(_holds(b, i) for b in bounds)]
        of_kind = [i for i in inside if i.kind in (ItemKind.DOOR, ItemKind.WINDOW)]
        item, others = (of_kind[0], of_kind[1:]) if of_kind else (None, [])
        in_roof = not walls
        has_window = item is not None or any(f.is_a("IfcWindow") for f in fillings)
        if in_roof and not has_window:
            continue  # of a chimney or a staircase
        undrawn = [] if item else [f for f in fillings if f.is_a("IfcDoor") or f.is_a("IfcWindow")]
        yield Void(
            id=str(opening.GlobalId),
            level_id=item.level_id if item is not None else level_of(float(points[:, 1].min())),
            walls=around,
            points=points,
            item=item,
            is_window=item.kind is ItemKind.WINDOW
            if item is not None
            else any(f.is_a("IfcWindow") for f in undrawn),
            undrawn=str(undrawn[0].GlobalId) if undrawn else "",
            in_roof=in_roof,
            others=tuple(i.id for i in others),
        )


def _without_records(model: Any, items: Mapping[str, Item]) -> list[Item]:
    """The doors and windows that no relation puts into a hole."""
    rows = [*model.by_type("IfcDoor"), *model.by_type("IfcWindow")]
    return [items[r.GlobalId] for r in rows if not r.FillsVoids and r.GlobalId in items]


def _holds(points: F64, item: Item) -> bool:
    """True if the middle of a door or window is between the bounds of a hole or wall, or just before them."""
    middle = item.bounds.mean(0)
    low, high = points.min(0) - _BEFORE_M, points.max(0) + _BEFORE_M
    return bool(((middle > low) & (middle < high)).all())


def hole_of_undrawn(opening: Opening, product: Any) -> Hole:
    """The hole to fill for a door or window without a shape."""
    normal = opening.normal
    along = opening.quad[1] - opening.quad[0]
    along /= np.linalg.norm(along)
    axes = np.stack([along, np.cross(normal, along), normal], 1)
    corners = opening.quad @ axes
    depth = float(np.ptp(opening.cutter.positions @ normal))
    width, height = np.ptp(corners, axis=0)[:2].tolist()
    return Hole(
        id=str(product.GlobalId),
        kind="window" if opening.is_window else "door",
        centre=opening.quad.mean(0),
        size=(width, height, depth),
        axes=axes,
        name=str(product.Name or "")[:200],
        source_class=product.is_a(),
    )


def _parts(product: Any, items: Mapping[str, Item], kind: ItemKind) -> frozenset[str]:
    """Ids of the wall or roof that a product is, or of those that it is put together from."""
    parts = [p for r in getattr(product, "IsDecomposedBy", ()) or () for p in r.RelatedObjects]
    ids = {str(p.GlobalId) for p in (product, *parts)}
    return frozenset(i for i in ids if i in items and items[i].kind is kind)


def swing(product: Any) -> tuple[str, ...]:
    """Tags of how a door opens, by its own or its type's OperationType."""
    import ifcopenshell.util.element as element

    if not product.is_a("IfcDoor"):
        return ()
    kind = element.get_type(product)
    word_of_type = getattr(product, "OperationType", None) or getattr(kind, "OperationType", None)
    word = str(word_of_type or "")
    if "ROLLINGUP" in word:
        return ("garage",)
    if "SLIDING" in word or "FOLDING" in word:
        return ("sliding",)
    if word.endswith("LEFT") or word.endswith("RIGHT"):
        return ("hinge:left" if word.endswith("LEFT") else "hinge:right",)
    return ()


def glass_parts(mesh: ProductMesh) -> Bools:
    """(F,) faces of the thin, large parts of a window without a clear style: its glass."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    rows, columns = mesh.faces[:, [0, 1]].ravel(), mesh.faces[:, [1, 2]].ravel()
    n = len(mesh.positions)
    graph = coo_array((np.ones(len(rows), np.int8), (rows, columns)), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    part = label[mesh.faces[:, 0]]
    size = np.ptp(mesh.positions, axis=0)
    whole = np.sort(size)[1:].prod()
    panes = np.zeros(len(mesh.faces), np.bool_)
    for k in np.unique(part):
        extent = np.sort(np.ptp(mesh.positions[mesh.faces[part == k]].reshape(-1, 3), axis=0))
        is_pane = extent[0] <= _THIN_M and extent[1] > 5 * extent[0] and extent[1] > 0.15
        panes |= (part == k) & bool(is_pane and extent[1:].prod() > 0.15 * whole)
    return panes
