"""Trainings that are run by the program itself, some at a time, judged and told of. Effects: runs it, writes runs."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

SMALL_PICTURES: Final = (
    "--size", "160x120", "--recipe", "fast", "--dress", "1",
    # Views are looked at as large as they are made: what a home costs is halved by it.
    "--set", "cameras.score_width_px=160", "--set", "cameras.score_height_px=120",
)  # fmt: skip
FIRST_JUDGE: Final = 60101
"""Seeds of made homes that judge begin here, as the learning curve's do."""
_GRACE_S: Final = 15.0  # between asking a process to end and ending it


@dataclass(frozen=True, slots=True)
class Training:
    """What is trained and judged, in words of the command line without their --out."""

    folder: Path
    train: tuple[str, ...]
    judges: tuple[str, ...]  # NAME=PLACE each

    @property
    def evaluation(self) -> Path:
        """What says that it is done."""
        return self.folder / "evaluation/evaluation.json"


def run_program(words: Sequence[str], deadline: float | None, log: Path) -> int:
    """Run pbrs-farm until it ends or until the deadline, told first and then ended; its exit code."""
    log.parent.mkdir(parents=True, exist_ok=True)
    line = [sys.executable, "-m", "pbrs_farm.cli", *words]
    with log.open("a") as out:
        process = subprocess.Popen(line, stdout=out, stderr=out, start_new_session=True)
        try:
            return process.wait(None if deadline is None else max(deadline - time.monotonic(), 0))
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGINT)
        try:
            return process.wait(_GRACE_S) or 1
        except subprocess.TimeoutExpired:
            return 1
        finally:
            # The session is its own: what it started ends with it.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def train_all(
    trainings: Sequence[Training], together: int, deadline: float | None, tell: Callable[[], object]
) -> None:
    """Train and judge those that are not done, some at a time; tell is called after each, by one at a time.

    What cannot end before the deadline is not begun, by the longest so far.
    """
    telling, took = threading.Lock(), [0.0]

    def make(training: Training) -> None:
        began = time.monotonic()
        if training.evaluation.exists() or (deadline and began + max(took) > deadline):
            return
        train = [*training.train, "--out", str(training.folder)]
        judging = (word for on in training.judges for word in ("--on", on))
        evaluate = ["evaluate", str(training.folder), *judging]
        log = training.folder.with_name(f"{training.folder.name}.log")
        if any(run_program(words, deadline, log) for words in (train, evaluate)):
            print(f"{training.folder.name}: not finished, {log} says how far", flush=True)
            return
        with telling:
            took.append(time.monotonic() - began)
            print(f"{training.folder.name}: {took[-1]:.0f} s", flush=True)
            tell()

    with ThreadPoolExecutor(together) as pool:
        list(pool.map(make, trainings))


def row_of_run(evaluation: Path) -> dict[str, Any]:
    """What a training that is judged was, and its evaluations by the judges' names."""
    report = json.loads(evaluation.read_text())
    return {
        "run": evaluation.parents[1].name, "steps": report["run"]["plan"]["steps"],
        "batch": report["run"]["plan"]["batch"], "homes": len(report["run"]["homes"]["train"]),
        "baseline": report["trained"]["baseline_name"],
        "training_deg": report["trained"]["network"]["train"]["mean_deg"],
        "judged": {
            one["on"]: {key: one[key] for key in ("n_views", "figures", "parts", "shares", "groups")}
            for one in report["evaluations"]
        },
    }  # fmt: skip


def gains_by_home(
    before: Mapping[int, Mapping[str, float]], after: Mapping[int, Mapping[str, float]]
) -> list[float]:
    """Degrees that each home gains, the mean over the seeds that both have; [] without any.

    before, after: seed -> the mean error of each home that judges.
    """
    seeds = sorted(before.keys() & after.keys())
    if not seeds:
        return []
    return [
        sum(before[s][home] - after[s][home] for s in seeds) / len(seeds)
        for home in before[seeds[0]]
    ]
