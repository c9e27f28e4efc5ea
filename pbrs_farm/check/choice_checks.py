"""cameras.json: whether its views are of the house, and its report is of its views. Effects: none beside reading documents."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.embree_caster import Floats, Rays
from pbrs_farm.check.fact_checks import POSE, SAME, is_rigid
from pbrs_farm.check.motion_checks import eye_of_row
from pbrs_farm.check.solid_checks import is_within
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.core import keys

COUNT_SHARE = 0.02  # of an item's pixels: those on its outline fall either way
COUNT_PX = 6  # the same of a small one
_EYE_M = 2.0  # above a floor, below which an eye stands though there is no ceiling
_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])  # OpenCV's axes <-> OpenGL's
HOME_RULES = ("near_duplicate",)  # that refuse a view for others of the home


def check_choice(house: StoredHouse, rays: Rays, triangles: Triangles, tally: Tally) -> None:
    """cameras.json: its views are of the house's rooms, its poses rigid, its counts of pixels right."""
    rows = house.cameras.get("views", [])
    if not rows:
        return
    report = house.cameras.get("report", {})
    ids = [row["id"] for row in rows]
    tally.expect(
        "choice", house.id, len(set(ids)) == len(ids), "a view stands twice in cameras.json"
    )
    firsts = [row for row in rows if not eye_of_row(row)]
    same = report.get("n_views") in (len(rows), len(firsts))
    tally.expect("choice", house.id, same, f"reports {report.get('n_views')} views of {len(rows)}")
    told = house.told_by_marker("cameras").get("views")
    if told:
        same = told == [[row["id"], row["room"], row["score"]] for row in rows]
        tally.expect("choice", house.id, same, "the step's marker tells of other views")
    _check_report(house, report, tally)
    for row in rows:
        _check_choice_row(house, row, rays, triangles, tally)
    _check_sequence(house, rows, tally)


def _check_report(house: StoredHouse, report: Mapping[str, Any], tally: Tally) -> None:
    """Numbers of the report that the views or other numbers of it decide."""
    if house.recipe and "source" in report:
        same = report["source"] == house.recipe["cameras"]["source"]
        tally.expect("choice", house.id, same, f"reports views that were {report['source']}")
    scores = {row["id"]: row["score"] for row in house.cameras["views"]}
    refused: Counter[str] = Counter()
    n_candidates = 0
    for room in report.get("rooms", []):
        place = f"{house.id} room {room['room_id']}"
        stored = house.rooms.get(room["room_id"])
        same = not house.rooms or (stored is not None and stored["name"] == room["name"])
        tally.expect("choice", place, same, "is no room of house.json")
        for sector in room.get("sectors", []):
            refused.update(sector["refused"])
            names = sector["views"]
            where = f"{place} sector {sector['sector']}"
            own = [house.camera_rows.get(n, {}) for n in names]
            same = all(
                (row.get("sector"), row.get("room")) == (sector["sector"], room["room_id"])
                for row in own
            )
            tally.expect("choice", where, same, "reports views of another sector")
            n = sum(sector["refused"].values()) + sector["n_kept"]
            what = f"had {sector['n_candidates']} candidates, {n} of them judged"
            tally.expect("choice", where, n == sector["n_candidates"], what)
            best = max((scores.get(n, -1.0) for n in names), default=None)
            same = best == sector["winner_score"]
            tally.expect(
                "choice", where, same, f"{sector['winner_score']} won, its best has {best}"
            )
        n_candidates += sum(sector["n_candidates"] for sector in room.get("sectors", []))
    if n_candidates:
        same = report["n_candidates"] == n_candidates
        tally.expect("choice", house.id, same, f"reports {report['n_candidates']} candidates")
        # Near likenesses are refused among the views of a whole home.
        told = {k: n for k, n in report["refused"].items() if k in refused or k not in HOME_RULES}
        tally.expect(
            "choice", house.id, told == dict(refused), "refused other views than its sectors"
        )
    if house.recipe and report.get("preset") not in (None, "objects"):
        same = report["preset"] == house.recipe["cameras"]["preset"]
        tally.expect("choice", house.id, same, f"reports the rules of {report['preset']}")


def _check_choice_row(
    house: StoredHouse, row: Mapping[str, Any], rays: Rays, triangles: Triangles, tally: Tally
) -> None:
    place = f"{house.id} {row['id']} in cameras.json"
    pose = np.array(row["world_from_camera_opengl"], np.float64)
    if not tally.expect("choice", place, pose.shape == (4, 4) and is_rigid(pose), "has no pose"):
        return
    held, room = row["intrinsics"], house.rooms.get(str(row["room"]))
    if house.rooms and not keys.is_object(house.id):
        tally.expect("choice", place, room is not None or not row["room"], "is of no room")
    if room is not None and row["origin"] in ("sampled", "walk"):
        eye = pose[:3, 3]
        # A balcony ends at its rail.
        same = room["floor_y"] < eye[1] < max(room["ceiling_y"] + 0.5, room["floor_y"] + _EYE_M)
        same &= row["origin"] == "walk" or "rig" in row or is_within(room["polygon"], eye[[0, 2]])
        tally.expect("choice", place, bool(same), f"does not stand in room {row['room']}")
    first = house.camera_rows.get(row["rig"]["instant"]) if eye_of_row(row) else None
    if first is not None:
        # What a rig takes at an instant is judged once.
        same = (row["objects"], row["score"]) == (first["objects"], first["score"])
        tally.expect("choice", place, same, "is judged otherwise than the rig's first camera")
    if not row["objects"] or "lens" in held or first is not None:
        return
    if "rig" in row:
        # It is the rig's own place that was judged, through the lens that all cameras have.
        own = rig_of_recipe(house.recipe).get(row["rig"]["camera"], {})
        if own.get("lens") or own.get("hfov_deg"):
            return
        pose = pose @ _FLIP @ np.linalg.inv(row["rig"]["rig_from_camera_opencv"]) @ _FLIP
    # Count the pixels of each thing at the size at which the view was judged.
    width, height = held["width_px"], held["height_px"]
    fx, fy, cx, cy = (held[name] for name in ("fx", "fy", "cx", "cy"))
    if house.recipe:
        fields = house.recipe["cameras"]
        width, height = fields["score_width_px"], fields["score_height_px"]
        if house.recipe.get("lens", {}).get("fx"):
            # Given cameras are counted before the recipe's lens, chosen ones through a pin-hole of
            # its field of view, aspect and square pixels, with the axis in the middle.
            if row["origin"] != "sampled":
                return
            height = max(round(width * held["height_px"] / held["width_px"]), 1)
            fy = fx * (held["height_px"] / height) / (held["width_px"] / width)
            cx, cy = held["width_px"] / 2, held["height_px"] / 2
    columns, lines = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    x = (columns.ravel() * held["width_px"] / width - cx) / fx
    y = (lines.ravel() * held["height_px"] / height - cy) / fy
    local = np.stack([x, -y, -np.ones(len(x))], axis=1)
    face = rays.first(pose[:3, 3], local @ pose[:3, :3].T)
    counts = np.bincount(np.where(face >= 0, triangles.instance[face], 0))
    for name, n in row["objects"].items():
        found = int(counts[int(name)]) if int(name) < len(counts) else 0
        same = abs(found - n) <= COUNT_PX + COUNT_SHARE * n
        tally.expect("choice", f"{place}: item {name}", same, f"counts {n} pixels, here {found}")


def _check_sequence(house: StoredHouse, rows: list[dict[str, Any]], tally: Tally) -> None:
    """Frames are numbered and follow each other in time; cameras of a rig stand where the recipe says."""
    fields = house.recipe.get("cameras", {})
    for row in rows:
        place = f"{house.id} {row['id']} in cameras.json"
        eye = eye_of_row(row)
        frame = row.get("frame")
        if frame is not None:
            name = f"frame_{frame:05d}" + (eye and f"_{eye}")
            tally.expect("sequence", place, row["id"] == name, f"is frame {frame}")
            if fields.get("source") == "walk":
                same = abs(row["time_s"] - frame / fields["walk_fps"]) <= SAME
                tally.expect("sequence", place, same, f"is told to be at {row['time_s']} s")
        if "rig" in row or fields.get("stereo_m") or house.recipe.get("rig"):
            _check_rig(house, row, place, tally)
    times = [row["time_s"] for row in rows if row.get("frame") is not None and not eye_of_row(row)]
    same = all(b > a for a, b in itertools.pairwise(times))
    tally.expect("sequence", house.id, same, "its frames do not follow each other in time")


def rig_of_recipe(recipe: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The cameras of a recipe's rig by name, in order; a stereo pair is one of two."""
    stereo_m = recipe.get("cameras", {}).get("stereo_m", 0.0)
    right = {"name": "right", "translation_m": [stereo_m, 0.0, 0.0]}
    pair: list[dict[str, Any]] = [{"name": "left"}, right]
    rows = pair if stereo_m else (recipe.get("rig") or {}).get("cameras", [])
    return {row["name"]: row for row in rows}


def _rig_from_camera(row: Mapping[str, Any]) -> Floats:
    """(4, 4) of a camera in the recipe, by products of turns about single axes, or its quaternion."""
    found = np.eye(4)
    found[:3, 3] = row.get("translation_m", (0.0, 0.0, 0.0))
    if row.get("rotation_wxyz") is not None:
        w, *xyz = np.array(row["rotation_wxyz"]) / np.linalg.norm(row["rotation_wxyz"])
        v = np.array(xyz)
        cross = np.cross(np.eye(3), v)
        found[:3, :3] = (w * w - v @ v) * np.eye(3) + 2 * np.outer(v, v) + 2 * w * cross
        return found
    yaw, pitch, roll = (
        np.radians(row.get(f"{name}_deg", 0.0)) for name in ("yaw", "pitch", "roll")
    )
    c, s = np.cos([yaw, pitch, roll]), np.sin([yaw, pitch, roll])
    about_y = np.array([[c[0], 0, s[0]], [0, 1, 0], [-s[0], 0, c[0]]])
    about_x = np.array([[1, 0, 0], [0, c[1], -s[1]], [0, s[1], c[1]]])
    about_z = np.array([[c[2], -s[2], 0], [s[2], c[2], 0], [0, 0, 1]])
    found[:3, :3] = about_y @ about_x @ about_z
    return found


def _check_rig(house: StoredHouse, row: Mapping[str, Any], place: str, tally: Tally) -> None:
    """A view of a rig: its name, its camera's place in the rig by the recipe, and the rig's in the world.

    All views of an instant agree where the rig stands; without a recipe they alone are compared.
    """
    rig = row.get("rig")
    if not tally.expect("sequence", place, rig is not None, "tells of no rig, the recipe does"):
        return
    assert rig is not None
    instant, camera = str(rig["instant"]), str(rig["camera"])
    first = house.camera_rows.get(instant)
    same = row["id"] in (instant, f"{instant}_{camera}") and first is not None
    if not tally.expect("sequence", place, same, f"is no camera of the rig at {instant!r}"):
        return
    assert first is not None
    told = np.array(rig["rig_from_camera_opencv"], np.float64)
    known = rig_of_recipe(house.recipe)
    if house.recipe:
        same = camera in known and (row["id"] == instant) == (camera == next(iter(known)))
        what = f"is told to be of camera {camera}"
        if tally.expect("sequence", place, same, f"{what}, the recipe's has another place"):
            off = float(np.abs(_rig_from_camera(known[camera]) - told).max())
            what = f"stands {off:.3g} m or parts of a turn off where the recipe's rig has {camera}"
            tally.expect("sequence", place, off <= POSE, what)
        stereo = bool(house.recipe["cameras"]["stereo_m"])
        name = "stereo" if stereo else (house.recipe.get("rig") or {}).get("name", "rig")
        tally.expect("sequence", place, rig["name"] == name, f"is told to be of rig {rig['name']}")
        left = instant if stereo and row["id"] != instant else None
        tally.expect("sequence", place, row.get("left") == left, "tells of another left eye")
        _check_rig_lens(row, first, known, place, tally)
    here, there = (_world_from_rig(one) for one in (row, first))
    off = float(np.abs(here - there).max())
    what = f"puts the rig {off:.3g} m or parts of a turn off where its first camera does"
    tally.expect("sequence", place, off <= POSE, what)
    tally.expect("sequence", place, row["room"] == first["room"], "is of another room than its rig")
    same = (row.get("frame"), row.get("time_s")) == (first.get("frame"), first.get("time_s"))
    tally.expect("sequence", place, same, "is of another instant than its rig")


def _check_rig_lens(
    row: Mapping[str, Any],
    first: Mapping[str, Any],
    known: Mapping[str, Mapping[str, Any]],
    place: str,
    tally: Tally,
) -> None:
    """A pin-hole's own field of view, or the lens that all cameras without their own have."""
    own, held = known.get(str(row["rig"]["camera"]), {}), row["intrinsics"]
    if own.get("hfov_deg"):
        hfov_deg = np.degrees(2 * np.arctan(held["width_px"] / 2 / held["fx"]))
        same = abs(hfov_deg - own["hfov_deg"]) <= POSE and "lens" not in held
        tally.expect(
            "sequence",
            place,
            bool(same),
            f"sees {hfov_deg:g} degrees, the recipe says {own['hfov_deg']:g}",
        )
    elif not own.get("lens"):
        shared = known.get(str(first["rig"]["camera"]), {})
        same = bool(shared.get("lens") or shared.get("hfov_deg")) or held == first["intrinsics"]
        tally.expect("sequence", place, same, "has another lens than the rig's first camera")


def _world_from_rig(row: Mapping[str, Any]) -> Floats:
    pose = np.array(row["world_from_camera_opengl"], np.float64) @ _FLIP
    told = np.array(row["rig"]["rig_from_camera_opencv"], np.float64)
    return np.asarray(pose @ np.linalg.inv(told))
