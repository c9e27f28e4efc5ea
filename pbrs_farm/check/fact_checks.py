"""What view.json tells against the files that say the same: house.json, cameras.json, illuminance.json, recipe, markers.

Effects: reads files. No ray is cast: names, classes, poses, corners of rooms, facts of light. What a file
does not have is not asked.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.embree_caster import Floats
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core import keys
from pbrs_farm.core.classes import NYU13_FROM_NYU40, NYU13_NAMES
from pbrs_farm.core.house import FLOATING
from pbrs_farm.core.recipe import groups_of_step, picture_groups

SAME = 1e-9  # of numbers that two files repeat
POSE = 1e-6  # of a product of two poses: metres, and parts of a rotation
LAYOUT_PX = 0.01  # of a corner that is projected again
CORNER_M = 0.05  # by which a corner that is seen may lie behind what its pixel shows
TIE_M = 0.01  # about that, where either answer holds

# Field of a row of instances -> field of the item's row in house.json.
ROW_FIELDS: Mapping[str, str] = {
    "item": "id", "name": "name", "kind": "kind", "nyu40": "nyu40", "class": "class",
    "source_class": "source_class", "room": "room_id",
}  # fmt: skip
# Integrator of the recipe -> as view.json may call it.
INTEGRATORS: Mapping[str, tuple[str, ...]] = {
    "path": ("path", "mitsuba path"),
    "metropolis": ("pssmlt-camera",),
}
_STEPS = ("light", "develop", "opengl_dl", "opengl_il")


def check_facts(
    view: StoredView, house: StoredHouse, arrays: Mapping[str, NDArray[Any]], tally: Tally
) -> None:
    """Judge every fact of view.json that another stored file repeats, or that follows from others.

    arrays: the view's layers by name, depth among them.
    """
    table, place = view.table, view.place
    tally.expect("facts", place, table["house"] == house.id, f"is told to be of {table['house']}")
    name = view.folder.name
    tally.expect("facts", place, table["view"] == name, f"is told to be view {table['view']}")
    _check_recipe(view, house, tally)
    _check_camera_row(view, house, tally)
    for row in table["instances"]:
        _check_names(view, house, row, tally)
        if "world_from_model" in row or "model" in row:
            _check_model_pose(view, house, row, tally)
        elif house.items.get(int(row["id"]), {}).get("pose"):
            tally.expect("model poses", f"{place} instance {row['id']}", False, "lacks its pose")
    _check_tables(view, house, tally)
    if "layout" in table:
        _check_layout(view, house, arrays["depth"], tally)
    _check_markers(view, house, tally)
    if table.get("modes", {}).get("light"):
        _check_light_facts(view, house, tally)


def _check_recipe(view: StoredView, house: StoredHouse, tally: Tally) -> None:
    if not house.recipe or "recipe" not in view.table:
        return
    told, own = view.table["recipe"], _digest(house.recipe, picture_groups())
    what = f"tells of recipe {told}, that of recipe.json is {own}"
    tally.expect("recipe", view.place, told == own, what)


def _digest(recipe: Mapping[str, Any], groups: tuple[str, ...]) -> str:
    fields = {g: recipe[g] for g in ("seed", *groups) if recipe.get(g) is not None}
    return keys.digest(fields)


def _check_camera_row(view: StoredView, house: StoredHouse, tally: Tally) -> None:
    """Pose, K, lens, and how the view was found are those of cameras.json."""
    if not house.camera_rows:
        return
    row = house.camera_rows.get(view.folder.name)
    if not tally.expect("camera file", view.place, row is not None, "is not in cameras.json"):
        return
    assert row is not None
    table, held = view.table, row["intrinsics"]
    for name in ("room", "sector", "origin", "score", "frame", "time_s", "rig", "left"):
        same = table.get(name) == row.get(name)
        what = f"{name} is {table.get(name)}, in cameras.json {row.get(name)}"
        tally.expect("camera file", view.place, same, what)
    stored = np.array(row["world_from_camera_opengl"], np.float64)
    same = bool(np.abs(stored - np.array(table["world_from_camera_opengl"])).max() <= SAME)
    tally.expect("camera file", view.place, same, "has another pose in cameras.json")
    height, width = view.size
    x, y = width / held["width_px"], height / held["height_px"]
    k = np.array(
        [[held["fx"] * x, 0, held["cx"] * x], [0, held["fy"] * y, held["cy"] * y], [0, 0, 1]]
    )
    same = bool(np.abs(k - view.k).max() <= 1e-6)
    tally.expect("camera file", view.place, same, "has another K in cameras.json")
    same = table.get("lens") == held.get("lens")
    tally.expect("camera file", view.place, same, "has another lens in cameras.json")
    if view.lens is not None:
        planar = "planar" if view.lens.model == "radtan" else "distance"
        what = f"depth is told to be {table.get('depth')} of a {view.lens.model}"
        tally.expect("camera file", view.place, table.get("depth") == planar, what)
    if house.recipe:
        image = house.recipe["image"]
        same = (width, height) == (image["width_px"], image["height_px"])
        tally.expect(
            "recipe", view.place, same, f"has {width} x {height} px, the recipe another size"
        )


def _check_names(view: StoredView, house: StoredHouse, row: dict[str, Any], tally: Tally) -> None:
    """A row of instances tells of the item what house.json tells; its NYU13 class follows from NYU40's."""
    place = f"{view.place} instance {row['id']}"
    nyu13 = int(NYU13_FROM_NYU40[int(row["nyu40"])])
    same = (row["nyu13"], row["class13"]) == (nyu13, NYU13_NAMES[nyu13])
    tally.expect("names", place, same, f"is {row['class13']} of NYU13, not {NYU13_NAMES[nyu13]}")
    if not house.items:
        return
    item = house.items.get(int(row["id"]))
    if not tally.expect("names", place, item is not None, "is no item of house.json"):
        return
    assert item is not None
    for own, stored in ROW_FIELDS.items():
        what = f"{own} is {row[own]}, in house.json {item[stored]}"
        tally.expect("names", place, row[own] == item[stored], what)
    told, floats = row.get("floating", False), FLOATING in item["tags"]
    what = f"floating is {told}, the tags of house.json say {floats}"
    tally.expect("names", place, told is floats, what)


def _check_model_pose(
    view: StoredView, house: StoredHouse, row: dict[str, Any], tally: Tally
) -> None:
    """A model's pose is rigid, that of house.json, and the two that BOP takes agree."""
    place = f"{view.place} instance {row['id']}"
    pose = np.array(row["world_from_model"], np.float64)
    seen = np.array(row["camera_from_model_opencv"], np.float64)
    if not tally.expect("model poses", place, pose.shape == seen.shape == (4, 4), "is no pose"):
        return
    tally.expect("model poses", place, is_rigid(pose), "world_from_model is not rigid")
    expected = np.linalg.inv(view.world_from_camera) @ pose
    off = float(np.abs(seen - expected).max())
    what = f"camera_from_model_opencv is off by {off:.2g} from what both other poses give"
    tally.expect("model poses", place, off <= POSE, what)
    stored = house.items.get(int(row["id"]), {}).get("pose")
    if house.items:
        same = stored is not None and stored["model"] == row["model"]
        tally.expect("model poses", place, same, f"{row['model']} is not its model in house.json")
        same = stored is not None and (
            np.abs(np.array(stored["world_from_model"]) - pose).max() <= SAME
        )
        tally.expect("model poses", place, bool(same), "has another pose in house.json")


def is_rigid(pose: Floats) -> bool:
    """Whether a (4, 4) matrix turns and moves, and does nothing else."""
    rotation = pose[:3, :3]
    is_turn = (
        np.abs(rotation @ rotation.T - np.eye(3)).max() <= POSE and np.linalg.det(rotation) > 0
    )
    return bool(is_turn and (pose[3] == [0, 0, 0, 1]).all())


def _check_tables(view: StoredView, house: StoredHouse, tally: Tally) -> None:
    """Ids of materials and of the source's classes stand for what house.json tells."""
    if not house.house:
        return
    if "materials" in view.table:
        expected = {
            str(k): {"name": m["name"], "kind": m["kind"]}
            for k, m in enumerate(house.house["materials"], start=1)
        }
        same = view.table["materials"] == expected
        tally.expect("tables", view.place, same, "materials are not those of house.json")
    if "source_classes" in view.table:
        named = sorted({row["source_class"] for row in house.items.values()} - {""})
        expected_classes = {str(k): name for k, name in enumerate(named, start=1)}
        same = view.table["source_classes"] == expected_classes
        tally.expect("tables", view.place, same, "source_classes are not those of house.json")


def _check_layout(view: StoredView, house: StoredHouse, depth: NDArray[Any], tally: Tally) -> None:
    """Corners of the room's polygon at its floor and ceiling, projected again."""
    room = house.rooms.get(str(view.table.get("room")))
    if not house.rooms:
        return
    if not tally.expect("layout", view.place, room is not None, "its room is not in house.json"):
        return
    assert room is not None
    expected = [
        (number, at, [x, room[y], z])
        for at, y in (("floor", "floor_y"), ("ceiling", "ceiling_y"))
        for number, (x, z) in enumerate(room["polygon"])
    ]
    rows = view.table["layout"]
    if not tally.expect("layout", view.place, len(rows) == len(expected), "lacks corners"):
        return
    points = np.array([world for _number, _at, world in expected], np.float64)
    local = (points - view.world_from_camera[:3, 3]) @ view.world_from_camera[:3, :3]
    pixels, depths = view.pixels_and_depths(local)
    for row, (number, at, world), pixel, z in zip(rows, expected, pixels, depths, strict=True):
        place = f"{view.place} layout {at} {number}"
        same = (row["corner"], row["at"]) == (number, at)
        same &= bool(np.abs(np.array(row["world"]) - world).max() <= POSE)
        tally.expect("layout", place, same, "is not the room's corner")
        is_seen = bool(np.isfinite(pixel).all() and (z > 1e-6 or view.lens is not None))
        if is_seen != (row["pixel"] is not None):
            same = bool(abs(z) < 1e-3) if np.isfinite(z) else view.lens is not None
        else:
            # Far beyond the edge, rounding is magnified.
            slack = LAYOUT_PX * (1 + np.abs(pixel).max() / max(view.size)) if is_seen else 0.0
            same = not is_seen or bool(np.abs(np.array(row["pixel"]) - pixel).max() <= slack)
        tally.expect("layout", place, same, f"lies at {row['pixel']}, here {pixel.tolist()}")
        answers = _corner_is_seen(pixel, float(z), depth) if is_seen else {False}
        what = f"is told to be {'seen' if row['visible'] else 'hidden'}"
        tally.expect("layout", place, bool(row["visible"]) in answers, what)


def _corner_is_seen(pixel: Floats, z: float, depth: NDArray[Any]) -> set[bool]:
    """Whether a corner is seen: no pixel around it must be nearer; both where it is close."""
    height, width = depth.shape
    found = set()
    # On the edge between two pixels it is either's.
    for dx, dy in ((0, 0), (1e-4, 1e-4), (-1e-4, -1e-4)):
        column, row = (int(np.floor(v)) for v in pixel + np.array([dx, dy]))
        if not (0 <= column < width and 0 <= row < height):
            found.add(False)
            continue
        around = depth[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2] / 1000
        farthest = float(np.where(around > 0, around, np.inf).max())
        found |= {farthest >= z - CORNER_M + slack for slack in (-TIE_M, TIE_M)}
    return found


def _check_markers(view: StoredView, house: StoredHouse, tally: Tally) -> None:
    """What view.json repeats of the markers of its steps stands there, too."""
    name = view.folder.name
    modes = view.table.get("modes", {})
    for step in _STEPS:
        told = house.told_by_marker(step, name)
        if not told and step not in modes:
            continue
        if not told:
            continue  # a marker without facts repeats nothing
        for key in sorted(told.keys() | modes.get(step, {}).keys()):
            same = modes.get(step, {}).get(key) == told.get(key)
            what = f"modes.{step}.{key} is not what the step's marker tells"
            tally.expect("markers", view.place, same, what)
    for key, value in house.told_by_marker("truth", name).get("table", {}).items():
        what = f"{key} is not what the marker of truth tells"
        tally.expect("markers", view.place, view.table.get(key) == value, what)


def _check_light_facts(view: StoredView, house: StoredHouse, tally: Tally) -> None:
    """Lux, sky, warnings and seed of a view's light."""
    light, room = view.table["modes"]["light"], str(view.table.get("room"))
    place = view.place
    if house.illuminance:
        row = house.lux_rows.get(room)
        if row is not None:
            lux = {"outdoor": row["outdoor_lx"], "indoor": row["indoor_lx"]}
            what = f"floor_lux is {light.get('floor_lux')}, in illuminance.json {lux}"
            tally.expect("light facts", place, light.get("floor_lux") == lux, what)
            same = light.get("warnings") == row["warnings"]
            tally.expect("light facts", place, same, "warnings are not those of illuminance.json")
        same = light.get("sky") == house.illuminance["sky"]
        tally.expect("light facts", place, same, "another sky than illuminance.json")
    lines = [*light.get("warnings", []), *light.get("dark", [])]
    same = view.table.get("warnings", []) == list(dict.fromkeys(lines))
    tally.expect("light facts", place, same, "warnings are not those of its light")
    if not house.recipe:
        return
    fields = house.recipe["light"]
    # All frames that one eye takes share a seed.
    name, is_frame = view.folder.name, view.table.get("frame") is not None
    name = ("clip_right" if name.endswith("_right") else "clip") if is_frame else name
    # light.groups adds layers and changes no picture.
    drawn = {**house.recipe, "light": {k: v for k, v in fields.items() if k != "groups"}}
    seed = keys.seed(house.id, name, "light", _digest(drawn, groups_of_step("light")))
    what = f"its seed is {light.get('seed')}, the recipe's {seed}"
    tally.expect("light facts", place, light.get("seed") == seed, what)
    told = light.get("integrator")
    names = INTEGRATORS[fields["integrator"]]
    tally.expect(
        "light facts", place, told in names, f"integrator is {told}, by the recipe {names[0]}"
    )
    if told == "path" and not fields["noise"] and not fields["time_budget_s"]:
        same = light.get("spp") == fields["spp"]
        tally.expect(
            "light facts", place, same, f"has {light.get('spp')} spp, by the recipe {fields['spp']}"
        )
    developed = view.table["modes"].get("develop", {})
    if "denoised" in developed:
        same = developed["denoised"] == fields["denoise"]
        tally.expect(
            "light facts", place, same, "is told to be denoised otherwise than by the recipe"
        )
    weights = light.get("lamp_weights", {})
    if house.items and weights:
        known = set(lamp_names(house))
        what = f"lamp_weights name {sorted(weights.keys() - known)[:3]}, which are no lamps"
        tally.expect("light facts", place, weights.keys() <= known, what)
        total = sum(weights.values())
        same = abs(total - 1) <= 1e-3 and min(weights.values()) >= 0
        tally.expect("light facts", place, same, f"lamp_weights sum to {total:.4f}")


def lamp_names(house: StoredHouse) -> dict[str, tuple[int, int]]:
    """Name of each light of a house -> instance of its item and the light's place there.

    A lamp of one light is called as its item is; of several, each has its number behind a slash.
    """
    found = {}
    for instance, row in sorted(house.items.items()):
        for k in range(len(row["lights"])):
            name = f"{row['id']}/{k}" if len(row["lights"]) > 1 else row["id"]
            found[name] = instance, k
    return found
