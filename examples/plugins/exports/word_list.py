"""An exporter of one's own: a line of words a view, from the scene itself.

pbrs-farm export out/studio --to word_list
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

from pbrs_farm.plugin import ViewForm


def write_word_list(views: list[Any], out: Path, _choice: Any) -> int:
    """words.tsv: view, and what is seen, largest first; the number of files.

    views: of pbrs_farm.export.chosen_view.ChosenView.
    """
    lines = []
    for view in views:
        rows = sorted(view.facts["instances"], key=lambda row: -row["pixels"])
        counts = Counter(row["class"] for row in rows if row["class"] not in ("wall", "none"))
        words = ", ".join(f"{n} {name}" for name, n in counts.items())
        lines.append(f"{view.house.id}/{view.id}\t{words}")
    (out / "words.tsv").write_text("\n".join(lines) + "\n")
    return 1


FORM = ViewForm("word_list", write_word_list, "`words.tsv`: a line of words a view")
