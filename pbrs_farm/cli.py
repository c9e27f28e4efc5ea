"""The `pbrs-farm` command: words -> one verb's handler -> exit code. Effects: the verb's.

Exit codes: 0 done; 1 something failed, the rest was done; 2 the words are wrong; 130 interrupted.
"""

from __future__ import annotations

import argparse
import os
import sys
import traceback
from collections.abc import Sequence
from typing import Any

import pbrs_farm
from pbrs_farm.commands import labelling, looking, making, selecting, stages, using
from pbrs_farm.commands.words import Handler, add_recipe, complain, recipe_of
from pbrs_farm.errors import PbrsError


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; the exit code."""
    parser = build_parser()
    args = parser.parse_args(argv)
    if not hasattr(args, "handler"):
        parser.print_help()
        return 2
    try:
        return int(args.handler(args))
    except PbrsError as error:
        if args.debug:
            traceback.print_exc()
        complain(str(error))
        return 1
    except KeyboardInterrupt:
        complain("interrupted; the same command goes on where it stopped")
        return 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def build_parser() -> argparse.ArgumentParser:
    """All verbs; the farm's are added when their packages are installed."""
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--debug", action="store_true", help="show tracebacks")
    parser = argparse.ArgumentParser(
        prog="pbrs-farm",
        description="Houses designed by people in, physically-based training images with exact labels out.",
    )
    parser.add_argument("--version", action="version", version=pbrs_farm.__version__)
    parser.set_defaults(debug=False)
    verbs = parser.add_subparsers(title="verbs", metavar="VERB")

    def verb(name: str, handler: Handler, text: str) -> argparse.ArgumentParser:
        sub: argparse.ArgumentParser = verbs.add_parser(
            name, help=text, description=text, parents=[common]
        )
        sub.set_defaults(handler=handler)
        return sub

    looking.add_verbs(verb)
    making.add_verbs(verb)
    stages.add_verbs(verb)
    using.add_verbs(verb)
    labelling.add_verbs(verb)
    selecting.add_verbs(verb)
    _add_farm(verbs, common)
    return parser


def _add_farm(verbs: Any, common: argparse.ArgumentParser) -> None:
    """The farm's verbs: only where celery and redis are installed."""
    try:
        from workers.cli import add_verbs
    except ImportError:
        return
    add_verbs(verbs, common, add_recipe=add_recipe, recipe_of=recipe_of)


if __name__ == "__main__":
    sys.exit(main())
