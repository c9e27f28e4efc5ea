"""A form of export: one line of words per view, from the scene itself.

pbrs-farm export out/studio --to word_list --most 5
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

from pbrs_farm.plugin import Record, ViewForm, option


class WordOptions(Record):
    """The options of the form."""

    most: int = option(20, "words a view (default 20)", metavar="N", least=1)


def write_word_list(views: list[Any], out: Path, choice: Any) -> None:
    """Write words.tsv: view, and the visible items, largest first.

    views: of pbrs_farm.export.chosen_view.ChosenView; choice: of Choice, beside it.
    """
    most, lines = choice.of(WordOptions).most, []
    for view in views:
        rows = sorted(view.facts["instances"], key=lambda row: -row["pixels"])
        counts = Counter(row["class"] for row in rows if row["class"] not in ("wall", "none"))
        words = ", ".join(f"{n} {name}" for name, n in list(counts.items())[:most])
        lines.append(f"{view.house.id}/{view.id}\t{words}")
    (out / "words.tsv").write_text("\n".join(lines) + "\n")


FORM = ViewForm(
    "word_list", write_word_list, "`words.tsv`: a line of words a view", options=WordOptions
)
