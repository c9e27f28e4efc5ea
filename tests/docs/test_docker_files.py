"""Files that the image copies are in the build context, checked without Docker."""

from __future__ import annotations

import re
from pathlib import Path

REPO = Path(__file__).parents[2]


def test_the_build_is_given_everything_that_the_dockerfile_copies() -> None:
    text = (REPO / "docker/Dockerfile").read_text(encoding="utf-8")
    copied = {
        word
        for line in re.findall(r"^COPY (?!--from)(.+)$", text, re.MULTILINE)
        for word in line.split()[:-1]
    }
    let_through = (REPO / ".dockerignore").read_text(encoding="utf-8").splitlines()
    assert copied >= {"pyproject.toml", "setup.py", "pbrs_farm", "workers"}
    for name in copied:
        assert (REPO / name).exists(), name
        assert any(x == f"!{name}" or x.startswith(f"!{name}/**") for x in let_through), name
