"""cameras.json: how many candidates each rule rejected, per room and sector; no effects."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class SectorReport(_Record):
    """One sector of a room. n_candidates = the sum of refused, + those kept by every rule.

    refused: rule -> candidates it was the first to reject. n_kept: candidates that kept every
    rule, the winners included. n_rescored: how many of them were scored at full size.
    Scores are in pixels at full size (preset released: a sum of logarithms); None = no camera.
    """

    sector: int
    n_candidates: int
    refused: dict[str, int]
    n_kept: int
    n_rescored: int
    views: tuple[str, ...] = ()
    winner_score: float | None = None
    runner_up_score: float | None = None
    reason: str = ""


class RoomReport(_Record):
    """One room. reason: why it was not sampled at all, or ""."""

    room_id: str
    name: str
    reason: str = ""
    sectors: tuple[SectorReport, ...] = ()


class CameraReport(_Record):
    """What the sampler did with a house; notes: what is not about one sector."""

    preset: str
    source: str
    n_views: int
    n_candidates: int
    refused: dict[str, int]
    rooms: tuple[RoomReport, ...]
    notes: tuple[str, ...] = ()


def total_rejected(rooms: tuple[RoomReport, ...]) -> dict[str, int]:
    """Rule -> rejected candidates over all sectors of all rooms."""
    total: dict[str, int] = {}
    for room in rooms:
        for sector in room.sectors:
            for rule, n in sector.refused.items():
                total[rule] = total.get(rule, 0) + n
    return total
