"""Runs a command as a user would, and watches all its processes. Effects: starts and kills them."""

from __future__ import annotations

import contextlib
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

LIMIT_S: Final = 25.0
"""Seconds until a command is killed; those it waited for a processor do not count."""

LIMIT_MB: Final = 4000
"""Resident memory of one process above which its command is killed."""

_ADDRESS_SPACE: Final = 24 * 2**30
"""What a process may map: a last guard for what grows faster than it is polled."""

_POLL_S: Final = 0.1


@dataclass(frozen=True, slots=True)
class Ended:
    """How a command ended. code: negative for a signal. killed: "time" or "memory" by our guard.

    seconds: of the clock, less those its processes were ready and no processor was free.
    """

    code: int
    text: str
    seconds: float
    cpu_s: float
    peak_mb: float
    killed: str


def watch(words: Sequence[str], limit_s: float = LIMIT_S) -> Ended:
    """Run `pbrs-farm WORDS` in a session of its own until it ends or a guard kills it."""
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
        while process.poll() is None:
            found = _session(process.pid)
            peak_mb = max([peak_mb, *(_high_water_mb(pid) for pid in found)])
            cpu_s = max(cpu_s, sum(_cpu_s(pid) for pid in found))
            delays |= {pid: _delay_s(pid) for pid in found}
            seconds = time.monotonic() - started - sum(delays.values())
            if seconds > limit_s:
                killed = "time"
            elif peak_mb > LIMIT_MB:
                killed = "memory"
            if killed:
                _kill(process.pid)
                break
            time.sleep(_POLL_S)
        code = process.wait()
        _kill(process.pid)  # whatever it left behind
        output.seek(0)
        text = output.read(4_000_000).decode("utf-8", "replace")
    return Ended(code, text, seconds, cpu_s, peak_mb, killed)


def _limit() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (_ADDRESS_SPACE, _ADDRESS_SPACE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _session(leader: int) -> list[int]:
    """The processes of a session: a command and all it started."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            fields = _stat(int(entry.name))
            if len(fields) > 3 and fields[3] == str(leader):
                found.append(int(entry.name))
    return found


def _stat(pid: int) -> list[str]:
    """/proc/PID/stat after the name: state, parent, group, session, ..."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return []


def _cpu_s(pid: int) -> float:
    fields = _stat(pid)
    return sum(int(x) for x in fields[11:13]) / os.sysconf("SC_CLK_TCK") if fields else 0.0


def _delay_s(pid: int) -> float:
    """Seconds that a process's main thread was ready to run and did not."""
    try:
        return int(Path(f"/proc/{pid}/schedstat").read_text().split()[1]) / 1e9
    except (OSError, IndexError):
        return 0.0


def _high_water_mb(pid: int) -> float:
    """VmHWM of a process in MB; 0 when it is gone."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0.0
    row = next((x for x in lines if x.startswith("VmHWM:")), "VmHWM: 0 kB")
    return int(row.split()[1]) * 1024 / 1e6


def _kill(leader: int) -> None:
    """Kill every process of a session that we started."""
    for pid in _session(leader):
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
