"""Every script under examples/ runs, on the built-in home and at a small size."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from typing import Any

import pytest

import pbrs_farm as pf
from tests.scene.homes import SMALL

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.py"))
# Run by `make test`; the others by `make test-all`.
QUICK = ("first_picture", "floor_plan")
NEED_TORCH = ("stream_training",)


@pytest.mark.filterwarnings("ignore:.*is in no room")
@pytest.mark.parametrize(
    "example",
    [
        pytest.param(
            path,
            id=path.stem,
            marks=[
                *([] if path.stem in QUICK else [pytest.mark.slow]),
                *([pytest.mark.study] if path.stem in NEED_TORCH else []),
            ],
        )
        for path in EXAMPLES
    ],
)
def test_an_example_runs(example: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    load, make = pf.load, pf.make

    def small_load(*words: Any, **options: Any) -> pf.Home:
        return load(*words, **options).set(**SMALL)

    def small_make(*words: Any, **options: Any) -> pf.Home:
        return make(*words, **options).set(**SMALL)

    monkeypatch.setattr(pf, "load", small_load)
    monkeypatch.setattr(pf, "make", small_make)
    monkeypatch.setattr(sys, "argv", [str(example), "builtin"])
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(example), run_name="__main__")
    assert example.read_text().startswith('"""')
