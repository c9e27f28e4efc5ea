from __future__ import annotations

from pathlib import Path

import pytest

from pbrs_farm.run.processes.limits import machine_mb, memory_share_mb


def test_memory_is_the_containers_when_it_has_a_limit(tmp_path: Path) -> None:
    limit = tmp_path / "memory.max"
    limit.write_text("1073741824\n")
    assert machine_mb((limit,)) == 1024
    limit.write_text("max\n")
    assert machine_mb((limit,)) == machine_mb(())
    assert memory_share_mb(2) == pytest.approx(memory_share_mb(1) / 2)
