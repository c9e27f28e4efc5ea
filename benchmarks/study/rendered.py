"""Roots that benches of the study train on, rendered once and kept in out/study. Effects: renders."""

from __future__ import annotations

import sys
from pathlib import Path

import pbrs_farm.cli

FOLDER = Path("out/study")
HOMES = (
    "Studio", "1BedroomApartmentWithRoundWall", "2BedroomApartment",
    "2BedroomApartmentWithBowWindow", "2BedroomHouseWithBasement", "3BedroomApartment",
    "3BedroomHouseWithAttic", "3BedroomHouseWithMezzanine", "4BedroomHouse",
)  # fmt: skip
HELD_OUT = ("studio", "2bedroomapartment", "3bedroomhousewithattic")
"""Homes that never train: a small one, a middling one, a large one."""


def rendered(name: str, homes: tuple[str, ...], *words: str, size: str = "160x120") -> Path:
    """out/study/<name>: homes by recipe preview; what stands there already is kept."""
    out = FOLDER / name
    line = ["run", *homes, "--recipe", "preview", "--size", size, "--jobs", "2", *words]
    # A view that fails costs that view; the others train.
    code = pbrs_farm.cli.main([*line, "--out", str(out)])
    if code:
        print(f"{name}: some steps failed, the rest is used", file=sys.stderr)
    return out
