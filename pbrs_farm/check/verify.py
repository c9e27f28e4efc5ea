"""`pbrs-farm verify`: is what lies in a folder right? From the stored files alone.

Effects: reads files. No House, no code of the stages that made them: triangles come from
house.glb, cameras from view.json, hits from Embree.
"""

from __future__ import annotations

import hashlib
import itertools
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.certificate import Certificate, Tally
from pbrs_farm.check.choice_checks import check_choice
from pbrs_farm.check.credit_checks import check_credits
from pbrs_farm.check.edge_checks import check_typed_boundaries
from pbrs_farm.check.embree_caster import Hits, Rays
from pbrs_farm.check.fact_checks import check_facts
from pbrs_farm.check.fields import stored_fields
from pbrs_farm.check.file_checks import check_files, check_root_manifest
from pbrs_farm.check.house_checks import check_house
from pbrs_farm.check.intrinsic_checks import check_intrinsic
from pbrs_farm.check.joint_checks import check_articulation, check_joints
from pbrs_farm.check.light_checks import check_developed, may_be_halved
from pbrs_farm.check.lit_checks import LitScene, check_lit
from pbrs_farm.check.methods import looked_at, not_looked_at
from pbrs_farm.check.mirror_rays import MirrorRays
from pbrs_farm.check.motion_checks import MOTION_LAYERS, Then, check_motion, check_partners, stay
from pbrs_farm.check.moved_house import MovedHouse, check_motion_table, check_motions, house_at
from pbrs_farm.check.pair_checks import check_pairs
from pbrs_farm.check.picture_checks import check_edges, check_histogram
from pbrs_farm.check.pixel_checks import RAY_LAYERS, PixelChecks, judge, of_another_colour
from pbrs_farm.check.pose_checks import SeenView, check_pose, check_reprojection
from pbrs_farm.check.projector_checks import check_projector
from pbrs_farm.check.radiance_checks import bright_pixels, check_fit, check_guides
from pbrs_farm.check.sensor_checks import check_derived
from pbrs_farm.check.sky_checks import check_illuminance
from pbrs_farm.check.solid_checks import check_floating, check_models, check_solids
from pbrs_farm.check.stored_files import BadFile, stored_bytes
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import BadGlb, Triangles, json_of_glb, triangles_from_glb
from pbrs_farm.check.stored_view import StoredView, views_of_house
from pbrs_farm.check.table_checks import HouseItems, check_rows
from pbrs_farm.check.track_checks import check_tracks
from pbrs_farm.check.view_checks import (
    check_consistency,
    check_pictures,
    check_planes,
    check_radiance,
    read_labels,
    read_radiance,
)
from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput

SAMPLE = 2000  # pixels of each view that are recomputed by default
MOST_COINCIDENT = 3  # of those, by chance: an edge where two things meet
_MOST_TIMES = 4  # of a house in which things move: at rest, a frame and its neighbours
DENOISED = 8  # of so many views the light of one is denoised again, which costs most of all
# What reading a document raises that does not have what it should.
FAULTS = (KeyError, TypeError, ValueError, IndexError, AttributeError, np.linalg.LinAlgError)
MAX_TIES = 0.0002  # share of pixels whose instance may be the other of two right answers


@dataclass(frozen=True, slots=True)
class Scenes:
    """What rays are cast into."""

    all: tuple[Triangles, Rays]
    opaque: tuple[Triangles, Rays]  # without glass and panes
    items: HouseItems
    house: StoredHouse
    lit: LitScene
    moved: MovedHouse


class ScenesInTime:
    """The scenes of a house at one time after another. State: those of the last times."""

    def __init__(self, house: StoredHouse, triangles: Triangles) -> None:
        self._house, self._triangles = house, triangles
        self._kept: dict[float | None, Scenes] = {}

    def at(self, time_s: float | None) -> Scenes:
        """The scenes at a time in seconds, None: at rest; a house in which nothing moves has one."""
        time_s = time_s if self._house.house.get("motions") else None
        if time_s not in self._kept:
            while len(self._kept) >= _MOST_TIMES:
                del self._kept[next(iter(self._kept))]
            moved = house_at(self._house, self._triangles, time_s)
            triangles = moved.triangles
            self._kept[time_s] = Scenes(
                (triangles, Rays(triangles)), (triangles, Rays(triangles, ~triangles.see_through)),
                HouseItems(moved.house, triangles), moved.house, LitScene(moved.house, triangles), moved,
            )  # fmt: skip
        return self._kept[time_s]

    def then(self, now: Scenes, time_s: float | None) -> Then:
        """The house at a partner's time, and where points of the scenes now are in it."""
        there = self.at(time_s)
        if there is now:
            return Then(now.all[1], stay)
        return Then(
            there.all[1], lambda points, faces: there.moved.carried(now.moved, points, faces)
        )


def verify(
    folder: Path,
    *,
    sample: int | None = None,
    all_pixels: bool = False,
    tell: Callable[[int, int], None] = lambda _n, _of: None,
) -> Certificate:
    """Check every house and view below folder (an output root) and say how much was checked.

    sample: pixels of each view that are recomputed by rays (SAMPLE when None); all_pixels: every
    one. Checks on files, tables and whole pictures are always complete. tell: called with how many
    views were checked, of how many, as each one is. Raises BadInput when folder is no output root.
    """
    found = [p for name in keys.FOLDERS for p in (folder / name).glob("*") if p.is_dir()]
    houses = sorted(found, key=lambda p: p.name)
    if not houses:
        raise BadInput(folder, "houses/", "no houses here", hint="give the folder of --out")
    tally, views, n_halved = Tally(), list[StoredView](), 0
    # None is every pixel.
    n_pixels = None if all_pixels else (SAMPLE if sample is None else sample)
    n_views = sum(1 for house in houses for _file in house.glob("views/*/view.json"))
    checked = itertools.count(1)
    tell(0, n_views)
    check_root_manifest(folder, houses, tally)
    check_credits(folder, [StoredHouse(house) for house in houses], tally)
    for house in houses:
        check_files(folder, house, tally)
        found_views, halved = _check_house(
            house, n_pixels, tally, lambda: tell(next(checked), n_views)
        )
        views, n_halved = views + found_views, n_halved + halved
    _judge_ties(tally)
    fields = stored_fields(folder, houses)
    return tally.certificate(
        str(folder), len(houses), len(views), all_pixels=all_pixels,
        looked_at=looked_at(views, fields), not_looked_at=not_looked_at(folder, houses, views, fields, n_halved),
    )  # fmt: skip


def _check_house(
    house: Path, n_pixels: int | None, tally: Tally, tell: Callable[[], None]
) -> tuple[list[StoredView], int]:
    """Check the house's views; those that could be read, and of how many the light is halved.

    tell: called as a view is done.
    """
    views, faults = views_of_house(house)
    for file, fault in faults.items():
        place = f"{house.name}/{file.parent.name}/view.json"
        tally.expect("layers", place, False, fault)
    stored = StoredHouse(house)
    try:
        glb = stored_bytes(house / "house.glb")
        triangles = triangles_from_glb(glb).with_finishes(stored.house.get("materials", []))
    except (BadFile, BadGlb) as error:
        tally.expect("layers", house.name, False, f"house.glb {error}")
        return [], 0
    times = ScenesInTime(stored, triangles)
    scenes = times.at(None)
    _check_documents(stored, glb, scenes, tally)
    # Check each view by itself; a damaged one fails and the rest goes on.
    seen: list[SeenView] = []
    halved = {view.place for view in views[1:] if _is_halved(view, n_pixels)}
    for view in views:
        try:
            is_halved = view.place in halved
            now = times.at(view.table.get("time_s"))
            arrays = _check_view(view, now, times, n_pixels, tally, is_halved=is_halved)
        except FAULTS as error:
            tally.expect("layers", f"{view.place}/view.json", False, _fault(error))
            arrays = None
        tell()
        if arrays is not None:
            moves = np.isin(arrays["instance"], list(now.moved.instances))
            seen.append(SeenView(view, arrays["depth"], arrays["normal"], moves))
    check_reprojection(seen, tally)
    check_partners([one.view for one in seen], stored.camera_rows, tally)
    check_pairs(house, scenes.all[1], tally)

    def scene_at(time_s: float | None) -> tuple[MovedHouse, Rays]:
        there = times.at(time_s)
        return there.moved, there.all[1]

    try:
        check_tracks(stored, [one.view for one in seen], scene_at, tally)
    except FAULTS as error:
        tally.expect("tracks", f"{house.name}/tracks.npz", False, _fault(error))
    return views, len(halved)


def _check_documents(house: StoredHouse, glb: bytes, scenes: Scenes, tally: Tally) -> None:
    """Check the documents of a house against each other; what does not fit fails, and the rest goes on."""
    triangles, rays = scenes.all
    digest = hashlib.sha256(glb).hexdigest()
    checks: tuple[tuple[str, Callable[[], None]], ...] = (
        ("house.json", lambda: check_house(house, json_of_glb(glb), digest, tally)),
        ("house.json", lambda: check_models(house, triangles, tally)),
        ("house.json", lambda: check_floating(house, triangles, tally)),
        ("house.json", lambda: check_solids(house, triangles, rays, tally)),
        ("house.json", lambda: check_joints(house, triangles, tally)),
        ("house.json", lambda: check_motions(house, tally)),
        ("illuminance.json", lambda: check_illuminance(house, tally)),
        ("cameras.json", lambda: check_choice(house, rays, triangles, tally)),
    )
    for file, check in checks:
        try:
            check()
        except FAULTS as error:
            tally.expect("layers", f"{house.id}/{file}", False, _fault(error))


def _fault(error: Exception) -> str:
    return f"{error} is missing" if isinstance(error, KeyError) else f"does not fit: {error}"


def _check_view(
    view: StoredView,
    scenes: Scenes,
    times: ScenesInTime,
    n_pixels: int | None,
    tally: Tally,
    *,
    is_halved: bool,
) -> dict[str, NDArray[Any]] | None:
    """Check one view; its layers by name, None when its labels cannot be read. scenes: at its time."""
    check_pose(view, tally)
    arrays = read_labels(view, tally)
    if arrays is None:
        return None
    # From cheap to dear: facts, whole pictures, layers against each other, rays.
    check_facts(view, scenes.house, arrays, tally)
    check_pictures(view, arrays, tally)
    check_consistency(view, arrays, tally)
    check_planes(view, arrays, tally)
    check_typed_boundaries(view, arrays, tally)
    check_derived(view, arrays, tally)
    check_articulation(view, scenes.house, arrays, tally)
    check_motion_table(view, scenes.house, tally)
    if "projector" in arrays:
        check_projector(view, arrays["projector"], _chosen(view, n_pixels), scenes.all, tally)
    channels = read_radiance(view, tally)
    if channels is not None:
        check_radiance(view, scenes.house, channels, arrays["valid"], tally)
        check_developed(view, channels, arrays, tally, is_halved=is_halved)
        pixels = _chosen(view, SAMPLE)
        check_guides(view, channels, pixels, arrays, scenes.all, scenes.house, tally)
        check_intrinsic(
            view, channels, arrays, scenes.lit, scenes.all[1], tally, denoise=not is_halved
        )
        check_fit(view, channels, bright_pixels(arrays["instance"], scenes.house), tally)
        check_lit(view, channels, arrays, scenes.lit, scenes.all[1], tally)
    check_edges(view, arrays, tally)
    check_histogram(view, arrays, scenes.house.house, tally)
    check_rows(view, arrays["instance"], scenes.items, n_pixels, tally)
    _check_rays(view, arrays, scenes, n_pixels, tally)
    if MOTION_LAYERS & arrays.keys():
        check_motion(
            view, arrays, scenes.all, _chosen(view, n_pixels), tally, partial(times.then, scenes)
        )
    return arrays


def _is_halved(view: StoredView, n_pixels: int | None) -> bool:
    """Whether a view's light is denoised again at half its size, which costs least: never with every pixel.

    Names choose one in DENOISED that is denoised as it stands; the first view of a house is, anyway.
    """
    if n_pixels is None or zlib.crc32(view.place.encode()) % DENOISED == 0:
        return False
    try:
        return may_be_halved(view)
    except FAULTS:
        return False  # a view that is damaged; its checks say so


def _check_rays(
    view: StoredView,
    arrays: dict[str, NDArray[Any]],
    scenes: Scenes,
    n_pixels: int | None,
    tally: Tally,
) -> None:
    rows, columns = _chosen(view, n_pixels)
    basic = ("depth", "normal", "semantic", "instance")
    judged: list[tuple[tuple[Triangles, Hits], str, dict[str, str]]] = [
        (scenes.all, "ray: ", {name: name for name in RAY_LAYERS}),
        (scenes.opaque, "ray: behind glass ", {name: f"behind_glass_{name}" for name in basic}),
    ]
    mirrored = {name: f"behind_mirror_{name}" for name in basic}
    if any(file in arrays for file in mirrored.values()):
        triangles, rays = scenes.all
        sent_on = MirrorRays(triangles, rays, view.world_from_camera[:3, 3])
        judged.append(((triangles, sent_on), "ray: behind mirror ", mirrored))
    for scene, prefix, names in judged:
        # Judge the layers that the view has, as whole numbers where they are.
        present = {name: file for name, file in names.items() if file in arrays}
        if not present:
            continue
        labels = {name: arrays[file][rows, columns] for name, file in present.items()}
        labels = {k: a.astype(np.int64) if a.dtype.kind == "u" else a for k, a in labels.items()}
        verdict = judge(view, labels, rows, columns, scene)
        # Coincident surfaces of the source are a class of their own, by pairs of items.
        item, instance = scene[0].item, scene[0].instance
        for k in np.nonzero(verdict.coincident)[0]:
            pair = instance[verdict.first[k]], instance[verdict.face[k]]
            tally.coincide(view.place.partition("/")[0], (item[int(pair[0])], item[int(pair[1])]))
        if scene is scenes.all:
            _note_glitter(view, verdict, rows, columns, scenes.all, tally)
        ties = int((verdict.tied & ~verdict.coincident).sum())
        for check, right in verdict.right.items():
            tally.add(f"{prefix}{check}", len(rows), ties=ties)
            # Name each wrong pixel.
            for k in np.nonzero(~right)[0]:
                tally.fail(f"{prefix}{check}", view.place, f"row {rows[k]}, column {columns[k]}")


def _note_glitter(
    view: StoredView,
    verdict: PixelChecks,
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    scene: tuple[Triangles, Rays],
    tally: Tally,
) -> None:
    """Tell of pixels that show either of two colours, where there are more than a few of a pair."""
    triangles, _ = scene
    origin, directions = view.rays(rows, columns)
    other = of_another_colour(verdict.first, origin, directions, scene)
    seen = np.nonzero((other >= 0) & ~verdict.coincident)[0]
    pairs = np.stack([triangles.instance[verdict.first[seen]], triangles.instance[other[seen]]], 1)
    kinds, n = np.unique(np.sort(pairs, axis=1), axis=0, return_counts=True)
    for pair, count in zip(kinds, n, strict=True):
        if count > MOST_COINCIDENT:
            a, b = (triangles.item[int(i)] for i in pair)
            for _ in range(count):
                tally.coincide(view.place.partition("/")[0], (a, b))


def _chosen(view: StoredView, n_pixels: int | None) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of the pixels to recompute: all, or a sample that the view's name fixes."""
    height, width = view.size
    if n_pixels is None or n_pixels >= height * width:
        index = np.arange(height * width)
    else:
        rng = np.random.default_rng(zlib.crc32(view.place.encode()))
        index = rng.choice(height * width, n_pixels, replace=False)
    return index // width, index % width


def _judge_ties(tally: Tally) -> None:
    checked, ties = tally.totals("ray: instance")
    if checked and ties > max(2, MAX_TIES * checked):
        what = f"{ties} of {checked} pixels have another right answer"
        tally.expect("ties", "all views", False, what)
