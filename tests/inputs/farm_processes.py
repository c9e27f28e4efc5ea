"""Processes of a farm's workers."""

from __future__ import annotations

import json
import os
from pathlib import Path

from benchmarks.memory import descendants
from tests.workers.small_farm import SmallFarm


def renderers(farm: SmallFarm, worker: str) -> list[int]:
    """Process ids of a worker's renderers."""
    found = []
    for pid in descendants(farm.processes[worker].pid):
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
        if b"workers.node.renderer:make_handler" in words:
            found.append(pid)
    return found


def note(fault: str, farm: SmallFarm, repeated: int, seconds: float) -> None:
    """A line of the chaos table; nothing is ever lost when this is reached."""
    path = os.environ.get("PBRS_CHAOS_TABLE")
    if path:
        row = {
            "fault": fault, "tasks": sum(farm.starts().values()) - repeated, "lost": 0,
            "repeated": repeated, "seconds": round(seconds, 1),
        }  # fmt: skip
        with Path(path).open("a") as file:
            file.write(json.dumps(row) + "\n")
