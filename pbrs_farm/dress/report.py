"""Additions, changes, refusals and gate results of dressing: dress.json. No effects."""

from __future__ import annotations

from collections.abc import Iterator

from pydantic import Field

from pbrs_farm.core.record import Record
from pbrs_farm.core.shown_text import MAX_MESSAGE, shown


class Credit(Record):
    """A library model or picture used in the house, with its licence."""

    id: str  # in the catalogue
    name: str
    library: str
    creator: str
    licence: str
    n: int  # how often


class Gate(Record):
    """A rule that a dressed house must keep, and what came of it."""

    name: str  # "penetration", "support", "doors", "windows", "path", "fronts", "must_haves"
    n_checked: int  # measured pairs, items or doors
    n_taken_out: int  # violating items removed or restored
    n_left: int  # violations that remain in the final house


class DressReport(Record):
    """Everything that dressing did to a house, in counts and names."""

    house_id: str  # as dressed
    seed: int
    style: str = ""
    added: dict[str, int] = Field(
        default_factory=dict
    )  # `<part>: <group>` -> items in the final house
    changed: dict[str, int] = Field(default_factory=dict)  # part -> changed items of the source
    refused: dict[str, int] = Field(
        default_factory=dict
    )  # `<part>: <reason>` -> abandoned attempts
    gates: tuple[Gate, ...] = ()
    moved_after_repair: int = 0  # items moved to the wall that repair kept
    credits: tuple[Credit, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def is_sound(self) -> bool:
        """Whether nothing in the house breaks a gate."""
        return not any(gate.n_left for gate in self.gates)


def summary_of_dressing(report: DressReport) -> str:
    """The additions, changes and refusals in a house, one sentence per line."""
    return "\n".join(
        [f"{report.house_id}:", *(f"- {shown(line, MAX_MESSAGE)}" for line in _sentences(report))]
    )


_GATE_TEXT = {
    "penetration": "no two items overlap by more than 1 cm",
    "support": "no item floats or sinks by more than 2 mm",
    "doors": "every door opens, with 0.8 m of free floor",
    "windows": "furniture covers at most a fifth of a window",
    "path": "doors stay connected by a path 0.6 m wide",
    "fronts": "doors and drawers of furniture open, except behind movable chairs",
    "must_haves": "every room keeps its beds, seats and fittings",
}


def _sentences(report: DressReport) -> Iterator[str]:
    style = f", style {report.style}" if report.style else ""
    yield f"dressed by seed {report.seed}{style}."
    # Say what came in, by part, the most frequent first.
    for part, groups in _by_part(report.added).items():
        named = ", ".join(f"{n} {group.replace('_', ' ')}" for group, n in groups)
        yield f"{part}: {sum(n for _group, n in groups)} added: {named}."
    for part, n in sorted(report.changed.items()):
        yield f"{part}: {n} items of the home changed."
    # Say what did not, and why.
    for part, reasons in _by_part(report.refused).items():
        named = ", ".join(f"{n} {reason}" for reason, n in reasons)
        yield f"{part}: not done: {named}."
    for gate in report.gates:
        text = _GATE_TEXT.get(gate.name, gate.name)
        if gate.n_left:
            yield f"GATE BROKEN: {text}: {gate.n_left} violations."
        else:
            out = f"; {gate.n_taken_out} removed or put back" if gate.n_taken_out else ""
            yield f"{text}: holds ({gate.n_checked} measured{out})."
    if report.moved_after_repair:
        yield f"{report.moved_after_repair} items moved to the wall that repair kept of two."
    owed = [c for c in report.credits if is_owed(c)]
    if report.credits:
        yield f"{len(report.credits)} models and pictures of libraries used, {len(owed)} of them CC-BY."
    yield from report.notes


def _by_part(counts: dict[str, int]) -> dict[str, list[tuple[str, int]]]:
    parts: dict[str, list[tuple[str, int]]] = {}
    for key, n in sorted(
        counts.items(), key=lambda row: (row[0].partition(": ")[0], -row[1], row[0])
    ):
        part, _, label = key.partition(": ")
        parts.setdefault(part, []).append((label, n))
    return parts


def is_owed(credit: Credit) -> bool:
    """True if attribution is required: for all but public-domain content and this project's own."""
    return bool(credit.licence) and not credit.licence.upper().startswith(("CC0", "PUBLIC"))
