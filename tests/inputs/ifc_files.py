"""IFC buildings written row by row, like the exports of architects' programs. Effects: writes files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import ifcopenshell
import ifcopenshell.guid
import numpy as np

_UNITS = {"mm": (("MILLI", "METRE"), 0.001), "m": ((None, "METRE"), 1.0)}


class IfcHouse:
    """A building under construction: metres, z up, whatever the file's unit."""

    def __init__(self, unit: str = "mm", at: Any = (0, 0, 0), schema: str = "IFC4") -> None:
        self.model = ifcopenshell.file(schema=schema)
        (prefix, name), self.scale = _UNITS[unit]
        m = self.model
        self.axes = m.createIfcAxis2Placement3D(self._point([0, 0, 0]))
        self.context = m.createIfcGeometricRepresentationContext(None, "Model", 3, 1e-6, self.axes)
        length = m.createIfcSIUnit(None, "LENGTHUNIT", prefix, name)
        units = m.createIfcUnitAssignment([length])
        contexts = [self.context]
        self.project = self.row(
            "IfcProject", Name="House", UnitsInContext=units, RepresentationContexts=contexts
        )
        self.site_place = self._placement(np.array(at, float))
        self.building = self.row("IfcBuilding", Name="House", ObjectPlacement=self.site_place)
        self._aggregate(self.project, [self.building])
        self.storeys: list[Any] = []
        self.contained: dict[int, list[Any]] = {}
        self.styles: dict[str, Any] = {}

    def row(self, entity: str, **fields: Any) -> Any:
        return self.model.create_entity(entity, GlobalId=ifcopenshell.guid.new(), **fields)

    def _point(self, p: Any) -> Any:
        return self.model.createIfcCartesianPoint([float(c) / self.scale for c in p])

    def _placement(self, p: Any, turn: float = 0.0) -> Any:
        m = self.model
        x = m.createIfcDirection([float(np.cos(turn)), float(np.sin(turn)), 0.0])
        z = m.createIfcDirection([0.0, 0.0, 1.0])
        parent = getattr(self, "site_place", None)
        return m.createIfcLocalPlacement(parent, m.createIfcAxis2Placement3D(self._point(p), z, x))

    def _aggregate(self, whole: Any, parts: list[Any]) -> None:
        self.row("IfcRelAggregates", RelatingObject=whole, RelatedObjects=parts)

    def storey(self, name: str, elevation: float | None) -> Any:
        """A storey; rows added afterwards belong to it."""
        height = None if elevation is None else elevation / self.scale
        storey = self.row("IfcBuildingStorey", Name=name, Elevation=height)
        self._aggregate(self.building, [storey])
        self.storeys.append(storey)
        return storey

    def style(self, name: str, rgb: Any, transparency: float = 0.0) -> str:
        m = self.model
        colour = m.createIfcColourRgb(None, *map(float, rgb))
        look = m.createIfcSurfaceStyleRendering(
            colour, transparency, None, None, None, None, None, None, "FLAT"
        )
        self.styles[name] = m.createIfcSurfaceStyle(name, "BOTH", [look])
        return name

    def extruded(
        self, outline: Any, height: float, bottom: Any = (0, 0, 0), style: str = ""
    ) -> Any:
        """A solid of an outline in plan, upright."""
        m = self.model
        points = [m.createIfcCartesianPoint([float(c) / self.scale for c in p]) for p in outline]
        ring = m.createIfcPolyline([*points, points[0]])
        profile = m.createIfcArbitraryClosedProfileDef("AREA", None, ring)
        place = m.createIfcAxis2Placement3D(self._point(bottom))
        up = m.createIfcDirection([0.0, 0.0, 1.0])
        solid = m.createIfcExtrudedAreaSolid(profile, place, up, float(height) / self.scale)
        if style:
            m.createIfcStyledItem(solid, [self.styles[style]], None)
        return solid

    def box_solid(self, low: Any, high: Any, style: str = "") -> Any:
        (x0, y0, z0), (x1, y1, z1) = low, high
        return self.extruded([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], z1 - z0, (0, 0, z0), style)

    def mesh_solid(self, points: Any, triangles: Any, style: str = "") -> Any:
        """A triangulated face set."""
        m = self.model
        rows = (np.asarray(points, float) / self.scale).tolist()
        coordinates = m.createIfcCartesianPointList3D(rows)
        indices = (np.asarray(triangles) + 1).tolist()
        solid = m.createIfcTriangulatedFaceSet(coordinates, None, True, indices)
        if style:
            m.createIfcStyledItem(solid, [self.styles[style]], None)
        return solid

    def mapped(self, solids: Any, *, axis_y: Any = (0, 1, 0), scale: float = 1.0) -> Any:
        """A mapped item of the solids; axis_y (0, -1, 0) mirrors them."""
        m = self.model
        shape = m.createIfcShapeRepresentation(self.context, "Body", "SweptSolid", list(solids))
        axes = [m.createIfcDirection([float(c) for c in d]) for d in ((1, 0, 0), axis_y, (0, 0, 1))]
        x, y, z = axes
        target = m.createIfcCartesianTransformationOperator3D(
            x, y, self._point((0, 0, 0)), scale, z
        )
        return m.createIfcMappedItem(m.createIfcRepresentationMap(self.axes, shape), target)

    def product(
        self, entity: str, name: str, solids: Any, place: Any = (0, 0, 0), turn: float = 0.0,
        inside: Any = None, **fields: Any,
    ) -> Any:  # fmt: skip
        """A product with solids in its local frame, in the last storey or in a space."""
        m = self.model
        is_mesh = any(s.is_a("IfcTriangulatedFaceSet") for s in solids)
        kind = "Tessellation" if is_mesh else "SweptSolid"
        shape = m.createIfcShapeRepresentation(self.context, "Body", kind, list(solids))
        body = m.createIfcProductDefinitionShape(None, None, [shape])
        entity_row = self.row(
            entity,
            Name=name,
            ObjectPlacement=self._placement(place, turn),
            Representation=body,
            **fields,
        )
        if entity == "IfcSpace":
            self._aggregate(self.storeys[-1], [entity_row])
        elif entity != "IfcOpeningElement":
            where = inside or self.storeys[-1]
            self.contained.setdefault(where.id(), []).append(entity_row)
        return entity_row

    def wall(
        self, name: str, start: Any, end: Any, bottom: float, height: float, thick: float = 0.2
    ) -> Any:
        """A wall in its local frame, x from start to end, thick to the left."""
        a, b = np.array(start, float), np.array(end, float)
        length = float(np.linalg.norm(b - a))
        turn = float(np.arctan2(*(b - a)[::-1]))
        solid = self.box_solid(
            (0, 0, 0), (length, thick, height), "plaster" if "plaster" in self.styles else ""
        )
        return self.product("IfcWall", name, [solid], (*a, bottom), turn)

    def hole(
        self, wall: Any, along: float, width: float, sill: float, height: float, thick: float = 0.2
    ) -> Any:
        """A hole through a wall, in the wall's frame."""
        solid = self.box_solid((0, -0.1, 0), (width, thick + 0.1, height))
        opening = self.product("IfcOpeningElement", "hole", [solid])
        place = self.model.createIfcAxis2Placement3D(self._point((along, 0, sill)))
        opening.ObjectPlacement = self.model.createIfcLocalPlacement(wall.ObjectPlacement, place)
        self.row("IfcRelVoidsElement", RelatingBuildingElement=wall, RelatedOpeningElement=opening)
        return opening

    def fill(self, hole: Any, entity: str, name: str, solids: Any, **fields: Any) -> Any:
        """A door or window in a hole, in the hole's frame."""
        filling = self.product(entity, name, solids, **fields)
        filling.ObjectPlacement = self.model.createIfcLocalPlacement(
            hole.ObjectPlacement, self.axes
        )
        self.row("IfcRelFillsElement", RelatingOpeningElement=hole, RelatedBuildingElement=filling)
        return filling

    def door(
        self, wall: Any, along: float, width: float = 0.9, height: float = 2.05, **fields: Any
    ) -> Any:
        hole = self.hole(wall, along, width, 0.0, height)
        leaf = self.box_solid((0.02, 0.08, 0.0), (width - 0.02, 0.12, height - 0.02))
        return self.fill(hole, "IfcDoor", "Door", [leaf], **fields)

    def window(self, wall: Any, along: float, width: float = 1.2, height: float = 1.2) -> Any:
        hole = self.hole(wall, along, width, 0.9, height)
        t = 0.06
        w, h = width, height
        bars: list[Any] = [((0, 0.07, 0), (w, 0.13, t)), ((0, 0.07, h - t), (w, 0.13, h))]
        bars += [((0, 0.07, t), (t, 0.13, h - t)), ((w - t, 0.07, t), (w, 0.13, h - t))]
        solids = [self.box_solid(a, b, "frame" if "frame" in self.styles else "") for a, b in bars]
        glass = "glass" if "glass" in self.styles else ""
        solids.append(self.box_solid((t, 0.09, t), (w - t, 0.11, h - t), glass))
        return self.fill(hole, "IfcWindow", "Window", solids)

    def space(self, name: str, outline: Any, bottom: float, height: float) -> Any:
        solid = self.extruded(outline, height, (0, 0, bottom))
        return self.product("IfcSpace", name, [solid], LongName=name)

    def text(self) -> str:
        for number, rows in self.contained.items():
            self.row(
                "IfcRelContainedInSpatialStructure", RelatedElements=rows,
                RelatingStructure=self.model.by_id(number),
            )  # fmt: skip
        self.contained = {}
        return str(self.model.to_string())

    def save(self, path: Path) -> Path:
        path.write_text(self.text(), "utf-8")
        return path


def storey_of_two_rooms(
    house: IfcHouse, bottom: float, *, spaces: bool = True, slab: bool = True
) -> None:
    """Two rooms, 4 x 3 and 3 x 3 m inside, walls 0.2 m, 2.6 m high, a door between, a window each."""
    h, t = 2.6, 0.2
    south = house.wall("South", (0, 0), (7.6, 0), bottom, h)
    house.wall("East", (7.6, t), (7.6, 3.2), bottom, h)
    north = house.wall("North", (7.6, 3.4), (0, 3.4), bottom, h)
    west = house.wall("West", (0, 3.2), (0, t), bottom, h)
    middle = house.wall("Middle", (4.4, t), (4.4, 3.2), bottom, h)
    for wall in (north, west):
        assert wall is not None
    house.window(south, 1.5)
    house.window(south, 5.4)
    house.door(middle, 1.0, OperationType="SINGLE_SWING_LEFT")
    house.door(south, 3.0, OverallWidth=2050.0, OverallHeight=900.0)
    if slab:
        floor = house.box_solid((0, 0, -0.25), (7.6, 3.4, 0))
        house.product("IfcSlab", "Slab", [floor], (0, 0, bottom), PredefinedType="FLOOR")
    if spaces:
        house.space("Wohnzimmer", [(0.2, 0.2), (4.2, 0.2), (4.2, 3.2), (0.2, 3.2)], bottom, h)
        house.space("Küche", [(4.4, 0.2), (7.4, 0.2), (7.4, 3.2), (4.4, 3.2)], bottom, h)


def roof(house: IfcHouse, bottom: float) -> None:
    solid = house.box_solid((-0.3, -0.3, 0), (7.9, 3.7, 0.3))
    house.product("IfcSlab", "Roof", [solid], (0, 0, bottom), PredefinedType="ROOF")


def attic(
    house: IfcHouse, *, knee: float = 1.0, is_box: bool = True, has_space: bool = True, roof: Any = (),
    **fields: Any,
) -> None:  # fmt: skip
    """A room of 6 x 5 m under two slabs that slope by 45 degrees up to a ridge along x.

    knee: height of the walls under the eaves. is_box: the space is a box up to the ridge, else it ends
    at the slabs. roof: entity and the two slabs' names, empty for no roof. fields: of the slabs.
    """
    house.storey("Attic", 0.0)
    ridge = knee + 2.5
    for name, start, end in (
        ("South", (-0.3, -0.3), (6.3, -0.3)), ("North", (6.3, 5.3), (-0.3, 5.3)),
    ):  # fmt: skip
        if knee:
            house.wall(name, start, end, 0.0, knee, thick=0.3)
    # A gable is one wall, cut by the roof.
    gable = [(0, 0), (5, 0), (5, knee), (2.5, ridge), (0, knee)]
    gable = gable if knee else [(0, 0), (5, 0), (2.5, ridge)]
    for name, x in (("West", -0.3), ("East", 6.0)):
        house.product("IfcWall", name, [house.mesh_solid(*_prism_along_x(gable, x, x + 0.3))])
    floor = house.box_solid((-0.3, -0.3, -0.2), (6.3, 5.3, 0))
    house.product("IfcSlab", "Floor", [floor], PredefinedType="FLOOR")
    if roof:
        entity, *names = roof
        # The undersides pass through the knee walls' inner edges.
        south = [(-0.5, knee - 0.5), (2.5, ridge), (2.5, ridge + 0.25), (-0.5, knee - 0.25)]
        for name, sign in zip(names, (1, -1), strict=True):
            side = [(2.5 + sign * (y - 2.5), z) for y, z in south][::sign]
            solid = house.mesh_solid(*_prism_along_x(side, -0.5, 6.5))
            house.product(entity, name, [solid], **fields)
    if has_space:
        inside = [(0, 0), (5, 0), (5, ridge), (0, ridge)] if is_box else gable
        solid = house.mesh_solid(*_prism_along_x(inside, 0, 6))
        house.product("IfcSpace", "Studio", [solid], LongName="Studio")


def _prism_along_x(outline: Any, x0: float, x1: float) -> tuple[Any, Any]:
    """(points, triangles) of a convex outline in (y, z), counter-clockwise, extruded from x0 to x1."""
    n = len(outline)
    points = [(x, y, z) for x in (x0, x1) for y, z in outline]
    caps = [(0, k + 1, k) for k in range(1, n - 1)] + [
        (n, n + k, n + k + 1) for k in range(1, n - 1)
    ]
    sides = [(k, (k + 1) % n, n + k) for k in range(n)]
    sides += [((k + 1) % n, n + (k + 1) % n, n + k) for k in range(n)]
    return np.array(points, float), np.array(caps + sides)


def realistic_house(path: Path, n_triangles: int = 300_000) -> Path:
    """Three storeys of two rooms, 60 furnishings of many triangles, lamps, a stair, railings."""
    house = IfcHouse("mm")
    house.style("glass", (0.7, 0.85, 0.9), 0.7)
    house.style("frame", (0.9, 0.9, 0.9))
    house.style("plaster", (0.93, 0.92, 0.88))
    house.style("wood", (0.5, 0.33, 0.2))
    ball = _ball(max(int(np.sqrt(n_triangles / 60 / 2)), 3))
    words = (
        "Sessel",
        "Tisch",
        "Bett",
        "Schrank",
        "Sofa",
        "Regal",
        "Stuhl",
        "Kommode",
        "Pflanze",
        "Fernseher",
    )
    for k in range(3):
        bottom = 2.85 * k
        house.storey(f"{k}. OG", bottom)
        storey_of_two_rooms(house, bottom)
        for j in range(20):
            place = (0.6 + 0.7 * (j % 10) + 0.5 * (j % 10 > 4), 0.8 + 1.4 * (j // 10), bottom + 0.3)
            solid = house.mesh_solid(ball[0] * 0.3, ball[1], "wood")
            house.product("IfcFurniture", f"{words[j % 10]} {j}", [solid], place)
        lamp = house.box_solid((-0.1, -0.1, 0), (0.1, 0.1, 0.1))
        for x in (2.0, 6.0):
            house.product("IfcLightFixture", "Lampe", [lamp], (x, 1.7, bottom + 2.3))
    house.storey("Dach", 8.3)
    roof(house, 2.85 * 3 - 0.25)
    return house.save(path)


def _ball(side: int) -> tuple[Any, Any]:
    """(points, triangles) of a closed unit ball."""
    u = np.linspace(0, 2 * np.pi, side, endpoint=False)
    v = np.linspace(0, np.pi, side + 1)[1:-1]
    uu, vv = np.meshgrid(u, v, indexing="ij")
    points = np.stack([np.cos(uu) * np.sin(vv), np.sin(uu) * np.sin(vv), np.cos(vv)], -1).reshape(
        -1, 3
    )
    n = len(v)
    i, j = np.meshgrid(np.arange(side), np.arange(n - 1), indexing="ij")
    a, b = i * n + j, (i + 1) % side * n + j
    faces = np.stack([np.stack([a, a + 1, b + 1], -1), np.stack([a, b + 1, b], -1)], -2).reshape(
        -1, 3
    )
    top, low = len(points), len(points) + 1
    k = np.arange(side)
    nxt = (k + 1) % side
    caps = [np.stack([np.full(side, top), k * n, nxt * n], -1)]
    caps.append(np.stack([np.full(side, low), nxt * n + n - 1, k * n + n - 1], -1))
    return np.concatenate([points, [[0, 0, 1], [0, 0, -1]]]), np.concatenate([faces, *caps])
