"""Printing, and the options that several verbs share; imports little, as every command imports it."""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

from pbrs_farm.commands.command_line import Parser
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.number_ranges import seeds_of
from pbrs_farm.core.shown_text import escaped, printable, shown

if TYPE_CHECKING:
    from pbrs_farm.core.recipe import Recipe
    from pbrs_farm.run.request import RecipeOptions
    from pbrs_farm.store.object_store import Store
    from workers.client.farm_client import Farm

# function of a verb: returns its exit code, or None for 0
Handler = Callable[[argparse.Namespace], int | None]
# (name, handler) -> the verb's parser; verbs.csv has its help
Verb = Callable[[str, Handler], Parser]

_MAX_LINE: Final = (
    1500  # maximum characters of a warning: room for a command that reproduces a fault
)
MAX_SEEDS: Final = 100_000  # maximum seeds of one command


def warn(text: str) -> None:
    """Write a printable line, cut at 1,500 characters, to standard error, after the program's name."""
    sys.stderr.write(f"pbrs-farm: {shown(text, _MAX_LINE)}\n")


def echo(text: str = "") -> None:
    """Write printable lines of a verb's result to standard output; messages go through `warn`."""
    sys.stdout.write(printable(text) + "\n")


def echo_json(value: Any) -> None:
    """Write a value to standard output as one JSON document for --json, keys sorted, indented by one."""
    echo(escaped(json.dumps(value, indent=1, sort_keys=True, ensure_ascii=False)))


def counted(n: int, noun: str) -> str:
    """ "1 house", "2 houses", of a noun with a plural in -s."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def echo_notes(notes: Counter[str], out: str) -> None:
    """Print the number of notes of each kind in the houses of an output; nothing without notes."""
    if notes:
        kinds = ", ".join(f"{n} {kind}" for kind, n in notes.most_common(8))
        echo(
            f"{counted(notes.total(), 'note')} ({kinds}): `notes` in {out}/houses/<house>/house.json"
        )


def dress_seeds(text: str | None, option: str = "--dress") -> tuple[int, ...]:
    """The distinct seeds of 3, 1..20 or 1,4,7, in order; BadInput also for more than MAX_SEEDS."""
    if text is None:
        return ()
    try:
        return seeds_of(text, least=1, max_seeds=MAX_SEEDS)
    except ValueError as error:
        raise BadInput(option, text, str(error), hint="3, 1..20 or 1,4,7") from None


def at_least(name: str, value: float, least: int) -> None:
    """Raise BadInput, naming the option, if its value is below the minimum."""
    if value < least:
        raise BadInput(name, str(value), f"expected {least} or more")


def home_arguments(homes: Sequence[str], houses: str | None) -> list[str]:
    """The requested homes, with ranges and folders expanded.

    houses: a list of SUNCG houses; homes is then their root alone. Raises BadInput. Warns of further
    homes one level below a folder of homes.
    """
    from pbrs_farm.prepare.source import homes_left_below, suncg_list, words_of_homes

    if not houses:
        words = words_of_homes(list(homes))
        # A folder without homes is not expanded; its error names the folders below it.
        for folder in dict.fromkeys(homes):
            if folder not in words and (unlisted := homes_left_below(Path(folder))):
                warn(f"{folder}: {unlisted}")
        return words
    if len(homes) != 1:
        raise BadInput("--houses", houses, "needs the SUNCG root as the only HOME")
    return suncg_list(Path(homes[0]), Path(houses))


def fields_set(
    pairs: Sequence[str], expected: str, prefixes: tuple[str, ...] = ("",)
) -> dict[str, str]:
    """The arguments of --set as path -> text; the last one wins if a path is repeated.

    expected: the valid form, for error messages. prefixes: valid beginnings of a path. Raises
    BadInput for an argument without "=" or with another prefix.
    """
    overrides = {}
    for pair in pairs:
        path, equals, text = pair.partition("=")
        if not equals or not path.startswith(prefixes):
            raise BadInput("--set", pair, f"expected {expected}")
        overrides[path] = text
    return overrides


def size_of(text: str | None) -> tuple[int, int] | None:
    """Parse WxH to (width, height) in pixels, 1 to 16,384, or None; BadInput for anything else."""
    from pbrs_farm.core.checked_calls import MAX_EDGE_PX

    if text is None:
        return None
    width, _, height = text.partition("x")
    if not all(n.isascii() and n.isdigit() and 1 <= int(n) <= MAX_EDGE_PX for n in (width, height)):
        expected = f"expected a width and a height, each 1 to {MAX_EDGE_PX} pixels"
        raise BadInput("--size", text, expected, hint="e.g. 320x240")
    return int(width), int(height)


def recipe_of(args: argparse.Namespace | RecipeOptions) -> Recipe:
    """The recipe named by a command's options or by a request.

    Short forms such as --noise and --size win over --set, and --set over the recipe's own fields.
    Raises BadRecipe for an unknown recipe or field, BadInput for a file without a valid recipe.
    """
    from pbrs_farm.core.recipe import recipe_from_name
    from pbrs_farm.formats.recipe_toml import ENDING, recipe_from_toml
    from pbrs_farm.run.request import SHORT_FORMS

    overrides = fields_set(args.set, "group.field=value")
    # Options such as --size override --set.
    size = size_of(args.size)
    if size is not None:
        overrides |= {"image.width_px": str(size[0]), "image.height_px": str(size[1])}
    for option, field in {**SHORT_FORMS, "per_sector": "cameras.per_sector"}.items():
        value = getattr(args, option, None)
        if value is not None:
            overrides[field] = str(value)
    more = cast("argparse.Namespace", args)
    if args.strict:
        overrides["read.strict"] = "true"
    if getattr(args, "camera_file", None):
        overrides["cameras.source"] = f"file,file={more.camera_file}"
    if getattr(args, "trajectory", None):
        overrides["cameras.source"] = f"trajectory,file={more.trajectory}"
    if getattr(args, "rig", None):
        from pbrs_farm.formats.rig_toml import rig_from_toml

        overrides["rig"] = rig_from_toml(more.rig).model_dump_json(exclude_unset=True)
    if getattr(args, "catalogue", None):
        overrides["dress.catalogue"] = json.dumps(":".join(more.catalogue))
    if getattr(args, "exact", False):
        overrides["cameras.exact"] = "true"
    if args.recipe.endswith(ENDING):
        recipe = recipe_from_toml(Path(args.recipe), overrides)
    else:
        recipe = recipe_from_name(args.recipe, overrides)
    for option in ("frames", "fps"):
        if getattr(args, option, None) is not None and recipe.cameras.source_name != "walk":
            raise BadInput(f"--{option}", "", "is for walks only", hint="--cameras walk")
    return recipe


def store_of(url: str) -> Store:
    """The store of a URL or an existing folder, with the environment's settings; BadInput for neither."""
    from pbrs_farm.settings import settings_from_environment
    from pbrs_farm.store import store_from_url

    if "://" not in url and not Path(url).is_dir():
        raise BadInput(url, "", "no such folder", hint="give an output folder, or a store's URL")
    return store_from_url(url, settings_from_environment().store)


@contextmanager
def folder_of(root: str) -> Iterator[Path]:
    """An output root as a local folder: the folder itself, or a copy of the store's files."""
    from pbrs_farm.run.output_root import as_files
    from pbrs_farm.settings import settings_from_environment

    with as_files(root, settings_from_environment().store) as folder:
        yield folder


def put_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a folder, each one atomically."""
    from pbrs_farm.store.folder import FolderStore

    store = FolderStore(folder)
    for name, data in files.items():
        store.put(name, data)
    store.tidy()


def farm_of(args: argparse.Namespace) -> Farm:
    """The farm of the environment (workers/config.py) and --store, unconnected; BadInput if incomplete."""
    from workers.client.farm_client import Farm
    from workers.config import config_from_environment

    config = config_from_environment()
    if args.store:
        # A store without a scheme is a folder.
        url = args.store if "://" in args.store else Path(args.store).absolute().as_uri()
        config = replace(config, store_url=url)
    return Farm(config)
