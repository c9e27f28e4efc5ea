"""Hostile files: what a stranger may hand to every verb that reads, each in a process of its own.

Every input is built in code, run beside a sound home by the command a user would type, watched for
time and memory, and judged by what came out. Effects: writes out/bench/hostile.json, and a
temporary folder.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import traceback
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

from benchmarks.figures import FOLDER, write_report
from benchmarks.hostile import (
    arch_cases,
    command_cases,
    container_cases,
    crowd_cases,
    file_cases,
    gltf_cases,
    gltf_companion_cases,
    input_cases,
    model_cases,
    mutation_cases,
    object_cases,
    plan_cases,
    shape_cases,
    stored_cases,
    suncg_cases,
    text_cases,
)
from benchmarks.hostile.case import ONE_VIEW, Case, Place, unique
from benchmarks.hostile.process_tree import watch
from benchmarks.hostile.sound_inputs import sound_home
from benchmarks.hostile.verdict import Verdict, judge

MODULES: Final = (
    shape_cases, text_cases, file_cases, container_cases, plan_cases, model_cases, suncg_cases,
    arch_cases, gltf_cases, gltf_companion_cases, object_cases, command_cases, stored_cases,
    mutation_cases, crowd_cases, input_cases,
)  # fmt: skip
N_PROCESSES: Final = 2
STRIDES: Final = {
    "suncg": 5, "stored": 8, "gltf": 5, "plan": 5, "mutation": 5, "set": 5, "shape": 2, "file": 4,
    "objects": 5, "model": 4, "text": 4, "xml": 4, "arch": 5, "cameras": 5, "words": 5, "zip": 4,
    "glb": 4, "rooms": 4, "classes": 4, "texture": 3, "mtl": 4,
    "crowd": 1, "input": 9,
}  # fmt: skip
"""Of a family of cases, every n-th is run unless all are asked for: what fits 12 minutes."""

NAMED: Final = (
    "file/zero.sh3d", "file/fifo.sh3d", "file/zero_camera_file", "set/light.spp=1000000000000",
    "cameras/json_million", "plan/overlapping_19000", "plan/room_99000_corners",
    "plan/piece_900_m_away", "plan/hidden_levels", "text/sh3d_newline", "text/sh3d_100_kb",
    "text/sh3d_unicode", "mtl/empty", "suncg/unknown_type", "suncg/walls_cut", "suncg/model_cut",
    "suncg/only_house_p", "texture/cut", "objects/run_obj", "objects/run_glb", "gltf/cycle",
    "zip/bomb_home_xml", "xml/laughs", "words/map_without_suffix",
)  # fmt: skip
"""Cases that are always run, beside all of the faults in WHOLE."""

WHOLE: Final = ("walls", "shell", "dark")
COUNTED: Final = (
    "tracebacks", "signals", "over_20_s", "over_2_gb", "lost_neighbours", "silent", "unexpected",
    "long_lines", "forged_lines",
)  # fmt: skip


def main(parts: Sequence[str] = ()) -> None:
    """Run the chosen cases, print the faulty ones, write the figures.

    Chosen are those whose names hold one of the parts; without parts some of every family, or,
    where the environment says FULL=1, all (more than 800, about an hour).
    """
    _write(*verdicts_of(parts))


def counted(parts: Sequence[str]) -> tuple[int, int]:
    """How many cases whose names hold one of the parts there are, and how many have a fault."""
    verdicts, _alone_s = verdicts_of(parts)
    return len(verdicts), sum(bool(v.what) for v in verdicts)


def verdicts_of(parts: Sequence[str]) -> tuple[list[Verdict], float]:
    """The verdicts on the chosen cases, as main says; what the sound home alone takes, s."""
    cases = unique(case for module in MODULES for case in module.cases())
    if parts or os.environ.get("FULL"):
        chosen = [c for c in cases if not parts or any(part in c.name for part in parts)]
    else:
        chosen = some_of(cases)
    with tempfile.TemporaryDirectory(prefix="hostile-") as name:
        work = Path(name)
        sound = sound_home(work / "sound")
        stored = work / "stored"
        done = watch(("run", str(sound), "--out", str(stored), *ONE_VIEW), 120.0)
        if done.code:
            raise RuntimeError(f"the sound home failed: {done.text}")
        print(f"{len(chosen)} inputs; the sound home alone takes {done.seconds:.1f} s")
        with ThreadPoolExecutor(N_PROCESSES) as pool:
            verdicts = list(pool.map(lambda case: _judged(case, work, sound, stored), chosen))
        # Try slow ones again, one at a time: a busy machine makes anything slow.
        for k, verdict in enumerate(verdicts):
            if "over_20_s" in verdict.what:
                again = _judged(verdict.case, work, sound, stored)
                verdicts[k] = min(verdict, again, key=lambda v: v.seconds)
                if "over_20_s" in verdicts[k].what:
                    _tell(verdicts[k], ("over_20_s",))
    return verdicts, done.seconds


def some_of(cases: Sequence[Case]) -> list[Case]:
    """Some of every family: every n-th, those of the worst faults, those that are named."""
    chosen, count = [], dict.fromkeys(STRIDES, 0)
    for case in cases:
        family = case.name.partition("/")[0]
        if case.name in NAMED or case.fault in WHOLE or count[family] % STRIDES[family] == 0:
            chosen.append(case)
        count[family] += 1
    return chosen


def _judged(case: Case, work: Path, sound: Path, stored: Path) -> Verdict:
    """Build a case, run it, and clean up."""
    folder = work / case.name.replace("/", "-")
    folder.mkdir()
    place = Place(folder, sound, stored)
    try:
        commands = case.write(place)
        ends = [watch(words) for words in commands]
        named = Path(commands[0][1]) if len(commands[0]) > 1 else folder
        verdict = judge(case, ends, place.out, named.stem)
    except Exception as error:  # noqa: BLE001  a builder's own fault costs its case only
        traceback.print_exc()
        verdict = Verdict(case, what={"unbuilt": repr(error)})
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    _tell(verdict, [name for name in verdict.what if name != "over_20_s"])
    return verdict


def _tell(verdict: Verdict, figures: Iterable[str]) -> None:
    """Print a line for each of these figures that the case breaks."""
    case = verdict.case
    for name in figures:
        print(f"{case.fault:<9} {case.name:<44} {name:<16} {verdict.what[name][:300]}", flush=True)


def _write(verdicts: Sequence[Verdict], alone_s: float) -> None:
    figures: dict[str, Any] = {"hostile.inputs": len(verdicts)}
    units = {"hostile.inputs": "inputs"}
    for name in COUNTED:
        figures[f"hostile.{name}"] = sum(name in v.what for v in verdicts)
        units[f"hostile.{name}"] = "inputs"
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
    path = write_report("hostile", figures, units)
    (FOLDER / "hostile_cases.json").write_text(json.dumps(rows, indent=1) + "\n")
    unbuilt = [v.case.name for v in verdicts if "unbuilt" in v.what]
    if unbuilt:
        raise RuntimeError(f"{path}: cases that could not be built: {', '.join(unbuilt)}")
