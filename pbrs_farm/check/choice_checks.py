"""cameras.json: its views are of the house, and its report is of its views. Effects: none beside reading documents."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pbrs_farm.check.axes import is_rigid, opencv_pose, opencv_transform
from pbrs_farm.check.cases import HouseCase
from pbrs_farm.check.certificate import Expect
from pbrs_farm.check.checks import Check
from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.lens_rays import PlacedCamera, scaled_k
from pbrs_farm.check.plan import is_within
from pbrs_farm.check.rules import judge
from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.shot import Shot

_COUNT_SHARE = 0.02  # of an item's pixels: those on its outline may fall either way
_COUNT_PX = 6  # the same of a small item
_COINCIDENT_M = 1e-4  # distance between coincident surfaces
_HEADROOM_M = 0.5  # of a camera above its room's ceiling: a balcony ends at its rail
_EYE_M = 2.0  # highest camera above a floor without a ceiling
_OUTSIDE = "out"  # room of a camera outside all rooms
_HOME_RULES = ("near_duplicate",)  # refuse a view for others of the home


def check_choice(case: HouseCase) -> None:
    """cameras.json: its views are of the house's rooms, its poses rigid, its counts of pixels right."""
    house, expect = case.house, case.expect("choice")
    rows = house.cameras.get("views", [])
    if not rows:
        return
    report = house.cameras.get("report", {})
    ids = [row["id"] for row in rows]
    expect(len(set(ids)) == len(ids), "a view is listed twice in cameras.json")
    n_views = report.get("n_views")
    n_firsts = sum(not _eye(row) for row in rows)
    expect(n_views in (len(rows), n_firsts), f"reports {n_views} views of {len(rows)}")
    in_marker = house.marker_facts("cameras").get("views")
    if in_marker:
        same = in_marker == [[row["id"], row["room"], row["score"]] for row in rows]
        expect(same, "the step's marker lists other views")
    _check_report(case, report)
    for row in rows:
        _check_view(case, row)
    _check_sequence(case, rows)


def _eye(row: Mapping[str, Any]) -> str:
    """The camera of a rig that took a view, "" for its first."""
    return Shot.of_row(row["id"], row).eye


def _check_report(case: HouseCase, report: Mapping[str, Any]) -> None:
    """Numbers of the report that follow from the views or from other numbers of it."""
    house, tally = case.house, case.tally
    recipe = house.recipe.get("cameras", {})
    if recipe and "source" in report:
        judge("camera source", house.id, tally, report=report, recipe=recipe)
    scores = {row["id"]: row["score"] for row in house.cameras["views"]}
    refused: Counter[str] = Counter()
    n_candidates = 0
    for room in report.get("rooms", []):
        place = f"{house.id} room {room['room_id']}"
        stored = house.rooms.get(room["room_id"])
        same = not house.rooms or (stored is not None and stored["name"] == room["name"])
        tally.expect("choice", place, same, "is not a room of house.json")
        for sector in room.get("sectors", []):
            refused.update(sector["refused"])
            n_candidates += sector["n_candidates"]
            expect = tally.at("choice", f"{place} sector {sector['sector']}")
            views = [house.camera_rows.get(n, {}) for n in sector["views"]]
            same = all(
                (view.get("sector"), view.get("room")) == (sector["sector"], room["room_id"])
                for view in views
            )
            expect(same, "reports views of another sector")
            n, total = sum(sector["refused"].values()) + sector["n_kept"], sector["n_candidates"]
            expect(n == total, f"had {total} candidates, {n} of them judged")
            best = max((scores.get(n, -1.0) for n in sector["views"]), default=None)
            winner = sector["winner_score"]
            expect(best == winner, f"{winner} won, its best has {best}")
    if n_candidates:
        # Near duplicates are refused among the views of a whole home.
        rows = report["refused"].items()
        by_sector = {k: n for k, n in rows if k in refused or k not in _HOME_RULES}
        judge("candidates", house.id, tally, report=report, n_candidates=n_candidates, by_sector=by_sector, refused=dict(refused))  # fmt: skip
    if recipe and report.get("preset") not in (None, "objects"):
        judge("camera preset", house.id, tally, report=report, recipe=recipe)


def _is_inside(room: Mapping[str, Any], eye: NDArray[Any]) -> bool:
    x, y, z = eye
    is_level = room["floor_y"] < y < room["ceiling_y"]
    return bool(is_level and is_within(room["polygon"], np.array([x, z])))


def _check_view(case: HouseCase, row: Mapping[str, Any]) -> None:
    """Pose, room and counted pixels of a view."""
    house, place = case.house, f"{row['id']} in cameras.json"
    expect = case.expect("choice", place)
    pose = np.array(row["world_from_camera_opengl"], np.float64)
    if not expect(is_rigid(pose), "has no pose"):
        return
    room = house.rooms.get(str(row["room"]))
    if house.rooms and not keys.is_object(house.id):
        is_known = room is not None or row["room"] in ("", _OUTSIDE)
        expect(is_known, "is of no room")
        rooms = (r["name"] for r in house.rooms.values() if _is_inside(r, pose[:3, 3]))
        inside = next(rooms, None) if row["room"] == _OUTSIDE else None
        expect(inside is None, f"is in room {inside}, not outside")
    if room is not None and row["origin"] in ("sampled", "walk"):
        x, y, z = pose[:3, 3]
        floor, ceiling = room["floor_y"], room["ceiling_y"]
        same = floor < y < max(ceiling + _HEADROOM_M, floor + _EYE_M)
        is_free = row["origin"] == "walk" or "rig" in row
        same &= is_free or is_within(room["polygon"], np.array([x, z]))
        expect(same, f"is not in room {row['room']}")
    first = house.camera_rows.get(row["rig"]["instant"]) if _eye(row) else None
    if first is not None:
        # A rig is judged once an instant.
        same = (row["objects"], row["score"]) == (first["objects"], first["score"])
        expect(same, "has another score than the rig's first camera")
    if not row["objects"] or "lens" in row["intrinsics"] or first is not None:
        return
    if "rig" in row:
        # The rig's own pose was judged, through the lens that all cameras share.
        camera = rig_of_recipe(house.recipe).get(row["rig"]["camera"], {})
        if camera.get("lens") or camera.get("hfov_deg"):
            return
        pose = pose @ opencv_transform(np.linalg.inv(row["rig"]["rig_from_camera_opencv"]))
    directions = _judged_rays(case, row, pose)
    if directions is None:
        return
    triangles, eye = case.rest.triangles, pose[:3, 3]
    face = case.rest.rays.first(eye, directions)
    counts = np.bincount(np.where(face >= 0, triangles.instance[face], 0))
    for name, n in row["objects"].items():
        count = int(counts[int(name)]) if int(name) < len(counts) else 0
        slack = _COUNT_PX + _COUNT_SHARE * n
        same = abs(count - n) <= slack
        if not same:
            # Pixels of surfaces that coincide may count for either item.
            low, high = count_range(case, int(name), eye, directions)
            same = low - slack <= n <= high + slack
        case.expect("choice", f"{place}: item {name}")(same, f"counts {n} pixels, here {count}")


def count_range(case: HouseCase, instance: int, eye: F64, directions: F64) -> tuple[int, int]:
    """Pixels in which an instance is in front of all others by more than _COINCIDENT_M, and not behind."""
    triangles = case.rest.triangles
    own = triangles.instance == instance
    ways = []
    for keep in (own, ~own):
        rays = Rays(triangles, keep)
        face = rays.first(eye, directions)
        length = np.linalg.norm(directions, axis=1)
        ways.append(np.where(face >= 0, rays.distance(face, eye, directions) * length, np.inf))
    is_seen = np.isfinite(ways[0])
    ahead = np.where(is_seen, ways[1] - np.where(is_seen, ways[0], 0.0), -np.inf)
    return int((ahead > _COINCIDENT_M).sum()), int((ahead >= -_COINCIDENT_M).sum())


def _judged_rays(case: HouseCase, row: Mapping[str, Any], pose: F64) -> F64 | None:
    """(N, 3) directions of the pixels' rays at the size at which a view was judged; None if unknown."""
    i = row["intrinsics"]
    full_width, full_height = width, height = i["width_px"], i["height_px"]
    if case.house.recipe:
        fields = case.house.recipe["cameras"]
        width, height = fields["score_width_px"], fields["score_height_px"]
        if case.house.recipe.get("lens", {}).get("fx"):
            # Given cameras are counted before the recipe's lens, chosen ones through a pinhole of
            # its field of view, aspect and square pixels, with the axis in the middle.
            if row["origin"] != "sampled":
                return None
            height = max(round(width * full_height / full_width), 1)
            fy = i["fx"] * (full_height / height) / (full_width / width)
            i = {**i, "fy": fy, "cx": full_width / 2, "cy": full_height / 2}
    camera = PlacedCamera(scaled_k(i, width, height), opencv_pose(pose), (height, width))
    return camera.ray_grid().reshape(-1, 3)


def _check_sequence(case: HouseCase, rows: list[dict[str, Any]]) -> None:
    """Frames are numbered and ordered in time; cameras of a rig have the recipe's poses."""
    recipe = case.house.recipe
    fields = recipe.get("cameras", {})
    for row in rows:
        place = f"{case.house.id} {row['id']} in cameras.json"
        frame = row.get("frame")
        if frame is not None:
            name = Shot.of_frame(frame, _eye(row)).id
            judge("frame", place, case.tally, row=row, name=name)
            if fields.get("source") == "walk":
                time_s = frame / fields["walk_fps"]
                judge("time of a frame", place, case.tally, row=row, time_s=time_s)
        if "rig" in row or fields.get("stereo_m") or recipe.get("rig"):
            _check_rig(case, row, place)
    times = [row["time_s"] for row in rows if row.get("frame") is not None and not _eye(row)]
    ascend = all(b > a for a, b in itertools.pairwise(times))
    case.expect("sequence")(ascend, "its frames do not follow each other in time")


def rig_of_recipe(recipe: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The cameras of a recipe's rig by name, in order; a stereo pair is a rig of two."""
    stereo_m = recipe.get("cameras", {}).get("stereo_m", 0.0)
    right = {"name": "right", "translation_m": [stereo_m, 0.0, 0.0]}
    pair: list[dict[str, Any]] = [{"name": "left"}, right]
    rows = pair if stereo_m else (recipe.get("rig") or {}).get("cameras", [])
    return {row["name"]: row for row in rows}


def _rig_from_camera(row: Mapping[str, Any]) -> F64:
    """(4, 4) pose of a camera in the recipe's rig, by its angles or its quaternion."""
    pose = np.eye(4)
    pose[:3, 3] = row.get("translation_m", (0.0, 0.0, 0.0))
    wxyz = row.get("rotation_wxyz")
    if wxyz is not None:
        rotation = Rotation.from_quat(np.roll(wxyz, -1))
    else:
        angles = [row.get(f"{name}_deg", 0.0) for name in ("yaw", "pitch", "roll")]
        rotation = Rotation.from_euler("YXZ", angles, degrees=True)
    pose[:3, :3] = rotation.as_matrix()
    return pose


def _check_rig(case: HouseCase, row: Mapping[str, Any], place: str) -> None:
    """A view of a rig: its name, its camera's pose in the rig by the recipe, and the rig's in the world.

    All views of an instant agree about the rig's pose; without a recipe they alone are compared.
    """
    house, expect = case.house, case.tally.at("sequence", place)
    rig = row.get("rig")
    if not expect(rig is not None, "has no rig, but the recipe does"):
        return
    assert rig is not None
    instant, camera = str(rig["instant"]), str(rig["camera"])
    first = house.camera_rows.get(instant)
    same = row["id"] in (instant, Shot.of_id(instant).partner(eye=camera).id) and first is not None
    if not expect(same, f"is not a camera of the rig at {instant!r}"):
        return
    assert first is not None
    if house.recipe:
        cameras = rig_of_recipe(house.recipe)
        same = camera in cameras and (row["id"] == instant) == (camera == next(iter(cameras)))
        fault = f"names the camera {camera}, which has another place in the recipe"
        if expect(same, fault):
            pose = _rig_from_camera(cameras[camera])
            judge("rig camera", place, case.tally, rig=rig, pose=pose)
        stereo = bool(house.recipe["cameras"]["stereo_m"])
        name = "stereo" if stereo else (house.recipe.get("rig") or {}).get("name", "rig")
        left_eye = instant if stereo and row["id"] != instant else None
        judge("rig", place, case.tally, row=row, name=name, left=left_eye)
        _check_rig_lens(row, first, cameras, expect)
    poses = [_world_from_rig(view) for view in (row, first)]
    judge("rig instant", place, case.tally, row=row, first=first, poses=poses)


def _check_rig_lens(
    row: Mapping[str, Any],
    first: Mapping[str, Any],
    cameras: Mapping[str, Mapping[str, Any]],
    expect: Expect,
) -> None:
    """A camera has its pinhole's field of view, or the lens that all cameras without one share."""
    camera, intrinsics = cameras.get(str(row["rig"]["camera"]), {}), row["intrinsics"]
    if camera.get("hfov_deg"):
        hfov_deg = np.degrees(2 * np.arctan(intrinsics["width_px"] / 2 / intrinsics["fx"]))
        same = abs(hfov_deg - camera["hfov_deg"]) <= 1e-6 and "lens" not in intrinsics
        expect(same, f"sees {hfov_deg:g} degrees, the recipe says {camera['hfov_deg']:g}")
    elif not camera.get("lens"):
        shared = cameras.get(str(first["rig"]["camera"]), {})
        has_lens = bool(shared.get("lens") or shared.get("hfov_deg"))
        same = has_lens or intrinsics == first["intrinsics"]
        expect(same, "has another lens than the rig's first camera")


def _world_from_rig(row: Mapping[str, Any]) -> F64:
    camera = np.array(row["rig"]["rig_from_camera_opencv"], np.float64)
    return np.asarray(opencv_pose(row["world_from_camera_opengl"]) @ np.linalg.inv(camera))


CHECKS = (Check("choice", "house", check_choice, 8, ("cameras.json",)),)
