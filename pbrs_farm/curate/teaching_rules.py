"""`pbrs-farm select --by`: leaves out views that teach nothing, by rules about what they show.

Effects: reads views of an output folder. Each rule is a number of a view and what it may be at most; a
view that breaks several is counted for the first. Nothing is compared with photographs here.
"""

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
from pbrs_farm.core.house import ItemKind
from pbrs_farm.export.chosen_view import Choice, ChosenView, intrinsics_of, opengl_normals
from pbrs_farm.export.sequences import pose_opencv
from pbrs_farm.formats.output_folder import ViewEntry
from pbrs_farm.selection.histogram_pack import BLACK
from pbrs_farm.selection.quality import picture_quality
from pbrs_farm.store.object_store import Store

_PLANE_COS: Final = float(np.cos(np.radians(5)))  # between normals of one plane
_PLANE_M: Final = 0.03  # across it
_POINTS: Final = 4_800  # of a view, about
_THING_SHARE: Final = 0.01  # of the picture, from which a thing counts
_TWIN_M: Final = 1.5  # between eyes beyond which views are no twins
_TWIN_SHIFT: Final = 0.08  # of the picture's width, by which a twin shows a point elsewhere


@dataclass(frozen=True, slots=True)
class TeachingRule:
    """A rule: what it measures of a view, and from what on the view is left out."""

    name: str
    reason: str
    most: float
    measure: Callable[[ChosenView], float]


@dataclass(frozen=True, slots=True)
class RuleVerdict:
    """What the rules say of a view: the first that it breaks, "" where it is kept."""

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
    """Share of the picture that lies on its largest plane; 0 of a picture that sees nothing."""
    points, normals, n = _grid(view)
    if not len(points):
        return 0.0
    offsets = (points * normals).sum(1)
    # The plane that most share, to about a plane's width; then all that lie on it.
    cells = np.concatenate([np.rint(normals / 0.1), np.rint(offsets / 0.1)[:, None]], axis=1)
    _cells, cell, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    largest = cell.reshape(-1) == counts.argmax()
    normal = normals[largest].mean(0)
    normal /= np.linalg.norm(normal)
    offset = float(np.median(points[largest] @ normal))
    on = (normals @ normal > _PLANE_COS) & (np.abs(points @ normal - offset) < _PLANE_M)
    return float(on.sum() / n)


def cut_share(view: ChosenView) -> float:
    """Share of the things that the picture's edge cuts; 0 without things.

    Things are no walls, floors or ceilings, and cover a hundredth of the picture at least.
    """
    structure = {kind.value for kind in ItemKind if kind.is_structure}
    things = [
        row
        for row in view.facts["instances"]
        if row["kind"] not in structure and row["fraction"] >= _THING_SHARE
    ]
    return sum(row["truncated"] for row in things) / len(things) if things else 0.0


def darkness(view: ChosenView) -> float:
    """1 where nothing is seen in the view's picture, else 0; 0 without one."""
    if view.picture is None:
        return 0.0
    return float(picture_quality(view.array(view.picture)).brightness <= BLACK)


def twin_share(view: ChosenView, other: ChosenView) -> float:
    """Share of what a view sees that another shows at nearly the same place of its picture.

    Of two pin-holes; 0 for other lenses and for eyes that are far apart. Not symmetric: a wide view
    may hold all of a narrow one.
    """
    i, theirs = intrinsics_of(view.facts), intrinsics_of(other.facts)
    near = np.linalg.norm(pose_opencv(view)[:3, 3] - pose_opencv(other)[:3, 3]) < _TWIN_M
    if not (near and i.lens.is_pinhole and theirs.lens.is_pinhole):
        return 0.0
    points, _normals, _n = _grid(view)
    if not len(points):
        return 0.0
    matrix = np.linalg.inv(pose_opencv(other)) @ pose_opencv(view)
    moved = theirs.pixels(points @ matrix[:3, :3].T + matrix[:3, 3])
    pixels = i.pixels(points)
    shift = (moved / [theirs.width_px, theirs.height_px]) - (pixels / [i.width_px, i.height_px])
    with np.errstate(invalid="ignore"):
        same = np.linalg.norm(shift * [1, i.height_px / i.width_px], axis=1) < _TWIN_SHIFT
        inside = ((moved >= 0) & (moved < [theirs.width_px, theirs.height_px])).all(1)
    return float((same & inside).mean())


@lru_cache(maxsize=64)
def _grid(view: ChosenView) -> tuple[F64, F64, int]:
    """(N, 3) points in camera axes (x right, y down, z forward), their normals, and of how many pixels."""
    depth = view.array("depth")
    step = max(1, int(np.sqrt(depth.size / _POINTS)))
    y, x = (g.ravel() for g in np.mgrid[: depth.shape[0] : step, : depth.shape[1] : step])
    n, z = len(x), depth[y, x] / 1000
    has_surface = (z > 0) & (view.array("valid")[y, x] > 0)
    y, x, z = y[has_surface], x[has_surface], z[has_surface]
    rays = intrinsics_of(view.facts).directions(np.stack([x + 0.5, y + 0.5], axis=1))
    normals = opengl_normals(view)[y, x].astype(np.float64) * [1, -1, -1]
    return rays * z[:, None], normals, n


_TWINS: Final = "twins"
_TWIN_MOST: Final = 0.8
RULES: Final = (
    TeachingRule("black", "black", 0.5, darkness),
    TeachingRule("plane", "one-plane", 0.8, plane_share),
    TeachingRule("cut", "cut-things", 0.9, cut_share),
)
REASONS: Final = {**{rule.name: rule.reason for rule in RULES}, _TWINS: "twin"}
"""What --by takes -> why a view is left out, in the order in which it is judged."""


def judged_by(entries: Sequence[ViewEntry], names: Sequence[str]) -> list[RuleVerdict]:
    """The verdict of each view by the rules of these names; BadInput for a name that is none.

    Twins are looked for last, in each room among the views that nothing else rejects: of two the one
    with the smaller id stays. What other cameras of a rig took goes where the view of the first one goes.
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
    """Write selection/<run>.jsonl and selection.json; the summary, as selection.json has it.

    by: names of the rules that judged, which may be none. BadInput for a run's name that is none.
    """
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
    """A view's numbers and the first reason; one that is kept is put to the others of its room."""
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
