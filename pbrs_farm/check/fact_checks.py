"""Facts of view.json against the files that repeat them. Effects: reads files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.axes import into_frame, is_rigid
from pbrs_farm.check.cases import ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.lens_rays import scaled_k
from pbrs_farm.check.rules import judge
from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import NYU13_FROM_NYU40, NYU13_NAMES
from pbrs_farm.core.house import FLOATING
from pbrs_farm.core.recipe import groups_of_step, picture_groups

_WORLD_M = 1e-6  # tolerance of a corner of the layout
_LAYOUT_PX = 0.01  # tolerance of a projected corner
_CORNER_M = 0.05  # maximum distance of a visible corner behind the surface in its pixel
_TIE_M = 0.01  # within this of that distance either answer is right

# Integrator of the recipe -> names in view.json.
INTEGRATORS: Mapping[str, tuple[str, ...]] = {
    "path": ("path", "mitsuba path"),
    "metropolis": ("pssmlt-camera",),
}
_PIECE_TAG = "dressed:"  # tag of an item with the id of its piece in dress.json
_STEPS = ("light", "develop", "opengl_dl", "opengl_il")


def check_facts(case: ViewCase) -> None:
    """Judge every fact of view.json that another stored file repeats, or that follows from others."""
    view, house, tally = case.view, case.house, case.tally
    table, place = view.table, case.place
    judge("view", place, tally, view=table, house=house, folder=view.folder)
    if house.recipe and "recipe" in table:
        digest = _recipe_digest(house.recipe, picture_groups())
        judge("view recipe", place, tally, view=table, digest=digest)
    _check_camera_row(case)
    for row in table["instances"]:
        _check_names(case, row)
        if "world_from_model" in row or "model" in row:
            _check_model_pose(case, row)
        elif house.items.get(int(row["id"]), {}).get("pose"):
            tally.expect("model poses", f"{place} instance {row['id']}", False, "lacks its pose")
    _check_tables(case)
    check_licences(case)
    if "layout" in table:
        _check_layout(case)
    _check_markers(case)
    if table.get("modes", {}).get("light"):
        _check_light_facts(case)


def _recipe_digest(recipe: Mapping[str, Any], groups: tuple[str, ...]) -> str:
    fields = {g: recipe[g] for g in ("seed", *groups) if recipe.get(g) is not None}
    return keys.digest(fields)


def _check_camera_row(case: ViewCase) -> None:
    """Pose, K, lens and origin of the view are those of cameras.json."""
    view, house, tally = case.view, case.house, case.tally
    if not house.camera_rows:
        return
    row = house.camera_rows.get(view.folder.name)
    if not case.expect("camera file")(row is not None, "is not in cameras.json"):
        return
    assert row is not None
    k = scaled_k(row["intrinsics"], *view.size[::-1])
    judge("camera file", case.place, tally, view=view.table, row=row, K=k)
    if view.lens is not None:
        depth = "planar" if view.lens.model in ("radtan", "opencv") else "distance"
        judge("camera depth", case.place, tally, view=view.table, lens=view.lens, depth=depth)
    if house.recipe:
        judge("view size", case.place, tally, view=view.table, image=house.recipe["image"])


def _check_names(case: ViewCase, row: dict[str, Any]) -> None:
    """A row of instances repeats its item of house.json; its NYU13 class follows from NYU40's."""
    place = f"{case.place} instance {row['id']}"
    number = int(NYU13_FROM_NYU40[int(row["nyu40"])])
    nyu13 = {"number": number, "name": NYU13_NAMES[number]}
    judge("instance class", place, case.tally, row=row, nyu13=nyu13)
    if not case.house.items:
        return
    item = case.house.items.get(int(row["id"]))
    if case.tally.expect("names", place, item is not None, "is not an item of house.json"):
        assert item is not None
        row = {"floating": False, **row}
        floats = FLOATING in item["tags"]
        judge("instance", place, case.tally, row=row, item=item, floats=floats)


def check_licences(case: ViewCase) -> None:
    """Licences are those of dress.json for the visible items' pieces and pictures, and that of the home."""
    house, table = case.house, case.view.table
    if "licences" not in table or not house.items:
        return
    items = [house.items.get(int(row["id"]), {}) for row in table["instances"]]
    tags = [[t for t in item.get("tags", ()) if t.startswith(_PIECE_TAG)] for item in items]
    shown = {tag.removeprefix(_PIECE_TAG) for of_item in tags for tag in of_item}
    materials = {s["material"] for item in items for s in item.get("surfaces", ())}
    shown |= {house.house["materials"][m]["texture_id"] for m in materials}
    rows = [(c["licence"], c["id"]) for c in house.dress.get("credits", ()) if c["id"] in shown]
    source = house.house["source"]
    rows += [(source["licence"], source["file"])] if not all(tags) else []
    expected: dict[str, list[str]] = {}
    for licence, of in sorted(set(rows)):
        expected.setdefault(licence, []).append(of)
    expected.pop("", None)
    fits = table["licences"] == expected
    case.expect("licences")(fits, f"are {sorted(table['licences'])}, not {sorted(expected)}")


def _check_model_pose(case: ViewCase, row: dict[str, Any]) -> None:
    """A model's pose is rigid and that of house.json; its two poses, as in BOP, agree."""
    place = f"{case.place} instance {row['id']}"
    expect = case.tally.at("model poses", place)
    pose = np.array(row["world_from_model"], np.float64)
    if not expect(
        pose.shape == np.shape(row["camera_from_model_opencv"]) == (4, 4), "is not a pose"
    ):
        return
    expect(is_rigid(pose), "world_from_model is not rigid")
    product = np.linalg.inv(case.view.world_from_camera) @ pose
    judge("model pose", place, case.tally, row=row, product=product)
    if case.house.items:
        stored = case.house.items.get(int(row["id"]), {}).get("pose") or {}
        judge("stored pose", place, case.tally, row=row, pose=stored)


def _check_tables(case: ViewCase) -> None:
    """Ids of materials and of source classes are those of house.json."""
    house, table = case.house, case.view.table
    if not house.house:
        return
    if "materials" in table:
        rows = enumerate(house.house["materials"], start=1)
        materials = {str(k): {"name": m["name"], "kind": m["kind"]} for k, m in rows}
        judge("materials of a view", case.place, case.tally, view=table, materials=materials)
    if "source_classes" in table:
        names = sorted({row["source_class"] for row in house.items.values()} - {""})
        classes = {str(k): name for k, name in enumerate(names, start=1)}
        judge("source classes", case.place, case.tally, view=table, classes=classes)


def _check_layout(case: ViewCase) -> None:
    """Project the corners of the room's polygon at its floor and ceiling again."""
    view, house = case.view, case.house
    room = house.rooms.get(str(view.table.get("room")))
    if not house.rooms:
        return
    expect = case.expect("layout")
    if not expect(room is not None, "its room is not in house.json"):
        return
    assert room is not None
    corners = [
        (number, end, [x, room[y], z])
        for end, y in (("floor", "floor_y"), ("ceiling", "ceiling_y"))
        for number, (x, z) in enumerate(room["polygon"])
    ]
    rows = view.table["layout"]
    if not expect(len(rows) == len(corners), "lacks corners"):
        return
    points = np.array([world for _number, _end, world in corners], np.float64)
    pixels, depths = view.pixels_and_depths(into_frame(view.world_from_camera, points))
    for row, (number, end, world), pixel, z in zip(rows, corners, pixels, depths, strict=True):
        expect = case.tally.at("layout", f"{case.place} layout {end} {number}")
        same = (row["corner"], row["at"]) == (number, end)
        same &= bool(np.abs(np.array(row["world"]) - world).max() <= _WORLD_M)
        expect(same, "is not the room's corner")
        is_in_front = bool(np.isfinite(pixel).all() and (z > 1e-6 or view.lens is not None))
        if is_in_front != (row["pixel"] is not None):
            same = bool(abs(z) < 1e-3) if np.isfinite(z) else view.lens is not None
        elif is_in_front:
            # Rounding grows with the distance from the picture.
            slack = _LAYOUT_PX * (1 + np.abs(pixel).max() / max(view.size))
            same = bool(np.abs(np.array(row["pixel"]) - pixel).max() <= slack)
        else:
            same = True
        expect(same, f"is at {row['pixel']}, recomputed {pixel.tolist()}")
        depth = case.arrays["depth"]
        answers = _corner_visibility(pixel, float(z), depth) if is_in_front else {False}
        fault = f"is marked {'visible' if row['visible'] else 'hidden'}"
        expect(bool(row["visible"]) in answers, fault)


def _corner_visibility(pixel: F64, z: float, depth: NDArray[Any]) -> set[bool]:
    """True if no pixel around a corner is nearer; both answers if that is a close call."""
    height, width = depth.shape
    answers = set()
    # On the edge between two pixels it belongs to either.
    for dx, dy in ((0, 0), (1e-4, 1e-4), (-1e-4, -1e-4)):
        column, row = (int(np.floor(v)) for v in pixel + np.array([dx, dy]))
        if not (0 <= column < width and 0 <= row < height):
            answers.add(False)
            continue
        around = depth[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2] / 1000
        farthest = float(np.where(around > 0, around, np.inf).max())
        answers |= {farthest >= z - _CORNER_M + slack for slack in (-_TIE_M, _TIE_M)}
    return answers


def _check_markers(case: ViewCase) -> None:
    """The facts of view.json that come from a step equal those of its marker."""
    name, modes = case.view.folder.name, case.view.table.get("modes", {})
    expect = case.expect("markers")
    for step in _STEPS:
        facts = case.house.marker_facts(step, name)
        # A marker without facts repeats nothing.
        for key in sorted(facts.keys() | modes.get(step, {}).keys()) if facts else ():
            same = modes.get(step, {}).get(key) == facts.get(key)
            expect(same, f"modes.{step}.{key} differs from the step's marker")
    for key, value in case.house.marker_facts("truth", name).get("table", {}).items():
        expect(case.view.table.get(key) == value, f"{key} differs from the marker of truth")


def _check_light_facts(case: ViewCase) -> None:
    """Lux, sky, warnings and seed of a view's light."""
    view, house, place, tally = case.view, case.house, case.place, case.tally
    table, light = view.table, view.table["modes"]["light"]
    if house.illuminance:
        row = house.lux_rows.get(str(table.get("room")))
        if row is not None:
            lux = {"outdoor": row["outdoor_lx"], "indoor": row["indoor_lx"]}
            judge("light lux", place, tally, light=light, lux=lux, row=row)
        judge("light sky", place, tally, light=light, illuminance=house.illuminance)
    lines = [*light.get("warnings", []), *light.get("dark", [])]
    table = {"warnings": [], **table}
    judge("light warnings", place, tally, view=table, lines=list(dict.fromkeys(lines)))
    if not house.recipe:
        return
    fields = house.recipe["light"]
    # light.groups adds layers and changes no picture.
    drawn = {**house.recipe, "light": {k: v for k, v in fields.items() if k != "groups"}}
    digest = _recipe_digest(drawn, groups_of_step("light"))
    seed = view.shot.seed(house.id, "light", digest, per="eye")
    judge("light seed", place, tally, light=light, seed=seed)
    expect = case.expect("light facts")
    integrator, names = light.get("integrator"), INTEGRATORS[fields["integrator"]]
    expect(integrator in names, f"integrator is {integrator}, by the recipe {names[0]}")
    if integrator == "path" and not fields["noise"] and not fields["time_budget_s"]:
        judge("light samples", place, tally, light=light, recipe=fields)
    developed = table["modes"].get("develop", {})
    if "denoised" in developed:
        judge("light denoised", place, tally, develop=developed, recipe=fields)
    weights = light.get("lamp_weights", {})
    if house.items and weights:
        unknown = weights.keys() - house.lamps.keys()
        expect(not unknown, f"lamp_weights name {sorted(unknown)[:3]}, which are not lamps")
        total = sum(weights.values())
        same = abs(total - 1) <= 1e-3 and min(weights.values()) >= 0
        expect(same, f"lamp_weights sum to {total:.4f}")


CHECKS = (Check("facts", "view", check_facts, 10),)
