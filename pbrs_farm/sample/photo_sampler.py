"""Views as a person would photograph a home: the preset `photo`; no effects of its own.

Candidates are the paper's (one a grid cell and sector), held as people hold cameras. Each gets
the score of photo_score.py from a small picture; PhotoChoice chooses among those of all rooms.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.camera import Camera, Intrinsics, View
from pbrs_farm.core.classes import NYU13_NAMES
from pbrs_farm.core.house import Geometry, House, Room
from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.sample.camera_report import REJECTIONS, RoomReport, SectorReport, Verdict
from pbrs_farm.sample.candidates import RoomCandidates, grid_candidates
from pbrs_farm.sample.eye_probes import ItemCounter, counted
from pbrs_farm.sample.paper_rules import rejections, room_grid
from pbrs_farm.sample.photo_score import (
    PhotoShares,
    framing_cost,
    item_roles,
    photo_score,
    photo_shares,
)
from pbrs_farm.sample.view_score import DEPTH_SIZE, DepthOf, overlap

# How near what a set of views shows comes to what photographs of rooms show.
# The measure is the L1 distance of the mean NYU13 pixel shares of the views to those published of
# NYUv2's labelled frames (Silberman et al. 2012), unlabelled pixels left out of both.


NYUV2_SHARES: Final[Mapping[str, float]] = {
    "wall": 0.235, "furniture": 0.139, "objects": 0.121, "floor": 0.098, "window": 0.051,
    "bed": 0.041, "table": 0.035, "chair": 0.033, "sofa": 0.031, "picture": 0.022,
    "ceiling": 0.013, "books": 0.007,
}  # fmt: skip
"""Shares of pixels over NYUv2's 1,449 labelled frames, unlabelled pixels counted."""

_PHOTOGRAPHS: Final[F64] = np.array([NYUV2_SHARES.get(name, 0.0) for name in NYU13_NAMES])
# (14,) the same of the labelled pixels alone.
_OF_LABELLED: Final[F64] = _PHOTOGRAPHS / _PHOTOGRAPHS.sum()


def share_distance(shares: F64) -> F64:
    """(...) L1 distance, 0..2, of NYU13 shares (..., 14) to those of NYUv2's frames.

    shares: means or sums over views, any scale; column 0 is left out. What shows nothing that has
    a class is as far as can be.
    """
    labelled = shares[..., 1:]
    total = labelled.sum(-1, keepdims=True)
    part = labelled / np.where(total > 0, total, 1.0)
    return np.where(total[..., 0] > 0, np.abs(part - _OF_LABELLED[1:]).sum(-1), 2.0)


# Which candidates of a home become its views: good ones, no twins, together like photographs.
# No effects of its own. The views of a home maximise the sum of their scores, less what their
# framing costs, less likeness x their number x the distance of their mean class shares to those
# of photographs (share_distance): first sector by sector, the best first, then by exchange.


MOST_OVERLAP: Final = 0.8
"""A view that shares more than this with a better one is its twin."""

_TRIES: Final = 12
"""Candidates of a sector that are asked, best first, before the sector is given up as a twin."""

_ROUNDS: Final = 3
"""How often every view may be exchanged for another of its sector."""

MOST_WORSE: Final = 0.25
"""By how much of score less than its sector's best a view may be taken for its likeness."""

_Name = tuple[str, int]
"""A candidate's room and number."""


@dataclass(slots=True, eq=False)
class _Sector:
    """A sector that may have views: its candidates, best first, and the numbers of those taken."""

    scored: RoomCandidates  # of its room
    number: int  # in its room
    candidates: NDArray[np.intp]
    taken: list[int] = field(default_factory=list)


@dataclass(slots=True, eq=False)
class PhotoChoice:
    """The choice among all candidates of one home, made once.

    lens: of zoom 1, of the size of depth pictures. depth_of: small depth pictures.
    """

    fields: CameraFields
    lens: Intrinsics
    depth_of: DepthOf
    _shown: F64 = field(default_factory=lambda: np.zeros(len(NYU13_NAMES)))  # sum over views
    _taken: dict[_Name, tuple[Camera, F32]] = field(default_factory=dict)
    _looked_at: dict[_Name, tuple[Camera, F32]] = field(default_factory=dict)

    def choose(self, rooms: Sequence[RoomCandidates]) -> dict[tuple[str, int], list[int]]:
        """(room id, sector) -> numbers of the chosen candidates; writes their verdicts.

        Sectors take turns by their best score, over all rooms, so that of two twins the better
        one stays.
        """
        # Let every sector that has a candidate take its turn, the best first.
        sectors = [
            _Sector(scored, number, ranked)
            for scored in rooms
            for number in range(self.fields.n_sectors)
            if len(ranked := scored.ranked(number))
        ]
        sectors.sort(key=lambda sector: -sector.scored.score[sector.candidates[0]])
        # Give each its views, compared with those of all rooms that are taken already.
        with_view: set[str] = set()
        for sector in sectors:
            self._leave_out_weak(sector, is_first=sector.scored.room.id not in with_view)
            self._fill(sector)
            if sector.taken:
                with_view.add(sector.scored.room.id)
        # Exchange views for others that bring all of them nearer to photographs.
        for _ in range(_ROUNDS if self.fields.likeness > 0 else 0):
            if not sum(self._exchange(sector) for sector in sectors):
                break
        for sector in sectors:
            sector.scored.verdict[sector.taken] = Verdict.WINNER
        return {(sector.scored.room.id, sector.number): sector.taken for sector in sectors}

    def _leave_out_weak(self, sector: _Sector, *, is_first: bool) -> None:
        """Close a sector to weak candidates; a room's first view, its best, may be weaker."""
        f, scored = self.fields, sector.scored
        weak = scored.score[sector.candidates] < f.min_score
        if is_first and scored.score[sector.candidates[0]] >= f.min_room_score:
            weak[0] = False
        scored.verdict[sector.candidates[weak]] = Verdict.WEAK
        sector.candidates = sector.candidates[~weak]
        # Likeness chooses among the better ones.
        if f.likeness > 0 and len(sector.candidates):
            score = scored.score[sector.candidates]
            sector.candidates = sector.candidates[score >= score[0] - MOST_WORSE]

    def _fill(self, sector: _Sector) -> None:
        """Take a sector's views, the candidate that adds most first, leaving out twins."""
        left = sector.candidates
        for _ in range(_TRIES * self.fields.per_sector):
            if len(sector.taken) == self.fields.per_sector or not len(left):
                return
            # Rank again after each: what a view adds depends on those that are taken.
            at = int(np.argmax(self._gain(sector.scored, left)))
            number, left = int(left[at]), np.delete(left, at)
            if self._is_twin(sector.scored, number):
                sector.scored.verdict[number] = Verdict.TWIN
            else:
                self._take(sector, number)

    def _exchange(self, sector: _Sector) -> bool:
        """Give each view of a sector up for the candidate that then adds most."""
        before = list(sector.taken)
        for number in before:
            self._give_up(sector, number)
            others = np.setdiff1d(sector.candidates, sector.taken)
            gain = self._gain(sector.scored, others)
            # Try the better ones from the best down; itself is no twin of any.
            order = others[np.argsort(-gain, kind="stable")][:_TRIES].tolist()
            better = order[: order.index(number)] if number in order else order
            free = (k for k in better if not self._is_twin(sector.scored, k))
            self._take(sector, next(free, number))
        return set(before) != set(sector.taken)

    def _gain(self, scored: RoomCandidates, numbers: NDArray[np.intp]) -> F64:
        """(M,) what candidates would add to the views that are taken."""
        score = scored.score[numbers]
        if self.fields.likeness == 0:
            return score
        distance = share_distance(self._shown + scored.nyu13[numbers])
        unlike = self.fields.likeness * (len(self._taken) + 1) * distance
        return np.asarray(score - scored.framing[numbers] - unlike)

    def _take(self, sector: _Sector, number: int) -> None:
        sector.taken.append(number)
        self._taken[sector.scored.room.id, number] = self._look(sector.scored, number)
        self._shown = self._shown + sector.scored.nyu13[number]

    def _give_up(self, sector: _Sector, number: int) -> None:
        sector.taken.remove(number)
        del self._taken[sector.scored.room.id, number]
        self._shown = self._shown - sector.scored.nyu13[number]

    def _is_twin(self, scored: RoomCandidates, number: int) -> bool:
        camera, depth = self._look(scored, number)
        return any(overlap(camera, depth, *o) > MOST_OVERLAP for o in self._taken.values())

    def _look(self, scored: RoomCandidates, number: int) -> tuple[Camera, F32]:
        """A candidate's camera and depth picture; remembered."""
        name = scored.room.id, number
        if name not in self._looked_at:
            camera = scored.candidates.cameras(np.array([number]), self.lens)[0]
            self._looked_at[name] = camera, self.depth_of([camera])[0]
        return self._looked_at[name]


# Views as a person would photograph a home.


@dataclass(slots=True, eq=False)
class PhotoSampler:
    """The sampler of one home. counter: pixels of each item; depth_of: small depth pictures."""

    house: House
    fields: CameraFields
    seed: int
    counter: ItemCounter
    depth_of: DepthOf
    geometry: Geometry

    def room_candidates(self, room: Room) -> RoomCandidates:
        """Every candidate of a room, rejected by a rule or scored."""
        # Reject by position first, and look at what is left through small pictures.
        f = self.fields
        names = (self.seed, self.house.id, room.id)
        candidates = grid_candidates(room_grid(room), f, names)
        verdict = rejections(self.house, room, f, candidates, self.geometry, self.counter)
        score = np.full(len(candidates), -np.inf)
        eligible = np.flatnonzero(verdict == Verdict.LOWER_SCORE)
        size = (f.coarse_width_px, f.coarse_height_px)
        seen = self._shares(candidates.cameras(eligible, self._intrinsics(*size)))

        # Rules about the picture come before any comparison of scores.
        one = (seen.largest > f.max_item_fraction) | (seen.wall > f.max_wall_fraction)
        verdict[eligible[one | (seen.opening > f.max_opening_fraction)]] = Verdict.FILLED_BY_ONE
        verdict[eligible[seen.n_objects < f.min_objects]] = Verdict.FEW_OBJECTS
        score[eligible] = np.where(
            verdict[eligible] == Verdict.LOWER_SCORE, photo_score(seen), -np.inf
        )
        nyu13, framing = np.zeros((len(score), seen.nyu13.shape[1])), np.zeros(len(score))
        tilt_deg = np.degrees(np.arcsin(-candidates.towards[eligible, 1]))
        nyu13[eligible], framing[eligible] = seen.nyu13, framing_cost(seen, tilt_deg)
        return RoomCandidates(room, candidates, verdict, score, nyu13, framing)

    def choose(self, rooms: Sequence[RoomCandidates]) -> dict[tuple[str, int], list[int]]:
        """(room id, sector) -> numbers of the chosen candidates; writes their verdicts."""
        choice = PhotoChoice(self.fields, self._intrinsics(*DEPTH_SIZE), self.depth_of)
        return choice.choose(rooms)

    def views(self, scored: RoomCandidates, sector: int, chosen: list[int]) -> list[View]:
        """The chosen candidates of a sector as views, at the scoring size."""
        # Count the pixels of furniture again at the size that scores are stored for.
        f = self.fields
        full = self._intrinsics(f.score_width_px, f.score_height_px)
        cameras = scored.candidates.cameras(np.array(chosen, np.intp), full)
        columns = np.flatnonzero(item_roles(self.house).furniture)
        counts = [r for _part, rows in counted(self.counter, cameras, self._n_items) for r in rows]
        return [
            View(
                id=keys.view_id(scored.room.id, sector, k if f.per_sector > 1 else None),
                room_id=scored.room.id,
                sector=sector,
                camera=camera,
                score=round(float(scored.score[number]), 4),
                objects={int(i): int(row[i]) for i in columns if row[i]},
            )
            for k, (number, camera, row) in enumerate(zip(chosen, cameras, counts, strict=True))
        ]

    @property
    def _n_items(self) -> int:
        return len(self.house.items)

    def _shares(self, cameras: list[Camera]) -> PhotoShares:
        """What small pictures of these cameras show."""
        rows = [part for _which, part in counted(self.counter, cameras, self._n_items)]
        counts = np.concatenate([np.zeros((0, self._n_items + 1), np.uint32), *rows])
        depth = self.depth_of([camera.with_size(*DEPTH_SIZE) for camera in cameras])
        flat = depth.reshape(len(cameras), DEPTH_SIZE[0] * DEPTH_SIZE[1])
        return photo_shares(counts, flat, item_roles(self.house), self.fields.min_object_fraction)

    def _intrinsics(self, width_px: int, height_px: int) -> Intrinsics:
        f = self.fields
        full = Intrinsics.from_hfov(f.score_width_px, f.score_height_px, f.hfov_rad)
        return full.resized(width_px, height_px)


def sector_report(scored: RoomCandidates, sector: int, views: Sequence[View]) -> SectorReport:
    """How many candidates of a sector each rule rejected, and its view."""
    verdict = scored.verdict[scored.candidates.sector == sector]
    # Count by the first rule that rejected; name the commonest where no view is left.
    tally = Counter(verdict.tolist())
    refused = {rule.label: tally[rule] for rule in REJECTIONS if tally[rule]}
    ranked = scored.ranked(sector)
    winners = np.flatnonzero(scored.verdict[ranked] == Verdict.WINNER)
    others = scored.score[np.delete(ranked, winners[:1] if len(winners) else slice(0, 1))]
    most = ", ".join(
        f"{n} {rule.replace('_', ' ')}" for rule, n in sorted(refused.items(), key=lambda p: -p[1])
    )
    return SectorReport(
        sector=sector,
        n_candidates=len(verdict),
        refused=refused,
        n_kept=tally[Verdict.LOWER_SCORE] + tally[Verdict.WINNER],
        n_rescored=0,
        views=tuple(view.id for view in views),
        winner_score=views[0].score if views else None,
        runner_up_score=round(float(others[0]), 4) if len(others) else None,
        reason="" if views else f"every candidate was rejected: {most}",
    )


def room_report(
    sampler: PhotoSampler, scored: RoomCandidates, chosen: dict[tuple[str, int], list[int]]
) -> tuple[list[View], RoomReport]:
    """A room's views and what became of its candidates."""
    room, views, sectors = scored.room, list[View](), []
    for sector in range(sampler.fields.n_sectors):
        mine = chosen.get((room.id, sector), [])
        found = sampler.views(scored, sector, mine) if mine else []
        views += found
        sectors.append(sector_report(scored, sector, found))
    return views, RoomReport(room_id=room.id, name=room.name, sectors=tuple(sectors))
