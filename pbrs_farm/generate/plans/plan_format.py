"""The entry of a format of floor plans: what `FORMAT` of its module is; and what part of a file is meant. No effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pbrs_farm.core.data_format import DataFormat
from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.plans.parsed_plan import ParsedPlan


@dataclass(frozen=True, slots=True)
class Part:
    """Which part of a file is meant: an apartment of a table, a storey of the others."""

    apartment: str = ""
    floor: int | None = None  # from 0, the lowest; None = all

    @property
    def word(self) -> str:
        """The part after the # in a command-line word; "" = the whole file."""
        parts = [f"apartment={self.apartment}"] * bool(self.apartment)
        parts += [f"floor={self.floor}"] * (self.floor is not None)
        return ",".join(parts)


def part_of(word: str) -> Part:
    """The part that a word names: "" or `apartment=ID`, `floor=K`, both with a comma. Raises BadInput."""
    part = Part()
    for option in filter(None, word.split(",")):
        key, _, value = option.partition("=")
        if key == "apartment" and value:
            part = replace(part, apartment=value)
        elif key == "floor" and value.isascii() and value.isdigit() and len(value) < 5:
            part = replace(part, floor=int(value))
        else:
            hint = "FILE#apartment=ID or FILE#floor=0"
            raise BadInput(word, option, "names no part of a plan", hint=hint)
    return part


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanFormat(DataFormat):
    """A format whose files become plans. `fits` recognises a .json, the suffix any other file."""

    read: Callable[[Path, Any, Part], ParsedPlan] | None = None
    """Storeys of a file; of a .json with its value, else None. None: a plan that a person wrote."""
    fits: Callable[[dict[str, Any]], bool] = lambda _value: False
    """Whether the object of a .json is a plan of this format."""
