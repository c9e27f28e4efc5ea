"""Groups of views for the forms of sequences: by house, in time, by the cameras of a rig; no effects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

import numpy as np

from pbrs_farm.export.chosen_view import ChosenView
from pbrs_farm.formats.film_mp4 import film_pace

_SAME_ROWS: Final = 1e-6  # tolerance of two cameras' rotations, and metres


@dataclass(frozen=True, slots=True, eq=False)
class SequenceFrame:
    """One moment of a house: the view of the rig's first camera, or the only one, and the others by name."""

    first: ChosenView
    others: Mapping[str, ChosenView]

    @property
    def time_s(self) -> float | None:
        """None for a view outside a walk."""
        time = self.first.facts.get("time_s")
        return None if time is None else float(time)

    @property
    def right(self) -> ChosenView | None:
        """The nearest view to the right of the first with the same rows (a rectified pair); None without one."""
        camera_from_world = np.linalg.inv(self.first.pose)
        by_distance: dict[float, ChosenView] = {}
        for view in self.others.values():
            between = camera_from_world @ view.pose
            aside, between[0, 3] = float(between[0, 3]), 0.0
            same_rows = np.abs(between - np.eye(4)).max() <= _SAME_ROWS
            if same_rows and aside > _SAME_ROWS and view.facts["K"] == self.first.facts["K"]:
                by_distance[aside] = view
        return by_distance[min(by_distance)] if by_distance else None


def by_house(views: Iterable[ChosenView]) -> dict[str, list[ChosenView]]:
    """House id -> its views, in their order."""
    houses: dict[str, list[ChosenView]] = {}
    for view in views:
        houses.setdefault(view.house.id, []).append(view)
    return houses


def frames_by_house(views: Sequence[ChosenView]) -> dict[str, list[SequenceFrame]]:
    """House id -> its moments: frames by number, then other views by id.

    Views of a rig's other cameras are grouped with that of its first; without it they are left out.
    """
    companions: dict[tuple[str, str], dict[str, ChosenView]] = {}
    for view in views:
        if view.shot.eye:
            companions.setdefault((view.house.id, view.shot.first.id), {})[view.shot.eye] = view
    frames: dict[str, list[SequenceFrame]] = {}
    for view in views:
        if not view.shot.eye:
            frame = SequenceFrame(view, companions.get((view.house.id, view.id), {}))
            frames.setdefault(view.house.id, []).append(frame)

    def order(frame: SequenceFrame) -> tuple[float, str]:
        return float(frame.first.facts.get("frame", float("inf"))), frame.first.id

    return {house: sorted(moments, key=order) for house, moments in frames.items()}


def films_of(views: Iterable[ChosenView]) -> dict[tuple[str, str], list[ChosenView]]:
    """(House, camera of a rig, "" for its first) -> the frames of a film in order."""
    films: dict[tuple[str, str], list[ChosenView]] = {}
    for view in views:
        films.setdefault((view.house.id, view.shot.eye), []).append(view)
    for frames in films.values():
        frames.sort(key=lambda view: int(view.facts["frame"]))
    return films


def pace_of(frames: Sequence[ChosenView]) -> Fraction:
    """Frames a second of a film."""
    ends = [(int(v.facts["frame"]), float(v.facts["time_s"])) for v in (frames[0], frames[-1])]
    return film_pace(*ends)
