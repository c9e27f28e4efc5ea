"""What the verbs share: how they print, and the words that name a recipe or a farm. Effects: prints.

Imports little, for every command does: a recipe's models only where a recipe is asked for.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pbrs_farm.core.errors import BadInput

if TYPE_CHECKING:
    from pbrs_farm.core.recipe import Recipe
    from workers.client.farm_client import Farm

Handler = Callable[[argparse.Namespace], int]
Verb = Callable[[str, Handler, str], argparse.ArgumentParser]
"""(name, handler, help) -> the verb's parser."""


def complain(text: str) -> None:
    """A line on standard error."""
    sys.stderr.write(f"pbrs-farm: {text}\n")


def say(text: str = "") -> None:
    """A line on standard output."""
    sys.stdout.write(text + "\n")


def dump(value: Any) -> None:
    """A value as JSON on standard output."""
    say(json.dumps(value, indent=1, sort_keys=True, ensure_ascii=False))


def counted(n: int, noun: str) -> str:
    """ "1 house", "2 houses"."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def add_recipe(p: argparse.ArgumentParser, default: str = "fast") -> None:
    """The words of a recipe."""
    from pbrs_farm.core.recipe import RECIPE_NAMES

    p.add_argument(
        "--recipe", default=default, help=f"{', '.join(RECIPE_NAMES)} (default {default})"
    )
    p.add_argument(
        "--set", action="append", default=[], metavar="GROUP.FIELD=VALUE", help="override a field"
    )
    p.add_argument("--seed", type=int, default=None, help="the recipe's seed (default 0)")
    p.add_argument("--size", default=None, metavar="WxH", help="picture size, e.g. 640x480")
    p.add_argument("--strict", action="store_true", help="recoverable faults of a home are errors")


def add_light(p: argparse.ArgumentParser) -> None:
    """How long a view's light is carried and by what parts: short forms of fields of the recipe."""
    p.add_argument(
        "--noise", default=None, metavar="E",
        help="add samples until the estimated relative error is below E, e.g. 0.05"
        " (light.noise; path only)",
    )  # fmt: skip
    p.add_argument(
        "--time-budget", default=None, metavar="S",
        help="seconds of light a view, instead of samples or mutations (light.time_budget_s)",
    )  # fmt: skip
    p.add_argument(
        "--groups", choices=("two", "lamps"), default=None,
        help="lamps: store the light of each lamp, too, for `relight VIEW --lamp` (light.groups;"
        " path only; default two: outdoor and indoor)",
    )  # fmt: skip


def recipe_of(args: argparse.Namespace) -> Recipe:
    """The recipe named by the words of a command; raises BadRecipe."""
    from pbrs_farm.core.recipe import recipe_from_name

    overrides: dict[str, str] = {}
    for word in args.set:
        path, equals, text = word.partition("=")
        if not equals:
            raise BadInput("--set", word, "expected group.field=value")
        overrides[path] = text
    if args.size is not None:
        width, _, height = args.size.partition("x")
        overrides |= {"image.width_px": width, "image.height_px": height}
    if getattr(args, "noise", None) is not None:
        overrides["light.noise"] = args.noise
    if getattr(args, "time_budget", None) is not None:
        overrides["light.time_budget_s"] = args.time_budget
    if getattr(args, "groups", None) is not None:
        overrides["light.groups"] = args.groups
    if args.seed is not None:
        overrides["seed"] = str(args.seed)
    if args.strict:
        overrides["read.strict"] = "true"
    if getattr(args, "cameras", None):
        overrides["cameras.source"] = args.cameras
    if getattr(args, "camera_file", None):
        overrides |= {"cameras.source": "file", "cameras.file": json.dumps(str(args.camera_file))}
    if getattr(args, "per_sector", None):
        overrides["cameras.per_sector"] = str(args.per_sector)
    if getattr(args, "exact", False):
        overrides["cameras.exact"] = "true"
    return recipe_from_name(args.recipe, overrides)


def add_farm(p: argparse.ArgumentParser) -> None:
    """The words every verb of the farm takes."""
    p.add_argument("--store", default="", metavar="URL", help="default: $PBRS_STORE")
    p.add_argument("--json", action="store_true", help="for machines")


def farm_of(args: argparse.Namespace) -> Farm:
    """The farm the environment and --store name; raises BadInput, touches nothing yet."""
    from workers.client.farm_client import Farm
    from workers.config import config_from_environment

    config = config_from_environment()
    if args.store:
        url = args.store if "://" in args.store else Path(args.store).absolute().as_uri()
        config = replace(config, store_url=url)
    return Farm(config)
