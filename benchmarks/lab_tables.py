"""Write the measured tables of the lab book: `python -m benchmarks lab_tables`.

A table is between `<!-- bench:NAME -->` and `<!-- /bench -->` of a page. NAME is a table of lab_rows.csv or of
renderers/cycles_tables.py. Below the table is the command that measures it and, in docs/lab, commit, machine and load.
A table without its report, or with a figure missing, is left unchanged and named. Reports of different commits or
machines are named too. Effects: writes docs/*.md.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from benchmarks.figures import FOLDER
from benchmarks.lab_rows import Figures, Table, head, row
from benchmarks.renderers.cycles_tables import compare_lines, cycles_lines
from pbrs_farm.core.record import Record, Several, read_csv

DOCS: Final = Path("docs")
ROWS: Final = Path(__file__).with_name("lab_rows.csv")

_BLOCK: Final = re.compile(r"<!-- bench:(\w+) -->\n(.*?)<!-- /bench -->", re.DOTALL)
_FIGURE: Final = re.compile(r"\{([\w.]+)(?:/(\d+))?(?::([^}]*))?\}")


class LabRow(Record):
    """A row of a table; the row without a bench is the table's head."""

    table: str
    what: str
    cells: Several[str]
    wanted: str = ""
    bench: str = ""


def filled(cell: str, figures: Figures) -> str:
    """Fill a cell's figures in. Raises KeyError with the name of a missing figure.

    Example:
        >>> filled("{a.mb/1000:.1f} GB, {a.same:yes}", {"a.mb": 1234, "a.same": 1})
        '1.2 GB, yes'
    """

    def value_of(match: re.Match[str]) -> str:
        name, divisor, form = match.groups()
        value = figures[name]
        if form == "yes":
            return "yes" if value else "no"
        return format(value / int(divisor) if divisor else value, form or "")

    return _FIGURE.sub(value_of, cell)


def simple_table(rows: Sequence[LabRow]) -> Table:
    """The table of these rows; the first is the head."""
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
        return [*head(*written[0]), *map(row, written[1:])]

    return Table(benches, f"python -m benchmarks {' '.join(benches)}", lines)


def _simple_tables() -> dict[str, Table]:
    by_table: dict[str, list[LabRow]] = {}
    for table_row in read_csv(ROWS, LabRow):
        by_table.setdefault(table_row.table, []).append(table_row)
    return {name: simple_table(rows) for name, rows in by_table.items()}


TABLES: Final = _simple_tables() | {
    "cycles": Table(("cycles",), "make bench-cycles", cycles_lines),
    "compare": Table(("cycles",), "make bench-cycles", compare_lines),
}
"""Name in a page -> its table."""


def main() -> None:
    """Write all tables and print which ones were left unchanged."""
    for line in written_tables(DOCS, FOLDER):
        print(line)


def written_tables(docs: Path, reports: Path) -> list[str]:
    """Write each table of the pages below docs from reports/*.json; a message for each table.

    Raises ValueError for a page with an unknown table.
    """
    messages: list[str] = []
    sources: dict[str, set[str]] = {}
    books = {
        name: page.relative_to(docs).as_posix()
        for page in sorted((docs / "lab").glob("*.md"))
        for name, _ in _BLOCK.findall(page.read_text(encoding="utf-8"))
    }
    for page in sorted(docs.rglob("*.md")):
        text = page.read_text(encoding="utf-8")

        def replaced(block: re.Match[str], page: Path = page) -> str:
            name = block[1]
            if name not in TABLES:
                raise ValueError(f"{page}: no table {name!r}; of {', '.join(TABLES)}")
            # The bench's own table in the lab book has commit and machine.
            book = books.get(TABLES[name].benches[0], "lab/index.md")
            book = "" if page.parent.name == "lab" else book
            lines, problem = table_lines(TABLES[name], reports, book)
            if problem:
                messages.append(f"{page}: {name} is unchanged: {problem} ({TABLES[name].command})")
                return block[0]
            for bench in TABLES[name].benches:
                sources.setdefault(_commit_and_machine(_report(bench, reports)), set()).add(bench)
            body = "\n".join(lines)
            messages.append(f"{page}: {name} written")
            return f"<!-- bench:{name} -->\n\n{body}\n\n<!-- /bench -->"

        new = _BLOCK.sub(replaced, text)
        if new != text:
            page.write_text(new, encoding="utf-8")
    if len(sources) > 1:
        benches = "; ".join(f"{s}: {', '.join(sorted(b))}" for s, b in sorted(sources.items()))
        messages.append(f"tables are of {len(sources)} commits or machines: {benches}")
    return messages


def table_lines(table: Table, reports: Path, book: str = "") -> tuple[list[str], str]:
    """(lines of a table and of its source, ""), or ([], reason). book: page to link instead of the source."""
    figures: dict[str, Any] = {}
    sources_of_table: dict[str, list[str]] = {}
    for bench in table.benches:
        if not (reports / f"{bench}.json").exists():
            return [], f"there is no {reports / bench}.json"
        try:
            report = _report(bench, reports)
        except ValueError:
            return [], f"{reports / bench}.json is damaged"
        figures |= report["figures"]
        sources_of_table.setdefault(_commit_and_machine(report), []).append(
            f"{report['machine']['load_1min']:.1f}"
        )
    try:
        lines = table.lines(figures)
    except KeyError as error:
        return [], f"{', '.join(table.benches)}: no figure {error.args[0]}"
    except (TypeError, ValueError) as error:
        return [], f"{', '.join(table.benches)}: a figure that does not fit its row: {error}"
    if book:
        where = f"commit and machine: the [lab book]({book})"
        return [*lines, "", f"*`{table.command}`; {where}.*"], ""
    source = "; ".join(
        f"{where}, load {', '.join(loads)}" for where, loads in sources_of_table.items()
    )
    return [*lines, "", f"*`{table.command}` ({source}, the bench's own included).*"], ""


def _report(bench: str, reports: Path) -> dict[str, Any]:
    report: dict[str, Any] = json.loads((reports / f"{bench}.json").read_text(encoding="utf-8"))
    return report


def _commit_and_machine(report: dict[str, Any]) -> str:
    machine, commit = report["machine"], report["commit"]
    changed = "+" if commit.endswith("+") else ""
    return f"{commit[:7]}{changed}: {machine['cores']} cores of {machine['cpu']}"


if __name__ == "__main__":
    main()
