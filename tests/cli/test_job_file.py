"""A job file is equivalent to the arguments of submit and pack."""

from __future__ import annotations

import argparse
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from pbrs_farm.commands.job_file import job_file, job_like, option_words, submit_arguments
from pbrs_farm.commands.options import add_options, request_from
from pbrs_farm.core.errors import BadInput
from workers.job import SubmitRequest

JOB = """
homes = ["made:1..3", "flat.sh3d"]
[render]
recipe = "fast"
views = 6
max_slots = 40
gpu = true
update = false
set = ["light.spp=64", "light.denoise=true"]
modes = ["mlt_ol", "opengl_dl"]
[select]
reference = "nyu.npz"
[pack]
out = "shards"
"""


def parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(exit_on_error=False)
    p.add_argument("homes", nargs="+")
    add_options(p, SubmitRequest)
    return p


def arguments(job: Mapping[str, Any], *words: str) -> argparse.Namespace:
    p = parser()
    return submit_arguments(job, p.parse_args(["job.toml", *words]), p, "job.toml")


def written(folder: Path, text: str) -> str:
    (folder / "job.toml").write_text(text)
    return str(folder / "job.toml")


def test_tables_are_options_and_lists_are_many_words(tmp_path: Path) -> None:
    job = job_file([written(tmp_path, JOB)])
    assert job is not None
    args = arguments(job)
    assert args.homes == ["made:1..3", "flat.sh3d"]
    request = request_from(args, SubmitRequest)
    assert (request.recipe, request.n_views, request.max_slots) == ("fast", 6, 40)
    assert request.reference == Path("nyu.npz")
    assert (args.gpu, args.update) == (True, False)
    assert args.set == ["light.spp=64", "light.denoise=true"]
    assert args.modes == ["mlt_ol", "opengl_dl"]
    assert option_words(job["pack"], "job.toml") == ["--out", "shards"]


def test_a_templates_options_apply_to_added_homes_unless_overridden(tmp_path: Path) -> None:
    job, p = job_like(written(tmp_path, JOB), ["x.sh3d"]), parser()
    arguments = p.parse_args(["x.sh3d", "--views", "9"])
    args = submit_arguments(job, arguments, p, "job.toml")
    assert (args.homes, args.recipe, args.views, args.gpu) == (["x.sh3d"], "fast", 9, True)
    assert job_like(written(tmp_path, "[pack]\n"), ["x"]) == {"homes": ["x"], "pack": {}}
    with pytest.raises(BadInput, match="rendr: is not a table of a job"):
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
        ("homes = [", "is not valid TOML"),
        ("homes = 3", "expected a list of homes"),
        ("homes = []", "expected a list of homes"),
        ('homes = ["a"]\n[rendr]\n', "is not a table of a job.*render"),
        ('homes = ["a"]\nrender = 3\n', "is not a table of a job"),
        ("homes = " + "[" * 3000, "is not valid TOML"),
    ],
)
def test_a_file_that_is_no_job_is_refused_in_one_line(
    tmp_path: Path, text: str, message: str
) -> None:
    with pytest.raises(BadInput, match=message):
        job_file([written(tmp_path, text)])


def test_an_option_there_is_not_is_named(tmp_path: Path) -> None:
    job = job_file([written(tmp_path, 'homes = ["a"]\n[render]\nrecip = "fast"\n')])
    assert job is not None
    with pytest.raises(BadInput, match=r"recip.*recipe"):
        arguments(job)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("views = 0", "render.toml: views: expected 1 or more"),
        ('views = "six"', "views: expected a whole number"),
        ("views = [1, 2]", "views: expected one value, not a list"),
        ("priority = 10", "priority: 10 is not a choice"),
        ("budget = -1", "budget: expected slot-hours, 0 or more"),
        ("max_slots = -1", "max_slots: expected 0 or more"),
        ("gpu = 1", "gpu: expected true or false"),
        ('groups = "three"', "groups: three is not a choice.*two, lamps"),
        ("views = {of = 3}", "views: expected a value, not a table"),
    ],
)
def test_an_entry_that_does_not_fit_is_named_with_its_file(entry: str, message: str) -> None:
    job = {"homes": ["a"], "render": tomllib.loads(entry)}
    p = parser()
    with pytest.raises(BadInput, match=message):
        submit_arguments(job, p.parse_args(["x"]), p, "render.toml")


def test_the_users_libraries_and_pictures_are_one_list() -> None:
    job = {"homes": ["a"], "render": {"catalogue": "a.sh3f", "pictures": ["b", "c"]}}
    assert arguments(job).catalogue == ["a.sh3f", "b", "c"]
    words = ["x", "--pictures", "b", "--catalogue", "a.sh3f"]
    assert parser().parse_args(words).catalogue == ["b", "a.sh3f"]
