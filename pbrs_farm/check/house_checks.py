"""house.json against house.glb's document and triangles, and repair.json. Effects: reads files."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from pbrs_farm.check.axes import into_frame, is_rigid
from pbrs_farm.check.cases import HouseCase
from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.checks import Check
from pbrs_farm.check.colours import linear_from_srgb
from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.plan import points_in_plan, polygon_area
from pbrs_farm.check.rules import judge
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import Triangles, json_of_glb
from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64, I64, Bools
from pbrs_farm.core.classes import NYU40_NAMES, WINDOW
from pbrs_farm.core.house import FLOATING

_STEP_M = 1.5  # maximum height of a sunken or raised floor over its level
_UNIT = 1e-6  # tolerance of a normal's length
_ACROSS = 1e-3  # tolerance of the cosine between an opening's normal and its sides
_OF_SEVERAL_FILES = ("suncg", "mjcf", "robot")
_MODEL_M = 1e-4  # between two instances of a model in its frame: float32 precision in the world
_BOX_M = 0.001  # tolerance of a box's sides
_FLOOR_M = 0.05  # height of rays above a floor, clear of carpets; tolerance below it
_FLOOR_SHARE = 0.5  # least share of a floor that rays meet: the rest may be covered, or a stairwell
_LIGHT_M = (
    0.05  # between a light and its surfaces beside its radius, as of a shade's ring about a bulb
)


def check_house(case: HouseCase) -> None:
    """Judge house.json, unless it is missing, against house.glb, repair.json and itself."""
    house, document = case.house, json_of_glb(case.glb)
    if not house.house:
        return
    scene = document["scenes"][document.get("scene", 0)]
    glb = {"sha256": hashlib.sha256(case.glb).hexdigest(), "scene": scene.get("name", "")}
    glb["house"] = document.get("extras", {}).get("house")
    json = {"id": None, "format": None, "glb_sha256": None, "name": None, **house.house}
    classes = {str(n): NYU40_NAMES[n] for n in {row["nyu40"] for row in house.items.values()}}
    is_finished = bool(house.repair) <= bool(json.get("is_repaired"))
    tally = case.tally
    judge("house", house.id, tally, json=json, house=house, glb=glb, is_finished=is_finished, classes=classes, format="pbrs_farm house 1")  # fmt: skip
    _check_items(house, document, tally)
    _check_materials(house, document, tally)
    _check_rooms(house, tally)
    _check_openings(house, tally)
    _check_source(house, document, tally)


def _check_items(house: StoredHouse, document: Mapping[str, Any], tally: Tally) -> None:
    """Each item is the node of its number, with its vertices, triangles and materials."""
    nodes, rows = document.get("nodes", []), house.house["items"]
    listed = document["scenes"][document.get("scene", 0)].get("nodes", [])
    expect = tally.at("house items", house.id)
    same = listed == list(range(len(nodes))) and len(rows) == len(nodes)
    expect(same, "the scene of house.glb does not show each item")
    # Ids of removed items may be used again.
    ids = [row["id"] for row in rows if "removed" not in row["tags"]]
    same = [row["instance"] for row in rows] == list(range(1, len(rows) + 1))
    same &= len(set(ids)) == len(ids)
    expect(same, "instances are not numbered 1, 2, ... with own ids")
    levels = {level["id"] for level in house.house["levels"]}
    for row, node in zip(rows, nodes, strict=False):
        place = f"{house.id} item {row['id']}"
        expect = tally.at("house items", place)
        extras = {name: row[name] for name in ("instance", "name", "kind", "nyu40", "class")}
        extras |= {"item": row["id"], "room": row["room_id"]}
        moves = sorted({"matrix", "translation", "rotation", "scale"} & node.keys())
        name = NYU40_NAMES[row["nyu40"]]
        judge("item", place, tally, node=node, extras=extras, row=row, moves=moves, none=[], name=name)  # fmt: skip
        is_room = row["room_id"] is None or row["room_id"] in house.rooms
        expect(is_room, f"is in {row['room_id']}, which is not a room")
        expect(row["level_id"] in levels, "is on no level")
        surfaces = [
            (s["n_vertices"], s["n_faces"], s["material"])
            for s in row["surfaces"]
            if s["n_vertices"]
        ]
        expect(_primitives(node, document) == surfaces, "has other surfaces in house.glb")
        # Outdoor items have a source class to themselves.
        is_outside = ("outside" in row["tags"]) == (row["source_class"] == "outside")
        expect(is_outside, "is outside by only one of its tags and its class")


def _primitives(node: Mapping[str, Any], document: Mapping[str, Any]) -> list[tuple[int, ...]]:
    """(vertices, triangles, material) of each primitive of a node."""
    accessors = document["accessors"]
    return [
        (
            accessors[p["attributes"]["POSITION"]]["count"],
            accessors[p["indices"]]["count"] // 3 if "indices" in p else 0,
            p["material"],
        )
        for p in (document["meshes"][node["mesh"]]["primitives"] if "mesh" in node else [])
    ]


def _check_materials(house: StoredHouse, document: Mapping[str, Any], tally: Tally) -> None:
    """Names, kinds, colours and pictures of materials are those of house.glb."""
    rows, stored = house.house["materials"], document.get("materials", [])
    expect = tally.at("materials", house.id)
    if not expect(len(rows) == len(stored), "differ in number"):
        return
    textures = house.house["textures"]
    texture_keys = {t["key"] for t in textures}
    expect(all(t["id"] == t["key"].partition("/")[0] for t in textures), "a texture's id is not its key")  # fmt: skip
    pictures = [t for t in textures if t["media_type"] in ("image/png", "image/jpeg")]
    images = [(i["name"], i["mimeType"]) for i in document.get("images", [])]
    same = images == [(t["name"] or t["id"], t["media_type"]) for t in pictures]
    expect(same, "textures are not the pictures of house.glb")
    picture_keys = [t["key"] for t in pictures]
    for row, material in zip(rows, stored, strict=True):
        place = f"{house.id} material {row['name']}"
        pbr = material["pbrMetallicRoughness"]
        colour = {"json": linear_from_srgb(row["diffuse"]), "glb": pbr["baseColorFactor"][:3]}
        judge("material", place, tally, row=row, material=material, colour=colour)
        for name, texture in (
            ("texture_id", pbr.get("baseColorTexture")),
            ("roughness_texture_id", pbr.get("metallicRoughnessTexture")),
            ("normal_texture_id", material.get("normalTexture")),
        ):
            expect = tally.at("materials", place)
            is_texture = row[name] is None or row[name] in texture_keys
            expect(is_texture, f"its {name} is not a texture of the house")
            in_json = row[name] if row[name] in picture_keys else None
            in_glb = None if texture is None else picture_keys[texture["index"]]
            expect(in_json == in_glb, f"has another {name} in house.glb")
        _check_finish(place, row, material, tally)


def _check_finish(
    place: str, row: Mapping[str, Any], material: Mapping[str, Any], tally: Tally
) -> None:
    """Roughness, opacity, holes and the normal map's scale of one material."""
    pbr, expect = material["pbrMetallicRoughness"], tally.at("materials", place)
    if row["kind"] == "mirror":
        roughness = 0.0
    elif row["roughness"] is not None:
        roughness = min(max(row["roughness"], 0.0), 1.0)
    elif row["roughness_texture_id"] is not None:
        roughness = 1.0
    else:
        roughness = (2 / (max(row["shininess"], 0.0) + 2)) ** 0.25
    judge("roughness", place, tally, pbr=pbr, roughness=roughness)
    alpha, mode = pbr["baseColorFactor"][3], material["alphaMode"]
    is_clear = row["kind"] in ("glass", "pane") or row["opacity"] < 1
    same = row["opacity"] >= 1 or abs(alpha - row["opacity"]) < 1e-6
    expect((mode == "BLEND") == is_clear and same, "has another opacity in house.glb")
    cutoff = material.get("alphaCutoff", material["extras"].get("alphaCutoff", 0.5))
    same = (mode == "MASK" or "alphaCutoff" in material["extras"]) == bool(row["alpha_cutout"])
    same &= not row["alpha_cutout"] or abs(cutoff - row.get("alpha_cutoff", 0.5)) < 1e-6
    expect(same, "has other holes in house.glb")
    if "normalTexture" in material:
        normal_map = {"scale": 1.0, **material["normalTexture"]}
        judge("normal map", place, tally, map=normal_map, row=row)


def _check_rooms(house: StoredHouse, tally: Tally) -> None:
    """Rooms are those of repair.json: names, light, enclosure, areas."""
    levels = {level["id"]: level["elevation"] for level in house.house["levels"]}
    repaired = {str(row["room_id"]): row for row in house.repair.get("rooms", [])}
    if house.repair:
        # The repair.json of an edited home names the home before its edits.
        name = house.repair.get("house_id", "")
        same = house.id == name or house.id.startswith(f"{name}-") or _is_derived(house)
        tally.expect("rooms", house.id, same, "repair.json is of another house")
    for name, room in house.rooms.items():
        place = f"{house.id} room {name}"
        expect = tally.at("rooms", place)
        expect(room["level_id"] in levels, "is on no level")
        off = abs(room["floor_y"] - levels.get(room["level_id"], room["floor_y"]))
        expect(off <= _STEP_M, f"its floor is {off:.2f} m off its level's")
        is_room = room["ceiling_y"] > room["floor_y"] and len(room["polygon"]) >= 3
        expect(is_room, "is not a room")
        row = repaired.get(name)
        if house.repair and expect(row is not None, "is not in repair.json"):
            area = polygon_area(np.array(room["polygon"], np.float64))
            judge("repaired room", place, tally, row=row, room=room, area=area)


def _check_openings(house: StoredHouse, tally: Tally) -> None:
    """Openings belong to doors and windows, and their normals are perpendicular to them."""
    ids = {row["id"]: row for row in house.items.values()}
    levels = {level["id"] for level in house.house["levels"]}
    panes = {k for k, m in enumerate(house.house["materials"]) if m["kind"] in ("pane", "glass")}
    for row in house.house["openings"]:
        expect = tally.at("openings", f"{house.id} opening {row['id']}")
        item = ids.get(row["item_id"])
        is_item = row["item_id"] is None or item is not None
        expect(is_item, f"is of {row['item_id']}, which is not an item")
        expect(row["level_id"] in levels, "is on no level")
        if item is not None:
            # A glazed door may be recorded as a window.
            is_glazed = not panes.isdisjoint(s["material"] for s in item["surfaces"])
            may_be_window = is_glazed or item["nyu40"] == WINDOW
            is_window = item["kind"] == "window"
            same = row["is_window"] == is_window or (row["is_window"] and may_be_window)
            expect(same, f"differs from its item, a {item['kind']}")
        quad, normal = np.array(row["quad"], np.float64), np.array(row["normal"], np.float64)
        sides = np.diff(quad, axis=0)
        lengths = np.maximum(np.linalg.norm(sides, axis=1), 1e-9)
        is_across = abs(np.linalg.norm(normal) - 1) <= _UNIT
        is_across &= np.abs(sides @ normal / lengths).max() <= _ACROSS
        expect(is_across, "its normal is not across it")


def _is_derived(house: StoredHouse) -> bool:
    """True if a plugin made the house of another one, with the same source and repair but a new id."""
    name = str(house.repair.get("house_id", ""))
    digest = house.house["source"]["sha256"][:8]
    return bool(name) and digest in name.split("-") and digest not in house.id.split("-")


def _check_source(house: StoredHouse, document: Mapping[str, Any], tally: Tally) -> None:
    """Source and credit are the same in house.json and house.glb."""
    source = house.house["source"]
    asset = {"extras": None, "copyright": "", **document.get("asset", {})}
    line = source["attribution"] or ", ".join(x for x in (source["author"], source["licence"]) if x)
    judge("source", house.id, tally, asset=asset, source=source, line=line)
    # Ids of homes hold a digest of their file, apart from those whose source is a digest of all files read.
    if not keys.is_object(house.id) and source["kind"] not in _OF_SEVERAL_FILES:
        same = source["sha256"][:8] in house.id.split("-") or _is_derived(house)
        tally.expect("credits", house.id, same, "its id does not match its source")


def check_solids(case: HouseCase) -> None:
    """Boxes, floors and bulbs of house.json are where the triangles of house.glb are."""
    house, triangles = case.house, case.rest.triangles
    for instance, row in sorted(house.items.items()):
        points = triangles.loose.get(instance)
        if points is None:
            continue
        if row["box"]:
            off = _box_off(row["box"], points.astype(np.float64))
            fault = f"its box differs by {off * 1000:.1f} mm from its triangles"
            case.expect("house items", f"item {row['id']}")(off <= _BOX_M, fault)
        if row["lights"]:
            _check_lights(case, instance)
    for name, room in house.rooms.items():
        if room["has_floor"]:
            share = _share_of_floor(room, case.rest.rays)
            fault = f"its floor is at another height below {1 - share:.0%} of it"
            case.expect("rooms", f"room {name}")(share >= _FLOOR_SHARE, fault)


def check_floating(case: HouseCase) -> None:
    """No edge of a floating item passes through a face of another one, nor the other way round."""
    house, triangles = case.house, case.rest.triangles
    hung = [n for n, row in house.items.items() if FLOATING in row["tags"]]
    if not hung:
        return
    floats = np.isin(triangles.instance, hung)
    begin, along = _edges(triangles, floats)
    owner = np.repeat(triangles.instance[floats], 3)
    touching = set(owner[_pierced(Rays(triangles, ~floats), begin, along) >= 0].tolist())
    # Of the other items, only the near triangles matter.
    corners = triangles.vertices[triangles.faces].astype(np.float64)
    low, high = begin.min(0), begin.max(0)
    near = ~floats & ((corners.max(1) >= low) & (corners.min(1) <= high)).all(1)
    face = _pierced(Rays(triangles, floats), *_edges(triangles, near))
    touching |= set(triangles.instance[face[face >= 0]].tolist())
    for instance in hung:
        expect = case.expect("floating", f"item {house.items[instance]['id']}")
        expect(instance not in touching, "is marked as hanging, but touches")


def _edges(triangles: Triangles, chosen: Bools) -> tuple[F64, F64]:
    """(3 F, 3) begins of the edges of some triangles, face by face, and the vectors to their ends."""
    corners = triangles.vertices[triangles.faces[chosen]].astype(np.float64)
    begin = corners.reshape(-1, 3)
    return begin, np.roll(corners, -1, axis=1).reshape(-1, 3) - begin


def _pierced(rays: Rays, begin: F64, along: F64) -> I64:
    """(N,) the triangle that each edge passes through, -1 = none."""
    face = rays.first(begin, along)
    return np.where(rays.distance(face, begin, along) <= 1, face, -1)


def _box_off(box: Mapping[str, Any], points: F64) -> float:
    """Largest error in metres of the sides of a box of house.json, whose axes are columns."""
    axes = np.array(box["axes"], np.float64)
    local = (points - np.array(box["centre"])) @ axes
    half = np.array(box["half"], np.float64)
    return float(np.abs([local.min(0) + half, local.max(0) - half]).max())


def _check_lights(case: HouseCase, instance: int) -> None:
    """Lights are at their surfaces, and repair.json has the same measures of them."""
    house, row = case.house, case.house.items[instance]
    place = f"{house.id} item {row['id']}"
    expect = case.tally.at("lights", place)
    measured = {(r["item_id"], r["source"]): r for r in house.repair.get("sources", [])}
    total = sum(light["share"] for light in row["lights"])
    judge("lights of an item", place, case.tally, total=total)
    for k, light in enumerate(row["lights"]):
        exist = all(0 <= n < len(row["surfaces"]) for n in light["emitting"])
        if not expect(exist, "emits from a missing surface"):
            continue
        materials = {row["surfaces"][n]["material"] for n in light["emitting"]}
        kinds = {house.house["materials"][m]["kind"] for m in materials}
        expect(kinds <= {"bulb"}, f"emits from {sorted(kinds)}")
        points = case.rest.triangles.points_of_surfaces(instance, light["emitting"])
        if len(points):
            low, high = points.min(0), points.max(0)
            outside = np.maximum(np.maximum(low - light["position"], light["position"] - high), 0)
            off = float(np.linalg.norm(outside))
            fault = f"light {k} is {off:.2f} m from its emitter"
            expect(off <= _LIGHT_M + light["radius_m"], fault)
        source = measured.get((row["id"], k))
        if source is not None:
            measures = [[r["escape"], r["radius_m"]] for r in (source, light)]
            judge("repaired light", place, case.tally, measures=measures, k=k)


def _share_of_floor(room: Mapping[str, Any], rays: Rays) -> float:
    """Share of a grid of points of a room that have the floor at its height below them."""
    points = points_in_plan(room["polygon"], 12, room["floor_y"] + _FLOOR_M, inner=True)
    if not len(points):
        return 1.0
    down = np.broadcast_to([0.0, -1.0, 0.0], points.shape)
    face = rays.first(points, down)
    return float(((face >= 0) & (rays.distance(face, points, down) <= 2 * _FLOOR_M)).mean())


def check_models(case: HouseCase) -> None:
    """Poses of placed models are rigid, and bring all instances of a model to the same points."""
    first: dict[str, tuple[str, F64]] = {}
    several = set[str]()
    for instance, row in sorted(case.house.items.items()):
        if not row.get("pose"):
            continue
        expect = case.expect("model poses", f"item {row['id']}")
        pose = np.array(row["pose"]["world_from_model"], np.float64)
        if not expect(is_rigid(pose), "has no rigid pose"):
            continue
        points = case.rest.triangles.loose.get(instance)
        if points is None:
            continue
        local = into_frame(pose, points.astype(np.float64))
        name, model = first.setdefault(row["pose"]["model"], (row["id"], local))
        if name != row["id"]:
            several.add(row["pose"]["model"])
            same = model.shape == local.shape and np.abs(model - local).max() <= _MODEL_M
            fault = f"is not where its pose brings {row['pose']['model']}, as {name} has it"
            expect(same, fault)
    for _model in first.keys() - several:
        case.tally.leave_out(
            "positions of a model's origin, of models with one instance in their home"
        )


CHECKS = (
    Check("house", "house", check_house, 1, ("house.json",)),
    Check("model poses", "house", check_models, 2, ("house.json",)),
    Check("floating", "house", check_floating, 3, ("house.json",)),
    Check("house items", "house", check_solids, 4, ("house.json",)),
)
