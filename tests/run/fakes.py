"""Fake steps: the house's "source" location names their fault."""

from __future__ import annotations

import os
import signal
import time

from pbrs_farm.core.errors import BadHouse, MachineFailed
from pbrs_farm.run.plan import STEPS
from pbrs_farm.run.step_cache import Outcome, StepOutput, Work, run_unless_done

SPOILT = {
    "note_kinds": {"missing-texture": 3, "wall-lost": 1},
    "leaks": [833, 20_000],
    "taken_out": {"plant": 2, "person": 1},
    "walls_lost": ["w3: repair left 0.5 of 24.0 m2 of it"],
}
"""Facts of a house with losses."""


def run_step(name: str, work: Work, *, attempt: int = 1) -> Outcome:
    """A step that writes its name, unless the recipe's name gives it another behaviour."""
    return run_unless_done(name, work, lambda w: _make(name, w), attempt=attempt)


def _make(name: str, work: Work) -> StepOutput:
    word, _, place = work.recipe.name.partition(":")
    where, _, home = place.partition("@")  # for any house, or for those whose id starts so
    key = f"{name}.{work.view_id}" if STEPS[name].per_view else name
    if where in (key, name) and work.house_id.startswith(home):
        if word == "crash":
            os.kill(os.getpid(), signal.SIGSEGV)
        if word == "hang":
            time.sleep(60)
        if word == "refuse":
            raise BadHouse("some.sh3d", "wall w3", "is made of cheese")
        if word == "bare":
            raise MachineFailed("no OpenGL here", hint="install it")
        if word == "bug":
            raise ZeroDivisionError("a bug")
    if name == "illuminance" and word == "dark":
        return StepOutput(
            {f"{name}.txt": b""}, {"floor_lux": {"0_0": {"outdoor": 0.3, "indoor": 0.0}}}
        )
    if name == "house" and word == "spoilt":
        return StepOutput({f"{name}.txt": b""}, dict(SPOILT))
    facts: dict[str, object] = {"dark": ["black"]} if name == "light" and word == "black" else {}
    facts |= {"views": [["0_0_0", "0_0", 2.0], ["0_0_1", "0_0", 1.0]]} if name == "cameras" else {}
    return StepOutput({f"{name}.txt": key.encode()}, facts)
