from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.operating_system import give_back_memory, resident_mb
from pbrs_farm.run.processes.limits import machine_mb, memory_share_mb


def test_memory_is_the_containers_when_it_has_a_limit(tmp_path: Path) -> None:
    limit = tmp_path / "memory.max"
    limit.write_text("1073741824\n")
    assert machine_mb((limit,)) == 1024
    limit.write_text("max\n")
    assert machine_mb((limit,)) == machine_mb(())
    assert memory_share_mb(2) == pytest.approx(memory_share_mb(1) / 2)


def test_memory_that_was_freed_is_given_back() -> None:
    # Pieces too small to be mapped separately, of which one in twenty is kept: memory does not
    # shrink unaided.
    pieces = [np.ones(8_000) for _ in range(2_000)]
    survivors = pieces[1::20]
    before = resident_mb(os.getpid())
    del pieces
    give_back_memory()
    assert resident_mb(os.getpid()) < before - 60
    assert all(piece[0] == 1 for piece in survivors)
