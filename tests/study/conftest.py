"""Tests of the parts that need torch are not even imported where it is missing."""

from __future__ import annotations

from importlib.util import find_spec

collect_ignore_glob = (
    []
    if find_spec("torch")
    else [f"{part}/test_*.py" for part in ("networks", "tasks", "training", "judging")]
)
