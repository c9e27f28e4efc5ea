"""One room's views: candidates, rules, the best of each sector, by the given counter; no effects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, Bools
from pbrs_farm.core.camera import Intrinsics, View
from pbrs_farm.core.house import Geometry, House, Room
from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.core.shot import view_id
from pbrs_farm.geometry.plan_surfaces import room_shape
from pbrs_farm.sample import paper_rules, released_rules
from pbrs_farm.sample.camera_report import RoomReport, SectorReport, Verdict
from pbrs_farm.sample.candidates import Candidates, Grid, grid_candidates, n_cells
from pbrs_farm.sample.eye_probes import ItemCounter, count_items
from pbrs_farm.sample.sector_search import (
    COARSE_MARGIN_PX,
    COARSE_SLACK,
    Coarse,
    FullScores,
    best_first,
    next_diverse,
)
from pbrs_farm.sample.view_score import (
    Scored,
    object_columns,
    overfill,
    paper_score,
    released_columns,
    released_score,
)

MAX_CELLS = 400_000  # 25,000 square metres at 0.25 m; a larger room is rejected to bound memory


@dataclass(frozen=True, slots=True, eq=False)
class RoomTrace:
    """Every candidate of a room, for the map."""

    room_id: str
    candidates: Candidates
    verdict: NDArray[np.uint8]  # (N,) of Verdict


@dataclass(frozen=True, slots=True, eq=False)
class RoomSampler:
    """The sampler of one room; fields.preset says by whose rules."""

    house: House
    room: Room
    fields: CameraFields
    seed: int
    counter: ItemCounter
    geometry: Geometry

    def explain_rejection(self) -> str:
        """Why this room is not sampled at all (no light, once repaired), or ""."""
        room = self.room
        if self.house.is_repaired and not room.lit_by:
            return "nothing lights it: neither lamp nor window nor sky"
        if shapely.area(room_shape(room)) <= 0:
            return "its polygon has no area"
        if self.fields.preset == "released" and not (room.has_floor and room.has_ceiling):
            return "the released sampler needs a floor and a ceiling"
        # More cells than this come of a wrong unit or an enormous polygon.
        n_x, n_z = n_cells(self._grid(), self.fields.cell_m)
        if n_x * n_z > MAX_CELLS:
            return f"it has {n_x * n_z} grid cells, more than {MAX_CELLS}: set cameras.cell_m"
        return ""

    def run(self) -> tuple[list[View], RoomReport, RoomTrace]:
        """The room's views, its report (with reasons) and all its candidates."""
        names = (self.seed, self.house.id, self.room.id)
        candidates = grid_candidates(self._grid(), self.fields, names)
        rules = released_rules if self.fields.preset == "released" else paper_rules
        verdict = rules.rejections(
            self.house, self.room, self.fields, candidates, self.geometry, self.counter
        )
        # Sectors compete by themselves: each keeps its own best views.
        views: list[View] = []
        sectors: list[SectorReport] = []
        for sector in range(self.fields.n_sectors):
            sector_views, sector_report = self._sector(sector, candidates, verdict)
            views += sector_views
            sectors.append(sector_report)
        report = RoomReport(room_id=self.room.id, name=self.room.name, sectors=tuple(sectors))
        return views, report, RoomTrace(self.room.id, candidates, verdict)

    def _sector(
        self, sector: int, candidates: Candidates, verdict: NDArray[np.uint8]
    ) -> tuple[list[View], SectorReport]:
        """Choose among a sector's candidates; writes their verdicts."""
        # Choose among the candidates that no rule of place rejected.
        of_sector = np.flatnonzero(candidates.sector == sector)
        eligible = of_sector[verdict[of_sector] == Verdict.LOWER_SCORE]
        full = FullScores(lambda which: self._full(candidates, eligible[which]))
        coarse, share, image_verdicts = self._coarse(candidates, eligible)
        chosen = self._chosen(coarse, share, full)

        # Judge by the full-size picture if there is one, else by the coarse one.
        for k, rows in full.counts.items():
            image_verdicts[k] = self._image_verdicts(rows[None])[0]
        image_verdicts[chosen] = Verdict.WINNER
        verdict[eligible] = image_verdicts
        views = [
            self._view(sector, k, candidates, int(eligible[c]), full.counts[c], full.score[c])
            for k, c in enumerate(chosen)
        ]
        return views, self._report(sector, verdict[of_sector], full, views)

    def _chosen(self, coarse: Coarse, share: F32, full: FullScores) -> list[int]:
        best = best_first(coarse, full, margin=None if self._exact else self._margin)
        chosen = [] if best is None else [best]
        # Add views that show what the chosen ones do not.
        while chosen and len(chosen) < self.fields.per_sector:
            more = next_diverse(coarse, share, chosen, full, self.fields.min_object_fraction)
            if more is None:
                break
            chosen.append(more)
        return chosen

    def _coarse(
        self, candidates: Candidates, which: NDArray[np.intp]
    ) -> tuple[Coarse, F32, NDArray[np.uint8]]:
        """Coarse scores, each object's share of the picture when several views are wanted, and
        the verdicts that the coarse pictures give."""
        columns, fraction = self._columns(), self.fields.min_object_fraction
        keep = self.fields.per_sector > 1  # shares are needed for diversity alone
        n = len(which)
        coarse = Coarse(np.zeros(n, np.bool_), np.zeros(n))
        share = np.zeros((n, len(columns) if keep else 0), np.float32)
        image_verdicts = np.zeros(n, np.uint8)
        cameras = candidates.cameras(which, self._intrinsics(coarse=True))
        for part, rows in count_items(self.counter, cameras, len(self.house.items)):
            # Let pass what the full-size picture might still accept.
            lenient = paper_score(rows, columns, fraction * COARSE_SLACK)
            enough = lenient.n_objects >= self.fields.min_objects
            over = overfill(rows, columns, self.fields)
            coarse.possible[part] = enough & (over <= self._margin)
            coarse.score[part] = self._scored(rows).score
            image_verdicts[part] = self._image_verdicts(rows)
            if keep:
                share[part] = rows[:, columns] / rows.sum(1, keepdims=True)
        return coarse, share, image_verdicts

    def _full(
        self, candidates: Candidates, which: NDArray[np.intp]
    ) -> tuple[Bools, F64, NDArray[np.uint32]]:
        cameras = candidates.cameras(which, self._intrinsics(coarse=False))
        parts = [rows for _part, rows in count_items(self.counter, cameras, len(self.house.items))]
        rows = np.concatenate(parts)
        return self._image_verdicts(rows) == Verdict.LOWER_SCORE, self._scored(rows).score, rows

    def _image_verdicts(self, rows: NDArray[np.uint32]) -> NDArray[np.uint8]:
        """(N,) the verdict of the rules about the picture, before any comparison of scores."""
        # Judge by the number of objects first, then by the largest one.
        scored = self._scored(rows)
        image_verdicts = np.full(len(rows), Verdict.LOWER_SCORE, np.uint8)
        image_verdicts[(scored.n_objects < self.fields.min_objects) | (scored.score <= 0)] = (
            Verdict.FEW_OBJECTS
        )
        image_verdicts[overfill(rows, self._columns(), self.fields) > 0] = Verdict.FILLED_BY_ONE
        return image_verdicts

    @property
    def _margin(self) -> float:
        """By how much a share of the picture may differ between the sizes."""
        return COARSE_MARGIN_PX / self.fields.coarse_width_px

    def _scored(self, rows: NDArray[np.uint32]) -> Scored:
        if self.fields.preset == "released":
            return released_score(rows, self._columns(), self.fields)
        return paper_score(rows, self._columns(), self.fields.min_object_fraction)

    def _columns(self) -> NDArray[np.intp]:
        if self.fields.preset == "released":
            return released_columns(self.house, self.room)
        return object_columns(self.house)

    def _grid(self) -> Grid:
        if self.fields.preset == "released":
            return released_rules.room_grid(self.house, self.room)
        return paper_rules.room_grid(self.room)

    @property
    def _exact(self) -> bool:
        # Skip coarse pictures for the released score: it jumps at multiples of its least count.
        return self.fields.exact or self.fields.preset == "released"

    def _intrinsics(self, *, coarse: bool) -> Intrinsics:
        f = self.fields
        full = Intrinsics.from_hfov(f.score_width_px, f.score_height_px, f.hfov_rad)
        if not coarse or self._exact:
            return full
        return full.resized(f.coarse_width_px, f.coarse_height_px)

    def _view(
        self,
        sector: int,
        k: int,
        candidates: Candidates,
        index: int,
        counts: NDArray[np.uint32],
        score: float,
    ) -> View:
        several = self.fields.per_sector > 1
        camera = candidates.cameras(np.array([index]), self._intrinsics(coarse=False))[0]
        # List every object in the view, whatever the score count_items.
        columns = object_columns(self.house)
        return View(
            id=view_id(self.room.id, sector, k if several else None),
            room_id=self.room.id,
            sector=sector,
            camera=camera,
            score=self._reported(score),
            objects={int(i): int(counts[i]) for i in columns if counts[i]},
        )

    def _reported(self, score: float) -> float:
        """Paper scores are shares of the picture inside, whole pixels outside."""
        f = self.fields
        if f.preset == "released":
            return score
        return float(round(score * f.score_width_px * f.score_height_px))

    def _report(
        self, sector: int, verdict: NDArray[np.uint8], full: FullScores, views: list[View]
    ) -> SectorReport:
        ranking = full.ranking
        runner_up = self._reported(full.score[ranking[1]]) if len(ranking) > 1 else None
        return SectorReport.of_verdicts(
            sector, verdict.tolist(), views, runner_up, n_rescored=len(full.score)
        )
