"""Write the measured tables of the lab book: `python -m benchmarks lab_tables`.

A table stands in a page between `<!-- bench:NAME -->` and `<!-- /bench -->`, NAME a table of lab_rows.csv or, where rows
need code, of light/table_rows.py. Below it stands the command that measures it; in the lab book, docs/lab, also the commit,
the machine and its load. A table whose JSON is missing or damaged, or lacks a figure, stays as it is and is named; so are tables of
different commits, and those that a program of WRITTEN_ELSEWHERE writes. Effects: writes docs/*.md.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from benchmarks.figures import FOLDER
from benchmarks.light import table_rows
from benchmarks.light.table_rows import Figures, Table, row
from pbrs_farm.core.record import Record, Several, read_csv

DOCS: Final = Path("docs")
ROWS: Final = Path(__file__).with_name("lab_rows.csv")
WRITTEN_ELSEWHERE: Final = {"sweep": "python -m benchmarks.study.sweep table --write"}
"""Mark -> the program that writes what stands there."""

_BLOCK: Final = re.compile(r"<!-- bench:(\w+) -->\n(.*?)<!-- /bench -->", re.DOTALL)
_FIGURE: Final = re.compile(r"\{([\w.]+)(?:/(\d+))?(?::([^}]*))?\}")


class LabRow(Record):
    """A row of a table; one without a bench is the table's head. lab_rows.csv says what cells hold."""

    table: str
    what: str
    cells: Several[str]
    wanted: str = ""
    bench: str = ""


def filled(cell: str, figures: Figures) -> str:
    """A cell with its figures. Raises KeyError with the name of one that there is not.

    Example:
        >>> filled("{a.mb/1000:.1f} GB, {a.same:yes}", {"a.mb": 1234, "a.same": 1})
        '1.2 GB, yes'
    """

    def told(match: re.Match[str]) -> str:
        name, divisor, form = match.groups()
        value = figures[name]
        if form == "yes":
            return "yes" if value else "no"
        return format(value / int(divisor) if divisor else value, form or "")

    return _FIGURE.sub(told, cell)


def simple_table(rows: Sequence[LabRow]) -> Table:
    """The table of these rows, of which the first is the head."""
    benches = tuple(dict.fromkeys(r.bench for r in rows if r.bench))

    def lines(figures: Figures) -> list[str]:
        written = [
            [
                r.what,
                *(filled(c, figures) for c in r.cells),
                *([r.wanted] if rows[0].wanted else []),
            ]
            for r in rows
        ]
        return [row(written[0]), "|---" * len(written[0]) + "|", *map(row, written[1:])]

    return Table(benches, f"python -m benchmarks {' '.join(benches)}", lines)


def _simple_tables() -> dict[str, Table]:
    by_table: dict[str, list[LabRow]] = {}
    for one in read_csv(ROWS, LabRow):
        by_table.setdefault(one.table, []).append(one)
    return {name: simple_table(rows) for name, rows in by_table.items()}


TABLES: Final = table_rows.TABLES | _simple_tables()
"""Mark -> its table."""


def main() -> None:
    """Write all tables and say which ones stay as they are."""
    for line in written_tables(DOCS, FOLDER):
        print(line)


def written_tables(docs: Path, reports: Path) -> list[str]:
    """Write each table of the pages below docs from reports/*.json; what there is to say of them.

    Raises ValueError when a page names a table that there is not.
    """
    said: list[str] = []
    commits: dict[str, set[str]] = {}
    for page in sorted(docs.rglob("*.md")):
        text = page.read_text(encoding="utf-8")

        def replaced(block: re.Match[str], page: Path = page) -> str:
            name = block[1]
            if name in WRITTEN_ELSEWHERE:
                said.append(f"{page}: {name} stays as it is: `{WRITTEN_ELSEWHERE[name]}` writes it")
                return block[0]
            if name not in TABLES:
                raise ValueError(f"{page}: no table {name!r}; of {', '.join(TABLES)}")
            lines, problem = table_lines(TABLES[name], reports, in_lab=page.parent.name == "lab")
            if problem:
                said.append(f"{page}: {name} stays as it is: {problem} ({TABLES[name].command})")
                return block[0]
            for bench in TABLES[name].benches:
                commits.setdefault(_report(bench, reports)["commit"], set()).add(bench)
            body = "\n".join(lines)
            said.append(f"{page}: {name} written")
            return f"<!-- bench:{name} -->\n\n{body}\n\n<!-- /bench -->"

        new = _BLOCK.sub(replaced, text)
        if new != text:
            page.write_text(new, encoding="utf-8")
    if len(commits) > 1:
        of_each = "; ".join(f"{c}: {', '.join(sorted(b))}" for c, b in sorted(commits.items()))
        said.append(f"tables are of {len(commits)} commits: {of_each}")
    return said


def table_lines(table: Table, reports: Path, *, in_lab: bool) -> tuple[list[str], str]:
    """(lines of a table and the line of its making, ""), or ([], what is missing)."""
    figures: dict[str, Any] = {}
    makings: dict[str, list[str]] = {}
    for bench in table.benches:
        if not (reports / f"{bench}.json").exists():
            return [], f"there is no {reports / bench}.json"
        try:
            report = _report(bench, reports)
        except ValueError:
            return [], f"{reports / bench}.json is damaged"
        figures |= report["figures"]
        makings.setdefault(_commit_and_machine(report), []).append(
            f"{report['machine']['load_1min']:.1f}"
        )
    try:
        lines = table.lines(figures)
    except KeyError as error:
        return [], f"{', '.join(table.benches)}: no figure {error.args[0]}"
    except (TypeError, ValueError) as error:
        return [], f"{', '.join(table.benches)}: a figure that does not fit its row: {error}"
    if not in_lab:
        where = "commit and machine: the [lab book](lab/light.md)"
        return [*lines, "", f"*`{table.command}`; {where}.*"], ""
    made = "; ".join(f"{where}, load {', '.join(loads)}" for where, loads in makings.items())
    return [*lines, "", f"*`{table.command}` ({made}, the bench's own included).*"], ""


def _report(bench: str, reports: Path) -> dict[str, Any]:
    """What write_report wrote."""
    report: dict[str, Any] = json.loads((reports / f"{bench}.json").read_text(encoding="utf-8"))
    return report


def _commit_and_machine(report: dict[str, Any]) -> str:
    machine, commit = report["machine"], report["commit"]
    changed = "+" if commit.endswith("+") else ""
    return f"{commit[:7]}{changed}: {machine['cores']} cores of {machine['cpu']}"


if __name__ == "__main__":
    main()
