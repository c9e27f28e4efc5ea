"""Memory and CPU time of processes: of this one alone, of others and their children. Effects: reads /proc.

getrusage's ru_maxrss starts at the peak of the process that started this one: a small child of a
large parent reports the parent's memory. VmHWM belongs to the program's own address space.
"""

from __future__ import annotations

import os
import resource
from pathlib import Path


def peak_mb() -> float:
    """Largest resident memory of this process since its program began, MB."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) * 1024 / 1e6
    raise RuntimeError("/proc/self/status holds no VmHWM")


def descendants(pid: int) -> list[int]:
    """Process ids of all children, theirs included."""
    try:
        words = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return []
    return [p for word in words for p in (int(word), *descendants(int(word)))]


def cpu_s(pid: int) -> float:
    """CPU seconds of a process and of its children that have ended."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def resident_mb(pid: int) -> float:
    """Memory of a process now, MB. Raises OSError when it is gone."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6
