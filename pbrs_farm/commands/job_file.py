"""A job of the farm as one file: homes, and the options of submit, select and pack. Effect: reads it.

homes = ["made:1..50", "flat.sh3d"]
[render]              # options of submit
recipe = "fast"
views = 6
max-slots = 40
[select]              # which views look like photographs, when all are made
reference = "nyu.npz"
[pack]                # options of pack, done by this command when the job is done
out = "shards"
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.options import flag, values_of_table
from pbrs_farm.core.shown_text import did_you_mean
from pbrs_farm.regular_files import toml_given

_TABLES = ("render", "select", "pack")


def job_file(words: list[str]) -> dict[str, Any] | None:
    """Read the job file if the command's one word names one; None if it names homes.

    A job is a .toml file with a list `homes`; another TOML file is a home's programme. Raises
    BadInput for invalid TOML and for unknown tables.
    """
    if len(words) != 1 or not words[0].endswith(".toml") or not Path(words[0]).is_file():
        return None
    job = toml_given(Path(words[0]))
    # The programme of a made home is TOML, too, but lists no homes.
    return _checked(job, words[0]) if "homes" in job else None


def job_like(file: str, homes: list[str]) -> dict[str, Any]:
    """The job of a template; homes, if any, replace those of its file. BadInput as job_file."""
    return _checked({**toml_given(Path(file)), "homes": homes}, file)


def _checked(job: dict[str, Any], file: str) -> dict[str, Any]:
    homes = job["homes"]
    if not isinstance(homes, list) or not homes or any(not isinstance(h, str) for h in homes):
        raise BadInput(file, "homes", "expected a list of homes")
    for name, table in job.items():
        if name != "homes" and (name not in _TABLES or not isinstance(table, dict)):
            hint = did_you_mean(name, [*_TABLES, "homes"]) or f"[{'], ['.join(_TABLES)}]"
            raise BadInput(file, name, "is not a table of a job file", hint=hint)
    return job


def submit_arguments(
    job: Mapping[str, Any], args: argparse.Namespace, parser: argparse.ArgumentParser, file: str
) -> argparse.Namespace:
    """The arguments of submit for a job, overridden by the command line; BadInput names the entry."""
    from workers.job import SubmitRequest

    table = {**job.get("render", {}), **job.get("select", {})}
    chosen = argparse.Namespace(**{**vars(args), "homes": list(job["homes"])})
    for name, value in values_of_table(table, SubmitRequest, file).items():
        if getattr(args, name) == parser.get_default(name):
            setattr(chosen, name, value)
    return chosen


def option_words(table: Mapping[str, Any], file: str) -> list[str]:
    """A table's entries as words of a command.

    {"split": True, "layers": ["depth"]} -> ["--split", "--layers", "depth"]: true becomes a flag,
    false nothing, a list several words. Raises BadInput for a nested table.
    """
    words: list[str] = []
    for name, value in table.items():
        if isinstance(value, dict):
            raise BadInput(file, name, "expected a value, not a table")
        values = [str(v) for v in value] if isinstance(value, list) else [str(value)]
        if isinstance(value, bool):
            words += [flag(name)] if value else []
        else:
            words += [flag(name), *values]
    return words
