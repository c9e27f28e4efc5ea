"""Peak memory of this process alone. Effects: reads /proc.

getrusage's ru_maxrss starts at the peak of the process that started this one: a small child of a
large parent reports the parent's memory. VmHWM belongs to the program's own address space.
"""

from __future__ import annotations

from pathlib import Path


def peak_mb() -> float:
    """Largest resident memory of this process since its program began, MB."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) * 1024 / 1e6
    raise RuntimeError("/proc/self/status holds no VmHWM")
