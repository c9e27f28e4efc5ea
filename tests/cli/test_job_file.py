"""A job as one file stands for the words of submit and pack."""

from __future__ import annotations

import argparse
from pathlib import Path

import pytest

from pbrs_farm.commands.job_file import (
    job_file,
    job_like,
    option_words,
    submit_arguments,
    submit_words,
)
from pbrs_farm.core.errors import BadInput

JOB = """
homes = ["made:1..3", "flat.sh3d"]
[render]
recipe = "fast"
views = 6
max_slots = 40
gpu = true
update = false
set = ["light.spp=64", "light.denoise=true"]
modes = ["path", "opengl_dl"]
[select]
reference = "nyu.npz"
[pack]
out = "shards"
"""


def parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(exit_on_error=False)
    p.add_argument("homes", nargs="+")
    for name in ("recipe", "views", "max-slots", "reference"):
        p.add_argument(f"--{name}")
    p.add_argument("--set", action="append")
    p.add_argument("--modes", nargs="+")
    p.add_argument("--gpu", action="store_true")
    p.add_argument("--update", action="store_true")
    return p


def written(folder: Path, text: str) -> str:
    (folder / "job.toml").write_text(text)
    return str(folder / "job.toml")


def test_tables_are_options_and_lists_are_many_words(tmp_path: Path) -> None:
    job = job_file([written(tmp_path, JOB)])
    assert job is not None
    args = parser().parse_args(submit_words(job, parser(), "job.toml"))
    assert args.homes == ["made:1..3", "flat.sh3d"]
    assert (args.recipe, args.views, args.max_slots, args.reference) == (
        "fast",
        "6",
        "40",
        "nyu.npz",
    )
    assert (args.gpu, args.update) == (True, False)
    assert args.set == ["light.spp=64", "light.denoise=true"]
    assert args.modes == ["path", "opengl_dl"]
    assert option_words(job["pack"], "job.toml") == ["--out", "shards"]


def test_a_template_s_options_hold_for_the_homes_named_beside_it_but_for_those_given(
    tmp_path: Path,
) -> None:
    job, p = job_like(written(tmp_path, JOB), ["x.sh3d"]), parser()
    given = p.parse_args(["x.sh3d", "--views", "9"])
    args = submit_arguments(job, given, p, "job.toml")
    assert (args.homes, args.recipe, args.views, args.gpu) == (["x.sh3d"], "fast", "9", True)
    assert job_like(written(tmp_path, "[pack]\n"), ["x"]) == {"homes": ["x"], "pack": {}}
    with pytest.raises(BadInput, match="rendr: is no table of a job"):
        job_like(written(tmp_path, "[rendr]\n"), ["x"])
    with pytest.raises(BadInput, match=r"none\.toml"):
        job_like(str(tmp_path / "none.toml"), ["x"])


def test_homes_and_programmes_are_no_jobs(tmp_path: Path) -> None:
    assert job_file(["builtin"]) is None
    assert job_file([written(tmp_path, "rooms = 3\n")]) is None
    assert job_file(["a.toml", "b.toml"]) is None
    assert job_file([str(tmp_path / "none.toml")]) is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("homes = [", "is no TOML"),
        ("homes = 3", "expected a list of homes"),
        ("homes = []", "expected a list of homes"),
        ('homes = ["a"]\n[rendr]\n', "is no table of a job.*render"),
        ('homes = ["a"]\nrender = 3\n', "is no table of a job"),
        ("homes = " + "[" * 3000, "is no TOML"),
    ],
)
def test_a_file_that_is_no_job_is_one_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        job_file([written(tmp_path, text)])


def test_an_option_there_is_not_is_named(tmp_path: Path) -> None:
    job = job_file([written(tmp_path, 'homes = ["a"]\n[render]\nrecip = "fast"\n')])
    assert job is not None
    with pytest.raises(BadInput, match=r"recip.*recipe"):
        submit_words(job, parser(), "job.toml")
