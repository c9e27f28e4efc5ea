"""No hostile input kills a command, hangs it, fills memory, or costs a sound home beside it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.hostile.case import Case, unique
from tests.hostile.process_tree import Ended
from tests.hostile.trials import MODULES, NAMED, STRIDES, Trials, all_cases, chosen_cases, some_of
from tests.hostile.verdict import FORGED, judge


@pytest.fixture(scope="module")
def trials(tmp_path_factory: pytest.TempPathFactory) -> Trials:
    """A sound home, run once; each case is tried beside it."""
    return Trials(tmp_path_factory.mktemp("hostile"))


@pytest.mark.slow
@pytest.mark.parametrize("case", chosen_cases(), ids=lambda case: case.name)
def test_a_hostile_input_ends_in_one_line_or_a_note(case: Case, trials: Trials) -> None:
    assert trials.judged_twice(case).what == {}


def test_every_family_has_cases_and_every_case_a_unique_name() -> None:
    cases = all_cases()
    assert len(cases) > 800
    assert {case.name.partition("/")[0] for case in cases} == STRIDES.keys()
    assert {*NAMED} <= {case.name for case in some_of(cases)}
    assert len(some_of(cases)) < len(cases) / 3
    assert all(any(True for _ in module.cases()) for module in MODULES)
    with pytest.raises(ValueError, match="two cases are called"):
        unique([cases[0], cases[0]])


CASE = Case("some/case", "format", lambda _place: [], neighbours=0)
FINE = Ended(1, "pbrs-farm: bad.sh3d: is not a zip", 1.0, 1.0, 100.0, "")


@pytest.mark.parametrize(
    ("ended", "figure"),
    [
        (
            Ended(1, "Traceback (most recent call last)\nKeyError: 1", 1.0, 1.0, 9.0, ""),
            "tracebacks",
        ),
        (Ended(1, "ValueError: what a library says", 1.0, 1.0, 9.0, ""), "unexpected"),
        (Ended(-11, "", 1.0, 1.0, 9.0, ""), "signals"),
        (Ended(0, "", 25.0, 25.0, 9.0, "time"), "over_20_s"),
        (Ended(0, "", 1.0, 1.0, 2500.0, ""), "over_2_gb"),
        (Ended(1, "x" * 3000, 1.0, 1.0, 9.0, ""), "long_lines"),
        (Ended(1, f"a\n{FORGED} b", 1.0, 1.0, 9.0, ""), "forged_lines"),
    ],
)
def test_a_fault_of_a_command_is_seen(ended: Ended, figure: str, tmp_path: Path) -> None:
    assert judge(CASE, [FINE], tmp_path, "bad").what == {}
    assert figure in judge(CASE, [ended], tmp_path, "bad").what


def test_a_lost_neighbour_and_a_silent_loss_are_seen(tmp_path: Path) -> None:
    beside = Case("some/case", "format", lambda _place: [], neighbours=1)
    assert "lost_neighbours" in judge(beside, [FINE], tmp_path, "bad").what
    lossy = Case("some/case", "format", lambda _place: [], neighbours=0, is_lossy=True)
    done = Ended(0, "1 house, 1 view", 1.0, 1.0, 9.0, "")
    assert "silent" in judge(lossy, [done], tmp_path, "bad").what
