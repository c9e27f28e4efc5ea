"""Figures about sets: the outcomes of the tests that read forms back."""

from __future__ import annotations

from benchmarks.sets import outcomes


def test_a_test_with_a_time_has_passed_and_one_with_a_failure_has_not() -> None:
    rows = "".join(
        f'<testcase classname="tests.export.test_coco" name="{name}">{below}</testcase>'
        for name, below in (
            ("plain", ""),
            ("timed", '<properties><property name="cpu_s" value="0.1" /></properties>'),
            ("wrong", "<failure>assert</failure>"),
            ("broken", "<error>setup</error>"),
            ("absent", "<skipped />"),
        )
    )
    report = f"<testsuites><testsuite>{rows}</testsuite></testsuites>"
    expected = {"plain": True, "timed": True, "wrong": False, "broken": False, "absent": False}
    assert outcomes(report) == {("coco", name): passed for name, passed in expected.items()}
