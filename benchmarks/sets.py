"""Questions answered again, blind answers, licences, waiting of a stream: `make bench NAME=sets` -> out/bench/sets.json.

Questions are about pictures and walks of dressed homes that nobody tunes on; pbrs_farm/check/question_checks.py answers them
again from the stored files. The pictures are of homes for which the licence CC0 alone is chosen. Tests read the forms back
(tests/export) and compare the bytes of sets that were killed and sharded (tests/sets).
"""

from __future__ import annotations

import csv
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any, Final

from benchmarks.blind_pairs import UNITS as UNITS_OF_PAIRS
from benchmarks.blind_pairs import blind_figures, render_edits
from benchmarks.figures import write_report
from benchmarks.stream_wait import UNITS as UNITS_OF_STREAM
from benchmarks.stream_wait import stream_figures
from pbrs_farm.check.question_checks import wrong_answers
from pbrs_farm.curate.teaching_rules import REASONS, judged_by
from pbrs_farm.export.export_views import finished_entries

UNITS: Final = {
    "sets.licences_wrong": "views of homes for CC0 alone that name another licence, and files of credits",
    "sets.questions": "questions of pictures and walks",
    "sets.questions_wrong": "questions with another answer by a checker of its own",
    "sets.blind_best": "largest share of right answers by always giving the same one of four",
    "sets.blind": "score of the best blind answer, by type",
    **UNITS_OF_STREAM,
    **UNITS_OF_PAIRS,
    "sets.curated": "views that each rule of `select --by` leaves out of the pictures and walks of the questions",
}
_PICTURES: Final = "made:70101..70104"
_WALKS: Final = "made:70115"
_CHOICES_OF_FOUR: Final = (
    "object_rel_distance",
    "object_rel_direction_hard",
    "obj_appearance_order",
)


def main() -> None:
    """Ask and answer, measure the stream, and write the report."""
    write_report("sets", _questions() | stream_figures(), UNITS)


def _questions() -> dict[str, Any]:
    """Figures of the questions about pictures and walks."""
    scores: dict[str, float] = {}
    n = n_wrong = licences_wrong = 0
    curated: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for name, homes, how in (
            ("pictures", _PICTURES, ["--views", "6", "--set", "dress.licences=CC0"]),
            ("walks", _WALKS, ["--cameras", "walk", "--frames", "150", "--fps", "10"]),
        ):
            root, out = Path(folder, name), Path(folder, f"{name}_questions")
            _pbrs_farm(
                "run", homes, "--dress", "1", "--recipe", "preview", "--size", "320x240",
                "--modes", "opengl_dl", *how, "--jobs", "2", "--out", str(root),
            )  # fmt: skip
            _pbrs_farm("export", str(root), "--to", "questions", "--out", str(out))
            entries = finished_entries(root)
            if name == "pictures":
                licences_wrong = sum(set(view.facts["licences"]) != {"CC0"} for view in entries)
                licences_wrong += len(list(root.rglob("ATTRIBUTION.txt")))
            verdicts = judged_by(entries, list(REASONS))
            curated.update(f"{name} {verdict.reason or 'kept'}" for verdict in verdicts)
            wrong = wrong_answers(root, out)
            print(*wrong, sep="\n", flush=True)
            n_wrong += len(wrong)
            with (out / "blind_scores.csv").open() as file:
                for row in csv.DictReader(file):
                    n += int(row["questions"])
                    scores[f"{name} {row['question_type']}"] = float(row["constant_score"])
        edits, of_edits = Path(folder, "edits"), Path(folder, "edits_questions")
        render_edits(edits)
        _pbrs_farm("export", str(edits), "--to", "questions", "--out", str(of_edits))
        n_wrong += len(wrong_answers(edits, of_edits))
        of_pairs = blind_figures([Path(folder, "pictures_questions"), of_edits])
    best = [score for name, score in scores.items() if name.split()[1] in _CHOICES_OF_FOUR]
    return {
        "sets.licences_wrong": licences_wrong, "sets.questions": n, "sets.questions_wrong": n_wrong, "sets.blind_best": max(best),
        **of_pairs, "sets.blind": scores, "sets.curated": dict(sorted(curated.items())),
    }  # fmt: skip


def _pbrs_farm(*words: str) -> None:
    subprocess.run(
        [sys.executable, "-m", "pbrs_farm.cli", *words], check=True, stdout=subprocess.DEVNULL
    )


if __name__ == "__main__":
    main()
