"""Films of homes that move: `make bench NAME=moving` -> out/bench/moving.json.

A walk through an example home while its doors open and a crate falls. Flow and tracks are followed again by
the caster of check/, over triangles that it moves by itself; the cost of a frame is compared with that of the
same walk through the home at rest, in CPU seconds of one process.
"""

from __future__ import annotations

import os
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any, Final

import numpy as np
import trimesh

import pbrs_farm as pf
from benchmarks.figures import write_report
from benchmarks.motion.between_views import layer
from pbrs_farm.check import verify
from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.followed_points import SEEN, OtherView, follow_points
from pbrs_farm.check.motion_checks import half_step
from pbrs_farm.check.moved_house import MovedHouse, house_at
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import triangles_from_glb
from pbrs_farm.check.stored_view import StoredView, views_of_house

UNITS: Final = {
    "motion.flow_error": "steps of 16-bit floats by which flow of what moves is off at most, a step of 1e-4 px at least",
    "motion.flow_pixels": "pixels of it that were compared",
    "motion.flow_ties": "of them where what moves and what does not lie at one depth: the flow of either is right",
    "motion.tracks_wrong": "places of tracked points, and whether they are seen, that are wrong",
    "motion.tracks": "of so many",
    "film.overhead": "cost of a frame over that of the walk at rest: labels, flow and OpenGL",
    "film.overhead_light": "the same with physical light",
    "film.frame_s": "CPU seconds of a frame of the moving home: labels, flow and OpenGL",
}
HOME: Final = "Studio"
N_FRAMES: Final = int(os.environ.get("FRAMES", "12"))
_FPS: Final = 6
_LEAST_PX: Final = 1e-4
_LAYERS: Final = ("flow_forward", "occlusion_forward", "scene_flow", "depth_z")


def main() -> None:
    """Measure and write out/bench/moving.json."""
    with tempfile.TemporaryDirectory() as scratch:
        rest, moving = _homes(Path(scratch))
        root = Path(scratch) / "root"
        seconds = N_FRAMES / _FPS
        walk = moving.set(**{
            "cameras.source": "walk", "cameras.walk_frames": N_FRAMES, "cameras.walk_fps": _FPS,
        })  # fmt: skip
        pf.render_homes(walk, root, modes=["opengl_dl"], layers=_LAYERS, tracks=True)
        figures: dict[str, Any] = _flow(root)
        counts = verify(root, sample=500).counts["tracks"]
        figures |= {"motion.tracks_wrong": counts.failed, "motion.tracks": counts.checked}
        cameras = [c.camera for c in walk.cameras()]
        for name, modes in (("", ["opengl_dl"]), ("_light", ["mlt_il_ol"])):
            # One after the other, so that both have the machine of the same minutes.
            costs: dict[str, list[float]] = {"rest": [], "moving": []}
            for _ in range(2 if not name else 1):
                for word, home in (("rest", rest), ("moving", moving)):
                    costs[word] += _frame_costs(home, cameras, seconds, modes)
            a, b = (float(np.median(costs[word])) for word in ("rest", "moving"))
            figures[f"film.overhead{name}"] = round(b / a, 3)
            if not name:
                figures["film.frame_s"] = round(b, 3)
    write_report("moving", figures, UNITS)


def _homes(scratch: Path) -> tuple[pf.Home, pf.Home]:
    """The home at rest, and as its doors open and a crate falls."""
    trimesh.creation.box((0.2, 0.15, 0.25)).export(scratch / "crate.glb")
    rest = pf.load(HOME, recipe="fast", **{"light.spp": 16})
    room = max(rest.house.rooms, key=lambda r: float(np.ptp(r.polygon, axis=0).prod()))
    x, z = room.polygon.mean(0)
    rest = rest.place(pf.model(scratch / "crate.glb"), at=(x, 1.6, z))
    # Lamps would take their light along.
    lamps = {item.id for item in rest.house.items if item.lights}
    opening = sorted({row["item"] for row in rest.joints} - lamps)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what opens as far as it can
        opened = rest.open(opening, at={0: 0, N_FRAMES / _FPS: 1})
    moving = opened.drop("crate 1", from_s=0.2)
    return rest, moving


def _frame_costs(
    home: pf.Home, cameras: list[pf.Camera], seconds: float, modes: list[str]
) -> list[float]:
    """CPU seconds of each frame but the first two, in which scenes are loaded."""
    ends: list[float] = []
    pf.film(
        home, cameras, fps=_FPS, seconds=seconds, modes=modes, layers=_LAYERS,
        observe=lambda _view: ends.append(time.process_time()),
    )  # fmt: skip
    return np.diff(ends)[1:].tolist()


def _flow(root: Path) -> dict[str, Any]:
    """How far stored flow of what moves is from points followed by another caster, in steps of float16."""
    (folder,) = root.glob("houses/*")
    house = StoredHouse(folder)
    triangles = triangles_from_glb((folder / "house.glb").read_bytes())
    views, _faults = views_of_house(folder)
    worst, n, n_ties = 0.0, 0, 0
    for view in views[:-1]:
        times = (view.table["time_s"], view.table["partners"]["next"]["time_s"])
        now, then = (house_at(house, triangles, t) for t in times)
        errors, ties = _flow_errors(view, now, then)
        worst, n = max(worst, float(errors.max(initial=0.0))), n + len(errors)
        n_ties += ties
    return {
        "motion.flow_error": round(worst, 3),
        "motion.flow_pixels": n,
        "motion.flow_ties": n_ties,
    }


def _flow_errors(view: StoredView, now: MovedHouse, then: MovedHouse) -> tuple[Any, int]:
    """(N,) steps by which flow is off, and of how many pixels it is that of another face at the same depth."""
    moves = (np.abs(layer(view, "scene_flow")) > 0).any(-1) & (layer(view, "depth_z") > 0)
    rows, columns = np.nonzero(moves)
    other = OtherView.of(view, "next")
    assert other is not None
    origin, directions = view.rays(rows, columns)
    rays = Rays(now.triangles)
    face = rays.first(origin, directions)
    z = rays.distance(face, origin, directions)
    # Pixels whose ray meets an edge show another surface here.
    same = np.abs(z - layer(view, "depth_z")[rows, columns]) < 1e-4 * (1 + z)
    rows, columns, face, z = rows[same], columns[same], face[same], z[same]
    flow, state = layer(view, "flow_forward"), layer(view, "occlusion_forward")
    there = Rays(then.triangles)

    def steps_off(of: Any, faces: Any) -> tuple[Any, Any]:
        """How far pixels are off, of points on faces, and whether both frames see them."""
        at = rows[of], columns[of]
        found = follow_points(
            view, other, at, z[of], there, lambda points: then.carried(now, points, faces)
        )
        off = np.abs(flow[at] - found.motion).max(axis=1, initial=0.0)
        # A step as that of the larger of both components, where it is more than what 32-bit floats lose.
        step = 2 * half_step(np.abs(found.motion).max(axis=1, initial=0.0))
        return off / np.maximum(step, _LEAST_PX), (found.state == SEEN) & (state[at] == SEEN)

    errors, seen = steps_off(np.arange(len(rows)), face)
    # Where a door meets its frame at one depth, two casters may see either: ask each for itself.
    wrong = np.flatnonzero(seen & (errors > 1))
    corners = (h.triangles.vertices[h.triangles.faces] for h in (now, then))
    moves_on = np.not_equal(*corners).any((1, 2))
    for kind in (moves_on, ~moves_on) if len(wrong) else ():
        alone = Rays(now.triangles, kind)
        ray = origin, directions[same][wrong]
        met = alone.first(*ray)
        near = np.abs(alone.distance(met, *ray) - z[wrong]) < 1e-4 * (1 + z[wrong])
        own = wrong[(met >= 0) & near]
        again = steps_off(own, met[(met >= 0) & near])[0]
        errors[own] = np.minimum(errors[own], again)
    return errors[seen], int((errors[wrong] <= 1).sum())


if __name__ == "__main__":
    main()
