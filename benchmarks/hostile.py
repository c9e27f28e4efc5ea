"""Time, memory and faults of hostile inputs: `make bench NAME=hostile` -> out/bench/hostile.json.

Cases and faults are those of tests/hostile. Some of every family are run, all with FULL=1 (more than 800, about an hour).
"""

from __future__ import annotations

import json
import tempfile
import traceback
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

from benchmarks.figures import FOLDER, write_report
from tests.hostile.case import Case
from tests.hostile.trials import COUNTED, SLOW, Trials, chosen_cases
from tests.hostile.verdict import Verdict

N_PROCESSES: Final = 2


def main() -> None:
    """Run the chosen cases, print the faulty ones, write the figures."""
    verdicts, alone_s = verdicts_of(())
    figures: dict[str, Any] = {
        "hostile.inputs": len(verdicts),
        "hostile.failures": sum(bool(v.what) for v in verdicts),
        **{f"hostile.{name}": sum(name in v.what for v in verdicts) for name in COUNTED},
    }
    units = dict.fromkeys(figures, "inputs")
    figures["hostile.peak_mb"] = round(max((v.peak_mb for v in verdicts), default=0.0))
    figures["hostile.slowest_s"] = round(max((v.seconds for v in verdicts), default=0.0), 1)
    figures["hostile.sound_alone_s"] = round(alone_s, 1)
    units |= {"hostile.peak_mb": "MB, largest process", "hostile.slowest_s": "s, 25 is killed"}
    units["hostile.sound_alone_s"] = "s, the sound home without a bad one"
    rows = [
        {
            "name": v.case.name, "fault": v.case.fault, "exit": v.code, "seconds": round(v.seconds, 1),
            "cpu_s": round(v.cpu_s, 1), "peak_mb": round(v.peak_mb), "what": v.what, "said": v.said[:1000],
        }
        for v in verdicts
    ]  # fmt: skip
    write_report("hostile", figures, units)
    (FOLDER / "hostile_cases.json").write_text(json.dumps(rows, indent=1) + "\n")


def counted(parts: Sequence[str]) -> tuple[int, int]:
    """(number of cases with one of the parts in their names, number of these with a fault)."""
    verdicts, _alone_s = verdicts_of(parts)
    return len(verdicts), sum(bool(v.what) for v in verdicts)


def verdicts_of(parts: Sequence[str]) -> tuple[list[Verdict], float]:
    """(verdicts on the cases with one of the parts in their names, seconds of the sound home alone)."""
    cases = chosen_cases(parts)
    with tempfile.TemporaryDirectory(prefix="hostile-") as folder:
        trials = Trials(Path(folder))
        print(f"{len(cases)} inputs; the sound home alone takes {trials.alone_s:.1f} s")
        with ThreadPoolExecutor(N_PROCESSES) as pool:
            verdicts = list(pool.map(lambda case: _judged(trials, case), cases))
        # Try slow ones again, one at a time.
        for k, verdict in enumerate(verdicts):
            if SLOW in verdict.what:
                again = _judged(trials, verdict.case)
                verdicts[k] = min(verdict, again, key=lambda v: v.seconds)
    return verdicts, trials.alone_s


def _judged(trials: Trials, case: Case) -> Verdict:
    """The verdict on a case; its faults are printed, and a failed builder is one."""
    try:
        verdict = trials.judged(case)
    except Exception as error:  # noqa: BLE001  a failed builder fails only its case
        traceback.print_exc()
        verdict = Verdict(case, what={"unbuilt": repr(error)})
    for name, line in verdict.what.items():
        print(f"{case.fault:<9} {case.name:<44} {name:<16} {line[:300]}", flush=True)
    return verdict
