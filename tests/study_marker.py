"""Tests of the marker `study` import torch: if deselected they are not even imported."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import pytest


class _WithoutTorch(PathFinder):
    """Finds every module but torch."""

    @classmethod
    def find_spec(
        cls, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        return None if fullname == "torch" else super().find_spec(fullname, path, target)


def pytest_configure(config: pytest.Config) -> None:
    """Hides torch from a run with -m "not study": it must pass the same on machines with torch."""
    if "not study" in config.getoption("markexpr") and PathFinder in sys.meta_path:
        sys.meta_path[sys.meta_path.index(PathFinder)] = _WithoutTorch


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Ignore a file of the marker if -m says "not study", so that torch may be missing.

    If torch is missing, a marker expression without study (chaos, slow) ignores them as well.
    """
    markers = config.getoption("markexpr")
    asks_for_others = bool(markers) and "study" not in markers
    is_deselected = "not study" in markers or (asks_for_others and find_spec("torch") is None)
    if not is_deselected or collection_path.suffix != ".py":
        return None
    is_marked = "\npytestmark = pytest.mark.study\n" in collection_path.read_text(encoding="utf-8")
    return True if is_marked else None


@pytest.fixture(autouse=True)
def one_thread(request: pytest.FixtureRequest) -> None:
    """Tests of torch use one thread: sums of several differ in their last bits."""
    if request.node.get_closest_marker("study"):
        import torch

        torch.set_num_threads(1)
