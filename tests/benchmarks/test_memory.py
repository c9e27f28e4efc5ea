"""A bench's memory is its own process's."""

from __future__ import annotations

import subprocess
import sys

from benchmarks.memory import peak_mb

CHILD = "from benchmarks.memory import peak_mb; print(peak_mb())"


def test_a_child_does_not_report_its_parents_peak() -> None:
    filled = bytearray(b"x" * 400_000_000)
    assert peak_mb() > 400
    del filled
    done = subprocess.run([sys.executable, "-c", CHILD], capture_output=True, text=True, check=True)
    assert float(done.stdout) < 200
