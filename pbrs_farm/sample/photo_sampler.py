"""Views as a person would photograph a home: the preset `photo`; no effects of its own.

Candidates are the paper's (one a grid cell and sector), held as people hold cameras. Each gets
the score of photo_score.py from a small picture; the best of each sector is kept unless it is
weak, or shows what a better view of the home shows already.
"""

from __future__ import annotations

import collections
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.camera import Camera, Intrinsics, View
from pbrs_farm.core.house import Geometry, House, Room
from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.sample.camera_report import RoomReport, SectorReport
from pbrs_farm.sample.candidates import Candidates, grid_candidates
from pbrs_farm.sample.eye_probes import Counter, counted
from pbrs_farm.sample.paper_rules import rejections, room_grid
from pbrs_farm.sample.photo_score import PhotoShares, item_roles, photo_score, photo_shares
from pbrs_farm.sample.rejection import REJECTIONS, Verdict
from pbrs_farm.sample.view_overlap import DEPTH_SIZE, DepthOf, overlap

MOST_OVERLAP: Final = 0.8
"""A view that shares more than this with a better one is its twin."""

_TRIES: Final = 12
"""Candidates of a sector that are asked, best first, before the sector is given up as a twin."""


@dataclass(frozen=True, slots=True, eq=False)
class RoomCandidates:
    """A room's candidates with the rule that rejected each, and the score of the others.

    verdict: (N,) uint8 of Verdict. score: (N,) float64, -inf where a rule rejected it.
    """

    room: Room
    candidates: Candidates
    verdict: NDArray[np.uint8]
    score: F64

    def ranked(self, sector: int) -> NDArray[np.intp]:
        """Numbers of a sector's candidates that no rule rejected, best first."""
        mine = (self.candidates.sector == sector) & np.isfinite(self.score)
        which = np.flatnonzero(mine)
        return which[np.argsort(-self.score[which], kind="stable")]


@dataclass(slots=True, eq=False)
class PhotoSampler:
    """The sampler of one home. counter: pixels of each item; depth_of: small depth pictures."""

    house: House
    fields: CameraFields
    seed: int
    counter: Counter
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
        return RoomCandidates(room, candidates, verdict, score)

    def choose(self, rooms: Sequence[RoomCandidates]) -> dict[tuple[str, int], list[int]]:
        """(room id, sector) -> numbers of the chosen candidates; writes their verdicts.

        Sectors take turns by their best score, over all rooms, so that of two twins the better
        one stays.
        """
        # Let every sector that has a candidate take its turn, the best first.
        turns = [
            (-scored.score[ranked[0]], scored, sector)
            for scored in rooms
            for sector in range(self.fields.n_sectors)
            if len(ranked := scored.ranked(sector))
        ]
        turns.sort(key=lambda turn: turn[0])
        # Give each its views, compared with those of all rooms that are taken already.
        taken: list[tuple[Camera, F32]] = []
        chosen: dict[tuple[str, int], list[int]] = {}
        with_view: set[str] = set()
        for _key, scored, sector in turns:
            found = self._take(scored, sector, taken, is_first=scored.room.id not in with_view)
            chosen[scored.room.id, sector] = found
            if found:
                with_view.add(scored.room.id)
        return chosen

    def _take(
        self,
        scored: RoomCandidates,
        sector: int,
        taken: list[tuple[Camera, F32]],
        *,
        is_first: bool,
    ) -> list[int]:
        f, found = self.fields, list[int]()
        ranked = scored.ranked(sector)
        # A room's first view, its best, may be weaker than the others.
        weak = scored.score[ranked] < f.min_score
        if is_first and scored.score[ranked[0]] >= f.min_room_score:
            weak[0] = False
        scored.verdict[ranked[weak]] = Verdict.WEAK
        # Try the others from the best down; leave out what a view taken before shows.
        small = self._intrinsics(*DEPTH_SIZE)
        for number in ranked[~weak][: _TRIES * f.per_sector].tolist():
            camera = scored.candidates.cameras(np.array([number]), small)[0]
            depth = self.depth_of([camera])[0]
            if any(overlap(camera, depth, *other) > MOST_OVERLAP for other in taken):
                scored.verdict[number] = Verdict.TWIN
                continue
            taken.append((camera, depth))
            scored.verdict[number] = Verdict.WINNER
            found.append(number)
            if len(found) == f.per_sector:
                break
        return found

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
    tally = collections.Counter(verdict.tolist())
    refused = {rule.label: tally[rule] for rule in REJECTIONS if tally[rule]}
    ranked = scored.ranked(sector)
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
        runner_up_score=round(float(scored.score[ranked[1]]), 4) if len(ranked) > 1 else None,
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
