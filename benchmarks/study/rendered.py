"""Roots that benches of the study train on, rendered once and kept in out/study. Effects: renders."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Final

import pbrs_farm.cli

FOLDER = Path(os.environ.get("PBRS_STUDY_FOLDER", "out/study"))
HOMES = (
    "Studio", "1BedroomApartmentWithRoundWall", "2BedroomApartment",
    "2BedroomApartmentWithBowWindow", "2BedroomHouseWithBasement", "3BedroomApartment",
    "3BedroomHouseWithAttic", "3BedroomHouseWithMezzanine", "4BedroomHouse",
)  # fmt: skip
HELD_OUT = ("studio", "2bedroomapartment", "3bedroomhousewithattic")
"""Homes that never train: a small one, a middling one, a large one."""

# The modes of Metropolis come from one trace, those of OpenGL cost a hundredth of it: all four.
_MODES: Final = ("--modes", "mlt_il_ol", "opengl_dl", "mlt_ol", "opengl_il")
_OF_HOMES: Final = (*_MODES, "--views", "45")
_OF_DRESSED: Final = ("--dress", "1..2", *_MODES, "--views", "32")
# As `fast` and `preview` chose views before the preset `photo` was there (commit 69b80dd^).
_OLD_CAMERAS: Final = {
    "preset": "paper", "height_min_m": 1.5, "height_max_m": 1.6, "tilt_deg": 11, "tilt_sd_deg": 0,
    "clearance_m": 0.1, "min_objects": 3, "max_item_fraction": 0.35, "max_wall_fraction": 0.55,
    "max_opening_fraction": 1, "min_score": 0, "min_room_score": 0, "likeness": 0,
    "hfov_rad": 1.1068, "hfov_spread": 0,
}  # fmt: skip
_OLD_WORDS: Final = tuple(
    word for name, value in _OLD_CAMERAS.items() for word in ("--set", f"cameras.{name}={value}")
)
ROOTS: Final[dict[str, tuple[tuple[str, ...], tuple[str, ...]]]] = {
    "bare_fast": (HOMES, (*_OLD_WORDS, *_OF_HOMES)),
    "bare_photo": (HOMES, _OF_HOMES),
    "dressed": (HOMES, _OF_DRESSED),
    "made": (("made:1..22",), ("--dress", "1", *_MODES, "--views", "20")),
}
"""Name -> homes, and the words of `run` behind them."""


def rendered(name: str, *, jobs: int = 2) -> Path:
    """out/study/<name>: its homes by recipe preview at 160x120; what stands there already is kept."""
    (homes, words), out = ROOTS[name], FOLDER / name
    line = ["run", *homes, "--recipe", "preview", "--size", "160x120", "--jobs", str(jobs), *words]
    # A view that fails costs that view; the others train.
    code = pbrs_farm.cli.main([*line, "--out", str(out)])
    if code:
        print(f"{name}: some steps failed, the rest is used", file=sys.stderr)
    return out
