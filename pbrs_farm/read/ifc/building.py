"""An IFC building -> House: storeys are levels, spaces rooms, walls come cut. Reads the file."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import shapely

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import CEILING, DOOR, FLOOR, LAMP, OTHERPROP, WALL, WINDOW
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import Y_UP_FROM_Z_UP, transform_points
from pbrs_farm.core.house import (
    Box,
    House,
    Item,
    ItemKind,
    Level,
    Material,
    MaterialKind,
    Opening,
    Room,
    Source,
    Surface,
)
from pbrs_farm.core.mesh import unit_normals
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.geometry.plan_surfaces import horizontal
from pbrs_farm.home.names import names_glass, words_of
from pbrs_farm.home.room_use import RoomKind, named_kind
from pbrs_farm.read.common.doors_and_windows import fill_hole
from pbrs_farm.read.common.format import GivenFile
from pbrs_farm.read.common.furniture_classes import PieceSize, words_of_list
from pbrs_farm.read.common.given_classes import GivenClass, given_class
from pbrs_farm.read.common.house_builder import HouseBuilder, structure_item, unique_id
from pbrs_farm.read.common.material_library import PANE_OPACITY, MaterialLibrary
from pbrs_farm.read.common.name_classes import UNMAPPED, NodeClass, class_of_node_name
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.openings import openings, openings_of_voids
from pbrs_farm.read.common.placed_mesh import across_last, assumed_light, oriented_box, placed
from pbrs_farm.read.common.room_floors import covered_share, floor_polygon
from pbrs_farm.read.common.rooms import rooms_from_floors, rooms_from_walls
from pbrs_farm.read.ifc.ceilings import NEAR_M, Overheads, with_roofs
from pbrs_farm.read.ifc.doors_and_windows import (
    glass_parts,
    hole_of_undrawn,
    kind_of_opening,
    swing,
    tags_of_name,
    voids_of_walls,
)
from pbrs_farm.read.ifc.model_file import (
    ProductMesh,
    Style,
    Whole,
    meshes_of_products,
    model_of,
    with_wholes,
)
from pbrs_farm.read.mesh.obj import Mesh

"""(x, y, z) with z up -> (x, z, -y) with y up."""
_FAR_M: Final = 1000.0  # from the origin: coordinates of a national grid
_CLEAR: Final = 0.3  # transparency of glass in a window
_LEAST_HEIGHT_M: Final = 1.8  # least height of an attic that counts as a room, and of its walls
_LEAST_KNEE_M: Final = 0.5  # least height of the walls of a room under a roof
_LEAST_ROOM_M: Final = 1.0  # least height of any other room
_LEAST_ROOM_M2: Final = 0.3
_COVERED: Final = 0.5  # share of a room that a slab covers to be its floor or ceiling
_BELOW_SLAB_M: Final = 0.005  # a room's own ceiling hangs so far below a slab
_OPENINGS: Final = (ItemKind.DOOR, ItemKind.WINDOW)
# Entities of furniture and fixtures, which are never structure or openings, whatever their names.
_PIECES: Final = (
    "IfcFurnishingElement",
    "IfcFlowTerminal",
    "IfcElectricAppliance",
    "IfcSanitaryTerminal",
)
_BETWEEN: Final = re.compile(r"[-:;,/&+()]")  # parts of a name
_UPWARD: Final = 0.05  # y of the normal of a face of a body's top, at least
_LEVEL_M: Final = 0.01  # a top whose heights differ less is level


def read_ifc(given: GivenFile, fields: ReadFields) -> House:
    """The House of the file, in metres, y up; BadHouse names the place."""
    return _Building(given.path, fields).house()


@dataclass(frozen=True, slots=True, eq=False)
class _Space:
    """An IfcSpace and the body that the library made of it."""

    row: Any
    mesh: ProductMesh


class _Building:
    """A building while it is read. State: the items read so far."""

    def __init__(self, path: Path, fields: ReadFields) -> None:
        from ifcopenshell.util.unit import calculate_unit_scale

        self._path, self._fields = path, fields
        self._notes = Notes(path.name, strict=fields.strict)
        self._library = MaterialLibrary(self._notes)
        self._model = model_of(path)
        self._metres = float(calculate_unit_scale(self._model))  # of a length of the file
        self._meshes: dict[int, ProductMesh] = {}
        self._world = Y_UP_FROM_Z_UP.copy()

    def house(self) -> House:
        """The House of the whole building."""
        products = [p for p in self._model.by_type("IfcProduct") if p.Representation is not None]
        products = [p for p in products if not _is_nothing(p)]
        meshes = meshes_of_products(self._model, products, self._path.name, self._fields)
        wholes = _wholes_of_parts(self._model, self._metres)
        self._meshes = with_wholes(meshes, {row.id(): parts for row, parts in wholes})
        products += [row for row, _parts in wholes if row.id() in self._meshes]
        self._note_failed([p for p in products if p.id() not in meshes])
        self._shift_to_origin()
        items = list(self._items(products))
        spaces = self._rooms_of_spaces()
        items = with_roofs(items, [room for room, _top in spaces])
        spaces = [(_on_its_floor(room, items), top) for room, top in spaces]
        overheads = Overheads(items)
        rooms = self._under_ceilings(spaces, overheads) or _rooms_between_walls(items, overheads)
        if not rooms:
            hint = "export its spaces or rooms, or its floor slabs, with it"
            raise BadHouse(
                self._path.name, "", "has no space and no floor between walls", hint=hint
            )
        builder = HouseBuilder(self._path.name, self._fields, self._notes, self._library)
        builder.set_rooms([room for room, _top in rooms])
        builder.levels = self._named(builder.levels)
        tops = [top for _room, top in rooms]
        for item in items:
            middle = None if item.kind is ItemKind.WALL else item.bounds.mean(0)
            builder.add(item, float(item.bounds[0, 1]), middle)
        for cover in self._covers(zip(builder.rooms, tops, strict=True), items, overheads):
            level_id = builder.level_of(float(cover.bounds[0, 1]))
            builder.items.append(replace(cover, level_id=level_id))
        source = Source("ifc", self._path.name, keys.sha256(self._path.read_bytes()))
        return builder.house(self._path.stem, source, openings=self._openings(builder))

    def _openings(self, builder: HouseBuilder) -> list[Opening]:
        """The openings of voids in walls as the relations tell them; of other doors and windows as meshes do."""
        by_id = {item.id: item for item in builder.items}
        voids = list(
            voids_of_walls(self._model, self._meshes, self._world, by_id, builder.level_of)
        )
        cut = openings_of_voids(builder.items, voids)
        # Build doors and windows without a shape to the size of their hole.
        for void in voids:
            if not void.undrawn or (opening := cut.get(void.id)) is None:
                continue
            hole = hole_of_undrawn(opening, self._model.by_guid(void.undrawn))
            room_id = builder.room_at(hole.centre)
            item = fill_hole(hole, self._library, opening.level_id, room_id)
            if item is not None:
                builder.items.append(item)
                cut[void.id] = replace(opening, item_id=item.id)
        filled = {o.item_id for o in cut.values()} | {i for void in voids for i in void.others}
        rest = [i for i in builder.items if i.id not in filled]
        of_item = {o.item_id: o for o in (*cut.values(), *openings(rest)) if o.item_id is not None}
        own_openings = [of_item[i.id] for i in builder.items if i.id in of_item]
        return own_openings + [o for o in cut.values() if o.item_id is None]

    def _note_failed(self, products: Sequence[Any]) -> None:
        for product in products:
            if product.id() not in self._meshes and _has_body(product):
                place = f"#{product.id()} {product.is_a()} {product.Name or ''}"
                self._notes.add(
                    "unusable-model", place.strip(), "its shape cannot be made; left out"
                )

    def _shift_to_origin(self) -> None:
        """Stand the building at the origin where it has the coordinates of a country."""
        lows = [m.world.min(0) for m in self._meshes.values()]
        if not lows:
            return
        # A site or a stray piece may lie far off: take the middle of all.
        middle = np.median(np.array(lows), axis=0)
        if np.abs(middle).max() <= _FAR_M:
            return
        shift = np.floor(middle)
        self._world = Y_UP_FROM_Z_UP @ np.array(
            [[1, 0, 0, -shift[0]], [0, 1, 0, -shift[1]], [0, 0, 1, -shift[2]], [0, 0, 0, 1.0]]
        )
        text = "moved to the origin from {:.0f}, {:.0f}, {:.0f}".format(*shift)
        self._notes.add("moved-to-origin", "IfcSite", text)

    # Products

    def _items(self, products: Sequence[Any]) -> Iterator[Item]:
        taken: set[str] = set()
        for product in products:
            mesh = self._meshes.get(product.id())
            if mesh is None or product.is_a("IfcSpace") or product.is_a("IfcOpeningElement"):
                continue
            item = self._item(product, mesh)
            if item is None:
                continue
            yield replace(item, id=unique_id(item.id, taken))

    def _item(self, product: Any, mesh: ProductMesh) -> Item | None:
        product_class = self._class(product, mesh)
        if product_class is None:
            return None
        kind, nyu40, tags = product_class
        name = str(product.Name or _type_name(product) or product.is_a())[:200]
        world = self._world @ mesh.world_from_product
        surfaces = tuple(self._surfaces(product, kind, mesh, world))
        if not surfaces:
            return None
        bounds = np.concatenate([s.positions for s in surfaces])
        if np.abs(bounds).max() > self._fields.max_extent_m:
            if product.is_a("IfcSite") or kind is ItemKind.GROUND:
                self._notes.add("far-away", f"#{product.id()}", "the land around is left out")
                return None
            text = f"is farther than {self._fields.max_extent_m:g} m from the origin"
            hint = "limit: read.max_extent_m"
            raise BadHouse(self._path.name, f"#{product.id()} {name}", text, hint=hint)
        item = Item(
            id=str(product.GlobalId),
            name=name,
            kind=kind,
            level_id="",
            surfaces=surfaces,
            nyu40=nyu40,
            source_class=product.is_a(),
            box=self._box(product, kind, mesh),
            tags=tags,
        )
        if kind is ItemKind.LAMP:
            item = replace(item, lights=(assumed_light(item),), tags=(*tags, "assumed_light"))
        return item

    def _class(
        self, product: Any, mesh: ProductMesh
    ) -> tuple[ItemKind, int, tuple[str, ...]] | None:
        """(kind, NYU40 class, tags); None for products that are not drawn."""
        given_class_ = _given(product)
        place = f"#{product.id()} {product.is_a()}"
        if given_class_ is not None and given_class_.kind == "none":
            return None
        if product.is_a("IfcPlate") or product.is_a("IfcMember"):
            return _part_of_wall(product, mesh)
        names = [str(n) for n in (product.Name, product.ObjectType, _type_name(product)) if n]
        if given_class_ is not None and given_class_.item_kind in _OPENINGS:
            return self._class_of_opening(product, given_class_.item_kind, names, mesh)
        if given_class_ is not None and given_class_.nyu40 >= 0:
            return given_class_.item_kind, given_class_.nyu40, ()
        if product.is_a("IfcCovering"):
            return self._class_of_covering(product, mesh)
        is_piece = any(product.is_a(entity) for entity in _PIECES)
        for name in names:
            name_class = class_of_node_name(name, size=_size_of(mesh))
            # A cabinet with two doors is no door.
            if is_piece and name_class is not None and not _is_piece(name_class):
                name_class = _class_of_part_of_name(name)
            if name_class is not None:
                kind = ItemKind.LAMP if name_class.nyu40 == LAMP else name_class.kind
                return kind, name_class.nyu40, ()
        self._notes.add("unmapped-class", f"{place} {product.Name or ''}", "is otherprop")
        return ItemKind.OBJECT, OTHERPROP, (UNMAPPED,)

    def _class_of_covering(
        self, product: Any, mesh: ProductMesh
    ) -> tuple[ItemKind, int, tuple[str, ...]]:
        """Ceiling, floor or wall, by the position of a covering of unknown type."""
        low, high = mesh.world.min(0), mesh.world.max(0)
        if high[2] - low[2] > (high - low)[:2].min():
            return ItemKind.WALL, WALL, ()
        is_high = (low[2] + high[2]) / 2 > self._floor_z(product) + _LEAST_ROOM_M
        return (ItemKind.CEILING, CEILING, ()) if is_high else (ItemKind.FLOOR, FLOOR, ())

    def _class_of_opening(
        self, product: Any, kind: ItemKind, names: Sequence[str], mesh: ProductMesh
    ) -> tuple[ItemKind, int, tuple[str, ...]]:
        low_z, high_z = float(mesh.world[:, 2].min()), float(mesh.world[:, 2].max())
        foot_m = low_z - self._floor_z(product)
        opening_kind = kind_of_opening(product, kind, names, foot_m, high_z - low_z)
        if opening_kind is ItemKind.WINDOW:
            return opening_kind, WINDOW, ()
        return opening_kind, DOOR, swing(product) if opening_kind is kind else tags_of_name(names)

    def _floor_z(self, product: Any) -> float:
        """z of the file, metres, of the floor of the storey that holds a product."""
        import ifcopenshell.util.element as element
        from ifcopenshell.util.placement import get_local_placement

        storey = element.get_container(product, ifc_class="IfcBuildingStorey")
        if storey is None:
            return 0.0
        z = float(get_local_placement(storey.ObjectPlacement)[2, 3]) * self._metres
        building = element.get_aggregate(storey)
        below = getattr(building, "ObjectPlacement", None)
        building_z = float(get_local_placement(below)[2, 3]) * self._metres
        # Some programs place every storey at the building's foot and tell its elevation alone.
        is_placed = storey.ObjectPlacement is not None and abs(z - building_z) > _LEVEL_M
        return z if is_placed else building_z + (self._elevation(storey) or 0.0)

    def _elevation(self, storey: Any) -> float | None:
        """Metres, z of the file; None if the storey has no elevation."""
        height = getattr(storey, "Elevation", None)
        return float(height) * self._metres if height is not None and np.isfinite(height) else None

    def _surfaces(
        self, product: Any, kind: ItemKind, mesh: ProductMesh, world: F64
    ) -> Iterator[Surface]:
        is_opening = kind in _OPENINGS
        materials = [self._material(s, kind) for s in mesh.styles]
        style_of_face = mesh.style_of_face
        panes = np.zeros(len(mesh.faces), np.bool_)
        clear = (MaterialKind.PANE, MaterialKind.GLASS)
        if kind is ItemKind.WINDOW and not any(m.kind in clear for m in materials):
            panes = glass_parts(mesh)
        for k in (-1, *range(len(materials))):
            for is_pane in (False, True):
                chosen = (style_of_face == k) & (panes == is_pane)
                if not chosen.any():
                    continue
                material = materials[k] if k >= 0 else self._unstyled(product)
                if is_pane and is_opening:
                    material = replace(material, kind=MaterialKind.PANE, opacity=PANE_OPACITY)
                used, faces = np.unique(mesh.faces[chosen], return_inverse=True)
                part = mesh.positions[used]
                whole = Mesh(
                    "", "", part, faces.reshape(-1, 3).astype(np.int32), None, np.zeros_like(part)
                )
                name = material.name or f"part {k}"
                index = self._library.index(material)
                surface = placed(whole, world, name=name, material=index)
                if surface is not None:
                    yield surface

    def _material(self, style: Style, kind: ItemKind) -> Material:
        clear = MaterialKind.PANE if kind in _OPENINGS else MaterialKind.GLASS
        is_glass = style.transparency >= _CLEAR or (
            kind in _OPENINGS and style.transparency == 0 and names_glass(style.name)
        )
        opacity = 1.0 - style.transparency if style.transparency >= _CLEAR else PANE_OPACITY
        return Material(
            style.name,
            kind=clear if is_glass else MaterialKind.OPAQUE,
            diffuse=style.rgb or (0.8, 0.8, 0.8),
            opacity=opacity if is_glass else 1.0,
            is_default=style.rgb is None,
        )

    def _unstyled(self, product: Any) -> Material:
        """Material of a product without a style, from its name."""
        import ifcopenshell.util.element as element

        material = element.get_material(product, should_skip_usage=True)
        name = str(getattr(material, "Name", None) or getattr(material, "LayerSetName", None) or "")
        return Material(name[:100], diffuse=(0.8, 0.8, 0.8), is_default=True)

    def _box(self, product: Any, kind: ItemKind, mesh: ProductMesh) -> Box | None:
        """The box in the product's own frame; of a door or window its hole's, where it fills one."""
        if kind.is_structure:
            return None
        source = mesh
        for fills in getattr(product, "FillsVoids", None) or ():
            source = self._meshes.get(fills.RelatingOpeningElement.id(), source)
        whole = Mesh(
            "", "", source.positions, source.faces.astype(np.int32), None, source.positions
        )
        box = oriented_box([whole], self._world @ source.world_from_product)
        if box is not None and int(np.abs(box.axes[1]).argmax()) == 2:
            # Right, up and front are the product's x, z and -y.
            axes = box.axes[:, [0, 2, 1]] * [1, 1, -1]
            box = Box(box.centre, box.half[[0, 2, 1]], axes)
        return across_last(box) if box is not None and kind in _OPENINGS else box

    # Rooms and levels

    def _rooms_of_spaces(self) -> list[tuple[Room, F64]]:
        """The IfcSpaces as rooms, each with the triangles of the top of its body."""
        spaces = [
            _Space(row, self._meshes[row.id()])
            for row in self._model.by_type("IfcSpace")
            if row.id() in self._meshes
        ]
        return [room for space in spaces if (room := self._room(space)) is not None]

    def _under_ceilings(
        self, spaces: Sequence[tuple[Room, F64]], overheads: Overheads
    ) -> list[tuple[Room, F64 | None]]:
        """Limit the rooms to the height of their ceilings; drop rooms on a roof, with nothing above."""
        limited: list[tuple[Room, F64 | None]] = []
        for room, top in spaces:
            above = overheads.over(room)
            near_y = room.ceiling_y + NEAR_M
            if _is_called_attic(room.name) and above.share(near_y) < _COVERED:
                self._notes.add("degenerate-room", room.name, "is under no roof; left out")
            elif above.share(near_y, of_ceilings=True) > _COVERED:
                y = above.height(near_y, of_ceilings=True)
                limited.append((replace(room, ceiling_y=y or room.ceiling_y), top))
            else:
                limited.append((room, top))
        return limited

    def _room(self, space: _Space) -> tuple[Room, F64] | None:
        row, mesh = space.row, space.mesh
        world = self._world @ mesh.world_from_product
        points = transform_points(world, mesh.positions).astype(np.float32)
        low, high = float(points[:, 1].min()), float(points[:, 1].max())
        name = str(row.LongName or row.Name or "")[:60]
        place = f"#{row.id()} {name}".strip()
        if high - low < (_LEAST_HEIGHT_M if _is_called_attic(name) else _LEAST_ROOM_M):
            self._notes.add("degenerate-room", place, f"is {high - low:.2f} m high; left out")
            return None
        # The lower face, turned to look up.
        near = points[mesh.faces][:, :, 1].max(1) < low + NEAR_M
        faces = np.ascontiguousarray(mesh.faces[near][:, ::-1], np.int32)
        polygon = floor_polygon([Surface("", points, faces, 0)], []) if len(faces) else None
        if polygon is None or shapely.Polygon(polygon).area < _LEAST_ROOM_M2:
            self._notes.add("degenerate-room", place, "has no floor; left out")
            return None
        corners = points.astype(np.float64)[mesh.faces]
        room = Room(
            id="",
            name=name,
            level_id="",
            polygon=polygon,
            floor_y=low,
            ceiling_y=high,
            types=(str(row.ObjectType)[:60],) if row.ObjectType else (),
        )
        return room, corners[unit_normals(corners)[:, 1] > _UPWARD]

    def _named(self, levels: Sequence[Level]) -> tuple[Level, ...]:
        """The levels of the rooms' floors, each named after the nearest storey."""
        storeys = [
            (z + float(self._world[1, 3]), str(row.LongName or row.Name or "")[:60])
            for row in self._model.by_type("IfcBuildingStorey")
            if (z := self._elevation(row)) is not None
        ]
        named = []
        for level in levels:
            near = min(storeys, key=lambda s: abs(s[0] - level.elevation), default=(np.inf, ""))
            is_named = abs(near[0] - level.elevation) < 1.0 and near[1]
            named.append(replace(level, name=near[1]) if is_named else level)
        return tuple(named)

    def _covers(
        self, rooms: Iterable[tuple[Room, F64 | None]], items: Sequence[Item], overheads: Overheads
    ) -> Iterator[Item]:
        """A floor or ceiling for each room without one; a slab below a room is its floor, above it hides a ceiling."""
        white = self._library.index(Material("", diffuse=(0.9, 0.9, 0.9), is_default=True))
        for room, top in rooms:
            is_open = named_kind(" ".join((*room.types, room.name))) is RoomKind.OUTDOOR
            floors = _heights_of_floors(items, room)
            if not floors:
                surface = horizontal("floor", [[room.polygon]], room.floor_y, white, up=True)
                yield _cover(room, ItemKind.FLOOR, surface)
            above = overheads.over(room)
            near_y = room.ceiling_y + NEAR_M
            is_ceiled = above.share(near_y, of_ceilings=True) > _COVERED
            slab_y = above.height(near_y) if above.share(near_y) > _COVERED else None
            if is_ceiled or (is_open and slab_y is None):
                continue
            if slab_y is None and top is not None and np.ptp(top[:, :, 1]) > _LEVEL_M:
                surface = _looking_down(top, white)
            else:
                y = min(room.ceiling_y, slab_y or np.inf) - _BELOW_SLAB_M
                surface = horizontal("ceiling", [[room.polygon]], y, white, up=False)
            yield _cover(room, ItemKind.CEILING, surface)


def _is_nothing(product: Any) -> bool:
    return any(
        product.is_a(e) for e in ("IfcAnnotation", "IfcGrid", "IfcVirtualElement", "IfcPort")
    )


def _wholes_of_parts(model: Any, metres: float) -> list[tuple[Any, Whole]]:
    """Doors and windows without a shape: each is assembled from bars and plates."""
    from ifcopenshell.util.placement import get_local_placement

    wholes = []
    for row in (*model.by_type("IfcWindow"), *model.by_type("IfcDoor")):
        parts = [p.id() for r in row.IsDecomposedBy or () for p in r.RelatedObjects]
        if row.Representation is None and parts:
            place = np.array(get_local_placement(row.ObjectPlacement), np.float64)
            place[:3, 3] *= metres
            wholes.append((row, Whole(place, tuple(parts))))
    return wholes


def _has_body(product: Any) -> bool:
    """Whether a product has a shape in space, not an axis or a footprint alone."""
    rows = getattr(product.Representation, "Representations", None) or ()
    names = {str(r.RepresentationIdentifier or "Body") for r in rows}
    return bool(names & {"Body", "Facetation", "Body-FallBack"})


def _is_piece(node_class: NodeClass) -> bool:
    return not node_class.kind.is_structure and node_class.kind not in _OPENINGS


def _class_of_part_of_name(name: str) -> NodeClass | None:
    """The class of the first part of a name that says a piece: a base cabinet of "Base Cabinet-2 Doors"."""
    classes = (class_of_node_name(part) for part in _BETWEEN.split(name))
    return next((c for c in classes if c is not None and _is_piece(c)), None)


def _type_name(product: Any) -> str:
    import ifcopenshell.util.element as element

    product_type = element.get_type(product)
    return str(product_type.Name or "") if product_type is not None else ""


def _given(product: Any) -> GivenClass | None:
    """The table's row for entity and predefined type, the product's own or its type's."""
    import ifcopenshell.util.element as element

    kind = element.get_type(product)
    names = []
    for row in (product, kind):
        if row is None:
            continue
        entity = row.is_a().removesuffix("Type").removesuffix("Style")
        word_of_type = getattr(row, "PredefinedType", None)
        if word_of_type:
            names.append(f"{entity} {word_of_type}")
        names.append(entity)
    for name in sorted(names, key=lambda n: " " not in n):
        if (class_row := given_class("ifc", name)) is not None:
            return class_row
    if product.is_a("IfcSlab"):
        return GivenClass("floor", FLOOR)
    # Entities of other schema versions are handled as their supertype.
    supertypes = ["IfcWall", "IfcDoor", "IfcWindow", "IfcRoof", "IfcStair", "IfcColumn", "IfcBeam"]
    entity = next(filter(product.is_a, supertypes), "")
    return given_class("ifc", entity)


def _part_of_wall(product: Any, mesh: ProductMesh) -> tuple[ItemKind, int, tuple[str, ...]]:
    """Class of a plate or a bar: glass of a curtain wall is a window, other plates are wall."""
    in_wall = any(
        rel.RelatingObject.is_a("IfcCurtainWall")
        for rel in getattr(product, "Decomposes", ()) or ()
    )
    is_glass = any(s.transparency >= _CLEAR or names_glass(s.name) for s in mesh.styles)
    is_glass = is_glass or names_glass(f"{product.Name or ''} {_type_name(product)}")
    if product.is_a("IfcPlate") and is_glass:
        return ItemKind.WINDOW, 9, ("curtain-wall",) if in_wall else ()
    if product.is_a("IfcPlate") and in_wall:
        return ItemKind.WALL, 1, ("curtain-wall",)
    return ItemKind.OBJECT, 38, ("curtain-wall",) if in_wall else ()


def _size_of(mesh: ProductMesh) -> PieceSize | None:
    if not len(mesh.positions):
        return None
    width, depth, height = np.ptp(mesh.world, axis=0).tolist()
    return PieceSize(width, height, depth)


def _top_of_item(item: Item) -> float:
    return float(item.bounds[1, 1])


def _heights_of_floors(items: Sequence[Item], room: Room) -> list[float]:
    """Heights of the slabs that form the room's floor."""
    low, high = room.polygon.min(0), room.polygon.max(0)
    heights = []
    for item in items:
        if item.kind is not ItemKind.FLOOR or abs(_top_of_item(item) - room.floor_y) > NEAR_M:
            continue
        plan = item.bounds[:, [0, 2]]
        if (plan[0] < high).all() and (plan[1] > low).all():
            share = sum(covered_share(s, room.polygon) for s in item.surfaces)
            if share > _COVERED:
                heights.append(_top_of_item(item))
    return heights


def _on_its_floor(room: Room, items: Sequence[Item]) -> Room:
    """The room down to its slab: the body of a space may end at the floor's finish, which is not drawn."""
    heights = _heights_of_floors(items, room)
    return replace(room, floor_y=min(max(heights), room.floor_y)) if heights else room


def _is_called_attic(name: str) -> bool:
    return bool(words_of(name) & (words_of_list("roof") | words_of_list("attic")))


def _rooms_between_walls(
    items: Sequence[Item], overheads: Overheads
) -> list[tuple[Room, F64 | None]]:
    """Rooms of a building without IfcSpaces, as high as the ceiling over most of their area."""
    rooms: list[tuple[Room, F64 | None]] = []
    for room in rooms_from_floors(items) or rooms_from_walls(items):
        above = overheads.over(room)
        y = above.height() if above.share(np.inf) > _COVERED else None
        # Under a roof knee walls bound a room, under the sky they are parapets.
        if _is_walled(room, items, _LEAST_HEIGHT_M if y is None else _LEAST_KNEE_M):
            rooms.append((room if y is None else replace(room, ceiling_y=y), None))
    return rooms


def _looking_down(top: F64, material: int) -> Surface:
    """The ceiling that the top of a space's body is, a little below it."""
    points = top[:, ::-1].reshape(-1, 3) - [0.0, _BELOW_SLAB_M, 0.0]
    faces = np.arange(len(points), dtype=np.int32).reshape(-1, 3)
    return Surface("ceiling", points.astype(np.float32), faces, material)


def _cover(room: Room, kind: ItemKind, surface: Surface) -> Item:
    name = f"{room.name} {kind}".strip()
    return structure_item(
        f"{kind}_{room.id}", kind, [surface], name=name, source_class="IfcSpace", room_id=room.id
    )


def _is_walled(room: Room, items: Sequence[Item], least_m: float) -> bool:
    """True if walls surround most of a room's outline; false for terraces and roofs."""
    ring: Any = shapely.Polygon(room.polygon).exterior
    points = shapely.points(
        [ring.interpolate(d).coords[0] for d in np.arange(0, ring.length, 0.25)]
    )
    lines: list[Any] = []
    for item in items:
        # Skip lower walls and walls below.
        if item.kind is not ItemKind.WALL or _top_of_item(item) < room.floor_y + least_m:
            continue
        for s in item.surfaces:
            plan = s.positions[s.faces][:, :, [0, 2]]
            lines.append(shapely.linestrings(np.concatenate([plan, plan[:, :1]], axis=1)))
    if not lines:
        return False
    tree = shapely.STRtree(np.concatenate(lines))
    _, distance = tree.query_nearest(points, return_distance=True, all_matches=False)
    return bool((distance < 0.15).mean() > 0.7)
