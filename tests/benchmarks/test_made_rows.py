"""The bench of made homes keeps each row as soon as it is measured, and goes on from there."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import TextIO

import pytest

from benchmarks.homes import made

ROW = "import sys; print(*('{{\"seed\": %s}}' % s for s in sys.argv[1:]), sep=chr(10))"


def test_a_bench_that_was_killed_measures_what_is_missing_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[list[int]] = []

    def started(_part: str, seeds: list[int], rows: TextIO) -> subprocess.Popen[str]:
        asked.append(seeds)
        words = [sys.executable, "-c", ROW.format(), *map(str, seeds)]
        return subprocess.Popen(words, stdout=rows, stderr=subprocess.PIPE, text=True)

    # Rows of 1 and 3 are whole, that of 4 was cut off.
    monkeypatch.setattr(made, "_started", started)
    path = tmp_path / "plans.jsonl"
    path.write_text('{"seed": 3}\n{"seed": 1}\n{"seed": 4, "bi')
    made._fill(path, "plans", range(1, 6))
    assert asked == [[2, 4, 5]]
    assert [row["seed"] for row in made._rows(path)] == [1, 2, 3, 4, 5]
