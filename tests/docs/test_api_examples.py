"""The examples in docstrings run and print the shown output; nine public names in ten have one."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.docs.api_examples import example_of, faults, public_names


def test_nine_public_names_in_ten_have_an_example() -> None:
    names = public_names()
    lacking = [name for name, named in names.items() if example_of(name, named) is None]
    assert len(lacking) <= len(names) / 10, lacking


def test_the_examples_of_cameras_and_recipes_run(tmp_path: Path) -> None:
    example_faults = list(faults(tmp_path, of_homes=False))
    assert len(example_faults) >= 12
    assert [fault for _name, fault in example_faults if fault] == []


@pytest.mark.pages
def test_the_examples_of_homes_and_frames_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    example_faults = list(faults(tmp_path, of_homes=True))
    assert len(example_faults) >= 60
    assert "".join(fault for _name, fault in example_faults) == ""
