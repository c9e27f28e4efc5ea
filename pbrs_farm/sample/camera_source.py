"""Sources of cameras: the type of an entry, and the table of all; no effects.

Each module of `sample/sources/` ends with an entry; a plugin brings the same type. The recipe
(`cameras.source`), `--cameras`, job.toml and the farm's JobSpec know sources from this table alone. The table
in docs/cameras.md is printed from it (`python -m pbrs_farm.sample.camera_source`).
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from pydantic import ValidationError

from pbrs_farm.core.camera import View
from pbrs_farm.core.checked_json import place_in, sentence
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import CAMERA_SOURCES, CameraFields
from pbrs_farm.core.record import Record
from pbrs_farm.sample.camera_report import CameraReport

if TYPE_CHECKING:
    from pbrs_farm.core.arrays import FirstHit
    from pbrs_farm.core.house import Geometry
    from pbrs_farm.sample.eye_probes import ItemCounter
    from pbrs_farm.sample.room_sampler import RoomTrace
    from pbrs_farm.sample.view_overlap import DepthOf, ItemPictures


@dataclass(frozen=True, slots=True, eq=False)
class Sampling:
    """Cameras of a house: its views, the report for cameras.json, every candidate for the map alone."""

    views: tuple[View, ...]
    report: CameraReport
    traces: tuple[RoomTrace, ...] = ()

    @classmethod
    def of_views(
        cls, fields: CameraFields, views: Iterable[View], notes: tuple[str, ...] = ()
    ) -> Sampling:
        """Views that no rule rejected. notes: of the report, shown if there are no views."""
        chosen = tuple(views)
        report = CameraReport(
            preset=fields.preset,
            source=fields.source,
            n_views=len(chosen),
            n_candidates=len(chosen),
            refused={},
            rooms=(),
            notes=notes,
        )
        return cls(chosen, report)


class HouseCaster(Protocol):
    """The ray caster of a house, as used by camera sources."""

    @property
    def geometry(self) -> Geometry: ...
    @property
    def first_hit(self) -> FirstHit: ...
    @property
    def item_counts(self) -> ItemCounter: ...
    @property
    def depth_pictures(self) -> DepthOf: ...
    @property
    def item_pictures(self) -> ItemPictures: ...


@dataclass(frozen=True, slots=True, eq=False)
class CameraRequest:
    """The inputs of a source.

    house: repaired. caster: of this house, panes included. content: of the user's file, from the
    source's `parse`; None without a file. options: an instance of the source's `options`, or None.
    """

    house: House
    fields: CameraFields
    seed: int
    caster: HouseCaster
    content: Any = None
    options: Any = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSource:
    """A source of cameras, used as `--cameras NAME`.

        SOURCE = CameraSource(name="orbit", views=_views, help="a circle in each room", options=Orbit)

    name: with `_` for dashes, the name of its module. views: pure: equal requests give equal views.
    help: a phrase for the documentation. use: how users select it; "" = `--cameras NAME`.
    options: a Record with a field for each of its options (core/options.py), given as
    `--cameras orbit,turns=2`. parse: of a source that
    needs a user's file (`--cameras NAME,file=PATH`): the text of the file and the fields -> content;
    raises BadInput for a damaged file. is_sequence: views are the frames of a film, in order; None if
    they may be. is_ranked: views are chosen by rules, so that those of dark rooms are left out.
    n_views: views of a house; None if that depends on the house.
    """

    name: str
    views: Callable[[CameraRequest], Sampling]
    help: str
    use: str = ""
    options: type[Record] | None = None
    parse: Callable[[str, CameraFields], Any] | None = None
    is_sequence: bool | None = False
    is_ranked: bool = False
    n_views: Callable[[CameraFields], int] | None = None

    @property
    def is_file(self) -> bool:
        """True if it needs a user's file."""
        return self.parse is not None

    def options_of(self, word: str) -> Record | None:
        """The options of a word `NAME,key=value,...`; ValueError naming the one that does not fit."""
        pairs = [part.partition("=") for part in word.split(",")[1:]]
        if self.options is None:
            if pairs:
                raise ValueError(f"{self.name} has no option {pairs[0][0]!r}")
            return None
        try:
            return self.options.model_validate({key: value for key, _, value in pairs})
        except ValidationError as error:
            fault = error.errors(include_url=False)[0]
            raise ValueError(f"{self.name}: {place_in(fault['loc'])}: {sentence(fault)}") from None


def source_of(fields: CameraFields) -> CameraSource:
    """The source of the cameras; MachineFailed for a plugin that does not bring one."""
    entry: CameraSource = CAMERA_SOURCES.entry(fields.source_name)
    return entry


def sources_table() -> str:
    """The package's sources of cameras as a Markdown table."""
    rows = ["| `cameras.source` | viewpoints | use |", "|---|---|---|"]
    for name in CAMERA_SOURCES.own_names():
        entry = CAMERA_SOURCES.entry(name)
        fields = {} if entry.options is None else entry.options.model_fields
        options = "".join(f"; `{key}`: {field.description}" for key, field in fields.items())
        rows.append(f"| `{name}` | {entry.help}{options} | {entry.use or f'`--cameras {name}`'} |")
    return "\n".join(rows)


if __name__ == "__main__":
    sys.stdout.write(f"{sources_table()}\n")
