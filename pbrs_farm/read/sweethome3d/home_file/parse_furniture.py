"""Furniture elements (pieces, doors, windows, lights, shelf units) -> PlanPiece. No effects."""

from __future__ import annotations

from pbrs_farm.core.checked_json import json_from_bytes
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.joints import JOINTS_PROPERTY, Joint
from pbrs_farm.formats.serialise import value_from_json
from pbrs_farm.read.sweethome3d.home_file.home_xml import DoorFrame, Paint, PlanLight, PlanPiece
from pbrs_farm.read.sweethome3d.home_file.parse_paints import piece_paint
from pbrs_farm.read.sweethome3d.home_file.xml_attributes import Attributes

FULL_CUT_OUT = "M0,0 v1 h1 v-1 z"  # the unit square: the whole opening


def parse_piece(a: Attributes, level: str, group: str = "") -> PlanPiece:
    """A piece by its XML element, of a level (its own or its group's) and a group or ""; BadHouse."""
    element = a.element
    return PlanPiece(
        tag=element.tag,
        place=a.place,
        level=level,
        catalogue_id=a.text("catalogId"),
        name=a.text("name"),
        model=a.text("model"),
        centre=(a.metres("x"), a.metres("y")),
        elevation=a.metres("elevation", 0.0),
        angle=a.number("angle", 0.0),
        pitch=a.number("pitch", 0.0),
        roll=a.number("roll", 0.0),
        size=(a.length("width"), a.length("depth"), a.length("height")),
        height_in_plan=a.optional_metres("heightInPlan"),
        is_mirrored=a.flag("modelMirrored", False),
        rotation=a.numbers("modelRotation", 9),
        paint=piece_paint(a),
        materials=_materials(a),
        transformations=_transformations(a),
        frame=_parse_door_frame(a) if _is_opening(a) else None,
        lights=_parse_lights(a) if element.tag == "light" else (),
        light_materials=tuple(e.get("name", "") for e in element.findall("lightSourceMaterial")),
        power=a.within("power", 0.5, 0.0, 10.0) if element.tag == "light" else 0.0,
        staircase_cut_out=a.text("staircaseCutOutShape"),
        group=group,
        joints=_joints(a),
    )


def _is_opening(a: Attributes) -> bool:
    return a.element.tag == "doorOrWindow" or a.flag("doorOrWindow", False)


def _materials(a: Attributes) -> tuple[tuple[str, Paint], ...]:
    materials = []
    for element in a.element.findall("material"):
        name = element.get("name", "")
        inner = Attributes(a.file, f"{a.place} material '{name}'", element, a.max_extent_m)
        materials.append((name, piece_paint(inner)))
    return tuple(materials)


def _transformations(a: Attributes) -> tuple[tuple[str, tuple[float, ...]], ...]:
    transformations = []
    for element in a.element.findall("transformation"):
        name = element.get("name", "")
        inner = Attributes(a.file, f"{a.place} transformation '{name}'", element, a.max_extent_m)
        matrix = inner.numbers("matrix", 12)
        if matrix is not None:
            transformations.append((name, matrix))
    return tuple(transformations)


def _joints(a: Attributes) -> tuple[Joint, ...]:
    for element in a.element.findall("property"):
        if element.get("name") == JOINTS_PROPERTY:
            place = f"{a.file}, {a.place}, {JOINTS_PROPERTY}"
            data = json_from_bytes(element.get("value", "").encode("utf-8", "replace"), place)
            joints = value_from_json(tuple[Joint, ...], data, place)
            for joint in joints:
                if not _is_unit(joint.axis) or joint.lower > joint.upper:
                    raise BadHouse(place, joint.part[:60], "its axis or its limits are none")
            return joints
    return ()


def _is_unit(axis: tuple[float, float, float]) -> bool:
    return abs(sum(v * v for v in axis) - 1.0) < 1e-6


def _parse_door_frame(a: Attributes) -> DoorFrame:
    return DoorFrame(
        cut_out=a.text("cutOutShape", FULL_CUT_OUT),
        wall_width=a.within("wallWidth", 1.0, -1.0, 2.0),
        wall_left=a.within("wallLeft", 0.0, -1.0, 2.0),
        wall_height=a.within("wallHeight", 1.0, -1.0, 2.0),
        wall_top=a.within("wallTop", 0.0, -1.0, 2.0),
        cuts_both_sides=a.flag("wallCutOutOnBothSides", False),
    )


def _fraction(a: Attributes, name: str) -> float:
    return a.within(name, 0.5, -10.0, 10.0)


def _parse_lights(a: Attributes) -> tuple[PlanLight, ...]:
    lights = []
    for k, element in enumerate(a.element.findall("lightSource")):
        inner = Attributes(a.file, f"{a.place} lightSource #{k}", element, a.max_extent_m)
        colour = inner.argb("color")
        lights.append(
            PlanLight(
                (_fraction(inner, "x"), _fraction(inner, "y"), _fraction(inner, "z")),
                (1.0, 1.0, 1.0) if colour is None else colour[1],
                None if inner.optional("diameter") is None else inner.within("diameter", 0, 0, 2),
            )
        )
    return tuple(lights)
