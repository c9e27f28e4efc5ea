"""Flow, disparity and occlusion against points that are followed from one stored view to another.

Effects: none. Rays are Embree's, points and cameras those of view.json; a pixel whose depth is another
one's (an edge that two casters see differently) is left to the checks of its own layers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.embree_caster import Faces, Floats, Rays
from pbrs_farm.check.lens_rays import StoredLens
from pbrs_farm.check.pixel_checks import of_another_part
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.check.stored_view import StoredView

Bools = NDArray[np.bool_]
SCENE_FLOW_M = 5e-5  # vertices of both times are 32-bit floats
FLOW_PX = 0.02  # beside half a step of what stores it
SEEN, OUTSIDE, HIDDEN = 0, 128, 255
BORDER_PX = 0.01  # of the other picture: on it a point is in or out
KITTI_REACH_PX = 511.9  # of motion that KITTI's 16 bits hold
REACH = 1e-5  # of the distance, and metres: how far before a point the ray to it may end
JITTER_PX = 0.02  # around a point: where its surroundings differ either state is right

# Relation -> layers of flow, of its KITTI form and of occlusion.
FLOW_LAYERS = {
    "next": ("flow_forward", "flow_forward_kitti", "occlusion_forward"),
    "previous": ("flow_backward", "flow_backward_kitti", "occlusion_backward"),
}
MOTION_LAYERS = {name for names in FLOW_LAYERS.values() for name in names}


MOTION_LAYERS |= {"disparity", "occlusion_stereo", "scene_flow"}

Carry = Callable[[Floats, Faces], Floats]
"""Where points (N, 3) on faces (N,) are at the partner's time."""


@dataclass(frozen=True, slots=True, eq=False)
class Then:
    """The house at the partner's time."""

    rays: Rays
    carry: Carry


def _carried(then: Then, faces: Faces, points: Floats) -> Floats:
    return then.carry(points, faces)


def stay(points: Floats, _faces: Faces) -> Floats:
    """Points where nothing moves."""
    return points


@dataclass(frozen=True, slots=True, eq=False)
class OtherView:
    """The partner's camera, as the view's own table has it."""

    k: Floats  # (3, 3)
    world_from_camera: Floats  # (4, 4), OpenCV axes
    size: tuple[int, int]  # height, width
    lens: StoredLens | None = None  # as the view's own: a run has one

    def pixels(self, points: Floats) -> tuple[Floats, Floats]:
        """(N, 2) px of world points (N, 3), and (N,) their depth; NaN where they are behind.

        float64. Depth is z for a pinhole, else what the lens's layers store. A point less than 1 mm
        before a pinhole counts as behind.
        """
        local = (points - self.world_from_camera[:3, 3]) @ self.world_from_camera[:3, :3]
        if self.lens is not None:
            plane, depth = self.lens.plane_and_depth(local)
            return plane * self.k[[0, 1], [0, 1]] + self.k[:2, 2], depth
        z = local[:, 2]
        homogeneous = local @ self.k.T
        with np.errstate(divide="ignore", invalid="ignore"):
            px = homogeneous[:, :2] / homogeneous[:, 2:]
        return np.where(z[:, None] > 1e-3, px, np.nan), z


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """N points of a view in its partner's picture."""

    motion: Floats  # (N, 2) px right and down; NaN behind the other camera
    state: NDArray[np.int64]  # (N,) SEEN, OUTSIDE or HIDDEN


def other_view(view: StoredView, relation: str) -> OtherView | None:
    """The partner of that relation that view.json names, None without it.

    Its size and lens are those of the view itself. KeyError or ValueError where the row in the
    table is damaged.
    """
    row = view.table.get("partners", {}).get(relation)
    if row is None:
        return None
    pose = np.array(row["world_from_camera_opencv"], np.float64)
    return OtherView(np.array(row["K"], np.float64), pose, view.size, view.lens)


def follow_points(
    view: StoredView,
    other: OtherView,
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    z: Floats,
    rays: Rays,
    carry: Callable[[Floats], Floats] = lambda points: points,
) -> Followed:
    """The surfaces at depth z (N,) metres behind pixels' centres, looked for in the other picture.

    rows and columns are (N,) indices of pixels. rays: of the house at the other view's time; carry:
    takes the points there. Flow is in px from the pixel's own centre; the
    state of each point is OUTSIDE, SEEN or HIDDEN.
    """
    points, px, margin = _points_of(view, other, rows, columns, z, carry)
    with np.errstate(invalid="ignore"):
        inside = margin >= 0
    state = np.full(len(rows), OUTSIDE, np.int64)
    at = np.nonzero(inside)[0]
    state[at] = np.where(is_seen(points[at], other, rays), SEEN, HIDDEN)
    return Followed(px - np.stack([columns + 0.5, rows + 0.5], axis=1), state)


def near_edge(
    view: StoredView,
    other: OtherView,
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    z: Floats,
    rays: Rays,
    carry: Callable[[Floats], Floats] = lambda points: points,
) -> Bools:
    """(N,) another state is as right: on the border of the other picture, or beside what hides it.

    Ask it only of points whose stored state differs from `follow_points`: it casts rays five times.
    """
    points, _px, margin = _points_of(view, other, rows, columns, z, carry)
    with np.errstate(invalid="ignore"):
        is_tie = np.asarray(np.abs(margin) <= BORDER_PX, bool)
    # Ask again a little beside each point: where answers differ both are right.
    seen = is_seen(points, other, rays, slack_m=0.01)
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        origin, beside = view.rays(rows + JITTER_PX * dy, columns + JITTER_PX * dx)
        moved = carry(origin + beside * z[:, None])
        is_tie |= is_seen(moved, other, rays, slack_m=0.01) != seen
    return is_tie


def _points_of(
    view: StoredView,
    other: OtherView,
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    z: Floats,
    carry: Callable[[Floats], Floats],
) -> tuple[Floats, Floats, Floats]:
    """(N, 3) surface points, their (N, 2) px in the other picture, (N,) px inside its border."""
    origin, directions = view.rays(rows, columns)
    points = carry(origin + directions * z[:, None])
    px, _depth = other.pixels(points)
    height, width = other.size
    with np.errstate(invalid="ignore"):
        margin = np.minimum(px, np.array([width, height]) - px).min(axis=1)
    return points, px, margin


def is_seen(points: Floats, other: OtherView, rays: Rays, slack_m: float = 0) -> Bools:
    """(N,) whether nothing stands between the other eye and each point, by more than 32-bit rays are off."""
    eye = other.world_from_camera[:3, 3]
    to = points - eye
    face: Faces = rays.first(eye, to)
    t = rays.distance(face, eye, to)
    distance = np.linalg.norm(to, axis=1)
    with np.errstate(invalid="ignore"):
        return np.asarray(
            (face < 0) | ((1 - t) * distance <= slack_m + REACH * (1 + distance)), bool
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """N pixels, and what their rays meet."""

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    z: Floats  # metres
    face: Faces

    def some(self, index: NDArray[Any]) -> _Seen:
        return _Seen(self.rows[index], self.columns[index], self.z[index], self.face[index])


def check_motion(
    view: StoredView,
    arrays: Mapping[str, NDArray[Any]],
    scene: tuple[Triangles, Rays],
    pixels: tuple[NDArray[np.int64], NDArray[np.int64]],
    tally: Tally,
    then: Callable[[float | None], Then] | None = None,
) -> None:
    """Recompute the layers between views at pixels (rows, columns).

    scene: the house at the view's time; then: of the house at another time, where things move.
    """
    _triangles, rays = scene
    rows, columns = pixels
    origin, directions = view.rays(rows, columns)
    face = rays.first(origin, directions)
    z = rays.distance(face, origin, directions)
    # Keep the pixels whose stored depth is that of the ray.
    own = (face >= 0) & (np.abs(arrays["depth"][rows, columns] - z * 1000) <= 1.0 + z)
    seen = _Seen(rows, columns, z, face).some(own)
    for relation in (*FLOW_LAYERS, "stereo"):
        other = other_view(view, relation)
        names = FLOW_LAYERS.get(relation, ("disparity", "occlusion_stereo"))
        names = (*names, "scene_flow") if relation == "next" else names
        if other is None:
            lost = [name for name in names if name in arrays]
            tally.expect("motion", view.place, not lost, f"{lost} without a {relation} view")
            continue
        row = view.table["partners"][relation]
        there = Then(rays, stay) if then is None else then(row.get("time_s"))
        layers = {n: arrays[n] for n in names if n in arrays}
        right, ties = _judge_layers(view, other, seen, layers, there)
        all_right = np.logical_and.reduce([np.ones(len(seen.z), bool), *right.values()])
        wrong = np.nonzero(~all_right)[0]
        if len(wrong) and there.carry is not stay:
            # Of two things at one depth either may move: one explains all layers at once.
            at = seen.some(wrong)
            faces = of_another_part(at.face, *view.rays(at.rows, at.columns), scene)
            wrong, at = wrong[faces >= 0], replace(at, face=faces).some(faces >= 0)
            again, _ = _judge_layers(view, other, at, layers, there)
            either = wrong[np.logical_and.reduce(list(again.values()))]
            for name in layers:
                right[name][either] = ties[name][either] = True
        for name in layers:
            tally.add(f"motion: {name}", len(seen.rows), ties=int(ties[name].sum()))
            for k in np.nonzero(~right[name])[0]:
                what = f"row {seen.rows[k]}, column {seen.columns[k]}"
                tally.fail(f"motion: {name}", view.place, what)


def _judge_layers(
    view: StoredView, other: OtherView, seen: _Seen, layers: Mapping[str, NDArray[Any]], there: Then
) -> tuple[dict[str, Bools], dict[str, Bools]]:
    """Layer -> (N,) what it stores at pixels is right, and that it is so as another answer is, too."""
    at = seen.rows, seen.columns, seen.z
    found = follow_points(view, other, *at, there.rays, partial(_carried, there, seen.face))
    rights, all_ties = dict[str, Bools](), dict[str, Bools]()
    for name, array in layers.items():
        values, tied = (
            array[seen.rows, seen.columns].astype(np.float64),
            np.zeros(len(seen.z), bool),
        )
        if name == "scene_flow":
            right, may_tie = _judge_scene_flow(view, values, seen, there), tied
        else:
            right, may_tie = _judge_motion(name, values, found)
        # Look again at what is wrong.
        ties = np.nonzero(~right & may_tie)[0]
        of = seen.some(ties)
        carry = partial(_carried, there, of.face)
        ties = ties[near_edge(view, other, of.rows, of.columns, of.z, there.rays, carry)]
        right[ties] = tied[ties] = True
        rights[name], all_ties[name] = right, tied
    return rights, all_ties


def _judge_scene_flow(view: StoredView, values: Floats, seen: _Seen, then: Then) -> Bools:
    """(N,) whether a layer tells how far the points of pixels have moved until the next frame."""
    origin, directions = view.rays(seen.rows, seen.columns)
    points = origin + directions * seen.z[:, None]
    off = np.abs(values - (then.carry(points, seen.face) - points)).max(axis=1)
    return np.asarray(off <= SCENE_FLOW_M, bool)


def _judge_motion(name: str, values: Floats, found: Followed) -> tuple[Bools, Bools]:
    """(N,) what a layer stores is right; (N,) where it is not, an edge may be the reason."""
    in_front = np.isfinite(found.motion).all(axis=1)
    motion = np.nan_to_num(found.motion)
    never = np.zeros(len(values), bool)
    if name.startswith("occlusion"):
        return np.asarray(values == found.state, bool), ~never
    if name.endswith("kitti"):
        # What is valid is seen; it moves as far as the steps say.
        valid = values[:, 2] == 1
        close = (np.abs((values[:, :2] - 2**15) / 64 - motion) <= FLOW_PX).all(axis=1)
        hidden = (found.state != SEEN) | (np.abs(motion) >= KITTI_REACH_PX).any(axis=1)
        return np.where(valid, close & (found.state == SEEN), hidden), close | ~valid
    if name == "disparity":
        shift = np.minimum(np.abs(motion[:, 0]), 65535 / 256)
        return ~in_front | (np.abs(values / 256 - shift) <= FLOW_PX), never
    slack = FLOW_PX + half_step(motion)
    close = (np.abs(values - motion) <= slack).all(axis=1)
    return np.asarray(close | ~in_front, bool), never


def half_step(values: Floats) -> Floats:
    """Half the distance between 16-bit floats next to values: what storing them may cost.

    A stored value is right within this of the computed one; float64, of any shape. NaN for values
    beyond the range of 16-bit floats.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(np.spacing(np.abs(values).astype(np.float16)).astype(np.float64) / 2)


def check_partners(
    views: list[StoredView], camera_rows: Mapping[str, dict[str, Any]], tally: Tally
) -> None:
    """Each partner that is stored itself has the pose and K that the view's table says.

    camera_rows: view's id -> its row in cameras.json.

    Its name follows from the view's own. Partners that the folder does not have are passed over
    then, as a view may be rendered alone.
    """
    by_name = {view.folder.name: view for view in views}
    for view in views:
        for relation, row in sorted(view.table.get("partners", {}).items()):
            name = _name_of_partner(view, relation, camera_rows)
            what = f"the {relation} view is told to be {row['view']}, not {name}"
            tally.expect("partners", view.place, row["view"] == name, what)
            other = by_name.get(str(row["view"]))
            if other is None:
                continue
            pose = np.array(row["world_from_camera_opencv"], np.float64)
            same = pose.shape == (4, 4) and bool(
                np.abs(pose - other.world_from_camera).max() < 1e-9
                and np.abs(np.array(row["K"]) - other.k).max() < 1e-9
            )
            what = f"the {relation} view {other.folder.name} has another camera"
            tally.expect("partners", view.place, same, what)
            same = row.get("time_s") == other.table.get("time_s")
            what = f"the {relation} view {other.folder.name} is of another time"
            tally.expect("partners", view.place, same, what)


def _name_of_partner(
    view: StoredView, relation: str, camera_rows: Mapping[str, dict[str, Any]]
) -> str:
    """The id of the other of a pair, or of the frame before or after, by the same camera of a rig."""
    rig, name = view.table.get("rig"), view.folder.name
    if relation != "stereo":
        number = int(view.table["frame"]) + (1 if relation == "next" else -1)
        eye = eye_of_row({"id": name, "rig": rig})
        return f"frame_{number:05d}" + (eye and f"_{eye}")
    # Of the views of the instant that stand beside it and look the same way, the nearest.
    own, found = camera_rows.get(name, {}), list[tuple[float, str]]()
    for other, row in camera_rows.items():
        if other == name or (row.get("rig") or {}).get("instant") != (rig or {}).get("instant"):
            continue
        a, b = (np.array(r["world_from_camera_opengl"], np.float64) for r in (own, row))
        step = a[:3, :3].T @ (b[:3, 3] - a[:3, 3])
        beside = np.abs(a[:3, :3] - b[:3, :3]).max() < 1e-9 and np.abs(step[1:]).max() < 1e-9
        if beside and row["intrinsics"] == own["intrinsics"]:
            found.append((round(abs(float(step[0])), 9), other))
    return min(found, key=lambda pair: pair[0])[1] if found else ""


def eye_of_row(row: Mapping[str, Any]) -> str:
    """Which camera of a rig took a view of cameras.json: "" of the rig's first one."""
    rig = row.get("rig")
    return "" if rig is None or rig["instant"] == row["id"] else str(rig["camera"])
