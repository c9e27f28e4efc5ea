"""A hostile input, and the arguments of the command that reads it; no effects."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

Words = Sequence[str]

TINY: Final = (
    "--recipe", "preview", "--size", "64x48", "--set", "cameras.cell_m=0.5",
    "--set", "cameras.min_objects=0", "--set", "cameras.max_item_fraction=1",
    "--set", "cameras.max_wall_fraction=1", "--set", "cameras.score_width_px=64",
    "--set", "cameras.score_height_px=48", "--set", "cameras.coarse_width_px=32",
    "--set", "cameras.coarse_height_px=24",
)  # fmt: skip
"""The cheapest recipe."""

ONE_VIEW: Final = (*TINY, "--views", "1", "--modes", "opengl_dl")


@dataclass(frozen=True, slots=True)
class Place:
    """Folders for a case. folder: for its files. sound: a sound home, the neighbour of every bad
    one. stored: the output folder of a finished run of that home, to be copied, not changed.
    """

    folder: Path
    sound: Path
    stored: Path

    @property
    def out(self) -> Path:
        """The output folder of the case's command."""
        return self.folder / "out"


@dataclass(frozen=True, slots=True)
class Case:
    """A hostile input. write: writes it below a Place and returns the commands to run on it.

    fault: the kind of fault, for the table.  neighbours: sound homes that must be finished beside it.
    is_lossy: the input names something that cannot be shown, so that a success must report it.
    """

    name: str
    fault: str
    write: Callable[[Place], Sequence[Words]]
    neighbours: int = 1
    is_lossy: bool = False


def run(place: Place, bad: Path | str, *more: str) -> Words:
    """The smallest `run BAD SOUND`."""
    return ("run", str(bad), str(place.sound), "--out", str(place.out), *ONE_VIEW, *more)


def home(
    name: str, fault: str, file: str, data: Callable[[], bytes] | bytes, *, lossy: bool = False
) -> Case:
    """A case of one file, run beside the sound home."""

    def write(place: Place) -> list[Words]:
        path = place.folder / file
        path.write_bytes(data if isinstance(data, bytes) else data())
        return [run(place, path)]

    return Case(name, fault, write, is_lossy=lossy)


def with_sheet(case: Case) -> Case:
    """The same case, followed by `sheet` and `classes` of its output."""

    def write(place: Place) -> list[Words]:
        out = str(place.out)
        return [*case.write(place), ("sheet", out), ("classes", out)]

    return Case(case.name, case.fault, write, case.neighbours, case.is_lossy)


def by_verb(case_name: str, fault: str, verb: str, file: str, data: bytes) -> Case:
    """A case of one file, read by `repair` or `cameras`, without a neighbour."""

    def write(place: Place) -> list[Words]:
        path = place.folder / file
        path.write_bytes(data)
        out = place.out if verb == "repair" else place.folder / "cameras.json"
        return [(verb, str(path), "--out", str(out), *TINY)]

    return Case(case_name, fault, write, 0)


def unique(cases: Iterable[Case]) -> list[Case]:
    """The cases in order; ValueError if a name occurs twice."""
    by_name: dict[str, Case] = {}
    for case in cases:
        if case.name in by_name:
            raise ValueError(f"two cases are called {case.name}")
        by_name[case.name] = case
    return list(by_name.values())
