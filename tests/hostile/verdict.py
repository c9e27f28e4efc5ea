"""Faults in a command's handling of a hostile input; no effects but reading its output folder."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from tests.hostile.case import Case
from tests.hostile.process_tree import Ended

SLOW_S: Final = 20.0
MAX_MB: Final = 2000
LONG_LINE: Final = 2000
"""Characters of a printed line above which it hides its message."""

FORGED: Final = "[   0.1 s] forged"
"""Start of a forged console line; builders put it after a newline in a name."""

_SIGNAL: Final = re.compile(r"SIG[A-Z]{3,}|Segmentation fault|core dumped|exit code 13[0-9]")
_STEP: Final = re.compile(r"\b(house|cameras|view|truth|opengl_\w+|light|develop|repair|read)\b")
_EXCEPTION: Final = re.compile(r"\b[A-Za-z_.]*(?:Error|Exception|Warning)\b(?=: )")
_NOTE: Final = re.compile(r"\b[1-9]\d* notes?\b|\bnotes?: ", re.IGNORECASE)


@dataclass(slots=True)
class Verdict:
    """Faults of one case. what: name of a figure -> the line that shows it."""

    case: Case
    seconds: float = 0.0
    cpu_s: float = 0.0
    peak_mb: float = 0.0
    code: int = 0
    what: dict[str, str] = field(default_factory=dict)
    said: str = ""


def judge(case: Case, ends: list[Ended], out: Path, bad: str) -> Verdict:
    """The verdict on a case. ends: one per command. bad: stem of the bad file."""
    verdict = Verdict(
        case,
        seconds=max(e.seconds for e in ends),
        cpu_s=max(e.cpu_s for e in ends),
        peak_mb=max(e.peak_mb for e in ends),
        code=ends[0].code,
        said=_last_words(ends[0].text),
    )
    figures = verdict.what
    for end in ends:
        lines = end.text.splitlines()
        if "Traceback (most recent call last)" in end.text:
            figures["tracebacks"] = lines[-1] if lines else ""
        named = next((x for x in lines if _EXCEPTION.search(x)), "")
        if named and "tracebacks" not in figures:
            figures["unexpected"] = named
        if end.code < 0 and not end.killed:
            figures["signals"] = f"ended by signal {-end.code}"
        for line in lines:
            if _SIGNAL.search(line) and not (bad.lower() in line.lower() and _STEP.search(line)):
                figures["signals"] = line
        if end.killed == "time" or end.seconds > SLOW_S:
            figures["over_20_s"] = f"{end.seconds:.0f} s ({end.cpu_s:.0f} s of processor)"
        if end.peak_mb > MAX_MB:
            figures["over_2_gb"] = f"{end.peak_mb:.0f} MB"
        if any(len(line) > LONG_LINE for line in lines):
            figures["long_lines"] = f"a line of {max(map(len, lines))} characters"
        if any(line.startswith(FORGED) for line in lines):
            figures["forged_lines"] = "a name forged a line"
    n_done = len({p.parents[2] for p in out.glob("*/*sound*/views/*/opengl_dl.png")})
    if n_done < case.neighbours:
        figures["lost_neighbours"] = verdict.said
    if case.is_lossy and ends[0].code == 0 and not _NOTE.search(ends[0].text):
        figures["silent"] = "exit 0 without a note"
    return verdict


def _last_words(text: str) -> str:
    lines = [x.strip() for x in text.splitlines() if x.strip()]
    messages = [x for x in lines if "FAILED" in x or "pbrs-farm:" in x]
    return " | ".join((messages or lines)[-2:])
