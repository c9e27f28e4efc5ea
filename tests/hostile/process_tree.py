"""Runs a command like a user, and watches all its processes. Effects: starts and kills them."""

from __future__ import annotations

import contextlib
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

LIMIT_S: Final = 25.0
"""Seconds until a command is killed, without those spent waiting for a processor."""

LIMIT_MB: Final = 4000
"""Resident memory of one process, in MB, above which its command is killed."""

_ADDRESS_SPACE: Final = 24 * 2**30
"""Limit of mapped memory: a last guard against growth faster than the polling."""

_POLL_S: Final = 0.1


@dataclass(frozen=True, slots=True)
class Ended:
    """The end of a command. code: negative for a signal. killed: "time" or "memory" by our guard.

    seconds: wall time, minus the time that the command and its longest waiting process were
    ready without a free processor. cpu_s, peak_mb: of all its processes, including render
    processes with separate sessions: their sum, and the largest.
    """

    code: int
    text: str
    seconds: float
    cpu_s: float
    peak_mb: float
    killed: str


def watch(words: Sequence[str], limit_s: float = LIMIT_S) -> Ended:
    """Run `pbrs-farm WORDS` in a new session until it ends or a guard kills it."""
    with tempfile.TemporaryFile() as output:
        started = time.monotonic()
        process = subprocess.Popen(
            [sys.executable, "-m", "pbrs_farm.cli", *words],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            preexec_fn=_limit,
        )
        peak_mb, cpu_s, seconds, killed = 0.0, 0.0, 0.0, ""
        delays: dict[int, float] = {}
        sessions = {str(process.pid)}
        while process.poll() is None:
            family = _family(sessions)
            peak_mb = max([peak_mb, *(_high_water_mb(pid) for pid in family)])
            cpu_s = max(cpu_s, sum(_cpu_s(pid) for pid in family))
            delays |= {pid: max(_delay_s(pid), delays.get(pid, 0.0)) for pid in family}
            child_delays = (d for pid, d in delays.items() if pid != process.pid)
            waited = delays.get(process.pid, 0.0) + max(child_delays, default=0.0)
            seconds = time.monotonic() - started - waited
            if seconds > limit_s:
                killed = "time"
            elif peak_mb > LIMIT_MB:
                killed = "memory"
            if killed:
                _kill(family)
                break
            time.sleep(_POLL_S)
        code = process.wait()
        _kill(_family(sessions))  # processes that it left behind
        output.seek(0)
        text = output.read(4_000_000).decode("utf-8", "replace")
    return Ended(code, text, seconds, cpu_s, peak_mb, killed)


def _limit() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (_ADDRESS_SPACE, _ADDRESS_SPACE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _family(sessions: set[str]) -> list[int]:
    """The processes of a command's sessions; sessions that its processes started are added."""
    rows = {int(e.name): _stat(int(e.name)) for e in Path("/proc").iterdir() if e.name.isdigit()}
    rows = {pid: fields for pid, fields in rows.items() if len(fields) > 3}
    family: set[int] = set()
    # A process belongs to it by its parent or its session; repeat until nothing is added.
    while True:
        more = {
            pid
            for pid, fields in rows.items()
            if pid not in family and (int(fields[1]) in family or fields[3] in sessions)
        }
        if not more:
            return sorted(family)
        family |= more
        sessions.update(rows[pid][3] for pid in more)


def _stat(pid: int) -> list[str]:
    """/proc/PID/stat after the name: state, parent, group, session, ..."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return []


def _cpu_s(pid: int) -> float:
    # Its time, and that of its finished children.
    fields = _stat(pid)
    return sum(int(x) for x in fields[11:15]) / os.sysconf("SC_CLK_TCK") if fields else 0.0


def _delay_s(pid: int) -> float:
    """Seconds that a process's main thread was ready but not running."""
    try:
        return int(Path(f"/proc/{pid}/schedstat").read_text().split()[1]) / 1e9
    except (OSError, IndexError):
        return 0.0


def _high_water_mb(pid: int) -> float:
    """VmHWM of a process in MB; 0 if it has ended."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0.0
    row = next((x for x in lines if x.startswith("VmHWM:")), "VmHWM: 0 kB")
    return int(row.split()[1]) * 1024 / 1e6


def _kill(processes: Iterable[int]) -> None:
    """Kill processes that we started."""
    for pid in processes:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
