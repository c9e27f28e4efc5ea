"""Hostile inputs for every verb that reads files: the cases, and the trial of one in a separate process.

Every input is built in code, run beside a sound home by the command of a user, watched for
time and memory, and judged by its output. Effects: a temporary folder, processes.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from tests.hostile import (
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
from tests.hostile.case import ONE_VIEW, Case, Place, unique
from tests.hostile.process_tree import watch
from tests.hostile.sound_inputs import sound_home
from tests.hostile.verdict import Verdict, judge

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
"""Of a family every n-th case is run by default, which fits 12 minutes."""

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
SLOW: Final = "over_20_s"
COUNTED: Final = (
    "tracebacks", "signals", "over_20_s", "over_2_gb", "lost_neighbours", "silent", "unexpected",
    "long_lines", "forged_lines",
)  # fmt: skip


def all_cases() -> list[Case]:
    """Every case, each name once."""
    return unique(case for module in MODULES for case in module.cases())


def chosen_cases(parts: Sequence[str] = ()) -> list[Case]:
    """Cases whose name contains one of the parts; without parts some of every family, or all if FULL=1 is set."""
    cases = all_cases()
    if parts or os.environ.get("FULL"):
        return [c for c in cases if not parts or any(part in c.name for part in parts)]
    return some_of(cases)


class Trials:
    """Hostile inputs beside a sound home, which is written and run once. work: a folder, left empty."""

    def __init__(self, work: Path) -> None:
        self._work = work
        self._sound = sound_home(work / "sound")
        self._stored = work / "stored"
        done = watch(("run", str(self._sound), "--out", str(self._stored), *ONE_VIEW), 120.0)
        if done.code:
            raise RuntimeError(f"the sound home failed: {done.text}")
        self.alone_s = done.seconds

    def judged(self, case: Case) -> Verdict:
        """Build a case, run it, clean up; returns the verdict."""
        folder = self._work / case.name.replace("/", "-")
        folder.mkdir()
        place = Place(folder, self._sound, self._stored)
        try:
            commands = case.write(place)
            ends = [watch(words) for words in commands]
            named = Path(commands[0][1]) if len(commands[0]) > 1 else folder
            return judge(case, ends, place.out, named.stem)
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def judged_twice(self, case: Case) -> Verdict:
        """As judged; a slow case is tried again, because a busy machine slows everything."""
        first = self.judged(case)
        if SLOW not in first.what:
            return first
        return min(first, self.judged(case), key=lambda verdict: verdict.seconds)


def some_of(cases: Sequence[Case]) -> list[Case]:
    """Some of every family: every n-th, those of the worst faults, the named ones."""
    chosen, count = [], dict.fromkeys(STRIDES, 0)
    for case in cases:
        family = case.name.partition("/")[0]
        if case.name in NAMED or case.fault in WHOLE or count[family] % STRIDES[family] == 0:
            chosen.append(case)
        count[family] += 1
    return chosen
