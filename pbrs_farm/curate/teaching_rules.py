"""`pbrs-farm select --by`: reject uninformative views by the first of some rules. Reads views."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import ItemKind
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.formats.output_folder import ViewEntry
from pbrs_farm.selection.histogram_pack import BLACK
from pbrs_farm.selection.quality import picture_quality
from pbrs_farm.store.object_store import Store

_PLANE_COS: Final = float(np.cos(np.radians(5)))  # minimum cosine between normals of one plane
_PLANE_M: Final = 0.03  # maximum distance of a point from its plane, metres
_POINTS: Final = 4_800  # approximate number of sampled points of a view
_THING_SHARE: Final = 0.01  # minimum share of the picture for an item to count
_TWIN_M: Final = 1.5  # maximum distance between the cameras of twins, metres
_TWIN_SHIFT: Final = 0.08  # maximum shift of a point between twins, share of the picture's width


@dataclass(frozen=True, slots=True)
class TeachingRule:
    """A rule: a measure of a view, and the maximum above which the view is rejected."""

    name: str
    reason: str
    most: float
    measure: Callable[[ChosenView], float]


@dataclass(frozen=True, slots=True)
class RuleVerdict:
    """The verdict on a view. reason: of the first rule that it breaks, "" if it is kept."""

    house: str
    view: str
    reason: str
    numbers: Mapping[str, float]  # by the rules' names

    @property
    def json_line(self) -> str:
        """The row of selection/<run>.jsonl."""
        row: dict[str, Any] = {"house": self.house, "view": self.view, "kept": not self.reason}
        row |= {"reason": self.reason} | {k: round(v, 4) for k, v in self.numbers.items()}
        return json.dumps(row, separators=(",", ":")) + "\n"


def plane_share(view: ChosenView) -> float:
    """Share of the picture covered by its largest plane; 0 for a picture without surfaces."""
    points, normals, n = _grid(view)
    if not len(points):
        return 0.0
    offsets = (points * normals).sum(1)
    # Find the most common plane in coarse bins, then all points within its tolerance.
    cells = np.concatenate([np.rint(normals / 0.1), np.rint(offsets / 0.1)[:, None]], axis=1)
    _cells, cell, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    largest = cell.reshape(-1) == counts.argmax()
    normal = normals[largest].mean(0)
    normal /= np.linalg.norm(normal)
    offset = float(np.median(points[largest] @ normal))
    on = (normals @ normal > _PLANE_COS) & (np.abs(points @ normal - offset) < _PLANE_M)
    return float(on.sum() / n)


def cut_share(view: ChosenView) -> float:
    """Share of the items, but structure and tiny ones, that the picture's edge cuts; 0 without items."""
    structure = {kind.value for kind in ItemKind if kind.is_structure}
    things = [
        row
        for row in view.facts["instances"]
        if row["kind"] not in structure and row["fraction"] >= _THING_SHARE
    ]
    return sum(row["truncated"] for row in things) / len(things) if things else 0.0


def darkness(view: ChosenView) -> float:
    """1 if the view's picture is black, else 0; 0 without a picture."""
    if view.picture is None:
        return 0.0
    return float(picture_quality(view.array(view.picture)).brightness <= BLACK)


def twin_share(view: ChosenView, other: ChosenView) -> float:
    """Share of a pinhole view's points that another, maybe narrower, shows at nearly the same pixel."""
    i, theirs = view.intrinsics, other.intrinsics
    near = np.linalg.norm(view.pose[:3, 3] - other.pose[:3, 3]) < _TWIN_M
    if not (near and i.lens.is_pinhole and theirs.lens.is_pinhole):
        return 0.0
    points, _normals, _n = _grid(view)
    if not len(points):
        return 0.0
    matrix = np.linalg.inv(other.pose) @ view.pose
    moved = theirs.pixels(transform_points(matrix, points))
    pixels = i.pixels(points)
    shift = (moved / [theirs.width_px, theirs.height_px]) - (pixels / [i.width_px, i.height_px])
    with np.errstate(invalid="ignore"):
        same = np.linalg.norm(shift * [1, i.height_px / i.width_px], axis=1) < _TWIN_SHIFT
        inside = ((moved >= 0) & (moved < [theirs.width_px, theirs.height_px])).all(1)
    return float((same & inside).mean())


@lru_cache(maxsize=64)
def _grid(view: ChosenView) -> tuple[F64, F64, int]:
    """(N, 3) points in camera axes (x right, y down, z forward), their normals, and the number of sampled pixels."""
    depth = view.array("depth")
    step = max(1, int(np.sqrt(depth.size / _POINTS)))
    y, x = (g.ravel() for g in np.mgrid[: depth.shape[0] : step, : depth.shape[1] : step])
    n, z = len(x), depth[y, x] / 1000
    has_surface = (z > 0) & (view.array("valid")[y, x] > 0)
    y, x, z = y[has_surface], x[has_surface], z[has_surface]
    rays = view.intrinsics.directions(np.stack([x + 0.5, y + 0.5], axis=1))
    normals = view.opengl_normals()[y, x].astype(np.float64) * [1, -1, -1]
    return rays * z[:, None], normals, n


_TWINS: Final = "twins"
_TWIN_MOST: Final = 0.8
RULES: Final = (
    TeachingRule("black", "black", 0.5, darkness),
    TeachingRule("plane", "one-plane", 0.8, plane_share),
    TeachingRule("cut", "cropped-objects", 0.9, cut_share),
)
REASONS: Final = {**{rule.name: rule.reason for rule in RULES}, _TWINS: "twin"}
"""Values of --by -> reason for the rejection, in the order of the checks."""


def judged_by(entries: Sequence[ViewEntry], names: Sequence[str]) -> list[RuleVerdict]:
    """Judge each view by the named rules; raises BadInput for an unknown name.

    Twins are checked last, in each room among the views that pass the other rules: of two, the one
    with the smaller id is kept. Other cameras of a rig get the verdict of its first camera.
    """
    for name in names:
        if name not in REASONS:
            raise BadInput("--by", name, "no such rule", hint=f"of {', '.join(REASONS)}")
    verdicts: dict[tuple[str, str], RuleVerdict] = {}
    shown: dict[tuple[str, str], list[ChosenView]] = {}
    for entry in sorted(entries, key=lambda e: (e.shot.eye != "", e.house.id, e.id)):
        first = verdicts.get((entry.house.id, entry.shot.first.id))
        shown_of_room = shown.setdefault((entry.house.id, entry.room_id), [])
        numbers, reason = (
            _judged(entry, names, shown_of_room) if first is None else (first.numbers, first.reason)
        )
        verdicts[entry.house.id, entry.id] = RuleVerdict(entry.house.id, entry.id, reason, numbers)
    return [verdicts[place] for place in sorted(verdicts)]


def write_verdicts(
    store: Store, run: str, by: Sequence[str], verdicts: Sequence[RuleVerdict]
) -> dict[str, Any]:
    """Write selection/<run>.jsonl and selection.json (whose content is returned); BadInput for a run."""
    key = keys.selection_key(run, "jsonl")
    store.put(key, "".join(verdict.json_line for verdict in verdicts).encode())
    counts = {
        reason: sum(verdict.reason == reason for verdict in verdicts)
        for name, reason in REASONS.items()
        if name in by
    }
    n = len(verdicts) - sum(counts.values())
    summary = {"run": run, "by": list(by), "views": len(verdicts), "kept": n, "reasons": counts}
    store.put(keys.SELECTION, (json.dumps(summary, indent=1) + "\n").encode())
    return summary


def _judged(
    entry: ViewEntry, names: Sequence[str], shown: list[ChosenView]
) -> tuple[dict[str, float], str]:
    """Measure a view; returns its numbers and first reason. A kept view is appended to shown."""
    view, numbers, reason = ChosenView(entry, Choice()), dict[str, float](), ""
    for rule in RULES:
        if rule.name in names:
            numbers[rule.name] = rule.measure(view)
            reason = reason or (rule.reason if numbers[rule.name] > rule.most else "")
    if _TWINS in names and not reason:
        numbers[_TWINS] = max((_alike(view, peer) for peer in shown), default=0.0)
        reason = "twin" if numbers[_TWINS] > _TWIN_MOST else ""
    if not reason:
        shown.append(view)
    return numbers, reason


def _alike(view: ChosenView, other: ChosenView) -> float:
    return min(twin_share(view, other), twin_share(other, view))
