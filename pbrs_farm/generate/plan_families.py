"""Families of plans: what homes of a country or a time have in common. Effect: reads plan_families.toml beside."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field, field_validator

from pbrs_farm.core.made_home import PLANS
from pbrs_farm.core.record import Record, read_toml
from pbrs_farm.generate.floor_plan import RoomType
from pbrs_farm.generate.opening_models import LEAVES, SASHES

_Share = Annotated[float, Field(ge=0, le=1)]
_Colour = Annotated[str, Field(pattern="^[0-9A-F]{6}$")]


class UsualWindow(Record):
    """A window as most of a home are; metres."""

    width: float = 1.3
    height: float = 1.3
    sill: float = 0.9


class PlanFamily(Record):
    """Rooms, ways, outlines, heights, windows and paints of one family; a field's default is a flat's."""

    weight: float = Field(0.0, ge=0, le=1)  # its share of seeds

    # Which rooms a home has, and how large.
    bedroom_shares: tuple[_Share, ...] = (0.10, 0.25, 0.35, 0.22, 0.08)  # of 0, 1, 2 .. bedrooms
    areas: dict[RoomType, float] = Field(default_factory=dict)  # by how much rooms are larger
    small_rooms: dict[RoomType, float] = Field(default_factory=dict)  # and more frequent
    dining_room: _Share = 0.2  # of homes with a bedroom to spare: the one nearest to the kitchen
    office: _Share = 0.3  # of the same homes: the smallest of the other bedrooms
    second_bathroom: _Share = 0.3  # of homes of three bedrooms; above .3 of two bedrooms, too
    hall_share: tuple[float, float] = (0.11, 0.16)  # of the area of all other rooms

    # Connections between rooms, and circulation.
    open_kitchen: _Share = 0.5  # no wall between kitchen and living room
    bedrooms_at: Literal["hall", "living or hall", "living"] = "hall"  # where their doors open to
    enfilade: _Share = 0.0  # a bedroom beside the living room has a second door, to it
    passage: _Share = 0.0  # the living room opens to the hall by a wide hole without a leaf
    hall_aspect: float = 8.0  # long by short side, at most

    # The outline.
    outline_ratio: tuple[float, float] = (0.6, 1.7)  # width by depth
    l_outline: _Share = 0.3  # a corner is left out
    court: _Share = 0.0  # a piece of a side is left out: the outline is a U
    notch: tuple[float, float] = (0.06, 0.12)  # how much, of the floor
    l_shaped: _Share = 0.25  # the living room has a second arm
    slanted: _Share = 0.2  # one side is not at right angles to the others
    bay: _Share = 0.2  # share of homes with a bay window in a living area
    balcony: _Share = 0.4
    blind_shares: tuple[_Share, ...] = (0.45, 0.4, 0.15)  # of 0, 1, 2 sides without daylight

    # Ceilings, windows, doors.
    heights: tuple[float, ...] = (2.4, 2.5, 2.5, 2.5, 2.6, 2.7)  # floor to ceiling
    window: UsualWindow = UsualWindow()
    french: _Share = 0.5  # the living room has French windows
    glass: tuple[float, float] = (1.05, 1.35)  # of an eighth of the floor
    door_height: float = 2.1
    sashes: tuple[str, ...] = SASHES
    leaves: tuple[str, ...] = LEAVES

    # Paints.
    walls: tuple[_Colour, ...] = (
        "F4F1EA",
        "EFEBE0",
        "E8ECEA",
        "F3E9DC",
        "E6E3DA",
        "DDE4E6",
        "F6F3EE",
        "EDE6DD",
    )
    floor: _Colour = "B08A62"
    ceiling: _Colour = "FAFAF8"
    opening_paints: tuple[_Colour, ...] = ("EDEBE6", "EDEBE6", "A88054", "737578")
    dry_floor: str = "wood"  # group of the floor's picture where no water runs

    @property
    def french_height(self) -> float:
        """Of French windows: they end where the other windows do, and let people through."""
        return max(2.1, round(self.window.sill + self.window.height - 0.1, 2))

    @field_validator("sashes", "leaves")
    @classmethod
    def _is_built(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if unknown := set(names) - {*SASHES, *LEAVES}:
            raise ValueError(f"opening_models.py builds no {unknown}")
        return names


@cache
def plan_families() -> dict[str, PlanFamily]:
    """Every family by its name."""
    path = Path(__file__).with_name("plan_families.toml")
    return read_toml(path, dict[str, PlanFamily])


FLAT: Final = PLANS[0]
"""The family of a home whose plan or programme a user gave."""


def drawn_family(rng: np.random.Generator, bedrooms: tuple[int, int]) -> str:
    """The name of a home's family by seed; each is the rarer the fewer homes of it have so many bedrooms."""
    low, high = bedrooms
    families = [plan_families()[name] for name in PLANS]
    weights = np.array([f.weight * sum(f.bedroom_shares[low : high + 1]) for f in families])
    return PLANS[int(rng.choice(len(PLANS), p=weights / weights.sum()))]
