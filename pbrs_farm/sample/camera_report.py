"""cameras.json: how many candidates each rule rejected, per room and sector; no effects."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from enum import IntEnum

from pbrs_farm.core.camera import View
from pbrs_farm.core.record import Record


class SectorReport(Record):
    """One sector of a room. Scores are pixels at full size, or the released sum of logarithms."""

    sector: int
    n_candidates: int  # the sum of refused, and n_kept
    refused: dict[str, int]  # rule -> candidates it was the first to reject
    n_kept: int  # candidates that no rule rejected, the winners included
    n_rescored: int  # how many were scored at full size
    views: tuple[str, ...] = ()
    winner_score: float | None = None  # None = no camera
    runner_up_score: float | None = None
    reason: str = ""  # why there is no camera

    @classmethod
    def of_verdicts(
        cls,
        sector: int,
        verdicts: Iterable[int],
        views: Sequence[View],
        runner_up_score: float | None,
        *,
        n_rescored: int = 0,
        word: str = "refused",
    ) -> SectorReport:
        """The report on a sector from the verdict of each candidate; word: of the reason."""
        tally = Counter(verdicts)
        refused = {rule.label: tally[rule] for rule in REJECTIONS if tally[rule]}
        most_first = sorted(refused.items(), key=lambda pair: -pair[1])
        counts = ", ".join(f"{n} {rule.replace('_', ' ')}" for rule, n in most_first)
        return cls(
            sector=sector,
            n_candidates=tally.total(),
            refused=refused,
            n_kept=tally[Verdict.LOWER_SCORE] + tally[Verdict.WINNER],
            n_rescored=n_rescored,
            views=tuple(view.id for view in views),
            winner_score=views[0].score if views else None,
            runner_up_score=runner_up_score,
            reason="" if views else f"every candidate was {word}: {counts}",
        )


class RoomReport(Record):
    """One room."""

    room_id: str
    name: str
    reason: str = ""  # why it was not sampled at all
    sectors: tuple[SectorReport, ...] = ()


class CameraReport(Record):
    """Report of the sampler on a house."""

    preset: str
    source: str
    n_views: int
    n_candidates: int
    refused: dict[str, int]
    rooms: tuple[RoomReport, ...]
    notes: tuple[str, ...] = ()  # notes that do not concern a single sector

    @property
    def why_none(self) -> str:
        """One line, naming at most three rooms, that says why no room has a view."""
        if not self.rooms:
            return "; ".join(self.notes) or "the house has no rooms"
        reasons = [
            f"{room.room_id}: {room.reason or (room.sectors[0].reason if room.sectors else 'no sector')}"
            for room in self.rooms
        ]
        # Name three rooms: a house of a hundred has one reason, mostly.
        more = f" and {len(reasons) - 3} more rooms" if len(reasons) > 3 else ""
        return "; ".join(reasons[:3]) + more


def total_rejected(rooms: tuple[RoomReport, ...]) -> dict[str, int]:
    """Rule -> rejected candidates over all rooms, each under the first rule that rejected it."""
    total = Counter[str]()
    for room in rooms:
        for sector in room.sectors:
            total.update(sector.refused)
    return dict(total)


class Verdict(IntEnum):
    """Outcome of a candidate viewpoint: the number of the first rule that rejects it, or its success."""

    OUTSIDE_ROOM = 0  # not inside the room's polygon
    NEAR_OBSTACLE = 1  # closer to a triangle than the clearance
    NOT_ABOVE_FLOOR = 2  # a wall or a ceiling is below: inside a wall, or above a sloped ceiling
    ENCLOSED = 3  # inside a piece of furniture or a wall
    FILLED_BY_ONE = 4  # one object or wall covers more of the picture than it may
    FEW_OBJECTS = 5  # too few objects cover enough of the picture
    BELOW_MIN_SCORE = 6  # preset photo: scores less than the least score
    NEAR_DUPLICATE = 7  # preset photo: shows what a better view of the home shows
    LOWER_SCORE = 8  # kept every rule; another one of its sector was taken
    WINNER = 9

    @property
    def label(self) -> str:
        """The name in reports: "near_obstacle"."""
        return self.name.lower()


REJECTIONS = tuple(v for v in Verdict if v < Verdict.LOWER_SCORE)
