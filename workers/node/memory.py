"""How much memory there is and how much a process holds. Effects: reads /proc and /sys."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

# cgroup v2 (the unified hierarchy) first, then v1.
_CGROUP_LIMITS: Final = (
    Path("/sys/fs/cgroup/memory.max"),
    Path("/sys/fs/cgroup/memory/memory.limit_in_bytes"),
)
_NO_LIMIT: Final = 1 << 50


def machine_mb(limits: tuple[Path, ...] = _CGROUP_LIMITS) -> float:
    """Memory this container or machine may use, in MiB."""
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    for path in limits:
        try:
            text = path.read_text().strip()
        except OSError:
            continue
        if text.isdigit() and int(text) < _NO_LIMIT:
            total = min(total, int(text))
    return total / 2**20


def memory_limit_mb(n_slots: int) -> float:
    """What one renderer may hold: its share of nine tenths of the machine, in MiB."""
    return 0.9 * machine_mb() / max(1, n_slots)


def resident_mb(pid: int) -> float:
    """Resident memory of a process in MiB, 0 when it is gone."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except (OSError, IndexError, ValueError):
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20
