"""Views as a person would photograph a home: the preset `photo`; no effects.

Candidates are the paper's (one per grid cell and sector), with hand-held poses. Each is scored by
photo_score.py from a tiny picture, and the promising ones again from a small picture; photo_choice.py chooses
among those of all rooms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.camera import Camera, Intrinsics, View
from pbrs_farm.core.classes import NYU13_NAMES
from pbrs_farm.core.house import Geometry, House, Room
from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.core.shot import view_id
from pbrs_farm.sample.camera_report import RoomReport, SectorReport, Verdict
from pbrs_farm.sample.candidates import grid_candidates
from pbrs_farm.sample.eye_probes import EnclosureLimits, ItemCounter, count_items, enclosure_limits
from pbrs_farm.sample.paper_rules import rejections, room_grid
from pbrs_farm.sample.photo_choice import PhotoChoice, RoomCandidates
from pbrs_farm.sample.photo_score import (
    ItemRoles,
    cut_shares,
    foreground_cost,
    framing_cost,
    furniture_points,
    item_pixels,
    item_roles,
    photo_score,
    photo_shares,
)
from pbrs_farm.sample.view_overlap import DEPTH_SIZE, ItemPictures

Size = tuple[int, int]  # width and height of a picture, px

# Edges of small and tiny pictures, of those of a coarse picture (96 x 72 and 24 x 18 of 160 x 120).
SMALL, TINY = 0.6, 0.15
_LEAST_TINY_PX: Final = (
    16  # minimum edge of a picture in which furniture and walls are distinguishable
)


@dataclass(eq=False)
class PhotoSampler:
    """The sampler of one home. counter: pixels of each item; pictures_of: small pictures of depth and items."""

    house: House
    fields: CameraFields
    seed: int
    counter: ItemCounter
    pictures_of: ItemPictures
    geometry: Geometry
    _looked_at: dict[tuple[str, int], tuple[Camera, F32]] = field(default_factory=dict)
    _at_full_size: dict[tuple[str, int], tuple[Camera, NDArray[np.uint32]]] = field(
        default_factory=dict
    )

    def room_candidates(self, room: Room) -> RoomCandidates:
        """Every candidate of a room, rejected by a rule or, slowly, scored from a tiny picture."""
        f = self.fields
        names = (self.seed, self.house.id, room.id)
        candidates = grid_candidates(room_grid(room), f, names)
        verdict = rejections(
            self.house, room, f, candidates, self.geometry, self.counter, self._limits
        )
        n = len(candidates)
        nothing = np.zeros((n, len(NYU13_NAMES)))
        none = np.zeros(n)
        placed = RoomCandidates(room, candidates, verdict, none, nothing, none, none)
        remaining = np.flatnonzero(verdict == Verdict.LOWER_SCORE)
        return self.scored_from_pictures(placed, remaining, self._first_size)

    def with_better_scores(self, rooms: Sequence[RoomCandidates]) -> list[RoomCandidates]:
        """Score the eligible candidates of all rooms again from small pictures; others lose their score."""
        if self._first_size == self._size:
            return list(rooms)
        first = [replace(scored, verdict=scored.verdict.copy()) for scored in rooms]
        likely = PhotoChoice(self.fields, self._intrinsics(*DEPTH_SIZE), None).likely(first)
        return [
            self.scored_from_pictures(scored, likely[scored.room.id], self._size)
            for scored in first
        ]

    def scored_from_pictures(
        self, placed: RoomCandidates, which: NDArray[np.intp], size: Size
    ) -> RoomCandidates:
        """The candidates numbered by which (M,) with scores from pictures of a size; no other has one."""
        f, candidates = self.fields, placed.candidates
        cameras = candidates.cameras(which, self._intrinsics(*size))
        depth, seen_items = self.pictures_of(cameras)
        counts = item_pixels(seen_items, self._n_items + 1)
        if size == self._size:
            # Depth that finds near-duplicates, too.
            cameras, depth, seen_items = self._at_depth_size(cameras, depth, seen_items)
            names = [(placed.room.id, int(k)) for k in which]
            self._looked_at |= dict(zip(names, zip(cameras, depth, strict=True), strict=True))
        cut = cut_shares(cameras, depth, seen_items, self._roles, self._points)
        flat = depth.reshape(len(cameras), depth.shape[1] * depth.shape[2])
        shares = photo_shares(counts, flat, self._roles, f.min_object_fraction, cut)
        # Rules about the picture come before any comparison of scores.
        rule = np.full(len(which), Verdict.LOWER_SCORE, np.uint8)
        overfilled = (shares.largest > f.max_item_fraction) | (shares.wall > f.max_wall_fraction)
        rule[overfilled | (shares.opening > f.max_opening_fraction)] = Verdict.FILLED_BY_ONE
        rule[shares.n_objects < f.min_objects] = Verdict.FEW_OBJECTS
        # Give the others the score of what they show.
        n = len(candidates)
        verdict, score = placed.verdict.copy(), np.full(n, -np.inf)
        nyu13, framing, foreground = np.zeros((n, shares.nyu13.shape[1])), np.zeros(n), np.zeros(n)
        tilt_deg = np.degrees(np.arcsin(-candidates.towards[which, 1]))
        verdict[which] = rule
        score[which] = np.where(rule == Verdict.LOWER_SCORE, photo_score(shares), -np.inf)
        nyu13[which], framing[which] = shares.nyu13, framing_cost(shares, tilt_deg)
        foreground[which] = foreground_cost(shares)
        return RoomCandidates(placed.room, candidates, verdict, score, nyu13, framing, foreground)

    def choose(self, rooms: Sequence[RoomCandidates]) -> dict[tuple[str, int], list[int]]:
        """(room id, sector) -> chosen indices; rooms: every room of the house. Writes the verdicts."""
        lens = self._intrinsics(*DEPTH_SIZE)
        looked_at = dict(self._looked_at)
        choice = PhotoChoice(self.fields, lens, lambda c: self.pictures_of(c)[0], looked_at)
        chosen = choice.choose(rooms)
        # Count the pixels of furniture again at the size of stored scores, for all views at once.
        f = self.fields
        full = self._intrinsics(f.score_width_px, f.score_height_px)
        by_room = {scored.room.id: scored for scored in rooms}
        names = [(room, int(k)) for (room, _sector), some in chosen.items() for k in some]
        cameras = [by_room[r].candidates.cameras(np.array([k], np.intp), full)[0] for r, k in names]
        parts = count_items(self.counter, cameras, self._n_items)
        counts = [row for _which, rows in parts for row in rows]
        self._at_full_size = dict(zip(names, zip(cameras, counts, strict=True), strict=True))
        return chosen

    def views(self, scored: RoomCandidates, sector: int, chosen: list[int]) -> list[View]:
        """The chosen candidates of a sector as views, at the scoring size."""
        columns, per_sector = np.flatnonzero(self._roles.furniture), self.fields.per_sector
        counted = [self._at_full_size[scored.room.id, number] for number in chosen]
        return [
            View(
                id=view_id(scored.room.id, sector, k if per_sector > 1 else None),
                room_id=scored.room.id,
                sector=sector,
                camera=camera,
                score=round(float(scored.worth(np.array([number]))[0]), 4),
                objects={int(i): int(row[i]) for i in columns if row[i]},
            )
            for k, (number, (camera, row)) in enumerate(zip(chosen, counted, strict=True))
        ]

    @cached_property
    def _roles(self) -> ItemRoles:
        return item_roles(self.house)

    @cached_property
    def _points(self) -> list[F64]:
        return furniture_points(self.house)

    @cached_property
    def _limits(self) -> EnclosureLimits:
        return enclosure_limits(self.house)

    @property
    def _n_items(self) -> int:
        return len(self.house.items)

    @property
    def _size(self) -> Size:
        """Of small pictures."""
        return self._of_coarse(SMALL)

    @property
    def _first_size(self) -> Size:
        """Of tiny pictures; that of small ones where tiny ones would show nothing."""
        size = self._of_coarse(TINY)
        return size if min(size) >= _LEAST_TINY_PX else self._size

    def _of_coarse(self, part: float) -> Size:
        f = self.fields
        return round(part * f.coarse_width_px), round(part * f.coarse_height_px)

    def _at_depth_size(
        self, cameras: list[Camera], depth: F32, seen_items: NDArray[np.uint32]
    ) -> tuple[list[Camera], F32, NDArray[np.uint32]]:
        """Small pictures (N, H, W) at DEPTH_SIZE: each third pixel, if its centre is the same."""
        small = [camera.with_size(*DEPTH_SIZE) for camera in cameras]
        if depth.shape[1:] == (3 * DEPTH_SIZE[1], 3 * DEPTH_SIZE[0]):
            return small, depth[:, 1::3, 1::3], seen_items[:, 1::3, 1::3]
        return small, *self.pictures_of(small)

    def _intrinsics(self, width_px: int, height_px: int) -> Intrinsics:
        f = self.fields
        full = Intrinsics.from_hfov(f.score_width_px, f.score_height_px, f.hfov_rad)
        return full.resized(width_px, height_px)


def sector_report(scored: RoomCandidates, sector: int, views: Sequence[View]) -> SectorReport:
    """Number of candidates of a sector rejected by each rule, and its views; after `choose`."""
    verdict = scored.verdict[scored.candidates.sector == sector]
    ranked = scored.ranked(sector)
    winners = np.flatnonzero(scored.verdict[ranked] == Verdict.WINNER)
    other_scores = scored.worth(np.delete(ranked, winners[:1] if len(winners) else slice(0, 1)))
    runner_up = round(float(other_scores.max()), 4) if len(other_scores) else None
    return SectorReport.of_verdicts(sector, verdict.tolist(), views, runner_up, word="rejected")


def room_report(
    sampler: PhotoSampler, scored: RoomCandidates, chosen: dict[tuple[str, int], list[int]]
) -> tuple[list[View], RoomReport]:
    """A room's views and what became of its candidates."""
    room, views, sectors = scored.room, list[View](), []
    for sector in range(sampler.fields.n_sectors):
        mine = chosen.get((room.id, sector), [])
        sector_views = sampler.views(scored, sector, mine) if mine else []
        views += sector_views
        sectors.append(sector_report(scored, sector, sector_views))
    return views, RoomReport(room_id=room.id, name=room.name, sectors=tuple(sectors))
