"""Limits of a render process, and the resources of the machine. Reads /sys."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pbrs_farm.operating_system import memory_bytes

# cgroup v2 (the unified hierarchy) first, then v1.
_CGROUP_LIMITS: Final = (
    Path("/sys/fs/cgroup/memory.max"),
    Path("/sys/fs/cgroup/memory/memory.limit_in_bytes"),
)
# cgroup v1 writes "no limit" as a number near 2^63.
_NO_LIMIT: Final = 1 << 50
_SHARE_OF_MACHINE: Final = 0.9
_APART_MB: Final = 6000.0  # memory of a machine on which two processes may share a view's steps


@dataclass(frozen=True, slots=True)
class ProcessLimits:
    """When a render process is killed, and when it is replaced between two tasks."""

    start_s: float = 300.0  # until it is ready
    # Time in which storage does not answer counts for neither of these two:
    step_s: float = math.inf  # for one step
    silence_s: float = 1800.0  # without a message and without a line in its log
    memory_mb: float = math.inf  # resident, MiB
    recycle_mb: float = math.inf  # resident between two tasks, MiB
    recycle_tasks: int = 2000  # tasks after which a process is replaced


def machine_mb(limits: tuple[Path, ...] = _CGROUP_LIMITS) -> float:
    """Memory of this container or machine, in MiB, used or not: the least in limits, files of cgroups."""
    # Take the container's limit where it is below what the machine has.
    total = memory_bytes()
    for path in limits:
        try:
            text = path.read_text("ascii").strip()
        except OSError:
            continue
        if text.isdigit() and int(text) < _NO_LIMIT:
            total = min(total, int(text))
    return total / 2**20


def is_room_for_two() -> bool:
    """Whether this machine has the cores and the memory for two processes that share a view's steps."""
    return (os.cpu_count() or 1) > 1 and machine_mb() > _APART_MB


def memory_share_mb(n_processes: int) -> float:
    """Memory limit of one of n render processes: its share of nine tenths of the machine, in MiB."""
    return _SHARE_OF_MACHINE * machine_mb() / max(1, n_processes)
