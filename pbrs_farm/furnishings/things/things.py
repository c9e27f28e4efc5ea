"""Generated small items by name; no effects. maker.py describes how to write them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pbrs_farm.furnishings.things.maker import Thing, described_in, modules_of

# fmt: off
THINGS: Final[Mapping[str, Thing[[]]]] = described_in(modules_of(__package__, (
    "appliances", "bath_things", "bins", "bottles", "bowls", "boxes", "clocks", "clothes",
    "cups", "desk_things", "floor_things", "food", "frames_and_candles", "glasses", "ornaments",
    "papers", "seating", "soft", "tableware", "toys", "vases")), Thing)
