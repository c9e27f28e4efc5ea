"""cameras.json: whether its views are of the house, and its report is of its views. Effects: none beside reading documents."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.fact_checks import SAME, is_rigid
from pbrs_farm.check.solid_checks import is_within
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.core import keys

COUNT_SHARE = 0.02  # of an item's pixels: those on its outline fall either way
COUNT_PX = 6  # the same of a small one
_EYE_M = 2.0  # above a floor, below which an eye stands though there is no ceiling
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
    lefts = [row for row in rows if not row.get("left")]
    same = report.get("n_views") in (len(rows), len(lefts))
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
        same &= (
            row["origin"] == "walk"
            or bool(row.get("left"))
            or is_within(room["polygon"], eye[[0, 2]])
        )
        tally.expect("choice", place, bool(same), f"does not stand in room {row['room']}")
    left = house.camera_rows.get(str(row.get("left", "")))
    if left is not None:
        # A pair is judged by its left eye.
        same = (row["objects"], row["score"]) == (left["objects"], left["score"])
        tally.expect("choice", place, same, "is judged otherwise than its left eye")
    if not row["objects"] or "lens" in held or left is not None:
        return
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
    """Frames are numbered and follow each other in time; the right eye stands beside the left one."""
    fields = house.recipe.get("cameras", {})
    for row in rows:
        place = f"{house.id} {row['id']} in cameras.json"
        left = row.get("left", "")
        frame = row.get("frame")
        if frame is not None:
            name = f"frame_{frame:05d}" + ("_right" if left else "")
            tally.expect("sequence", place, row["id"] == name, f"is frame {frame}")
            if fields.get("source") == "walk":
                same = abs(row["time_s"] - frame / fields["walk_fps"]) <= SAME
                tally.expect("sequence", place, same, f"is told to be at {row['time_s']} s")
        if left or row["id"].endswith("_right"):
            partner = house.camera_rows.get(left)
            same = row["id"] == f"{left}_right" and partner is not None
            if tally.expect("sequence", place, same, f"is not the right eye of {left!r}"):
                assert partner is not None
                _check_pair(house, row, partner, place, tally)
    times = [row["time_s"] for row in rows if row.get("frame") is not None and not row.get("left")]
    same = all(b > a for a, b in itertools.pairwise(times))
    tally.expect("sequence", house.id, same, "its frames do not follow each other in time")


def _check_pair(
    house: StoredHouse, right: Mapping[str, Any], left: Mapping[str, Any], place: str, tally: Tally
) -> None:
    """The right eye is the left one, moved to its right by the recipe's base line."""
    a = np.array(left["world_from_camera_opengl"], np.float64)
    b = np.array(right["world_from_camera_opengl"], np.float64)
    step = a[:3, :3].T @ (b[:3, 3] - a[:3, 3])
    base = float(house.recipe.get("cameras", {}).get("stereo_m", 0.0)) or float(step[0])
    same = bool(np.abs(a[:3, :3] - b[:3, :3]).max() <= SAME and step[0] > 0)
    same &= bool(np.abs(step - [base, 0, 0]).max() <= 1e-6)
    what = f"stands {np.round(step, 4).tolist()} m from the left eye, by the recipe {base} m to the right"
    tally.expect("sequence", place, same, what)
    same = left["intrinsics"] == right["intrinsics"] and left["room"] == right["room"]
    tally.expect("sequence", place, same, "has another lens than the left eye")
