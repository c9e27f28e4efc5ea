"""A house's files against each other: house.json and house.glb, rooms, lamps, sky, the choice of views.

Effects: reads files.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.embree_caster import Floats
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.core import keys
from pbrs_farm.core.classes import NYU40_NAMES

AREA = 0.002  # of a room's floor area, beside half a square decimetre of rounding
STEP_M = 1.5  # of a room's floor against its level's: sunken and raised floors


def check_house(house: StoredHouse, document: Mapping[str, Any], digest: str, tally: Tally) -> None:
    """Judge house.json against house.glb (its JSON: document; its sha256: digest), repair.json and itself.

    Nothing is judged where house.json is missing: the checks of files say so.
    """
    held = house.house
    if not held:
        return
    tally.expect("house", house.id, held.get("id") == house.id, f"is told to be {held.get('id')}")
    same = held.get("format") == "pbrs_farm house 1" and bool(house.repair) <= bool(
        held.get("is_repaired")
    )
    tally.expect("house", house.id, same, "is no finished house of a known format")
    same = held.get("glb_sha256") == digest
    tally.expect("house", house.id, same, "house.glb is not the one it was written with")
    scene = document["scenes"][document.get("scene", 0)].get("name", "")
    told = document.get("extras", {}).get("house")
    same = (scene, told) == (held.get("name"), house.id)
    tally.expect("house", house.id, same, f"is {held.get('name')!r}, in house.glb {scene!r}")
    told = {str(n): NYU40_NAMES[n] for n in {row["nyu40"] for row in house.items.values()}}
    tally.expect(
        "house", house.id, held.get("classes") == told, "classes are not those of its items"
    )
    _check_items(house, document, tally)
    _check_materials(house, document, tally)
    _check_rooms(house, tally)
    _check_openings(house, tally)
    _check_source(house, document, tally)


def _check_items(house: StoredHouse, document: Mapping[str, Any], tally: Tally) -> None:
    """Each item is the node of its number, with as many vertices and triangles of the same materials."""
    nodes = document.get("nodes", [])
    rows = house.house["items"]
    listed = document["scenes"][document.get("scene", 0)].get("nodes", [])
    same = listed == list(range(len(nodes))) and len(rows) == len(nodes)
    tally.expect("house items", house.id, same, "the scene of house.glb does not show each item")
    numbers = [row["instance"] for row in rows]
    same = numbers == list(range(1, len(rows) + 1)) and _are_unique(rows)
    tally.expect("house items", house.id, same, "instances are not numbered 1, 2, ... with own ids")
    levels = {level["id"] for level in house.house["levels"]}
    for row, node in zip(rows, nodes, strict=False):
        place = f"{house.id} item {row['id']}"
        extras = {
            "instance": row["instance"], "item": row["id"], "name": row["name"],
            "kind": row["kind"], "nyu40": row["nyu40"], "class": row["class"], "room": row["room_id"],
        }  # fmt: skip
        same = node["extras"] == extras and node["name"] == row["id"]
        tally.expect("house items", place, same, "is another in house.glb")
        same = not ({"matrix", "translation", "rotation", "scale"} & node.keys())
        tally.expect("house items", place, same, "is moved by its node")
        same = row["class"] == NYU40_NAMES[row["nyu40"]]
        tally.expect("house items", place, same, f"class {row['class']} is not {row['nyu40']}")
        same = row["room_id"] is None or row["room_id"] in house.rooms
        tally.expect("house items", place, same, f"stands in {row['room_id']}, which is no room")
        tally.expect("house items", place, row["level_id"] in levels, "stands on no level")
        _check_surfaces(place, row, node, document, tally)
        # What stands before the windows is of its own class of the source.
        same = ("outside" in row["tags"]) == (row["source_class"] == "outside")
        tally.expect("house items", place, same, "is outside by its tags or its class alone")


def _are_unique(rows: list[dict[str, Any]]) -> bool:
    """No two items share an id, but for those that an edit took away: theirs are free."""
    ids = [row["id"] for row in rows if "removed" not in row["tags"]]
    return len(set(ids)) == len(ids)


def _check_surfaces(
    place: str, row: Mapping[str, Any], node: Mapping[str, Any], document: Mapping[str, Any],
    tally: Tally,
) -> None:  # fmt: skip
    stored = document["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []
    accessors = document["accessors"]
    counts = [
        (
            accessors[p["attributes"]["POSITION"]]["count"],
            accessors[p["indices"]]["count"] // 3 if "indices" in p else 0,
            p["material"],
        )
        for p in stored
    ]
    told = [
        (s["n_vertices"], s["n_faces"], s["material"]) for s in row["surfaces"] if s["n_vertices"]
    ]
    tally.expect("house items", place, counts == told, "has other surfaces in house.glb")


def _check_materials(house: StoredHouse, document: Mapping[str, Any], tally: Tally) -> None:
    """Names, kinds, colours and pictures of materials are those of house.glb."""
    rows, stored = house.house["materials"], document.get("materials", [])
    if not tally.expect("materials", house.id, len(rows) == len(stored), "are not as many"):
        return
    textures = house.house["textures"]
    keys_of_textures = {t["key"] for t in textures}
    same = all(t["id"] == t["key"].partition("/")[0] for t in textures)
    tally.expect("materials", house.id, same, "a texture's id is not its key")
    shown = [t["key"] for t in textures if t["media_type"] in ("image/png", "image/jpeg")]
    images = document.get("images", [])
    same = [i["name"] for i in images] == [
        t["name"] or t["id"] for t in textures if t["key"] in shown
    ] and [i["mimeType"] for i in images] == [
        t["media_type"] for t in textures if t["key"] in shown
    ]
    tally.expect("materials", house.id, same, "textures are not the pictures of house.glb")
    for row, other in zip(rows, stored, strict=True):
        place = f"{house.id} material {row['name']}"
        pbr = other["pbrMetallicRoughness"]
        same = row["name"] == other["name"] and row["kind"] == other["extras"]["kind"]
        tally.expect("materials", place, same, f"is {other['name']} in house.glb")
        srgb = np.clip(np.array(row["diffuse"], np.float64), 0, 1)
        linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
        same = bool(np.abs(linear - pbr["baseColorFactor"][:3]).max() <= 1e-5)
        tally.expect("materials", place, same, "has another colour in house.glb")
        for name, texture in (
            ("texture_id", pbr.get("baseColorTexture")),
            ("roughness_texture_id", pbr.get("metallicRoughnessTexture")),
            ("normal_texture_id", other.get("normalTexture")),
        ):
            found = None if texture is None else shown[texture["index"]]
            same = row[name] is None or row[name] in keys_of_textures
            tally.expect("materials", place, same, f"its {name} is no texture of the house")
            told = row[name] if row[name] in shown else None
            tally.expect("materials", place, told == found, f"has another {name} in house.glb")
        _check_finish(place, row, other, tally)


def _check_finish(
    place: str, row: Mapping[str, Any], other: Mapping[str, Any], tally: Tally
) -> None:
    """Roughness, opacity, holes and the normal map's scale of one material."""
    rough = other["pbrMetallicRoughness"]["roughnessFactor"]
    if row["kind"] == "mirror":
        expected = 0.0
    elif row["roughness"] is not None:
        expected = min(max(row["roughness"], 0.0), 1.0)
    elif row["roughness_texture_id"] is not None:
        expected = 1.0
    else:
        expected = (2 / (max(row["shininess"], 0.0) + 2)) ** 0.25
    tally.expect("materials", place, abs(rough - expected) <= 1e-6, "is as rough as another")
    alpha, mode = other["pbrMetallicRoughness"]["baseColorFactor"][3], other["alphaMode"]
    is_clear = row["kind"] in ("glass", "pane") or row["opacity"] < 1
    same = (mode == "BLEND") == is_clear and (
        row["opacity"] >= 1 or abs(alpha - row["opacity"]) < 1e-6
    )
    tally.expect("materials", place, same, "lets through what another does")
    cut = other.get("alphaCutoff", other["extras"].get("alphaCutoff", 0.5))
    same = (mode == "MASK" or "alphaCutoff" in other["extras"]) == bool(row["alpha_cutout"])
    same &= not row["alpha_cutout"] or abs(cut - row.get("alpha_cutoff", 0.5)) < 1e-6
    tally.expect("materials", place, same, "has other holes in house.glb")
    if "normalTexture" in other:
        same = abs(other["normalTexture"].get("scale", 1.0) - row["normal_scale"]) < 1e-6
        tally.expect("materials", place, same, "is bent otherwise in house.glb")


def _check_rooms(house: StoredHouse, tally: Tally) -> None:
    """Rooms are those of repair.json: names, how they are lit and closed, areas."""
    levels = {level["id"]: level["elevation"] for level in house.house["levels"]}
    repaired = {str(row["room_id"]): row for row in house.repair.get("rooms", [])}
    if house.repair:
        # Of an edited home it tells of the home before its edits.
        told = house.repair.get("house_id", "")
        same = house.id == told or house.id.startswith(f"{told}-") or _is_derived(house)
        tally.expect("rooms", house.id, same, "repair.json is of another house")
    for name, room in house.rooms.items():
        place = f"{house.id} room {name}"
        tally.expect("rooms", place, room["level_id"] in levels, "is on no level")
        off = abs(room["floor_y"] - levels.get(room["level_id"], room["floor_y"]))
        what = f"its floor is {off:.2f} m off its level's"
        tally.expect("rooms", place, off <= STEP_M, what)
        same = room["ceiling_y"] > room["floor_y"] and len(room["polygon"]) >= 3
        tally.expect("rooms", place, same, "is no room")
        row = repaired.get(name)
        if house.repair and tally.expect("rooms", place, row is not None, "is not in repair.json"):
            assert row is not None
            same = all(row[k] == room[k] for k in ("name", "enclosure", "lit_by"))
            same &= row["reason"] == room["enclosure_reason"]
            tally.expect("rooms", place, same, "is another in repair.json")
            area = polygon_area(np.array(room["polygon"], np.float64))
            what = f"has {row['floor_area_m2']} m2 in repair.json, here {area:.2f}"
            same = abs(row["floor_area_m2"] - area) <= 0.006 + AREA * area
            tally.expect("rooms", place, same, what)


def polygon_area(points: Floats) -> float:
    """m2 of a simple polygon (N, 2), by the sum of its trapezia."""
    x, z = points.T
    return float(abs((x * np.roll(z, -1) - np.roll(x, -1) * z).sum()) / 2)


def _check_openings(house: StoredHouse, tally: Tally) -> None:
    """An opening is of a door or window, its normal is across it."""
    ids = {row["id"]: row for row in house.items.values()}
    levels = {level["id"] for level in house.house["levels"]}
    for row in house.house["openings"]:
        place = f"{house.id} opening {row['id']}"
        item = ids.get(row["item_id"])
        same = row["item_id"] is None or item is not None
        tally.expect("openings", place, same, f"is of {row['item_id']}, which is no item")
        tally.expect("openings", place, row["level_id"] in levels, "is on no level")
        if item is not None:
            same = (item["kind"] == "window") == row["is_window"]
            tally.expect("openings", place, same, f"is no {item['kind']}'s")
        quad, normal = np.array(row["quad"], np.float64), np.array(row["normal"], np.float64)
        sides = np.diff(quad, axis=0)
        lengths = np.maximum(np.linalg.norm(sides, axis=1), 1e-9)
        same = bool(abs(np.linalg.norm(normal) - 1) <= 1e-6)
        same &= bool(np.abs(sides @ normal / lengths).max() <= 1e-3)
        tally.expect("openings", place, same, "its normal is not across it")


def _is_derived(house: StoredHouse) -> bool:
    """A plugin made it of another home, which has its source and its repair, under an id of its own."""
    told = str(house.repair.get("house_id", ""))
    digest = house.house["source"]["sha256"][:8]
    return bool(told) and digest in told.split("-") and digest not in house.id.split("-")


def _check_source(house: StoredHouse, document: Mapping[str, Any], tally: Tally) -> None:
    """Source and credit are the same in house.json, house.glb and each line of the manifest."""
    source, asset = house.house["source"], document.get("asset", {})
    place = house.id
    tally.expect("credits", place, asset.get("extras") == source, "house.glb tells another source")
    line = source["attribution"] or ", ".join(x for x in (source["author"], source["licence"]) if x)
    same = asset.get("copyright", "") == line
    tally.expect("credits", place, same, "house.glb carries another credit")
    # Ids of homes have their source's digest in them; SUNCG's are its own.
    if not keys.is_object(house.id) and source["kind"] != "suncg":
        same = source["sha256"][:8] in house.id.split("-") or _is_derived(house)
        tally.expect("credits", place, same, "its id is not of that source")
