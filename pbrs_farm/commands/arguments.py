"""What the verbs share: how they print, and the options that several of them take. Effects: prints.

It imports little, since every command imports it: a recipe's models only where one is asked for.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.shown_text import escaped, printable, shown

if TYPE_CHECKING:
    from pbrs_farm.core.recipe import Recipe
    from workers.client.farm_client import Farm

Handler = Callable[[argparse.Namespace], int]
# (name, handler, help) -> the verb's parser.
Verb = Callable[[str, Handler, str], argparse.ArgumentParser]

# Help of arguments that name a home, and a view.
HOME: Final = "file, SUNCG house folder, example home's name, `builtin`, or `made:SEED`"
_MAX_LINE: Final = 1500  # characters of a warning: a command that reproduces a fault fits
VIEW: Final = "a view's folder: OUT/houses/<house>/views/<view>"


def warn(text: str) -> None:
    """Write a line to standard error."""
    sys.stderr.write(f"pbrs-farm: {shown(text, _MAX_LINE)}\n")


def echo(text: str = "") -> None:
    """Write a line, or several, to standard output."""
    sys.stdout.write(printable(text) + "\n")


def echo_json(value: Any) -> None:
    """Write a value as JSON to standard output."""
    echo(escaped(json.dumps(value, indent=1, sort_keys=True, ensure_ascii=False)))


def counted(n: int, noun: str) -> str:
    """ "1 house", "2 houses"."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def options(p: argparse.ArgumentParser, title: str) -> argparse._ArgumentGroup:
    """The parser's group of options of that title, in its help."""
    for group in p._action_groups:
        if group.title == title:
            return group
    return p.add_argument_group(title)


MAX_SEEDS: Final = 100_000  # of one command


def add_dress(p: argparse.ArgumentParser) -> None:
    """By which seeds each home is dressed, and with what."""
    add = options(p, "dressing").add_argument
    text = "dress each home by each seed, a house of its own each: 3, 1..20 or 1,4,7"
    add("--dress", metavar="SEEDS", type=str, help=text)
    text = "furnish rooms that have nothing in them before the home is dressed (docs/homes.md)"
    add("--furnish", choices=("none", "empty"), help=text)
    add_catalogue(p)


def add_catalogue(p: argparse.ArgumentParser) -> None:
    """What to dress with beside the furniture package."""
    text = (
        "your own library, repeatable: .sh3f (models), .sh3t (textures), a folder of OBJ or GLB, of"
        " 3D-FUTURE, hssd-models or objathor; `generated` leaves out the furniture package"
    )
    options(p, "dressing").add_argument(
        "--catalogue", action="append", default=[], metavar="LIBRARY", help=text
    )
    text = "your own photographs as pictures on walls, repeatable: a folder of JPEG or PNG"
    options(p, "dressing").add_argument(
        "--pictures", action="append", default=[], dest="catalogue", metavar="DIR", help=text
    )


def dress_seeds(text: str | None) -> tuple[int, ...]:
    """The seeds of --dress, each once; none where it is not given. Raises BadInput."""
    if text is None:
        return ()
    # A dict keeps the order in which seeds are named; MAX_SEEDS bounds each range.
    seeds: dict[int, None] = {}
    for word in text.split(","):
        first, dots, last = word.partition("..")
        bounds = [first, last] if dots else [first, first]
        if not all(b.isascii() and b.isdigit() and len(b) < 10 for b in bounds):
            raise BadInput("--dress", text, "expected a seed, or seeds", hint="3, 1..20 or 1,4,7")
        low, high = (int(b) for b in bounds)
        if not 1 <= low <= high < low + MAX_SEEDS:
            raise BadInput("--dress", text, f"expected 1 to {MAX_SEEDS} seeds from 1 on, ascending")
        seeds |= dict.fromkeys(range(low, high + 1))
    return tuple(seeds)


def at_least(name: str, value: float, least: int) -> None:
    """Raise BadInput, naming the option, where its value is below the least that makes sense."""
    if value < least:
        raise BadInput(name, str(value), f"expected {least} or more")


def add_home(p: argparse.ArgumentParser) -> None:
    """The home that a verb looks at."""
    p.add_argument("home", help=HOME)
    add_models(p)


def add_models(p: argparse.ArgumentParser) -> None:
    """Where the models lie that a home's file names."""
    text = "folder of the models that a scene of HSSD, 3D-FRONT or Holodeck names (docs/houses.md)"
    p.add_argument("--models", default="", metavar="DIR", help=text)


def add_cameras(p: argparse.ArgumentParser) -> None:
    """Where viewpoints come from (cameras.source)."""
    add = options(p, "viewpoints").add_argument
    text = "where viewpoints come from; walk: frames along a person's way (docs/motion.md)"
    add("--cameras", choices=("sampled", "stored", "walk"), help=text)
    text = "your own way: TUM rows t x y z qx qy qz qw (docs/motion.md)"
    add("--trajectory", type=Path, metavar="FILE", help=text)
    add("--frames", type=int, metavar="N", help="frames of a walk (default 150)")
    add("--fps", type=float, metavar="F", help="frames a second of a walk (default 30)")
    text = "open: doors between rooms stand open, where their model has a hinge (read.doors)"
    add("--doors", choices=("drawn", "open"), help=text)
    text = "a second view to the right of each, so many metres off, e.g. 0.065"
    add("--stereo", type=float, metavar="B", help=text)


def add_recipe(p: argparse.ArgumentParser, default: str = "fast") -> None:
    """The recipe by name, its seed, and what overrides its fields."""
    add_fields(p, default)
    options(p, "recipe").add_argument("--seed", type=int, help="the recipe's seed (default 0)")


def add_fields(p: argparse.ArgumentParser, default: str = "fast") -> None:
    """The recipe by name, and what overrides its fields, the seed apart."""
    from pbrs_farm.core.recipe import RECIPE_NAMES

    add = options(p, "recipe").add_argument
    text = f"{', '.join(RECIPE_NAMES)}, or your own FILE.toml (default {default})"
    add("--recipe", default=default, help=text)
    add_set(p, "GROUP.FIELD=VALUE", "override a field")
    add("--size", metavar="WxH", help="picture size, e.g. 640x480")
    add("--strict", action="store_true", help="recoverable faults of a home are errors")


def add_set(p: argparse.ArgumentParser, metavar: str, text: str) -> None:
    """--set, repeatable: fields of the recipe."""
    options(p, "recipe").add_argument(
        "--set", action="append", default=[], metavar=metavar, help=text
    )


def add_light(p: argparse.ArgumentParser) -> None:
    """How long light is traced and which groups are stored: short forms of the recipe's fields."""
    add = options(p, "light").add_argument
    add(
        "--noise", metavar="E",
        help="end a view's light at this estimated relative error, e.g. 0.05 (light.noise):"
        " path adds samples, metropolis leaves out mutations",
    )  # fmt: skip
    add(
        "--time-budget", metavar="S",
        help="seconds of light a view, instead of samples or mutations (light.time_budget_s)",
    )  # fmt: skip
    add(
        "--groups", choices=("two", "lamps"),
        help="lamps: store the light of each lamp, too, for `relight VIEW --lamp` (light.groups;"
        " path only; default two: outdoor and indoor)",
    )  # fmt: skip


def add_output(p: argparse.ArgumentParser) -> None:
    """What of each house is made: lighting modes, label layers, number of views."""
    add = options(p, "what is made").add_argument
    modes = "opengl_dl opengl_il mlt_ol mlt_il_ol (default all)"
    add("--modes", nargs="+", default=[], metavar="MODE", help=modes)
    layers = "optional layers to write beside those that are there"
    add("--layers", nargs="+", default=[], metavar="LAYER", help=layers)
    add("--views", type=int, metavar="N", help="at most N views a house (default: all)")


def views_wanted(args: argparse.Namespace) -> int:
    """The --views of a command, 0 where it is not given: all of them. Raises BadInput below 1."""
    if args.views is not None and args.views < 1:
        hint = "leave it out for all views"
        raise BadInput("--views", str(args.views), "expected 1 or more", hint=hint)
    return args.views or 0


def home_arguments(homes: list[str], houses: str | None) -> list[str]:
    """The homes asked for, those of ranges and of folders one by one.

    houses: a list of SUNCG houses, and homes their root alone. Raises BadInput.
    """
    from pbrs_farm.prepare.source import suncg_list, words_of_homes

    if not houses:
        return words_of_homes(homes)
    if len(homes) != 1:
        raise BadInput("--houses", houses, "needs the SUNCG root as the one HOME")
    return suncg_list(Path(homes[0]), Path(houses))


# Options that are short forms -> the recipe's field.
_SHORT_FORMS: Final = {
    "noise": "light.noise",
    "time_budget": "light.time_budget_s",
    "groups": "light.groups",
    "seed": "seed",
    "cameras": "cameras.source",
    "per_sector": "cameras.per_sector",
    "frames": "cameras.walk_frames",
    "fps": "cameras.walk_fps",
    "stereo": "cameras.stereo_m",
    "doors": "read.doors",
}


def fields_set(
    pairs: list[str], expected: str, prefixes: tuple[str, ...] = ("",)
) -> dict[str, str]:
    """The arguments of --set as path -> text; raises BadInput for one without "=" or prefix."""
    overrides = {}
    for pair in pairs:
        path, equals, text = pair.partition("=")
        if not equals or not path.startswith(prefixes):
            raise BadInput("--set", pair, f"expected {expected}")
        overrides[path] = text
    return overrides


def size_of(text: str | None) -> tuple[int, int] | None:
    """(width, height) of WxH, None of None; BadInput for anything else."""
    if text is None:
        return None
    width, _, height = text.partition("x")
    if not all(n.isascii() and n.isdigit() and 1 <= int(n) <= 16384 for n in (width, height)):
        raise BadInput("--size", text, "expected a width and a height", hint="e.g. 320x240")
    return int(width), int(height)


def recipe_of(args: argparse.Namespace) -> Recipe:
    """The recipe that a command's options name; raises BadRecipe."""
    from pbrs_farm.core.recipe import recipe_from_name
    from pbrs_farm.formats.recipe_toml import ENDING, recipe_from_toml

    overrides = fields_set(args.set, "group.field=value")
    # Let the options that are short forms of fields win over --set.
    size = size_of(args.size)
    if size is not None:
        overrides |= {"image.width_px": str(size[0]), "image.height_px": str(size[1])}
    for option, field in _SHORT_FORMS.items():
        value = getattr(args, option, None)
        if value is not None:
            overrides[field] = str(value)
    if args.strict:
        overrides["read.strict"] = "true"
    if getattr(args, "camera_file", None):
        # A recipe's fields are JSON: quote the path.
        overrides |= {"cameras.source": "file", "cameras.file": json.dumps(str(args.camera_file))}
    if getattr(args, "trajectory", None):
        text = json.dumps(str(args.trajectory))
        overrides |= {"cameras.source": "trajectory", "cameras.file": text}
    if getattr(args, "catalogue", None):
        overrides["dress.catalogue"] = json.dumps(":".join(args.catalogue))
    if getattr(args, "furnish", None):
        overrides["dress.furnish"] = args.furnish
    if getattr(args, "exact", False):
        overrides["cameras.exact"] = "true"
    if args.recipe.endswith(ENDING):
        return recipe_from_toml(Path(args.recipe), overrides)
    return recipe_from_name(args.recipe, overrides)


def add_farm(p: argparse.ArgumentParser) -> None:
    """The options that every verb of the farm takes."""
    p.add_argument("--store", default="", metavar="URL", help="default: $PBRS_STORE")
    p.add_argument("--json", action="store_true", help="for machines")


def farm_of(args: argparse.Namespace) -> Farm:
    """The farm the environment and --store name; raises BadInput, touches nothing yet."""
    from workers.client.farm_client import Farm
    from workers.config import config_from_environment

    config = config_from_environment()
    if args.store:
        # A store without a scheme is a folder.
        url = args.store if "://" in args.store else Path(args.store).absolute().as_uri()
        config = replace(config, store_url=url)
    return Farm(config)
