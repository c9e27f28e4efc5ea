from importlib.util import find_spec

import pytest

from benchmarks.__main__ import DEFAULT, OWN_TARGET, main


@pytest.mark.parametrize(("name", "module"), (DEFAULT | OWN_TARGET).items())
def test_every_bench_has_its_module(name: str, module: str) -> None:
    assert find_spec(f"benchmarks.{module}") is not None, name


def test_an_unknown_bench_is_rejected_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["nothing"]) == 2
    assert "no bench 'nothing'; of demo" in capsys.readouterr().err
