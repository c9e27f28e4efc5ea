"""The table of checks: a new check needs one module, and each entry has a planted falsehood."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import pbrs_farm.check
from pbrs_farm.check import verify
from pbrs_farm.check.checks import all_checks
from pbrs_farm.check.rules import Rule, judge, rules_by_scope
from tests.check import falsehoods
from tests.check.falsehoods import FALSEHOODS, planted

TOY = '''"""A view's name and its room's begin alike."""

from pbrs_farm.check.cases import ViewCase
from pbrs_farm.check.checks import Check


def check_toy(case: ViewCase) -> None:
    stored = (case.view.folder / "toy.txt").read_text()
    case.expect("toy", "toy.txt")(stored == case.view.folder.name, f"names {stored}")


CHECKS = (
    Check(
        name="toy", of="view", needs=("toy.txt",), function=check_toy, cost=99,
        files={"toy.txt": "named as its folder"},
    ),
)
'''


@pytest.mark.kinds("check")
def test_a_new_check_needs_one_file_and_its_falsehood(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "checks").mkdir()
    (tmp_path / "checks/toy_checks.py").write_text(TOY)
    paths = [*pbrs_farm.check.__path__, str(tmp_path / "checks")]
    monkeypatch.setattr(pbrs_farm.check, "__path__", paths)

    def rename(view: Path) -> None:
        (view / "toy.txt").write_text("elsewhere")

    monkeypatch.setitem(FALSEHOODS, "toy", {"a file of another view": (rename, "toy")})
    view = falsehoods.view_of(root)
    assert "toy" not in verify(root, sample=100).counts
    (view / "toy.txt").write_text(view.name)
    marker = view.parents[1] / f"done/truth.{view.name}.json"
    stored = json.loads(marker.read_text())
    stored["files"].append({"key": f"houses/{view.parents[1].name}/views/{view.name}/toy.txt"})
    marker.write_text(json.dumps(stored))
    falsehoods.sign(root, view.parents[1])
    certificate = verify(root, sample=100)
    assert certificate.is_clean, certificate.text()
    assert certificate.counts["toy"].checked == 1
    assert "toy.txt (1): named as its folder" in certificate.looked_at
    assert planted(root, "toy", "a file of another view") == {"toy"}


def test_each_check_of_a_subject_has_its_place_in_the_order() -> None:
    places = [(check.of, check.cost) for check in all_checks()]
    assert len(set(places)) == len(places)


def test_each_rule_can_fail_and_hold() -> None:
    assert sum(map(len, rules_by_scope().values())) >= 100
    assert all(rule.fault for rules in rules_by_scope().values() for rule in rules)


def test_a_rule_compares_within_its_tolerance_and_names_the_fault(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from pbrs_farm.check import rules
    from pbrs_farm.check.certificate import Tally

    rule = Rule(
        scope="toy", check="toy", field="a.x? a.y", equals="b.0 2", fault="{field} of {name}"
    )
    near = Rule(scope="toy", check="toy", field="a.y", equals="b.1", within=0.1, fault="off by {off:.2f}")  # fmt: skip
    monkeypatch.setattr(rules, "rules_by_scope", lambda: {"toy": (rule, near)})
    tally = Tally()
    judge("toy", "here", tally, a={"y": 2}, b=[None, 2.05], name="a")
    assert tally.n_failed == 0
    judge("toy", "here", tally, a={"x": 1, "y": 2}, b=[None, 2.25], name="a")
    judge("toy", "here", tally, a={"y": 2}, b=[None, [2, 2]], name="a")
    lines = tally.certificate("", 0, 0, all_pixels=False).failures
    assert lines == (
        "toy: here: (1, 2) of a", "toy: here: off by 0.25", "toy: here: off by inf",
    )  # fmt: skip
    with pytest.raises(KeyError):
        judge("toy", "here", tally, a={}, b=[None, 2], name="a")
