"""A field of run/request.py is an option of run and submit, an entry of job.toml, and a job's field."""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

import pytest

from pbrs_farm.commands.options import add_options, request_from
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.lighting import ALL_MODES, Mode
from pbrs_farm.core.options import options_of
from pbrs_farm.core.recipe import Recipe, field_paths
from pbrs_farm.run import request as request_module
from pbrs_farm.run.request import SHORT_FORMS, RunRequest, Wanted, wanted_of
from workers.job import JobSpec, SubmitRequest

ADDED = '''
import sys
from pathlib import Path
from types import ModuleType

text = Path(sys.argv[1]).read_text()
new = """    pairs: bool = _output_option("""
added = """    n_dogs: int = _output_option(0, "dogs a house", name="dogs", least=1)
"""
assert new in text
module = ModuleType("pbrs_farm.run.request")
import pbrs_farm.run
sys.modules["pbrs_farm.run.request"] = module
pbrs_farm.run.request = module
exec(compile(text.replace(new, added + new), sys.argv[1], "exec"), module.__dict__)

import argparse
from pbrs_farm.commands.job_file import submit_arguments
from pbrs_farm.commands.options import request_from
from pbrs_farm.commands.submitting import _spec
from pbrs_farm.cli import MODULES, build_parser
from pbrs_farm.commands import making
from pbrs_farm.run.request import Wanted, wanted_of
from workers.job import JobSpec, SubmitRequest

parsers = build_parser("making").verbs() | build_parser("submitting").verbs()
run = making._described(parsers["run"].parse_args(
    ["builtin", "--out", "o", "--dogs", "3", "--step-timeout", "5"], argparse.Namespace(debug=False)
), ["builtin"], ())
assert run.want.n_dogs == 3, run
spec = _spec(request_from(parsers["submit"].parse_args(["builtin", "--dogs", "4"]), SubmitRequest))
assert JobSpec.model_validate_json(spec.model_dump_json()).n_dogs == 4
given = parsers["submit"].parse_args(["job.toml"])
job = {"homes": ["builtin"], "render": {"dogs": 5}}
chosen = submit_arguments(job, given, parsers["submit"], "job.toml")
assert wanted_of(_spec(request_from(chosen, SubmitRequest))).n_dogs == 5
print("everywhere")
'''


@pytest.mark.kinds("option")
def test_an_option_added_in_one_place_is_everywhere() -> None:
    words = [sys.executable, "-c", ADDED, str(request_module.__file__)]
    done = subprocess.run(words, capture_output=True, text=True, cwd=Path(__file__).parents[2])
    assert (done.stdout, done.returncode) == ("everywhere\n", 0), done.stderr


def request_of(*words: str) -> RunRequest:
    p = argparse.ArgumentParser(exit_on_error=False)
    add_options(p, RunRequest)
    return request_from(p.parse_args(list(words)), RunRequest)


def test_an_omitted_option_has_the_fields_default() -> None:
    assert request_of() == RunRequest()
    assert wanted_of(request_of()) == Wanted()
    assert request_of().modes == ALL_MODES


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--views", "0"], "--views: 0: expected 1 or more (omit it for all views)"),
        (["--jobs", "0"], "--jobs: 0: expected 1 or more"),
        (["--memory", "nan"], "--memory: nan: expected 0 or more"),
        (["--silence", "-1"], "--silence: -1.0: expected 0 or more"),
        (["--modes", "opengl_li"], "--modes: opengl_li: no such lighting mode"),
    ],
)
def test_a_value_below_its_limit_is_named(words: list[str], message: str) -> None:
    with pytest.raises(BadInput) as caught:
        request_of(*words)
    assert str(caught.value).startswith(message)


def test_modes_and_layers_are_in_their_tables_order_and_known() -> None:
    request = request_of("--modes", "mlt_ol", "opengl_dl", "--layers", "depth_z", "albedo")
    assert request.modes == (Mode.OPENGL_DL, Mode.MLT_OL)
    with pytest.raises(BadInput, match="--layers: albdo: no such layer"):
        wanted_of(Wanted(layers=("albdo",)))


def test_every_short_form_names_a_field_of_the_recipe() -> None:
    assert set(SHORT_FORMS.values()) <= set(field_paths())


def test_every_option_has_a_help_text() -> None:
    for model in (RunRequest, SubmitRequest):
        for name, (field, _shown) in options_of(model).items():
            assert model.model_fields[field].description, name


def test_a_job_has_the_fields_of_its_request() -> None:
    want = Wanted(modes=("opengl_dl",), layers=("albedo",), n_views=3, pairs=True)
    spec = JobSpec(job_id="", version="", recipe=Recipe(), **dict(want))
    assert wanted_of(JobSpec.model_validate_json(spec.model_dump_json())) == want
