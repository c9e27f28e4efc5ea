"""The sweep: arms differ in one field, gains are of equal seeds, and its table goes into the lab book."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from benchmarks.study import sweep
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.study.training_plan import plan_of

pytestmark = pytest.mark.study


def row(arm: str, seed: int, groups: dict[str, float], desk: float) -> dict[str, Any]:
    """A training of an arm whose mean angle is that of its homes."""
    mean = sum(groups.values()) / len(groups)
    judged = {
        name: {
            "n_views": 6,
            "figures": {"network": {"mean_deg": deg}, "mean normal": {"mean_deg": 45.0}},
            "groups": groups,
        }
        for name, deg in (("made", mean), ("desk", desk))
    }
    return {
        "run": arm, "arm": arm, "seed": seed, "steps": 300, "batch": 16, "homes": 12,
        "baseline": "mean normal", "training_deg": 20.0, "judged": judged,
    }  # fmt: skip


ROWS = [
    row("plain", 0, {"a": 30.0, "b": 32.0}, 28.0), row("plain", 1, {"a": 32.0, "b": 34.0}, 26.0),
    row("air1", 0, {"a": 29.0, "b": 29.0}, 25.0), row("air1", 1, {"a": 31.0, "b": 31.0}, 25.0),
    row("rays", 0, {"a": 31.0, "b": 33.0}, 24.0),
]  # fmt: skip


def cells(table: str) -> list[list[str]]:
    return [
        [cell.strip() for cell in line.split("|")[1:-1]]
        for line in table.splitlines()
        if line.startswith("|")
    ]


def test_a_gain_is_over_plain_at_equal_seeds_with_an_interval_over_homes() -> None:
    rows = {line[1]: line for line in cells(sweep.sweep_table(ROWS, {"air1": 0.08}))}
    # Home a gains 1 with either seed, home b 3.
    assert rows["float_share .1"] == [
        "things in the air", "float_share .1", "8 %", "2", "20.0", "30.00 ± 1.41",
        "+2.00 [+1.00, +3.00]", "25.00 ± 0.00",
    ]  # fmt: skip
    # One seed alone is compared with that seed of plain, which is better by a degree in both homes.
    assert rows["told"][6] == "-1.00 [-1.00, -1.00]"
    assert rows["recipe fast as it is"][6] == "-"
    assert rows["mean normal"][5] == "45.00"


def test_every_arm_is_of_fields_that_there_are_and_differs_from_plain() -> None:
    plain = recipe_from_name("fast")
    for name, arm in sweep.ARMS.items():
        recipe = dict(field.split("=") for field in arm.recipe)
        plan = dict(field.split("=") for field in arm.plan)
        changed = recipe_from_name("fast", recipe), plan_of("normals", "lite", plan)
        is_as_plain = changed == (plain, plan_of("normals", "lite")) and len(arm.pictures) < 2
        assert is_as_plain == (name == sweep.PLAIN), name
        assert set(arm.pictures) <= sweep.ARMS.keys()
        assert "_" not in name  # makes the names of runs unique


def test_plain_is_always_among_the_arms_and_homes_are_those_that_all_have() -> None:
    assert sweep.arms_to_do(["rays", "plain", "rays"]) == ["plain", "rays"]
    assert sweep.arms_to_do(["both"]) == ["plain", "drawn", "both"]
    views = [{"made-1": 8, "made-2": 8}, {"made-2": 5, "made-3": 8}]
    assert sweep.equal_homes(views) == {"made-2"}
    assert sweep.equal_homes([]) == frozenset()


def test_the_command_of_an_arm_holds_its_fields() -> None:
    words = sweep.render_words("level", 5, 8, 8, 2)
    assert words[:2] == ["run", "made:5..8"]
    assert "cameras.roll_sd_deg=0" in words


def test_the_table_takes_the_place_of_the_one_before(tmp_path: Path) -> None:
    page = tmp_path / "study.md"
    page.write_text("# The lab book\n\nText.\n")
    for k in (1, 2):
        sweep.write_into(page, sweep.sweep_section(ROWS[:k], {}, f"Commit {k}."))
    text = page.read_text()
    assert text.startswith("# The lab book\n\nText.\n\n## What each property")
    assert text.count(sweep._BEGIN) == text.count(sweep._END) == 1
    assert "Commit 2." in text
    assert "Commit 1." not in text
    page.write_text(text + "\n## Behind it\n")
    sweep.write_into(page, sweep.sweep_section(ROWS, {}, "Commit 3."))
    assert page.read_text().endswith("\n## Behind it\n")
